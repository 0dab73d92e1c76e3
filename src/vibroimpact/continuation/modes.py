r"""The equations of a branch or a boundary for systems of several coordinates and stops, in scaled unknowns.

The unknown x holds the turns of the impacts, the state just before the first impact, in the scaled modes of the system
at the beginning of the curve, for a graze in mid-flight the turns of the touch, and the free parameters relative to
their ranges. The modes change with the parameters; since the state refers to one fixed basis, it depends on the
parameters smoothly even where modes change their order. The conditions in addition to the residuals of the cycle are,
with the multipliers mu,

    fold: 1 - mu,   period doubling: (1 + mu) v,   Neimark-Sacker: 1 - mu_i mu_j of a complex pair,
    grazing: the velocity of one impact, or clearance and rate at the touch.

The first three are evaluated for the multipliers that come closest to satisfying them, with the sign of the product
over all. Where v, the lowest velocity of the impacts on rigid stops, passes 0, one multiplier passes through infinity.

An orbit that is its own mirror image half a cycle later has a half map, the flow of half a cycle and then the mirror.
Its multipliers h make those of the cycle, mu = h^2: at h = 1 symmetric orbits fold. At h = -1 the half map doubles its
period: this is a pitchfork of the cycle, at which two asymmetric orbits are born that are mirror images of each other
(J. W. Swift and K. Wiesenfeld, Phys. Rev. Lett. 52 (1984) 705-708).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.continuation.equations import (
    BRANCH,
    DOUBLING,
    FOLD,
    GRAZING,
    LAST_IMPACT,
    LEAST,
    NUDGE,
    TORUS,
    TOUCH,
    Equations,
    Range,
)
from vibroimpact.continuation.grazes import gaining, losing
from vibroimpact.orbits.cycle import Cycle, cycle_of
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import GRAZE, LET_GO, Event, Nearest
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.symmetry import mirror
from vibroimpact.orbits.systems.admissibility import nearest_of
from vibroimpact.orbits.systems.orbit import make_orbit

NOISE = 1e-12  # a test closer to zero than this is rounding, for example that of an undamped mode
KEPT = 16  # designs whose flights are cached


@dataclass(frozen=True, kw_only=True)
class Modes(Equations):
    """Equations of a cycle of a system; states are `basis` @ (state in the unknown); `scale` is that of the modes.

    A change of the free parameters by `reach`, relative to their ranges, changes the flights by order one.
    """

    cycle: Cycle
    basis: Floats
    scale: float
    reach: tuple[float, ...] = ()

    @property
    def size(self) -> int:
        """Number of turns of the events and components of the state before the first."""
        return len(self.cycle.events) + len(self.basis)

    @property
    def impacts(self) -> int:
        """Number of events of the cycle, or of half of a mirrored cycle, including the ends of compliant contacts."""
        return len(self.cycle.events)

    @property
    def length(self) -> float:
        """Driving periods of the cycle, or of the half of a mirrored cycle."""
        return self.cycle.length / TURN

    @property
    def kind(self) -> str:
        """The kind of bifurcation of the condition."""
        return "pitchfork" if self.condition == DOUBLING and self.cycle.images else super().kind

    def scaled(self, z: Floats) -> Floats:
        """Return turns and scaled state from driving angles and a state in the coordinates."""
        p = self.impacts
        return np.concatenate([z[:p] / TURN, np.linalg.solve(self.basis, z[p:])])

    def scaled_at(self, unknown: Floats, values: list[float]) -> Floats:
        """Return turns and scaled state from a cycle's unknown at given values of the parameters."""
        p, transform = self.impacts, self._at(values)[1]
        return np.concatenate([unknown[:p] / TURN, np.linalg.solve(transform, unknown[p:])])

    @cached_property
    def _designs(self) -> Callable[[tuple[float, ...]], tuple[Cycle, Floats]]:
        return lru_cache(KEPT)(self._design)

    def _design(self, values: tuple[float, ...]) -> tuple[Cycle, Floats]:
        flow = Flow(self.model.at(**dict(zip(self.names, values, strict=True))))
        transform: Any = np.linalg.solve(flow.physical, self.basis)
        return replace(self.cycle, flow=flow), transform

    def _at(self, values: list[float]) -> tuple[Cycle, Floats]:
        """Return the cycle at the nearest values inside the ranges, and the transformation of its modes."""
        return self._designs(tuple(self.inside(values)))

    def solved(self, x: Floats) -> tuple[Cycle, Floats]:
        """Return the cycle at x, and its own unknown."""
        return self._transformed(x)[:2]

    def _transformed(self, x: Floats) -> tuple[Cycle, Floats, Floats]:
        """Return the cycle at x, its own unknown, and the transformation of its modes."""
        p, (cycle, transform) = self.impacts, self._at(self.values(x))
        return cycle, np.concatenate([TURN * x[:p], transform @ x[p : self.size]]), transform

    def possible(self, x: Floats) -> bool:
        """Whether the system exists with the same number of coordinates."""
        try:
            _, transform = self._at(self.values(x))
        except (ValueError, np.linalg.LinAlgError):
            return False
        return transform.shape == self.basis.shape

    def flights(self, x: Floats) -> Floats:
        """Return clearances at the impacts and the closure error, extrapolated linearly beyond the ranges."""
        return self._extended(x, self._misses)

    def conditions(self, x: Floats) -> list[float]:
        """Return the conditions of the boundary, which vanish on it."""
        return [] if self.condition == BRANCH else self._extended(x, self._conditions).tolist()

    def _extended(self, x: Floats, function: Callable[[Floats], Floats]) -> Floats:
        """Return the value at the nearest place in the ranges, extrapolated along its derivative."""
        base = function(x)
        extended, values = base, self.values(x)
        for j, (value, edge, (low, high)) in enumerate(zip(values, self.inside(values), self.ranges, strict=True)):
            if value != edge:
                moved = x.copy()
                moved[self.inner + j] = 1.0 - NUDGE if value > edge else NUDGE
                extended = extended + abs(value - edge) / (high - low) * (base - function(moved)) / NUDGE
        return extended

    def _misses(self, x: Floats) -> Floats:
        """Return the scaled residuals at the nearest values in the ranges."""
        p, (cycle, unknown, transform) = self.impacts, self._transformed(x)
        misses = cycle.misses(unknown)
        return np.concatenate([misses[:p] / self.scale, np.linalg.solve(transform, misses[p:])])

    def flights_jacobian(self, x: Floats) -> Floats:
        """Return the derivative of the residuals with respect to turns and state."""
        p, (cycle, unknown, transform) = self.impacts, self._transformed(x)
        matrix = cycle.derivative(unknown)
        matrix = np.hstack([TURN * matrix[:, :p], matrix[:, p:] @ transform])
        matrix[:p] /= self.scale
        matrix[p:] = np.linalg.solve(transform, matrix[p:])
        return matrix

    def _conditions(self, x: Floats) -> Floats:
        cycle, unknown = self.solved(x)
        if self.condition == LAST_IMPACT:
            return cycle.speeds(unknown)[[self.impact]] / self.scale
        if self.condition == TOUCH:
            flow, begin, at = cycle.flow, unknown[self.impact], TURN * x[self.inner - 1]
            event, pushing = cycle.events[self.impact], cycle.phases[self.impact + 1]
            after = flow.struck(event.stop, cycle.states(unknown)[self.impact], flow.drive(begin))
            touching = flow.fly(after, begin, at, pushing)
            return np.array(flow.touching(self.stop, touching, flow.drive(at), pushing)) / self.scale
        value = _TESTS[self.condition](cycle.multipliers(unknown))
        return np.array([value * self._slowest(cycle, unknown) if self.condition == DOUBLING else value])

    def _slowest(self, cycle: Cycle, unknown: Floats) -> float:
        """Return the lowest speed at rigid stops, or 1: where it passes 0, a multiplier passes through infinity."""
        rigid = ~cycle.flow.compliant[[event.stop for event in cycle.events]]
        return float(cycle.speeds(unknown)[rigid].min() / self.scale) if rigid.any() else 1.0

    def fits(self, x: Floats) -> bool:
        """Whether a touch is inside its flight, and two multipliers whose product is 1 are a complex pair."""
        if self.condition != TORUS:
            return super().fits(x)
        cycle, unknown = self.solved(x)
        nearest = min(combinations(cycle.multipliers(unknown), 2), key=lambda pair: abs(1.0 - pair[0] * pair[1]))
        return nearest[0].imag != 0.0

    def bounded(
        self, condition: str, x: Floats, impact: int = 0, touch: float = 0.0, stop: int = 0
    ) -> tuple[Equations, Floats]:
        """Return these equations with one more condition; a lost contact with a compliant stop becomes a graze."""
        event = self.cycle.events[impact]
        if condition != LAST_IMPACT or not self.compliant_at(impact) or self._closes(x, impact):
            return super().bounded(condition, x, impact, touch, stop)
        events = (*self.cycle.events[:impact], Event(event.stop, GRAZE), *self.cycle.events[impact + 2 :])
        x = np.concatenate([x[:impact], [0.5 * (x[impact] + x[impact + 1])], x[impact + 2 :]])
        return replace(self, cycle=replace(self.cycle, events=events), condition=condition, impact=impact), x

    def on_branch(self, x: Floats) -> Floats:
        """Return the unknown of the branch on which a bifurcation lies: a graze is a contact of zero duration there."""
        x, at = super().on_branch(x), self.impact
        vanishes = self.condition == LAST_IMPACT and self.cycle.events[at].kind == GRAZE
        return np.insert(x, at + 1, x[at]) if vanishes else x

    def _closes(self, x: Floats, impact: int) -> bool:
        """Whether no gap is left before an impact on a damped stop, which lets go while it is still pressed in."""
        (cycle, unknown), stop = self.solved(x), self.cycle.events[impact].stop
        state, drive = cycle.states(unknown)[impact], cycle.flow.drive(unknown[impact])
        return bool(cycle.flow.lag(stop) and cycle.flow.clearance(stop, state, drive, cycle.phases[impact])[2] < 0.0)

    def compliant_at(self, impact: int) -> bool:
        """Whether an impact is a contact with a compliant stop that ends before any other event."""
        return self.cycle.events[impact + 1 : impact + 2] == (Event(self.cycle.events[impact].stop, LET_GO),)

    @property
    def soft(self) -> bool:
        """Whether the condition is a graze of a compliant stop, beyond which the branch continues."""
        compliant = self.cycle.flow.compliant
        if self.condition == TOUCH:
            return bool(compliant[self.stop])
        return self.condition == LAST_IMPACT and bool(compliant[self.cycle.events[self.impact].stop])

    @property
    def touched(self) -> str:
        """Name of the stop that a graze touches; empty for other conditions."""
        if self.condition not in GRAZING:
            return ""
        stop = self.stop if self.condition == TOUCH else self.cycle.events[self.impact].stop
        return str(self.model.at().stops[stop].name)

    def beyond(self, x: Floats, sign: float) -> tuple[Equations, Floats, Floats] | None:
        """Return the equations beyond a graze of a compliant stop, a solution and its tangent; None if the branch ends.

        A contact, or the gap in one, appears or disappears there. `sign` is the direction in which the parameter
        continues.
        """
        if not self.soft:
            return None
        equations = replace(self, condition=BRANCH, impact=0, stop=0)
        cycle, unknown = self.solved(x)
        if self.condition == TOUCH:
            return gaining(equations, cycle, self.impact, self.stop, x, sign)
        further = losing(cycle, unknown, self.impact)
        if further is None:
            return None
        equations = replace(equations, cycle=further[0])
        solution = np.concatenate([equations.scaled_at(further[1], self.values(x)), x[self.inner :]])
        return equations, solution, equations.tangent(solution, sign * np.eye(len(solution))[-1])

    def sizes(self, x: Floats) -> Floats:
        """Return the change of each unknown that changes the flights by order one."""
        p, cycle = self.impacts, self.solved(x)[0]
        slowest = float(np.abs(self.speeds(x)).min())
        turns, states = 1.0 / cycle.fastest, np.full(len(self.basis), min(1.0, max(slowest, LEAST)))
        return np.concatenate([np.full(p, turns), states, np.full(self.inner - self.size, turns), self.reach])

    def reaching(self, x: Floats) -> Modes:
        """Return these equations with the `reach` of their parameters at x."""
        base, reach = self._misses(x), []
        for j in range(self.size, len(x)):
            moved = x.copy()
            moved[j] += NUDGE if x[j] < 0.5 else -NUDGE
            change = float(np.abs(self._misses(moved) - base).max()) / NUDGE
            reach.append(min(max(1.0 / change, 1e-3), 1.0) if change > 0.0 else 1.0)
        return replace(self, reach=tuple(reach))

    def orbit(self, x: Floats) -> Orbit:
        """Return the orbit of a solution."""
        return make_orbit(self.model_at(x), *self.solved(x))

    def velocities(self, x: Floats) -> Floats:
        """Return the velocities of the impacts in m/s."""
        cycle, unknown = self.solved(x)
        return cycle.velocities(unknown)

    def speeds(self, x: Floats) -> Floats:
        """Return the relative velocities of the impacts, scaled by the lengths of their stops' directions."""
        cycle, unknown = self.solved(x)
        return cycle.speeds(unknown) / self.scale

    def nearest(self, x: Floats) -> Nearest:
        """Return the closest approach of the system to any stop between impacts."""
        return nearest_of(*self.solved(x))

    def tests(self, x: Floats) -> dict[str, float]:
        """Return the tests of period doublings (or pitchforks) and Neimark-Sacker points."""
        cycle, unknown = self.solved(x)
        multipliers = cycle.multipliers(unknown)
        values = {condition: _TESTS[condition](multipliers) for condition in (DOUBLING, TORUS)}
        values[DOUBLING] *= self._slowest(cycle, unknown)
        return {condition: value if abs(value) > NOISE else NOISE for condition, value in values.items()}

    def halves(self, x: Floats) -> Floats | None:
        """Return the difference between the halves of a cycle, or between the first and the mirrored second half."""
        half = self._half()
        if half is None:
            return None
        (cycle, unknown), p, h = self.solved(x), self.impacts, self.impacts // 2
        state = half.sign * cycle.states(unknown)[h] - unknown[p:]
        return np.append(x[h:p] - x[:h] - half.length / TURN, state / self.scale)

    def _half(self) -> Cycle | None:
        """Return half of the cycle, if the cycle may have been born at a period doubling or a pitchfork."""
        cycle, p = self.cycle, self.impacts
        first, second = cycle.events[: p // 2], cycle.events[p // 2 :]
        if cycle.images or p % 2:
            return None
        if cycle.n_periods % 2 == 0:
            return replace(cycle, n_periods=cycle.n_periods // 2, events=first) if first == second else None
        mirrored = replace(cycle, events=first, images=self._images)
        return mirrored if mirrored.images and second == mirrored.next_events else None

    @cached_property
    def _images(self) -> tuple[int, ...]:
        return images_along(self.model, self.names, self.ranges)

    def half(self, x: Floats) -> tuple[Equations, Floats]:
        """Return the bifurcation at which such halves coincide, and their mean."""
        half, (cycle, unknown), p, h = self._half(), self.solved(x), self.impacts, self.impacts // 2
        assert half is not None
        turns = 0.5 * (x[:h] + x[h:p] - half.length / TURN)
        mean = 0.5 * (unknown[p:] + half.sign * cycle.states(unknown)[h])
        equations = replace(self, cycle=half, condition=DOUBLING)
        scaled = equations.scaled_at(np.append(TURN * turns, mean), self.values(x))
        return equations, np.append(scaled, x[self.size :])

    def twice(self, z: Floats) -> tuple[Equations, Floats]:
        """Return the equations of two rounds, and the orbit traversed twice; two mirrored halves are the cycle."""
        cycle, p = self.cycle, self.impacts
        if cycle.images:
            both = cycle.whole(z)[0]
        else:
            both = replace(cycle, n_periods=2 * cycle.n_periods, events=cycle.events * 2)
        return replace(self, cycle=both), np.concatenate([z[:p], z[:p] + cycle.length, z[p:]])


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


_TESTS: dict[str, Any] = {
    FOLD: lambda multipliers: _nearest_zero([1.0 - value for value in multipliers]),
    DOUBLING: lambda multipliers: _nearest_zero([1.0 + value for value in multipliers]),
    TORUS: lambda multipliers: _nearest_zero(1.0 - _products(multipliers)) if len(multipliers) > 2 else 1.0,
}


def images_along(model: Any, names: Sequence[str], ranges: Sequence[Range]) -> tuple[int, ...]:
    """Return the mirror image of each stop, if no parameter alone breaks a model's symmetry."""
    images = mirror(model.at())[0]
    for name, (low, high) in zip(names, ranges, strict=True):
        for share in (0.0, 0.31, 1.0) if images else ():
            try:
                moved = mirror(model.at(**{name: low + share * (high - low)}))[0]
            except ValueError:  # the model does not exist at this value
                continue
            if moved != images:
                return ()
    return images


def modes_of(orbit: Orbit, names: tuple[str, ...], ranges: tuple[Range, ...]) -> tuple[Modes, Floats]:
    """Return the equations of an orbit with free parameters, and its driving angles and state.

    A symmetric orbit is followed with the equations of half a cycle if the parameters keep the symmetry.
    """
    images = images_along(orbit.model, names, ranges) if orbit.symmetric else ()
    cycle, unknown = cycle_of(orbit)
    flow, p = cycle.flow, len(cycle.events) // (2 if images else 1)
    angles, state = np.split(unknown, [len(cycle.events)])
    scale = float(np.abs(state).max())
    equations = Modes(
        model=orbit.model,
        cycle=replace(cycle, events=cycle.events[:p], images=images),
        names=names,
        ranges=ranges,
        basis=flow.physical * scale,
        scale=scale,
    )
    solution = np.append(angles[:p], flow.physical @ state)
    return equations.reaching(equations.pack(solution)), solution
