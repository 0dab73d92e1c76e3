r"""The equations of a cycle with one free parameter (a branch), or with two and one more condition (a boundary).

The unknown x holds the impacts of a cycle, for a graze in mid-flight the turns of the touch, and the free parameters
relative to their ranges. The equations set the residuals of the cycle to zero and, on a boundary, one more condition.
With one equation fewer than unknowns the solutions form a curve; with as many, a solution is isolated.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.model import Model
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.events import Nearest
from vibroimpact.orbits.orbit import Orbit, value_of

BRANCH, FOLD, DOUBLING, TORUS = "branch", "fold", "period_doubling", "neimark_sacker"
TOUCH, LAST_IMPACT = "touch", "last_impact"
GRAZING = (TOUCH, LAST_IMPACT)
STEP = 1e-5  # step of differences, relative to an unknown's size: accurate to about 1e-10, enough for Newton's method
CORRECTIONS = 12  # corrections per point, at most
CLOSE = 1e-9  # correction after which quadratic convergence is complete
FAR = 1e3  # larger corrections count as divergence
LEAST = 1e-3  # of the orbit's size: smallest scale used for the step of differences
NUDGE = 1e-6  # of a range: change of a parameter by which the sensitivity of the equations is estimated
INSIDE = 1e-6  # turns: a touch closer to an impact counts as the impact itself
REST = 1e-9  # of the orbit's speed: a slower impact is a graze
REPEATED = 1e-6  # of the orbit's size: largest difference within a motion that repeats

Range = tuple[float, float]


class Corrected(NamedTuple):
    """The result of Newton's method, the number of corrections (0: it failed), and the Jacobian before the last."""

    x: Floats
    corrections: int
    jacobian: Floats | None = None


