"""How far two cycles are apart, and whether they are the same."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from vibroimpact.orbits.equations import SAME, TURN, Floats


class Impacts(NamedTuple):
    """The impacts of one cycle, in the order of time: driving phases (or turns) and speeds in m/s."""

    phases: Sequence[float] | Floats
    velocities: Sequence[float] | Floats

    @staticmethod
    def of(z: Floats) -> Impacts:
        """Return the impacts of a solution z = (turns, velocities)."""
        return Impacts(*np.split(z, 2))


class HasImpacts(Protocol):
    """Protocol of objects with the impacts of one cycle: an orbit, a recognised motion, an attractor."""

    @property
    def phases(self) -> Sequence[float] | Floats:
        """Driving phases, in [0, 1)."""

    @property
    def velocities(self) -> Sequence[float] | Floats:
        """Speeds just before contact, in m/s."""


def orbit_distance(a: HasImpacts, b: HasImpacts) -> float:
    """Return the distance between two cycles, independent of the impact with which each begins.

    Each impact is a point (sin, cos, v) of the impact surface: sine and cosine of its driving angle, and its speed
    divided by the largest speed in both cycles. The distance is the largest difference of any coordinate over all
    impacts, minimised over cyclic shifts.

    Parameters
    ----------
    a, b : Orbit, Motion, Attractor or Impacts
        Whatever has the `phases` and `velocities` of one cycle.

    Returns
    -------
    float
        0 to 2; infinite for cycles of different numbers of impacts.

    Examples
    --------
    >>> orbit_distance(Impacts([0.1, 0.6], [2.0, 1.0]), Impacts([0.6, 0.1], [1.0, 2.0]))
    0.0
    """
    if len(a.velocities) != len(b.velocities):
        return math.inf
    if not len(a.velocities):
        return 0.0
    fastest = max(*a.velocities, *b.velocities)
    one, other = points_of(a, fastest), points_of(b, fastest)
    return min(float(np.abs(one - np.roll(other, shift, axis=0)).max()) for shift in range(len(one)))


def points_of(cycle: HasImpacts, fastest: float) -> Floats:
    """Return the impacts of a cycle as points (sin, cos, v), one row each."""
    angles = TURN * np.asarray(cycle.phases)
    return np.column_stack([np.sin(angles), np.cos(angles), np.asarray(cycle.velocities) / (fastest or 1.0)])


def smallest_cycle(n_periods: int, cycle: HasImpacts, *columns: Any, tolerance: float = SAME) -> tuple[int, int]:
    """Return the periods and impacts after which a cycle repeats; `columns` hold more numbers of each impact."""
    impacts = np.column_stack([points_of(cycle, max(cycle.velocities)), *columns])
    most = math.gcd(n_periods, len(impacts))
    for parts in range(most, 0, -1):
        p = len(impacts) // parts
        if most % parts == 0 and np.abs(impacts - np.roll(impacts, p, axis=0)).max() <= tolerance:
            break
    return n_periods // parts, p


def same_orbit(a: HasImpacts, b: HasImpacts, *, tolerance: float = SAME) -> bool:
    """Return whether two cycles are the same within a tolerance; the whole package uses this test.

    Parameters
    ----------
    a, b : Orbit, Motion, Attractor or Impacts
        Whatever has the `phases` and `velocities` of one cycle.
    tolerance : float
        Largest `orbit_distance` between equal cycles; 1e-7 suits solutions of the equations.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator, find_orbit
    >>> slow, fast = (find_orbit(ImpactOscillator(omega=w))[0] for w in (2.0, 2.0 + 1e-6))
    >>> same_orbit(slow, fast), same_orbit(slow, fast, tolerance=1e-4)
    (False, True)
    """
    return orbit_distance(a, b) <= tolerance
