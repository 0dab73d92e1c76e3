"""A stored refined map in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vibroimpact.execution.store import SweepStore
    from vibroimpact.refinement.progress import RefinedProgress


def tell_refined(store: SweepStore) -> list[str]:
    """Return how far a refined map is, level by level, what it cost, and how its cells ended, a line each."""
    from vibroimpact.refinement.progress import progress_of

    found, picture = progress_of(store), int(store.tiling.shape[0] * store.tiling.shape[1])
    drawn = found.drawn and bool(store.records()[:, 0].all())
    lines = [_head(found, picture, drawn)]
    for level in found.levels:
        lines.append(f"  level {level.level}: {level.computed:,} of {level.needed:,} cells")
    last, deepest = (found.levels[-1].level if found.levels else -1), int(store.identity["refine"])
    if last < deepest and not drawn:
        named = f"level {deepest}" if last + 1 == deepest else f"levels {last + 1} to {deepest}"
        lines.append(f"  {named}: not begun")
    if found.computed:
        lines.append(f"{found.seconds:.3g} s went by, {found.impacts:.3g} impacts{_left(found, drawn)}")
        lines.append(", ".join(f"{word.replace('_', ' ')} {count:,}" for word, count in found.statuses.items()))
    if found.damaged:
        lines.append(f"{found.damaged} chunks of cells are damaged; they are computed again when you go on")
    return lines


def _head(found: RefinedProgress, picture: int, drawn: bool) -> str:
    if drawn:
        share = found.computed / picture
        return f"finished: {found.computed:,} cells computed, {share:.1%} of {picture:,} in the picture"
    return (
        f"{found.computed:,} of {found.needed:,} cells computed that are known so far to be needed, for a picture of "
        f"{picture:,}; it is drawn when the sweep ends or is stopped"
    )


def _left(found: RefinedProgress, drawn: bool) -> str:
    left = found.seconds * (found.needed - found.computed) / found.computed
    return "" if drawn or not left else f", about {left:.2g} s left for the cells known so far"
