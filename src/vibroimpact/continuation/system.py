r"""The equations that a branch or a boundary obeys, in scaled unknowns, and how the curve that they leave is followed.

The unknown x holds turns and velocities of the impacts, for a graze in mid-flight the turns at which it touches, and
the free parameters as parts of their ranges. The misses of the flights, and on a boundary one condition more, vanish:

    fold: 1 - trace + determinant,   period doubling: 1 + trace + determinant,
    grazing: the velocity of one impact, or gap and rate at the touch.

One equation fewer than unknowns leaves a curve; with as many the point is isolated.

A free parameter may be any of the model's. Of a family's own parameters the oscillator's numbers are known only as the
function that makes them: their derivatives are central differences of it.

A step along the curve leads along its tangent; Newton's method then corrects it on the hyperplane normal to the
tangent, which passes folds where the parameter turns (H. B. Keller, in Applications of Bifurcation Theory, Academic
Press (1977) 359-384).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.orbits.equations import TURN, Cycle, Floats, fastest_of, flight_of, parameters_of
from vibroimpact.orbits.orbit import Orbit, check_pair, solution_of, value_of
from vibroimpact.oscillator import ImpactOscillator, Model, the_oscillator
from vibroimpact.parameters import invalid, real_number
from vibroimpact.progress import Report

BRANCH, FOLD, DOUBLING, TOUCH, LAST_IMPACT = "branch", "fold", "period_doubling", "touch", "last_impact"
NUDGE = 1e-6  # of a range: by so much a family's parameter is moved to see how the oscillator depends on it
STEP = 1e-5  # of an unknown's size: differences are then right to about 1e-10, enough for Newton's method
MOST = 12  # corrections per point
CLOSE = 1e-9  # the correction after which convergence, which is quadratic, is complete
SHORTEST = 1e-6  # of the longest step
STRAIGHT = 0.97  # least cosine between the tangents at two points
EASY = 3  # corrections up to which the next step may be longer
UNKNOWN: Any = None  # how many points or curves there will be
MOST_POINTS = 20_000  # of one direction


class Corrected(NamedTuple):
    """What Newton's method reached, in how many corrections (0: it failed), and the Jacobian before the last."""

    x: Floats
    made: int
    jacobian: Floats | None = None


