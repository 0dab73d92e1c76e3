r"""How the curve is followed that equations with a free parameter or two leave: a branch, or a boundary.

The unknown x holds the impacts of a cycle, for a graze in mid-flight the turns at which it touches, and the free
parameters as parts of their ranges. The misses of the cycle, and on a boundary one condition more, vanish. One equation
fewer than unknowns leaves a curve; with as many the point is isolated.

A step along the curve leads along its tangent; Newton's method then corrects it on the hyperplane normal to the
tangent, which passes folds where the parameter turns (H. B. Keller, in Applications of Bifurcation Theory, Academic
Press (1977) 359-384).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.model import Model
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.orbit import Orbit, check_pair, value_of
from vibroimpact.parameters import invalid, real_number
from vibroimpact.progress import Report

BRANCH, FOLD, DOUBLING, TORUS = "branch", "fold", "period_doubling", "neimark_sacker"
TOUCH, LAST_IMPACT = "touch", "last_impact"
GRAZING = (TOUCH, LAST_IMPACT)
STEP = 1e-5  # of an unknown's size: differences are then right to about 1e-10, enough for Newton's method
MOST = 12  # corrections per point
CLOSE = 1e-9  # the correction after which convergence, which is quadratic, is complete
SHORTEST = 1e-6  # of the longest step
STRAIGHT = 0.97  # least cosine between the tangents at two points
EASY = 3  # corrections up to which the next step may be longer
UNKNOWN: Any = None  # how many points or curves there will be
MOST_POINTS = 20_000  # of one direction

Range = tuple[float, float]


class Corrected(NamedTuple):
    """What Newton's method reached, in how many corrections (0: it failed), and the Jacobian before the last."""

    x: Floats
    made: int
    jacobian: Floats | None = None


class Nearest(NamedTuple):
    """Where an orbit comes closest to a stop between impacts: flight, turns, clearance in parts of its size, stop."""

    flight: int
    turns: float
    margin: float
    stop: int = 0
    beside: float = math.inf  # the least clearance, likewise, of another stop than the struck one at an impact


