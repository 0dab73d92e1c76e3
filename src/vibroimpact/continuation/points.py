"""Points of a branch or a boundary: solutions of its equations, with test functions of bifurcations."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vibroimpact.continuation.equations import FOLD, INSIDE, LAST_IMPACT, NUDGE, REPEATED, TOUCH, Equations
from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.events import Nearest
from vibroimpact.orbits.orbit import Orbit


@dataclass(frozen=True)
class Solution:
    """A solution of equations: a point of a branch or a boundary, or a bifurcation."""

    equations: Equations
    x: Floats

    @cached_property
    def orbit(self) -> Orbit:
        """The orbit at the point; what vanishes at a graze has the sign of rounding, which is not held against it."""
        orbit = self.equations.orbit(self.x)
        margin = self.nearest.margin if self.touches and self.nearest else 0.0
        rounded = np.abs([margin, *self.speeds[self._vanishing]]).max() > ROUNDING and self.admissible
        return replace(orbit, admissible=True, message="") if rounded else orbit

    @cached_property
    def _vanishing(self) -> NDArray[np.bool_]:
        """Whether each impact vanishes at a graze: the one that defines it and, if the motion repeats, its copies."""
        at, vanishing = self.equations, np.zeros(len(self.speeds), bool)
        if at.condition == LAST_IMPACT:
            vanishing |= at.repeats(self.x) & (np.abs(self.speeds) < REPEATED)
            vanishing[at.impact] = True
        return vanishing

    @property
    def value(self) -> float:
        """The free parameter, or the first of two."""
        return self.equations.values(self.x)[0]

    @cached_property
    def speeds(self) -> Floats:
        """Velocities of the impacts, relative to the orbit's speed."""
        return self.equations.speeds(self.x)

    @cached_property
    def nearest(self) -> Nearest | None:
        """The closest approach of the orbit to a stop between impacts."""
        return self.equations.nearest(self.x)

    @property
    def touches(self) -> bool:
        """Whether the closest approach is the touch that defines a graze."""
        at, near = self.equations, self.nearest
        if at.condition != TOUCH or near is None or (near.flight, near.stop) != (at.impact, at.stop):
            return False
        return abs(near.turns - at.touch(self.x)) < INSIDE

    @property
    def margin(self) -> float:
        """The clearance at the closest approach, relative to the orbit's size; infinite if there is none."""
        if self.nearest is None:
            return math.inf
        return 0.0 if self.touches else self.nearest.margin

    @property
    def parted(self) -> bool:
        """Whether all other stops are open at each impact."""
        return self.nearest is None or self.nearest.beside > 0.0

    @property
    def admissible(self) -> bool:
        """Whether the orbit is admissible, apart from the graze that defines a boundary."""
        others = self.speeds[~self._vanishing]
        return bool((others > 0.0).all() and self.margin >= -ROUNDING and self.parted)

    @property
    def kind(self) -> str:
        """The kind of bifurcation."""
        return self.equations.kind

    @property
    def touch_phase(self) -> float:
        """Driving phase of the graze; NaN for other kinds."""
        phase = self.equations.touch(self.x) % 1.0
        return math.nan if math.isnan(phase) else phase  # one object: points with equal content are equal

    @property
    def touched(self) -> str:
        """Name of the stop that a graze of a system touches; empty for other kinds."""
        return self.equations.touched

    @cached_property
    def residual(self) -> float:
        """Residual of the orbit's flights and its defining condition, relative to its size."""
        return self.equations.residual(self.x)

    @property
    def on_branch(self) -> Floats:
        """The unknown of the branch on which the bifurcation lies."""
        return self.equations.on_branch(self.x)

    def bifurcation(self, parameter: str) -> BifurcationPoint:
        """Return the bifurcation as a public `BifurcationPoint`."""
        return BifurcationPoint(self.kind, parameter, self.value, self.orbit, self.residual, self.touch_phase)


@dataclass(frozen=True)
class Point(Solution):
    """A point of a branch with its tangent, and the test functions, which change sign at bifurcations."""

    tangent: Floats

    def at(self, x: Floats, jacobian: Floats | None = None) -> Point:
        """Return another point of the curve, with its tangent in the same direction."""
        return Point(self.equations, x, self.equations.tangent(x, self.tangent, jacobian))

    def towards(self, other: Point, share: float = 0.5) -> Point | None:
        """Return the point at a share of the chord to another, normal to it; None if Newton's method finds none."""
        chord = other.x - self.x
        solution, corrections, jacobian = self.equations.newton(self.x + share * chord, chord)
        return self.at(solution, jacobian) if corrections else None

    def furthest(self, other: Point, halvings: int, holds: Callable[[Point], bool]) -> Point:
        """Return the last point on the way to another at which a condition that holds here still holds."""
        inside, outside = self, other
        for _ in range(halvings):
            middle = inside.towards(outside)
            if middle is None:
                break
            inside, outside = (middle, outside) if holds(middle) else (inside, middle)
        return inside

    def outward(self) -> Point:
        """Return a point just beside a graze, on the side of clear orbits: ahead if possible; this one if none is."""
        for way in (1.0, -1.0):
            ahead = self.x + way * NUDGE * self.tangent
            solution, corrections, jacobian = self.equations.newton(ahead, self.tangent)
            if corrections and self.equations.in_order(solution) and (beside := self.at(solution, jacobian)).clear:
                return beside if way > 0.0 else replace(beside, tangent=-beside.tangent)
        return self

    @cached_property
    def tests(self) -> dict[str, float]:
        """The test function of each condition."""
        return {
            FOLD: float(self.tangent[-1]),
            LAST_IMPACT: float(self.speeds.min()),
            TOUCH: self.margin,
            **self.equations.tests(self.x),
        }

    def nears(self, other: Point) -> bool:
        """Whether a test function is less than half its value at another point."""
        return any(
            self.tests[condition] * math.copysign(1.0, before) < 0.5 * abs(before)
            for condition, before in other.tests.items()
        )

    @property
    def clear(self) -> bool:
        """Whether no flight penetrates a stop and no impact velocity points away from it."""
        return self.tests[LAST_IMPACT] > 0.0 and self.margin > 0.0 and self.parted