@dataclass(frozen=True)
class System:
    """Equations of a cycle with free parameters; `condition` says which boundary, `where` which flight or impact."""

    model: Model
    cycle: Cycle
    names: tuple[str, ...]
    ranges: tuple[tuple[float, float], ...]
    speed: float
    condition: str = BRANCH
    where: int = 0

    @cached_property
    def oscillator(self) -> ImpactOscillator:
        """The model's own oscillator, which is where the curve begins."""
        return the_oscillator(self.model)

    @cached_property
    def inner(self) -> int:
        """How many of the unknowns are no parameters."""
        return 2 * self.cycle.n_impacts + (self.condition == TOUCH)

    def pack(self, z: Floats, touch: float = math.nan) -> Floats:
        """Return the unknown of a solution z of the model at its own values."""
        p = self.cycle.n_impacts
        free = [
            (value_of(self.model, name) - low) / (high - low)
            for name, (low, high) in zip(self.names, self.ranges, strict=True)
        ]
        return np.concatenate([z[:p], z[p:] / self.speed, [touch] if self.condition == TOUCH else [], free])

    def solution(self, x: Floats) -> Floats:
        """Return turns and velocities."""
        p = self.cycle.n_impacts
        z = x[: 2 * p].copy()
        z[p:] *= self.speed
        return z

    def touch(self, x: Floats) -> float:
        """Return the turns at which the orbit grazes; NaN for other conditions."""
        if self.condition == LAST_IMPACT:
            return float(x[self.where])
        return float(x[self.inner - 1]) if self.condition == TOUCH else math.nan

    def in_order(self, x: Floats) -> bool:
        """Whether the impacts follow one another, and the touch is inside its flight."""
        begin, end = self.cycle.span(x, self.where)
        return self.cycle.in_order(x) and (self.condition != TOUCH or begin < x[self.inner - 1] < end)

    def values(self, x: Floats) -> list[float]:
        """Return the free parameters."""
        return [
            low + float(part) * (high - low) for part, (low, high) in zip(x[self.inner :], self.ranges, strict=True)
        ]

    def _inside(self, values: list[float]) -> list[float]:
        return [min(max(value, low), high) for value, (low, high) in zip(values, self.ranges, strict=True)]

    @cached_property
    def _own(self) -> list[tuple[int, float]] | None:
        """Which of the oscillator's numbers each free parameter is, and times what; None where it is no such number."""
        if not isinstance(self.model, ImpactOscillator):
            return None
        places = {name: (i, 1.0) for i, name in enumerate(self.model.values)}
        places["frequency"] = places["omega"][0], TURN
        return [places[name] for name in self.names] if set(self.names) <= set(places) else None

    def parameters(self, x: Floats) -> list[float]:
        """Return the oscillator's numbers; those of a family go on in a straight line beyond the ranges."""
        values = self.values(x)
        if self._own is not None:
            numbers = parameters_of(self.oscillator)
            for (i, factor), value in zip(self._own, values, strict=True):
                numbers[i] = factor * value
            return numbers
        inside = self._inside(values)
        beyond = np.subtract(values, inside)
        numbers = self._numbers(inside)
        return numbers if not beyond.any() else (np.array(numbers) + beyond @ self._slopes(inside)).tolist()

    def _numbers(self, values: list[float]) -> list[float]:
        return parameters_of(self.model.at(**dict(zip(self.names, values, strict=True))))

    def _slopes(self, values: list[float]) -> Floats:
        """Return the derivatives of the oscillator's numbers by the free parameters, a row for each of these."""
        if self._own is not None:
            return np.array([factor * np.eye(len(self.model.values))[i] for i, factor in self._own])
        rows = []
        for j, (low, high) in enumerate(self.ranges):
            below, above = (max(low, values[j] - NUDGE * (high - low)), min(high, values[j] + NUDGE * (high - low)))
            moved = [np.array(self._numbers([*values[:j], value, *values[j + 1 :]])) for value in (below, above)]
            rows.append((moved[1] - moved[0]) / (above - below))
        return np.array(rows)

    def possible(self, x: Floats) -> bool:
        """Whether the flights have a meaning: there is a mass, a spring and a driving frequency."""
        try:
            m, _, k, _, w, _, _ = self.parameters(x)
        except ValueError:  # a family makes no oscillator of these values
            return False
        return m > 0.0 and k > 0.0 and w > 0.0

    def model_at(self, x: Floats) -> Model:
        """Return the model, its free parameters inside their ranges."""
        return self.model.replace(**dict(zip(self.names, self._inside(self.values(x)), strict=True)))

    def misses(self, x: Floats) -> Floats:
        """Return what must vanish, in parts of the speed and of the length that goes with it."""
        parameters, z = self.parameters(x), self.solution(x)
        misses = self.cycle.misses(parameters, z) / self.scales[0]
        return misses if self.condition == BRANCH else np.append(misses, self._conditions(x, parameters, z))

    @cached_property
    def scales(self) -> tuple[Floats, Floats]:
        """The sizes of the misses and of turns and velocities."""
        return self.cycle.scales(self.oscillator, self.speed)

    def _conditions(self, x: Floats, parameters: list[float], z: Floats) -> list[float]:
        ahead = (self.touch(x) - self.cycle.span(z, self.where)[0]) * TURN / parameters[4]
        return self.condition_misses(parameters, z, ahead, self.scales[0][0], self.speed)

    def condition_misses(
        self, parameters: list[float], z: Floats, ahead: float, length: float, speed: float
    ) -> list[float]:
        """Return what vanishes on the boundary alone, in parts of a length and a speed; a touch is `ahead` s away."""
        cycle = self.cycle
        if self.condition in (FOLD, DOUBLING):
            trace = cycle.trace(parameters, z)
            return [(1.0 - trace if self.condition == FOLD else 1.0 + trace) + cycle.determinant(parameters)]
        if self.condition == LAST_IMPACT:
            return [float(z[cycle.n_impacts + self.where]) / speed]
        if self.condition == TOUCH:
            angle, rate, _ = cycle.takeoff(parameters, z, self.where)
            gap, slope = flight_of(parameters).after(angle, rate, ahead)
            return [gap / length, slope / speed]
        return []

    def jacobian(self, x: Floats) -> Floats:
        """Return the derivative of the misses: of the flights by turns and velocities in closed form, the rest not."""
        p, inner = self.cycle.n_impacts, self.inner
        parameters, z = self.parameters(x), self.solution(x)
        sizes = self._sizes(x, parameters)
        matrix = np.zeros((2 * p + len(self._conditions(x, parameters, z)), len(x)))
        matrix[: 2 * p, : 2 * p] = self.flights_jacobian(parameters, z)
        for j in range(len(x)):
            first = 0 if j >= inner else 2 * p
            if first < len(matrix):
                matrix[first:, j] = self._difference(x, j, sizes[j], first)
        return matrix

    def flights_jacobian(self, parameters: list[float], z: Floats) -> Floats:
        """Return the scaled derivative of the flights' misses by turns and velocities."""
        rows, columns = self.scales
        return self.cycle.jacobian(parameters, z) * columns / rows[:, None]

    def _difference(self, x: Floats, j: int, size: float, first: int) -> Floats:
        """Return the derivative of the misses, those of the flights only if `first` is 0, by one unknown."""

        def misses(value: float) -> Floats:
            moved = x.copy()
            moved[j] = value
            if first == 0:
                return self.misses(moved)
            return np.array(self._conditions(moved, self.parameters(moved), self.solution(moved)))

        step = STEP * size
        return (misses(x[j] + step) - misses(x[j] - step)) / (2.0 * step)

    def _sizes(self, x: Floats, parameters: list[float]) -> Floats:
        """Return by how much each unknown must change to change the flights by something of order one."""
        m, _, k, f, w, _, g = parameters
        p, natural = self.cycle.n_impacts, math.sqrt(k / m)
        slow = min(1.0, w / (self.cycle.n_periods * natural))  # free turns in a cycle multiply a change of pace
        force = max(abs(f), k * abs(g), 1e-3 * self.speed * math.sqrt(k * m))
        damping = min(math.sqrt(k * m), m * w / self.cycle.n_periods)
        numbers = [m * slow, damping, k * slow, force, w * slow, 1.0, force / k]
        free = [
            (size if math.isfinite(size) else high - low) / (high - low)
            for size, (low, high) in zip(self._steps(x, numbers), self.ranges, strict=True)
        ]
        turns = np.full(self.inner - p, min(1.0, w / natural))
        speeds = np.maximum(np.abs(x[p : 2 * p]), 1e-3)
        return np.concatenate([turns[:p], speeds, turns[p:], free])

    def _steps(self, x: Floats, numbers: list[float]) -> list[float]:
        """Return by how much each free parameter must change to change one of the oscillator's numbers by as much."""
        if self._own is not None:
            return [numbers[i] / factor for i, factor in self._own]
        slopes = np.abs(self._slopes(self._inside(self.values(x))))
        with np.errstate(divide="ignore", invalid="ignore"):
            steps: list[float] = np.where(slopes > 0.0, np.array(numbers) / slopes, math.inf).min(axis=1).tolist()
        return steps

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

    def weights(self, x: Floats) -> Floats:
        """Return the weight of each unknown in the length of a step; velocities are relative to the largest above 1."""
        p, counts = self.cycle.n_impacts, np.ones(len(x))
        counts[p : 2 * p] /= max(1.0, float(np.abs(x[p : 2 * p]).max()))
        return counts

    def tangent(self, x: Floats, along: Floats, jacobian: Floats | None = None) -> Floats:
        """Return the tangent of the curve at x, in the direction of `along`, of weighted length 1."""
        counts = self.weights(x)
        direction = np.linalg.svd((self.jacobian(x) if jacobian is None else jacobian) / counts)[2][-1]
        return np.asarray(direction / counts * (1.0 if direction @ (along * counts) >= 0.0 else -1.0))


