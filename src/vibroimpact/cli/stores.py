"""Maps that are written tile by tile, and continued: what a store holds, in words."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibroimpact.cli.study import REFUSALS, WrongRequest, refusing

if TYPE_CHECKING:
    from vibroimpact.execution.store import SweepStore
    from vibroimpact.refinement.progress import RefinedProgress


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
        left = "nothing is left to compute" if _is_complete(store) else "continuing"
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
    damaged = store.damaged(store.records())
    if damaged:
        yield f"{len(damaged)} damaged tiles; they are computed again when you continue"
    if damaged or not _is_complete(store):
        words = [word for word in store.command.split(" ") if word != "--overwrite"]
        typed = words[0] == "vibroimpact"
        yield f"continue with: {' '.join(words) if typed else 'the same parameter_map(..., store=...) call'}"


def _opened(path: Path) -> SweepStore | None:
    from vibroimpact.execution.store import SweepStore

    try:
        return SweepStore(path)
    except OSError:
        return None


def _is_complete(store: SweepStore) -> bool:
    return bool(store.records()[:, 0].all())


def _progress(store: SweepStore) -> list[str]:
    """Return how far a sweep is, what it cost, and how its cells ended, a line each."""
    if "refine" in store.identity:
        return _refined(store)
    from vibroimpact.execution.store import summary

    found = summary(store.records(), store.tiling)
    share = found["cells_done"] / found["cells"]
    lines = [f"{found['tiles_done']} of {found['tiles']} tiles done, {share:.0%} of {found['cells']:,} cells"]
    if found["tiles_done"]:
        left = found["seconds"] * (1.0 / share - 1.0)
        lines.append(
            f"{found['seconds']:.3g} s of computing, {found['impacts']:.3g} impacts"
            + (f", about {left:.2g} s on one core left" if left else "")
        )
        lines.append(_statuses(found["statuses"]))
    return lines


def _refined(store: SweepStore) -> list[str]:
    """Return how far a refined map is, level by level, what it cost, and how its cells ended."""
    from vibroimpact.refinement.progress import progress_of

    found, picture = progress_of(store), int(store.tiling.shape[0] * store.tiling.shape[1])
    drawn = found.drawn and _is_complete(store)
    lines = [_computed(found, picture, drawn)]
    lines += [f"  level {level.level}: {level.computed:,} of {level.needed:,} cells" for level in found.levels]
    last, deepest = (found.levels[-1].level if found.levels else -1), int(store.identity["refine"])
    if last < deepest and not drawn:
        levels = f"level {deepest}" if last + 1 == deepest else f"levels {last + 1} to {deepest}"
        lines.append(f"  {levels}: not started")
    if found.computed:
        left = 0.0 if drawn else found.seconds * (found.needed - found.computed) / found.computed
        more = f", about {left:.2g} s left for the cells known so far" if left else ""
        lines += [f"{found.seconds:.3g} s elapsed, {found.impacts:.3g} impacts{more}", _statuses(found.statuses)]
    if found.damaged:
        lines.append(f"{found.damaged} damaged chunks of cells; they are computed again when you continue")
    return lines


def _computed(found: RefinedProgress, picture: int, drawn: bool) -> str:
    if drawn:
        share = found.computed / picture
        return f"finished: {found.computed:,} cells computed, {share:.1%} of {picture:,} in the map"
    return (
        f"{found.computed:,} of {found.needed:,} cells computed (the total may grow), for a map of {picture:,}, which "
        "is completed when the run ends or is stopped"
    )


def _statuses(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{word.replace('_', ' ')} {count:,}" for word, count in counts.items())
