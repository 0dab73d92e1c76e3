"""Damped Newton's method for the equations of an orbit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vibroimpact.orbits.equations import Floats

MOST = 40
CLOSE = 1e-9  # relative: the correction after which convergence, being quadratic, is complete
SINGULAR = 1e13


@dataclass(frozen=True)
class Solved:
    """The result of Newton's method: whether it converged, and whether the solution is not isolated."""

    z: Floats
    converged: bool
    singular: bool = False


class Equations(Protocol):
    """The equations of an orbit, of which each flight misses its impact by something."""

    def scales(self, z: Floats) -> tuple[Floats, Floats]:
        """Return the sizes of the misses and of the unknown, for an orbit near z."""

    def misses(self, z: Floats) -> Floats:
        """Return by how much z misses a solution."""

    def jacobian(self, z: Floats) -> Floats:
        """Return the derivative of the misses."""

    def in_order(self, z: Floats) -> bool:
        """Whether the events follow one another, the first of the next cycle included."""


def solve(equations: Equations, start: Floats) -> Solved:
    """Return the solution that damped Newton's method reaches: steps are halved while they raise the misses."""
    z = np.array(start, dtype=float)
    rows, columns = equations.scales(z)
    misses = equations.misses(z) / rows
    for _ in range(MOST):
        matrix = equations.jacobian(z) * columns / rows[:, None]
        if not np.isfinite(matrix).all():
            break
        correction = np.linalg.lstsq(matrix, misses, rcond=None)[0]
        size, part = float(np.abs(correction).max()), 1.0
        while part > 1e-3:
            trial = z - part * columns * correction
            left = equations.misses(trial) / rows
            if size < CLOSE or (np.abs(left).max() < np.abs(misses).max() and equations.in_order(trial)):
                break
            part *= 0.5
        else:
            break
        z, misses = trial, left
        if size < CLOSE:
            return Solved(z, equations.in_order(z), bool(np.linalg.cond(matrix) > SINGULAR))
    matrix = equations.jacobian(z) * columns / rows[:, None]
    return Solved(z, False, bool(not np.isfinite(matrix).all() or np.linalg.cond(matrix) > 1e6))
