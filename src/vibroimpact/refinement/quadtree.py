"""The order in which a plane is computed: a coarse lattice, then ever finer ones where motions change."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from vibroimpact.indices import INDICES
from vibroimpact.refinement import curves
from vibroimpact.refinement.lattice import Places, places
from vibroimpact.refinement.marking import Rule, overlooked, wanted
from vibroimpact.refinement.picture import NAMING, Picture
from vibroimpact.refinement.scales import Curves

# Computes cells and puts them into the picture at a level; returns whether it was let finish.
Compute = Callable[[Places, int], bool]


def refine(
    picture: Picture,
    levels: int,
    jump: float | None,
    watched: tuple[str, ...],
    compute: Compute,
    along: Curves | None = None,
) -> bool:
    """Compute and fill the picture; return whether it is complete.

    Each batch follows from the ones before alone, so that a stopped run retraces its steps.
    """
    step = 1 << levels
    everywhere = np.ones(picture.level[::step, ::step].shape, bool)
    going = compute(places(everywhere, step, picture.shape), 0)
    rule = Rule({} if jump is None else _jumps(picture, step, jump, watched))
    stride = 1 if along is None else min(curves.STRIDE, step)
    for level in range(1, levels + 1):
        step //= 2
        batch = wanted(picture, step, rule) if going and step >= stride else None
        picture.fill(step)
        while batch is not None and len(batch):
            going = compute(batch, level)
            batch = overlooked(picture, step, rule) if going else None
    if going and along is not None:
        return _follow(picture, levels, stride, rule, compute, along)
    return going


def _follow(picture: Picture, levels: int, stride: int, rule: Rule, compute: Compute, along: Curves) -> bool:
    """Halve intervals of ln(omega/omega_n) along the curves near boundaries until neighbours agree; fill the rest."""
    area = curves.doubtful_area(picture, stride, rule)
    for _ in range(curves.SURVEYS):
        left = curves.doubtful(picture, curves.unknown(picture, area), along, rule)
        if len(left) < curves.FEW * picture.level.size:
            break
        for turn in range(curves.PART):
            if not compute(curves.thinned(left, turn), levels):
                return False
            left = curves.doubtful(picture, curves.still_unknown(picture, left), along, rule)
    curves.fill(picture, curves.unknown(picture, area), along)
    return True


def _jumps(picture: Picture, step: int, jump: float, watched: tuple[str, ...]) -> Mapping[str, float]:
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
