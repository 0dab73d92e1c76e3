"""Damped Newton's method for the equations of an orbit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vibroimpact.orbits.equations import Floats

Linearised = Callable[[Floats], tuple[Floats, Floats]]

MOST_STEPS = 40
CLOSE = 1e-9  # relative correction: convergence is quadratic, so the next iterate is exact to rounding
SHORTEST = 1e-3  # smallest fraction of a Newton step that is tried
SINGULAR = 1e13  # condition number above which the solution counts as not isolated
SUSPECT = 1e6  # the same if Newton's method did not converge


@dataclass(frozen=True)
class Solved:
    """The result of Newton's method: whether it converged, and whether the solution is not isolated."""

    z: Floats
    converged: bool
    singular: bool = False


def solve(
    linearised: Linearised,
    start: Floats,
    sizes: tuple[Floats, Floats],
    in_order: Callable[[Floats], bool],
    close: float = CLOSE,
) -> Solved:
    """Return the solution that damped Newton's method reaches: a step is halved while it increases the residuals.

    `linearised` returns the residuals and their derivative, `sizes` are the scales of the residuals and of the
    unknowns, `in_order` tests whether the events are in the order of time, and the last relative correction is below
    `close`.
    """
    rows, columns = sizes

    def scaled(unknown: Floats) -> tuple[Floats, Floats]:
        missed, slope = linearised(unknown)
        return missed / rows, slope * columns / rows[:, None]

    z, (misses, matrix) = start, scaled(start)
    for _ in range(MOST_STEPS):
        if not np.isfinite(matrix).all():
            break
        correction = np.linalg.lstsq(matrix, misses, rcond=None)[0]
        largest, part = float(np.abs(correction).max()), 1.0
        while part > SHORTEST:
            trial = z - part * columns * correction
            possible = in_order(trial)  # a flight far back in time is too large for a number
            if possible:
                trial_misses, slope = scaled(trial)
            if largest < close or (possible and np.abs(trial_misses).max() < np.abs(misses).max()):
                break
            part *= 0.5
        else:
            break
        if largest < close:
            return Solved(trial, possible, bool(np.linalg.cond(matrix) > SINGULAR))
        z, misses, matrix = trial, trial_misses, slope
    return Solved(z, False, bool(not np.isfinite(matrix).all() or np.linalg.cond(matrix) > SUSPECT))
