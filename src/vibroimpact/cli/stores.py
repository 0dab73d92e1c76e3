"""Maps that are written tile by tile, and continued: what a store holds, in words."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibroimpact.cli.errors import REFUSALS, WrongRequest, refusing

if TYPE_CHECKING:
    from vibroimpact.execution.store import SweepStore


def is_wanted(options: Mapping[str, Any]) -> bool:
    """Return whether a map goes to a store, tile by tile."""
    return options["out"] is not None and options["out"].suffix.lower() == ".zarr"


def exists(options: Mapping[str, Any]) -> bool:
    """Return whether there is a stored map, of this study or another, that may not be overwritten."""
    out: Path = options["out"]
    return out.exists() and not options["overwrite"] and _opened(out) is not None


def announce(out: Path) -> None:
    """Show how far the existing store of the same study is."""
    store = _opened(out)
    if store is not None:
        left = "nothing is left to compute" if store.is_complete() else "continuing"
        # By way of `sys.stderr` as it is now, so that it does not run into a bar.
        print(f"{out} exists: {_progress(store)[0]}; {left}", file=sys.stderr, flush=True)


@contextmanager
def making_room(options: Mapping[str, Any]) -> Iterator[None]:
    """Set aside what may be overwritten; restore it if the request turns out to be wrong."""
    out: Path = options["out"]
    if not (options["overwrite"] and out.exists()):
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


def state_of(out: Path, seconds: float) -> str:
    """Return in one line what a store holds after a run."""
    store = _opened(out)
    return f"{out}: {_progress(store)[0] if store else 'nothing'} ({seconds:.2g} s)"


def check_cluster(options: Mapping[str, Any]) -> None:
    """Refuse `--workers` with `--cluster`, and an invalid cluster, before anything is touched."""
    if options["cluster"] is None:
        return
    if options["workers"] is not None:
        raise WrongRequest("give either `--workers` or `--cluster`, not both; a cluster has its own workers")
    from vibroimpact.execution.cluster import check_cluster as check

    try:
        with refusing():
            check(options["cluster"])
    except ImportError as error:
        raise WrongRequest(str(error)) from error


def sentences_of_store(path: Path) -> Iterator[str]:
    """Yield what a stored map is, how far it is, what it found, and how to continue it."""
    with refusing(*REFUSALS, OSError):
        from vibroimpact.execution.store import SweepStore
        from vibroimpact.request import unmarked

        store = SweepStore(path)
    identity = dict(store.identity)
    axes = [unmarked(name, str(identity.pop(name))) for name in list(identity) if name.startswith("axis ")]
    kind = "refined map" if "refine" in identity else "parameter map"
    yield f"{path}: {kind} of {identity.pop('indices')} over {' and '.join(axes)}"
    yield "  " + ", ".join(f"{name} {value}" for name, value in identity.items() if value is not None)
    yield from _progress(store)
    damaged = store.damaged()
    if damaged:
        yield f"{len(damaged)} damaged tiles; they are computed again when you continue"
    if damaged or not store.is_complete():
        words = [word for word in store.command.split(" ") if word != "--overwrite"]
        typed = words[0] == "vibroimpact"
        yield f"continue with: {' '.join(words) if typed else 'the same parameter_map(..., store=...) call'}"


def _opened(path: Path) -> SweepStore | None:
    from vibroimpact.execution.store import SweepStore

    try:
        return SweepStore(path)
    except OSError:
        return None


def _progress(store: SweepStore) -> list[str]:
    """Return how far a sweep is, what it cost, and how its cells ended, one line each."""
    found = store.summary()
    done, needed, cells = (found[name] for name in ("cells_done", "needed", "cells"))
    if not store.refined:
        lines = [f"{found['tiles_done']} of {found['tiles']} tiles done, {done / cells:.0%} of {cells:,} cells"]
    elif store.is_complete():
        lines = [f"finished: {done:,} cells computed, {done / cells:.1%} of {cells:,} in the map"]
    else:
        lines = [f"{done:,} of {needed:,} cells computed (the total may grow), for a map of {cells:,}"]
    if done:
        left = found["seconds"] * (needed - done) / done
        more = f", about {left:.2g} s left" if left else ""
        lines.append(f"{found['seconds']:.3g} s elapsed, {found['impacts']:.3g} impacts{more}")
        lines.append(", ".join(f"{word.replace('_', ' ')} {count:,}" for word, count in found["statuses"].items()))
    return lines