@dataclass(frozen=True, kw_only=True)
class Equations(ABC):
    """Base class of the equations of a cycle with free parameters.

    `condition` is that of the boundary, `impact` the grazing impact or the one before the grazing flight, `stop` the
    stop it touches.
    """

    model: Model
    cycle: Any
    names: tuple[str, ...]
    ranges: tuple[Range, ...]
    condition: str = BRANCH
    impact: int = 0
    stop: int = 0

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of unknowns that describe the impacts of the cycle."""

    @property
    @abstractmethod
    def impacts(self) -> int:
        """Number of impacts solved for; their turns are the first unknowns."""

    @property
    @abstractmethod
    def length(self) -> float:
        """Driving periods of the cycle, or of the half of a mirrored cycle."""

    @abstractmethod
    def scaled(self, z: Floats) -> Floats:
        """Return the unknowns of a solution other than parameters."""

    @abstractmethod
    def orbit(self, x: Floats) -> Orbit:
        """Return the orbit of a solution."""

    @abstractmethod
    def possible(self, x: Floats) -> bool:
        """Whether the flights are defined at x."""

    @abstractmethod
    def flights(self, x: Floats) -> Floats:
        """Return the `size` residuals of the flights at their impacts, relative to the orbit's size."""

    @abstractmethod
    def flights_jacobian(self, x: Floats) -> Floats:
        """Return the derivative of these residuals with respect to the impacts, in closed form."""

    @abstractmethod
    def conditions(self, x: Floats) -> list[float]:
        """Return the conditions of the boundary, which vanish on it."""

    @abstractmethod
    def sizes(self, x: Floats) -> Floats:
        """Return the change of each unknown that changes the flights by order one."""

    @abstractmethod
    def velocities(self, x: Floats) -> Floats:
        """Return the velocities of the impacts in m/s."""

    @abstractmethod
    def speeds(self, x: Floats) -> Floats:
        """Return the velocities of the impacts relative to the orbit's speed."""

    @abstractmethod
    def nearest(self, x: Floats) -> Nearest | None:
        """Return the closest approach of the orbit to a stop between impacts."""

    @abstractmethod
    def tests(self, x: Floats) -> dict[str, float]:
        """Return the test functions that change sign where a multiplier leaves the unit circle, except at folds."""

    @abstractmethod
    def halves(self, x: Floats) -> Floats | None:
        """Return the difference between the two halves of a cycle; None if it has no halves."""

    @abstractmethod
    def half(self, x: Floats) -> tuple[Equations, Floats]:
        """Return the equations of the bifurcation at which such halves separate, and the mean of both."""

    @abstractmethod
    def twice(self, z: Floats) -> tuple[Equations, Floats]:
        """Return the equations of two rounds, and the orbit traversed twice."""

    @property
    def inner(self) -> int:
        """Number of unknowns other than parameters."""
        return self.size + (self.condition == TOUCH)

    @property
    def kind(self) -> str:
        """The kind of bifurcation of the condition."""
        return "grazing" if self.condition in GRAZING else self.condition

    def in_order(self, x: Floats) -> bool:
        """Whether the impacts are in the order of time, and the touch is inside its flight."""
        ends = np.append(x[: self.impacts], x[0] + self.length)
        begin, end = ends[self.impact : self.impact + 2]
        inside = self.condition != TOUCH or begin + INSIDE < x[self.inner - 1] < end - INSIDE
        return bool((np.diff(ends) > 0.0).all() and inside)

    def fits(self, x: Floats) -> bool:
        """Whether a solution is of the kind of the condition: a touch must be inside its flight."""
        return self.condition != TOUCH or self.in_order(x)

    def weights(self, x: Floats) -> Floats:
        """Return the weight of each unknown in the length of a step; unknowns of the orbit are relative to the largest.

        Turns and parameters have weight 1, and so have velocities and states if all are below 1.
        """
        weights = np.ones(len(x))
        weights[self.impacts : self.size] /= max(1.0, float(np.abs(x[self.impacts : self.size]).max()))
        return weights

    def touching(self, x: Floats) -> Nearest | None:
        """Return the approach to a stop between impacts that is closest to a touch."""
        return self.nearest(x)

    def at_graze(self, x: Floats) -> tuple[Equations, Floats]:
        """Return the equations with the condition of the graze of an orbit, and their unknown."""
        impact = int(np.argmin(self.speeds(x)))
        if self.speeds(x)[impact] <= REST:
            return self.bounded(LAST_IMPACT, x, impact)
        touch = self.touching(x) or Nearest(0, math.nan, math.nan)
        return self.bounded(TOUCH, x, touch.flight, touch.turns, touch.stop)

    def pack(self, z: Floats) -> Floats:
        """Return the unknown for a solution z of the model at its own parameter values."""
        free = [
            (value_of(self.model, name) - low) / (high - low)
            for name, (low, high) in zip(self.names, self.ranges, strict=True)
        ]
        return np.concatenate([self.scaled(z), free])

    def doubled(self, z: Floats) -> tuple[Equations, Floats, Floats]:
        """Return the equations of two rounds, the unknown of the orbit traversed twice, and how the rounds separate."""
        equations, both = self.twice(z)
        x = equations.pack(both)
        return equations, x, np.append(np.linalg.svd(equations.flights_jacobian(x))[2][-1], 0.0)

    def bounded(
        self, condition: str, x: Floats, impact: int = 0, touch: float = 0.0, stop: int = 0
    ) -> tuple[Equations, Floats]:
        """Return these equations with one more condition, and x as their unknown."""
        start = np.concatenate([x[: self.size], [touch] if condition == TOUCH else [], x[self.size :]])
        return replace(self, condition=condition, impact=impact, stop=stop), start

    def on_branch(self, x: Floats) -> Floats:
        """Return the unknown of the branch on which a bifurcation lies."""
        return np.concatenate([x[: self.size], x[self.inner :]])

    @property
    def of_branch(self) -> Self:
        """These equations without the condition of a boundary."""
        return replace(self, condition=BRANCH, impact=0, stop=0)

    def compliant_at(self, impact: int) -> bool:
        """Whether an impact is a contact with a compliant stop that ends before any other event."""
        return False

    @property
    def soft(self) -> bool:
        """Whether the condition is a graze of a compliant stop, beyond which the branch continues."""
        return False

    def beyond(self, x: Floats, sign: float) -> tuple[Equations, Floats, Floats] | None:
        """Return the equations of a branch beyond a graze, a solution and its tangent; None if the branch ends."""
        return None

    def seen(self, point: Any) -> list[Any]:
        """Return a point of the branch before a graze in the unknown of these equations beyond it, if it has any."""
        return [point]

    def repeats(self, x: Floats) -> bool:
        """Whether the motion of a solution repeats within its cycle."""
        return False

    def past(self, x: Floats) -> tuple[Equations, Floats] | None:
        """Return equations beyond a place where two events meet, or of the graze there; None if the branch ends."""
        return None

    @property
    def touched(self) -> str:
        """Name of the stop that a graze touches; empty for other conditions, and for one mass with one stop."""
        return ""

    def touch(self, x: Floats) -> float:
        """Return the turns at which the orbit grazes; NaN for other conditions."""
        if self.condition == LAST_IMPACT:
            return float(x[self.impact])
        return float(x[self.inner - 1]) if self.condition == TOUCH else math.nan

    def values(self, x: Floats) -> list[float]:
        """Return the free parameters."""
        return [
            low + float(part) * (high - low) for part, (low, high) in zip(x[self.inner :], self.ranges, strict=True)
        ]

    def inside(self, values: list[float]) -> list[float]:
        """Return the nearest values inside the ranges."""
        return [min(max(value, low), high) for value, (low, high) in zip(values, self.ranges, strict=True)]

    def model_at(self, x: Floats) -> Model:
        """Return the model, with the free parameters limited to their ranges."""
        return self.model.replace(**dict(zip(self.names, self.inside(self.values(x)), strict=True)))

    def apart(self, start: Floats, x: Floats) -> Floats:
        """Return the difference of a point of the curve from an earlier one, up to whole turns."""
        apart = x - start
        apart[[*range(self.impacts), *([self.size] if self.condition == TOUCH else [])]] -= np.rint(apart[0])
        return apart

    def distance(self, start: Floats, x: Floats) -> float:
        """Return the length of that difference."""
        return float(np.linalg.norm(self.apart(start, x) * self.weights(start)))

    def residual(self, x: Floats) -> float:
        """Return the residual of the flights and of the condition, relative to the orbit's size."""
        return float(np.abs(self.misses(x)).max())

    def misses(self, x: Floats) -> Floats:
        """Return the residuals relative to the orbit's size."""
        flights = self.flights(x)
        return flights if self.condition == BRANCH else np.append(flights, self.conditions(x))

    def linearised(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the residuals and their derivative, in closed form with respect to impacts, else by differences.

        Conditions are evaluated where the linearised flights close, and differentiated along their other solutions
        alone: Newton's method reaches the same point, and a cycle of many impacts has one or two such directions.
        """
        sizes, misses, flights = self.sizes(x), self.flights(x), np.zeros((self.size, len(x)))
        flights[:, : self.size] = self.flights_jacobian(x)
        free = np.eye(len(x))[self.inner :]
        flights[:, self.inner :] = _slopes(self.flights, x, sizes * free) / sizes[self.inner :]
        if self.condition == BRANCH:
            return misses, flights
        if not (np.isfinite(misses).all() and np.isfinite(flights).all()):
            raise ValueError("the flights are not finite")
        left, scales, right = np.linalg.svd(flights * sizes)
        parts = np.divide(misses @ left, scales, out=np.zeros(self.size), where=scales > 0.0)
        closed, along = x - sizes * (parts @ right[: self.size]), right[self.size :]
        slopes = _slopes(self.conditions, closed, sizes * along) @ along / sizes
        return np.append(misses, self.conditions(closed)), np.concatenate([flights, slopes])

    @np.errstate(over="ignore", invalid="ignore")  # what is not finite ends the search
    def newton(self, x: Floats, row: Floats | None = None, target: float | None = None) -> Corrected:
        """Return the solution near x, with row . x = target (its own by default)."""
        x = x.copy()
        aim: Any = row @ x if row is not None and target is None else target
        for corrections in range(1, CORRECTIONS + 1):
            if not self.possible(x):
                break
            try:
                misses, jacobian = self.linearised(x)
            except ValueError:  # the family rejects neighbouring values
                break
            matrix = jacobian
            if row is not None:
                misses, matrix = np.append(misses, row[None, :] @ x - aim), np.concatenate([jacobian, row[None, :]])
            if not (np.isfinite(misses).all() and np.isfinite(matrix).all()):
                break
            try:
                correction = np.linalg.solve(matrix, misses)
            except np.linalg.LinAlgError:
                break
            x -= correction
            size = float(np.abs(correction).max())
            if size < CLOSE:
                return Corrected(x, corrections, jacobian)
            if not size < FAR:
                break
        return Corrected(x, 0)

    def tangent(self, x: Floats, along: Floats, jacobian: Floats | None = None) -> Floats:
        """Return the tangent of the curve at x, in the direction of `along`, of weighted length 1."""
        weights = self.weights(x)
        direction = np.linalg.svd((self.linearised(x)[1] if jacobian is None else jacobian) / weights)[2][-1]
        return np.asarray(direction / weights * (1.0 if direction @ (along * weights) >= 0.0 else -1.0))


def _slopes(function: Callable[[Floats], Any], x: Floats, directions: Floats) -> Floats:
    """Return the derivatives of a function along some directions, as central differences, one per column.

    One-sided ones would leave the parameter at which an orbit has just been born uncertain to a millionth of itself.
    """
    slopes = [np.subtract(function(x + STEP * one), function(x - STEP * one)) / (2.0 * STEP) for one in directions]
    return np.array(slopes, dtype=float).T


def _nearest_zero(values: Sequence[complex] | NDArray[np.complex128]) -> float:
    """Return the product of the two numbers closest to zero, with the sign of the product of all, which is real."""
    sizes = np.sort(np.abs(values))
    if not np.isfinite(sizes).all() or sizes[0] == 0.0:
        return 0.0 if np.isfinite(sizes).all() else math.inf
    return math.copysign(float(np.prod(sizes[:2])), float(np.prod(np.array(values) / np.abs(values)).real))


def _products(multipliers: Sequence[complex]) -> NDArray[np.complex128]:
    """Return the products of all pairs."""
    with np.errstate(invalid="ignore"):  # one is infinite at a graze
        return np.asarray(np.outer(multipliers, multipliers)[np.triu_indices(len(multipliers), 1)])


TESTS: dict[str, Any] = {  # of all multipliers of a cycle: zero at a bifurcation
    FOLD: lambda multipliers: _nearest_zero([1.0 - value for value in multipliers]),
    DOUBLING: lambda multipliers: _nearest_zero([1.0 + value for value in multipliers]),
    TORUS: lambda multipliers: _nearest_zero(1.0 - _products(multipliers)) if len(multipliers) > 2 else 1.0,
}
