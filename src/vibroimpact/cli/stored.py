"""Maps that are written tile by tile, and taken up again."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli.request import REFUSALS, WrongRequest, asked

if TYPE_CHECKING:
    from vibroimpact.execution.store import SweepStore


def wanted(function: str, options: Mapping[str, Any]) -> bool:
    """Return whether a result goes to a store, tile by tile."""
    out = options.get("out")
    return function == "parameter_map" and out is not None and out.suffix.lower() == ".zarr"


def stands(options: Mapping[str, Any]) -> bool:
    """Return whether a stored sweep stands there, of this study or another."""
    out: Path = options["out"]
    return out.exists() and not options.get("overwrite") and _opened(out) is not None


def going_on(out: Path) -> None:
    """Tell how far the store of the same study is that stood there."""
    store = _opened(out)
    if store is not None:
        left = "nothing is left to compute" if _complete(store) else "going on"
        # By way of `sys.stderr` as it is now, lest it run into a bar.
        print(f"{out} stands there: {_progress(store)[0]}; {left}", file=sys.stderr, flush=True)


@contextmanager
def making_room(options: Mapping[str, Any]) -> Iterator[None]:
    """Set aside what may be overwritten; it comes back if the request turns out to be wrong."""
    out: Path = options["out"]
    if not (options.get("overwrite") and out.exists()):
        yield
        return
    aside = out.with_name(f".{out.name}.replaced")
    shutil.rmtree(aside, ignore_errors=True)
    out.rename(aside)
    try:
        yield
    except WrongRequest:
        if not out.exists():
            aside.rename(out)
        raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def told(out: Path, seconds: float) -> str:
    """Return in a line what a store holds after a run."""
    store = _opened(out)
    line = _progress(store)[0] if store else "nothing"
    return f"{out}: {line} ({seconds:.2g} s)"


def info(options: Mapping[str, Any]) -> None:
    """Tell what a stored sweep is, how far it is, what it found, and how to go on."""
    path: Path = options["file"]
    with asked(*REFUSALS, OSError):
        from vibroimpact.execution.store import SweepStore
        from vibroimpact.request import unmarked

        store = SweepStore(path)
    identity = dict(store.identity)
    axes = [unmarked(name, str(identity.pop(name))) for name in list(identity) if name.startswith("axis ")]
    kind = "refined map" if "refine" in identity else "parameter map"
    typer.echo(f"{path}: a {kind} of {identity.pop('indices')} over {' and '.join(axes)}")
    typer.echo("  " + ", ".join(f"{name} {value}" for name, value in identity.items() if value is not None))
    for line in _progress(store):
        typer.echo(line)
    damaged = store.damaged(store.records())
    if damaged:
        typer.echo(f"{len(damaged)} tiles are damaged; they are computed again when you go on")
    if damaged or not _complete(store):
        words = [word for word in store.command.split(" ") if word != "--overwrite"]
        typed = words[0] == "vibroimpact"
        typer.echo(f"go on with: {' '.join(words) if typed else 'the same parameter_map(..., store=...) call'}")


def _opened(path: Path) -> SweepStore | None:
    from vibroimpact.execution.store import SweepStore

    try:
        return SweepStore(path)
    except OSError:
        return None


def _complete(store: SweepStore) -> bool:
    return bool(store.records()[:, 0].all())


def _progress(store: SweepStore) -> list[str]:
    """Return how far a sweep is, what it cost, and how its cells ended, a line each."""
    if "refine" in store.identity:
        from vibroimpact.cli.refined import tell_refined

        return tell_refined(store)
    from vibroimpact.execution.store import summary

    found = summary(store.records(), store.tiling)
    share = found["cells_done"] / found["cells"]
    lines = [f"{found['tiles_done']} of {found['tiles']} tiles done, {share:.0%} of {found['cells']:,} cells"]
    if found["tiles_done"]:
        left = found["seconds"] * (1.0 / share - 1.0)
        lines.append(
            f"{found['seconds']:.3g} s of computing, {found['impacts']:.3g} impacts"
            + (f", about {left:.2g} s of one core left" if left else "")
        )
        lines.append(", ".join(f"{word.replace('_', ' ')} {count:,}" for word, count in found["statuses"].items()))
    return lines


def check_cluster(options: Mapping[str, Any]) -> None:
    """Refuse `--workers` beside `--cluster`, and a cluster that is none, before anything is touched."""
    if options.get("cluster") is None:
        return
    if options.get("workers") is not None:
        raise WrongRequest("`--workers` stands beside `--cluster`; allowed is one of the two; the cluster has its own")
    from vibroimpact.execution.cluster import check_cluster as check

    try:
        with asked():
            check(options["cluster"])
    except ImportError as error:
        raise WrongRequest(str(error)) from error