@dataclass(frozen=True, kw_only=True)
class Equations(ABC):
    """Equations of a cycle with free parameters.

    `condition` says which boundary, `where` which flight or impact, `stop` what that flight touches.
    """

    model: Model
    cycle: Any
    names: tuple[str, ...]
    ranges: tuple[Range, ...]
    condition: str = BRANCH
    where: int = 0
    stop: int = 0

    @property
    @abstractmethod
    def size(self) -> int:
        """How many of the unknowns are the impacts of the cycle."""

    @property
    @abstractmethod
    def impacts(self) -> int:
        """How many impacts, whose turns come first, are solved for."""

    @abstractmethod
    def scaled(self, z: Floats) -> Floats:
        """Return the unknowns of a solution that are no parameters, without a touch."""

    @abstractmethod
    def orbit(self, x: Floats) -> Orbit:
        """Return the orbit of a solution."""

    @abstractmethod
    def possible(self, x: Floats) -> bool:
        """Whether the flights have a meaning there."""

    @abstractmethod
    def in_order(self, x: Floats) -> bool:
        """Whether the impacts follow one another, and the touch is inside its flight."""

    @abstractmethod
    def flights(self, x: Floats) -> Floats:
        """Return by how much flights miss their impacts, in parts of the orbit's size: as many as `size`."""

    @abstractmethod
    def flights_jacobian(self, x: Floats) -> Floats:
        """Return the derivative of these misses by the impacts, in closed form."""

    @abstractmethod
    def conditions(self, x: Floats) -> list[float]:
        """Return the conditions that vanish on the boundary alone."""

    @abstractmethod
    def sizes(self, x: Floats) -> Floats:
        """Return by how much each unknown must change to change the flights by something of order one."""

    @abstractmethod
    def weights(self, x: Floats) -> Floats:
        """Return the weight of each unknown in the length of a step."""

    @abstractmethod
    def velocities(self, x: Floats) -> Floats:
        """Return the velocities of the impacts in m/s."""

    @abstractmethod
    def speeds(self, x: Floats) -> Floats:
        """Return the velocities of the impacts in parts of the orbit's speed."""

    @abstractmethod
    def nearest(self, x: Floats) -> Nearest | None:
        """Return the closest approach of the orbit to a stop between impacts."""

    @abstractmethod
    def tests(self, x: Floats) -> dict[str, float]:
        """Return the functions that change sign where a multiplier leaves the unit circle, other than at folds."""

    @abstractmethod
    def residual(self, x: Floats) -> float:
        """Return by how much the orbit misses its flights and its own condition, relative to its size."""

    @abstractmethod
    def at_graze(self, x: Floats) -> tuple[Equations, Floats]:
        """Return the condition of the graze that an orbit is at, and its unknown."""

    @abstractmethod
    def halves(self, x: Floats) -> Floats | None:
        """Return by how much the two halves of a cycle differ; None if it has no halves."""

    @abstractmethod
    def half(self, x: Floats) -> tuple[Equations, Floats]:
        """Return the equations of half of a cycle at which such halves separate, and the mean of both."""

    @abstractmethod
    def doubled(self, z: Floats) -> tuple[Equations, Floats, Floats]:
        """Return the equations of two rounds, the orbit traversed twice, and how the rounds separate."""

    @property
    def inner(self) -> int:
        """How many of the unknowns are no parameters."""
        return self.size + (self.condition == TOUCH)

    @property
    def kind(self) -> str:
        """Which bifurcation the condition is."""
        return "grazing" if self.condition in GRAZING else self.condition

    def is_own(self, x: Floats) -> bool:
        """Whether a solution is of the kind that the condition stands for."""
        return True

    def pack(self, z: Floats, touch: float | None = None) -> Floats:
        """Return the unknown of a solution z of the model at its own values."""
        free = [
            (value_of(self.model, name) - low) / (high - low)
            for name, (low, high) in zip(self.names, self.ranges, strict=True)
        ]
        return np.concatenate([self.scaled(z), [] if touch is None else [touch], free])

    def bounded(
        self, condition: str, x: Floats, where: int = 0, touch: float = 0.0, stop: int = 0
    ) -> tuple[Equations, Floats]:
        """Return these equations with a condition more, and the unknown of theirs that x is."""
        start = np.concatenate([x[: self.size], [touch] if condition == TOUCH else [], x[self.size :]])
        return replace(self, condition=condition, where=where, stop=stop), start

    def on_branch(self, x: Floats) -> Floats:
        """Return the unknown of the branch that a bifurcation lies on."""
        return np.concatenate([x[: self.size], x[self.inner :]])

    def gives_at(self, where: int) -> bool:
        """Whether an impact is a contact of a compliant stop, which ends before anything else happens."""
        return False

    @property
    def soft(self) -> bool:
        """Whether the condition is a graze of a compliant stop, beyond which the branch goes on."""
        return False

    def beyond(self, x: Floats, way: float) -> tuple[Equations, Floats, Floats] | None:
        """Return the equations on which a branch goes on beyond a graze, a solution and its tangent, if it does so."""
        return None

    def touch(self, x: Floats) -> float:
        """Return the turns at which the orbit grazes; NaN for other conditions."""
        if self.condition == LAST_IMPACT:
            return float(x[self.where])
        return float(x[self.inner - 1]) if self.condition == TOUCH else math.nan

    def values(self, x: Floats) -> list[float]:
        """Return the free parameters."""
        return [
            low + float(part) * (high - low) for part, (low, high) in zip(x[self.inner :], self.ranges, strict=True)
        ]

    def inside(self, values: list[float]) -> list[float]:
        """Return the values next to these in the ranges."""
        return [min(max(value, low), high) for value, (low, high) in zip(values, self.ranges, strict=True)]

    def model_at(self, x: Floats) -> Model:
        """Return the model, its free parameters inside their ranges."""
        return self.model.replace(**dict(zip(self.names, self.inside(self.values(x)), strict=True)))

    def distance(self, start: Floats, x: Floats) -> float:
        """Return the distance of a point of the curve from its first one; whole turns do not count."""
        apart = (x - start) * self.weights(start)
        apart[[*range(self.impacts), *([self.size] if self.condition == TOUCH else [])]] -= np.rint(apart[0])
        return float(np.linalg.norm(apart))

    def misses(self, x: Floats) -> Floats:
        """Return the residuals, in parts of the orbit's size."""
        flights = self.flights(x)
        return flights if self.condition == BRANCH else np.append(flights, self.conditions(x))

    def jacobian(self, x: Floats) -> Floats:
        """Return the derivative of the misses: of the flights by the impacts in closed form, the rest not."""
        sizes = self.sizes(x)
        matrix = np.zeros((self.size + len(self.conditions(x)), len(x)))
        matrix[: self.size, : self.size] = self.flights_jacobian(x)
        for j in range(len(x)):
            first = 0 if j >= self.inner else self.size
            if first < len(matrix):
                matrix[first:, j] = self._difference(x, j, sizes[j], first)
        return matrix

    def _difference(self, x: Floats, j: int, size: float, first: int) -> Floats:
        """Return the derivative of the misses, those of the flights only if `first` is 0, by one unknown."""

        def misses(value: float) -> Floats:
            moved = x.copy()
            moved[j] = value
            return self.misses(moved) if first == 0 else np.array(self.conditions(moved))

        step = STEP * size
        return (misses(x[j] + step) - misses(x[j] - step)) / (2.0 * step)

    def newton(self, x: Floats, row: Floats | None = None, target: float | None = None) -> Corrected:
        """Return the solution near x, with row . x = target (its own by default)."""
        x = x.copy()
        aim: Any = row @ x if row is not None and target is None else target
        for made in range(1, MOST + 1):
            if not self.possible(x):
                break
            try:
                misses, jacobian = self.misses(x), self.jacobian(x)
            except ValueError:  # a family makes no oscillator of values beside these
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
                return Corrected(x, made, jacobian)
            if not size < 1e3:
                break
        return Corrected(x, 0)

    def tangent(self, x: Floats, along: Floats, jacobian: Floats | None = None) -> Floats:
        """Return the tangent of the curve at x, in the direction of `along`, of weighted length 1."""
        counts = self.weights(x)
        direction = np.linalg.svd((self.jacobian(x) if jacobian is None else jacobian) / counts)[2][-1]
        return np.asarray(direction / counts * (1.0 if direction @ (along * counts) >= 0.0 else -1.0))