def system_of(orbit: Orbit, names: tuple[str, ...], ranges: tuple[tuple[float, float], ...]) -> tuple[System, Floats]:
    """Return the equations of an orbit with free parameters, and its turns and velocities."""
    cycle, z = solution_of(orbit)
    speed = fastest_of(orbit.oscillator, z[cycle.n_impacts :])
    return System(orbit.model, cycle, names, ranges, speed), z


@dataclass(frozen=True)
class Step:
    """A point of a curve and its tangent; `end` is why no point follows, "range", "closed" or "lost", else empty."""

    x: Floats
    tangent: Floats
    end: str = ""


def follow(system: System, x: Floats, way: Floats, longest: float) -> Iterator[Step]:
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
        distance = _distance(system, start, x)
        away = away or distance > 3.0 * longest
        closed = away and distance < longest and way @ first > 0.0
        yield Step(x, way, "closed" if closed else "")
        if closed:
            return
        step = min(longest, step * (1.5 if made <= EASY else 1.0))


def _to_edge(system: System, inside: Floats, beyond: Floats, outside: list[int], way: Floats) -> Step:
    """Return the point at which the curve first leaves the ranges, between a point inside and one beyond."""
    reached = {j: ((0.0 if beyond[j] < 0.0 else 1.0) - inside[j]) / (beyond[j] - inside[j]) for j in outside}
    j = min(reached, key=lambda key: reached[key])
    start = inside + reached[j] * (beyond - inside)
    found, made, jacobian = system.newton(start, np.eye(len(start))[j], 0.0 if beyond[j] < 0.0 else 1.0)
    if not made or np.abs(found - start).max() > np.abs(beyond - inside).max() + 1e-12:
        return Step(inside, way, "lost")
    return Step(found, system.tangent(found, way, jacobian), "range")


