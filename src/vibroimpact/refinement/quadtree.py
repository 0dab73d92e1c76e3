"""The order in which a plane is computed: a coarse lattice, then ever finer ones where motions change."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from vibroimpact.indices import INDICES
from vibroimpact.refinement.picture import NAMING, Flags, Picture, places, points_of, quads
from vibroimpact.request import Places

# Computes cells and puts them into the picture at a level; returns whether all were computed.
Compute = Callable[[Places, int], bool]
# The difference of an index between neighbours beyond which a boundary lies between them.
Jumps = Mapping[str, float]


def refine(picture: Picture, levels: int, jump: float | None, watched: tuple[str, ...], compute: Compute) -> bool:
    """Compute and fill the picture; return whether it is complete.

    Each batch follows from the ones before alone, so that a stopped run retraces its steps.
    """
    step = 1 << levels
    everywhere = np.ones(picture.level[::step, ::step].shape, bool)
    going = compute(places(everywhere, step, picture.shape), 0)
    jumps = {} if jump is None else _jumps(picture, step, jump, watched)
    for level in range(1, levels + 1):
        step //= 2
        batch = _wanted(picture, step, jumps) if going else None
        picture.fill(step)
        while batch is not None and len(batch):
            going = compute(batch, level)
            batch = _overlooked(picture, step, jumps) if going else None
    return going


def _wanted(picture: Picture, step: int, jumps: Jumps) -> Places:
    """Return the cells of the lattice of `step` to compute: those in mixed squares of the lattice of twice the step.

    No margin around mixed squares: `_overlooked` finds boundaries that slip between samples, at less cost.
    """
    points = points_of(_mixed_squares(picture, 2 * step, jumps)) & (picture.level[::step, ::step] < 0)
    return places(points, step, picture.shape)


def _overlooked(picture: Picture, step: int, jumps: Jumps) -> Places:
    """Return the cells of the lattice of `step` that were filled in but turn out to lie beside a boundary."""
    squares = _mixed_squares(picture, step, jumps)
    points = np.zeros(picture.level[::step, ::step].shape, bool)
    for corner in quads(points):
        corner |= squares
    return places(points & (picture.level[::step, ::step] < 0), step, picture.shape)


def _mixed_squares(picture: Picture, step: int, jumps: Jumps) -> Flags:
    """Return the squares of a lattice whose corners differ in motion, or in an index by more than a jump."""
    first, *others = quads(picture.motion[::step, ::step])
    mixed: Flags = np.zeros(first.shape, bool)
    for other in others:
        mixed |= first != other
    for name, most in jumps.items():
        corners = quads(picture.values[name][::step, ::step])
        with np.errstate(invalid="ignore"):  # no value is no boundary: the class shows it
            mixed |= np.max(corners, axis=0) - np.min(corners, axis=0) > most
    return mixed


def _jumps(picture: Picture, step: int, jump: float, watched: tuple[str, ...]) -> Jumps:
    """Return the differences that count as a jump: this part of an index's range over the coarse lattice."""
    limits = {}
    for name in watched:
        if INDICES[name].dtype != "float64" or name in NAMING:
            continue
        values = picture.values[name][::step, ::step]
        finite = values[np.isfinite(values)]
        if finite.size:
            limits[name] = jump * float(np.ptp(finite))
    return limits