@dataclass(frozen=True)
class Step:
    """A point of a curve and its tangent; `end` is why no point follows, "range", "closed" or "lost", else empty."""

    x: Floats
    tangent: Floats
    end: str = ""


def follow(system: Equations, x: Floats, way: Floats, longest: float) -> Iterator[Step]:
    """Yield the points of a curve after x, where `way` is its tangent, to the edge of the ranges or back to x."""
    start, first, step, away = x, way, longest, False
    while True:
        counts, ahead = system.weights(x), x + step * way
        found, made, jacobian = system.newton(ahead, counts * counts * way)
        turned = system.tangent(found, way, jacobian) if made else way
        straight = (turned * counts) @ (way * counts) / np.linalg.norm(turned * counts)
        if not made or straight < STRAIGHT or np.abs((found - ahead) * counts).max() > step:
            step *= 0.5
            if step < SHORTEST * longest:
                yield Step(x, way, "lost")
                return
            continue
        outside = [j for j in range(system.inner, len(found)) if not -1e-12 <= found[j] <= 1.0 + 1e-12]
        if outside:
            yield _to_edge(system, x, found, outside, way)
            return
        x, way = found, turned
        distance = system.distance(start, x)
        away = away or distance > 3.0 * longest
        closed = away and distance < longest and way @ first > 0.0
        yield Step(x, way, "closed" if closed else "")
        if closed:
            return
        step = min(longest, step * (1.5 if made <= EASY else 1.0))


def _to_edge(system: Equations, inside: Floats, beyond: Floats, outside: list[int], way: Floats) -> Step:
    """Return the point at which the curve first leaves the ranges, between a point inside and one beyond."""
    reached = {j: ((0.0 if beyond[j] < 0.0 else 1.0) - inside[j]) / (beyond[j] - inside[j]) for j in outside}
    j = min(reached, key=lambda key: reached[key])
    start = inside + reached[j] * (beyond - inside)
    found, made, jacobian = system.newton(start, np.eye(len(start))[j], 0.0 if beyond[j] < 0.0 else 1.0)
    if not made or np.abs(found - start).max() > np.abs(beyond - inside).max() + 1e-12:
        return Step(inside, way, "lost")
    return Step(found, system.tangent(found, way, jacobian), "range")


@dataclass
class Way:
    """What was met along one direction of a curve: its points, bifurcations on it, and why it ended or was lost."""

    points: list[Any]
    special: list[Any] = field(default_factory=list)
    end: str = "budget"
    why: str = ""


def both_ways(walk: Callable[[float], Iterator[Way]], report: Report) -> list[Way]:
    """Return the two directions of a curve, -1 and 1 of its tangent; a walk yields its way after each point."""
    ways: list[Way] = []
    done = 0
    for direction in (-1.0, 1.0):
        if ways and ways[0].end == "closed":
            return [*ways, Way(ways[0].points[:1], end="closed")]
        for way in walk(direction):
            if report(done + len(way.points), UNKNOWN, None) is False:
                way.end = "stopped"
                break
        done += len(way.points)
        ways.append(way)
    return ways


def check_range(model: Model, name: Any, given: Any, orbit: Orbit | None = None) -> Range:
    """Return the ends of a range of a parameter of a model, which must hold the value of an orbit."""
    low, high = check_pair(model, name, "range", given)
    if not low < high:
        raise invalid("range", (low, high), "a lower number before a higher one")
    if orbit and not low <= orbit.value(name) <= high:
        raise invalid("range", (low, high), f"one that holds the orbit's {name}, {orbit.value(name):.12g}", "widen it")
    return low, high


def check_share(name: str, share: Any) -> float:
    """Return a length that is a share of the ranges, of a driving period and of the orbit's speed."""
    allowed = "a number from 1e-6 to 0.5"
    value = real_number(name, share, allowed)
    if not 1e-6 <= value <= 0.5:
        raise invalid(name, share, allowed, "0.01 is usual")
    return value