def _distance(system: System, start: Floats, x: Floats) -> float:
    """Return how far a point of the curve is from its first one; whole turns do not count."""
    p, apart = system.cycle.n_impacts, (x - start) * system.weights(start)
    apart[[*range(p), *([2 * p] if system.condition == TOUCH else [])]] -= np.rint(apart[0])
    return float(np.linalg.norm(apart))


@dataclass
class Way:
    """What was met along one direction of a curve: its points, bifurcations on it, and why it ended, also in words."""

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
                way.end = way.why = "stopped"
                break
        done += len(way.points)
        ways.append(way)
    return ways


def check_range(owner: Orbit | Model, name: Any, given: Any) -> tuple[float, float]:
    """Return the ends of a range of a parameter of a model, or of an orbit's model, whose value it must then hold."""
    low, high = check_pair(owner.model if isinstance(owner, Orbit) else owner, name, "range", given)
    if not low < high:
        raise invalid("range", (low, high), "a lower number before a higher one")
    if isinstance(owner, Orbit) and not low <= owner.value(name) <= high:
        raise invalid("range", (low, high), f"one that holds the orbit's {name}, {owner.value(name):.12g}", "widen it")
    return low, high


def check_share(name: str, share: Any) -> float:
    """Return a length that is a share of the ranges, of a driving period and of the orbit's speed."""
    allowed = "a number from 1e-6 to 0.5"
    value = real_number(name, share, allowed)
    if not 1e-6 <= value <= 0.5:
        raise invalid(name, share, allowed, "0.01 is usual")
    return value
