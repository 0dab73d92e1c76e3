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

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations
from typing import Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.continuation.equations import (
    BRANCH,
    DOUBLING,
    GRAZING,
    LAST_IMPACT,
    LEAST,
    NUDGE,
    REPEATED,
    TESTS,
    TORUS,
    TOUCH,
    Equations,
    Range,
)
from vibroimpact.continuation.grazes import gaining, losing, meeting
from vibroimpact.orbits.cycle import Cycle, cycle_of
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import GRAZE, LET_GO, PUSH_AGAIN, Event, Nearest
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.symmetry import images_along
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
            return self.speeds(x)[[self.impact]]
        if self.condition == TOUCH:
            touching = cycle.state_at(unknown, self.impact, TURN * self.touch(x))
            return np.array(cycle.flow.touching(self.stop, *touching, cycle.phases[self.impact + 1])[0]) / self.scale
        value = TESTS[self.condition](cycle.multipliers(unknown))
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
        stop = self.cycle.events[impact].stop
        return self.cycle.events[impact : impact + 2] == (Event(stop), Event(stop, LET_GO))

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
        if self.condition == TOUCH:
            return gaining(self, x, sign)
        further = losing(*self.solved(x), self.impact)
        if further is None:
            return None
        equations = replace(self.of_branch, cycle=further[0])
        solution = np.concatenate([equations.scaled_at(further[1], self.values(x)), x[self.inner :]])
        return equations, solution, equations.tangent(solution, sign * np.eye(len(solution))[-1])

    def seen(self, point: Any) -> list[Any]:
        """Return a point of the branch before a graze in the unknown of these equations beyond it, if it has any."""
        places = point.x, point.x + NUDGE * point.tangent
        views = zip(*(self._views(point.equations, x) for x in places), strict=True)
        return [replace(point, equations=self, x=x, tangent=self.tangent(x, ahead - x)) for x, ahead in views]

    def _views(self, other: Modes, x: Floats) -> Iterator[Floats]:
        """Yield an unknown of other equations as one of these, from each event on with which the same events begin."""
        cycle, unknown = other.solved(x)
        for _ in cycle.events * (2 if cycle.images else 1):
            cycle, unknown = cycle.rotated(unknown, 1)
            if cycle.events == self.cycle.events:
                yield np.append(self.scaled_at(unknown, other.values(x)), x[other.inner :])

    def repeats(self, x: Floats) -> bool:
        """Whether the motion of a solution repeats within its cycle."""
        cycle, unknown = self.solved(x)
        return cycle.repeats(unknown, REPEATED * self.scale)

    def past(self, x: Floats) -> tuple[Equations, Floats] | None:
        """Return equations with the events beyond a place where two of these meet, and their unknown; None if it ends.

        If two events of one stop vanish, that is a graze.
        """
        cycle, unknown = self.solved(x)
        further = meeting(cycle, unknown)
        if further is None:
            return None
        equations = replace(self, cycle=further.cycle)
        x = np.append(equations.scaled_at(further.unknown, self.values(x)), x[self.inner :])
        if further.stop is None:
            return equations, x
        return equations.bounded(TOUCH, x, further.leg, further.angle / TURN, further.stop)

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
        """Return the relative velocities of the impacts, scaled by the lengths of their stops' directions.

        For a stop that pushes again, it is the rate at which its clearance rises: an impact is born where that is 0.
        """
        cycle, unknown = self.solved(x)
        states, speeds = cycle.states(unknown), cycle.speeds(unknown)
        for at, (stop, kind) in enumerate(cycle.events):
            if kind == PUSH_AGAIN:
                speeds[at] = cycle.flow.closing(stop, states[at], cycle.flow.drive(unknown[at]))
        return speeds / self.scale

    def nearest(self, x: Floats) -> Nearest:
        """Return the closest approach of the system to any stop between impacts."""
        return nearest_of(*self.solved(x))

    def tests(self, x: Floats) -> dict[str, float]:
        """Return the tests of period doublings (or pitchforks) and Neimark-Sacker points."""
        cycle, unknown = self.solved(x)
        multipliers = cycle.multipliers(unknown)
        values = {condition: TESTS[condition](multipliers) for condition in (DOUBLING, TORUS)}
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
