"""The orbits of the present motions, continued along a parameter to their boundaries and to advised values.

A slow change leads along their branches, which initial conditions of the changed design may miss.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from vibroimpact.continuation.branch import walk
from vibroimpact.continuation.flights import equations_of
from vibroimpact.continuation.following import Way
from vibroimpact.verdict.present import MOST_IMPACTS, Coexisting, Present
from vibroimpact.verdict.ranges import Range

STEP = 0.01  # of the range, a period, or the speed: the longest step along a branch of one mass near a bifurcation
STRIDE = 0.08  # elsewhere
MOST = 800  # orbits times impacts that are solved for along one branch
WHOLE = 1e-6  # of a period, or a change: what differs by less is one


def present_orbits(present: Present, motions: Sequence[Coexisting]) -> list[Any]:
    """Return the stable orbits of the present motions that soon repeat and do not rest at a stop."""
    orbits = [present.orbit if motion.from_rest else _orbit_of(motion) for motion in motions]
    return [orbit for orbit in orbits if orbit is not None and not orbit.sticks]


def _orbit_of(motion: Coexisting) -> Any:
    """Return the orbit of a motion that repeats after few impacts, or None."""
    attractor = motion.attractor
    if attractor is None or not motion.repeats or not 0 < len(attractor.velocities) <= MOST_IMPACTS:
        return None
    return attractor.orbit


class LazyBranch:
    """A branch of an orbit along a parameter in one direction, followed only as far as is needed."""

    def __init__(self, orbit: Any, varied: Range, direction: int) -> None:
        self.orbit, self.varied, self.direction = orbit, varied, direction
        self.way: Way | None = None
        self._ways = self._walk()

    def _walk(self) -> Iterator[Way]:
        longest = STEP * math.sqrt(self.orbit.model.at().step_cost)  # dearer orbits lie wider apart
        equations, z = equations_of(self.orbit, (self.varied.name,), ((self.varied.low, self.varied.high),))
        yield from walk(equations, equations.pack(z), longest, False, self.direction, round(STRIDE / longest))

    def goes_on(self) -> bool:
        """Follow the branch by one more point, if it is solved for; return whether it continues."""
        if self.way is not None and len(self.way.points) * self.orbit.n_impacts > MOST:
            return False
        following = next(self._ways, None)
        self.way = following or self.way
        return following is not None

    def at(self, value: float) -> list[Any]:
        """Return the stable orbits at a value, on the branch up to the point where it first passes this value.

        A branch that turns and comes back past its beginning is not followed further: stable orbits there are present
        motions.
        """
        while not self._passes(value) and self.goes_on():
            pass
        pairs = pairwise(self.way.points if self.way else [])
        orbits = [self._crossing(a, b, value) for a, b in pairs if a.equations is b.equations]
        return [orbit for orbit in orbits if orbit is not None and orbit.stable]

    def _passes(self, value: float) -> bool:
        """Whether the branch has passed a value, or has come back past its beginning."""
        present, points = self.varied.value, self.way.points if self.way else []
        shares = [(point.value - present) / (value - present) for point in points]
        return bool(shares) and (max(shares) >= 1.0 or min(shares) < -WHOLE)

    def _crossing(self, a: Any, b: Any, value: float) -> Any:
        """Return the orbit at a value between two points, or None if the value is not between them."""
        low, high = a.value, b.value
        if not min(low, high) <= value <= max(low, high) or low == high:
            return None
        x = a.x + (value - low) / (high - low) * (b.x - a.x)
        solution, corrections, _ = a.equations.newton(x, np.eye(len(x))[-1])
        return a.equations.orbit(solution) if corrections else None


class Branches(dict[tuple[int, str, int], LazyBranch]):
    """The branches of orbits along parameters, as far as they were needed."""

    def of(self, orbit: Any, varied: Range, direction: int) -> LazyBranch:
        """Return the branch of an orbit downwards (-1) or upwards (+1) along a parameter."""
        key = id(orbit), varied.name, direction  # the branch keeps the orbit, and so its number
        if key not in self:
            self[key] = LazyBranch(orbit, varied, direction)
        return self[key]

    def at(self, orbits: Sequence[Any], varied: Range, value: float) -> list[Any]:
        """Return the stable orbits at a value of a parameter on the branches of some orbits."""
        reached: list[Any] = []
        for orbit in orbits:
            try:
                reached += self.of(orbit, varied, 1 if value > varied.value else -1).at(value)
            except (ArithmeticError, ValueError, np.linalg.LinAlgError):
                continue  # it runs where its equations have no meaning
        return reached
