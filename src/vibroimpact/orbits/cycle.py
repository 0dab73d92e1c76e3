r"""The equations of an orbit with given events, for Newton's method, and its stability.

The unknowns are the driving angles theta_1 ... theta_p of the events of one cycle, on given stops, and the state x_1
just before the first event, an impact. From it, flights, contacts and impacts give the states x_i before the other
events and x_{p+1} after a cycle of length Theta, at theta_1 + Theta. An orbit satisfies

    x_{p+1} = s x_1,    level of the event = 0 at theta_1 ... theta_p,

with Theta = 2 pi n and s = 1. The level is the clearance where contact begins, and the force over the stiffness where
the force of a compliant stop ends or begins again. In a symmetric system, -q(t + T/2) is a motion whenever q(t) is one.
Some orbits are then their own mirror image half a cycle later: Theta = pi n, n odd, and s = -1, with the events of half
a cycle.

An event is made in the state nearest to x_i in which its level is 0. Solutions are the same, but while levels are not 0
to rounding, a displacement does not become a speed that a stiff contact makes larger by the ratio of the rates, and the
next one again, until rounding decides where the cycle ends.

The derivatives are exact: with x' just before (-) and after (+) an event, P_i and p_i those of the state in which it is
made, and Gamma and k those of the state after it by the state before it and by time (1 and 0 but for impacts on rigid
stops),

    dx_{i+1} = Phi_i (Gamma_i (P_i dx_i + p_i dtheta_i) + (k_i - x'_i+) dtheta_i) + x'_{i+1}- dtheta_{i+1}.

The multipliers are the eigenvalues of the product of flows and saltation matrices, times s for a mirrored half cycle.

Nothing depends on the position of a free centre of mass, and mostly not on its drift; their multipliers (1 without
drag) are left out. Its closure equations are kept as far as they can be solved, which excludes an undriven drift, and
an undetermined position is set to zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.matrices import ROUNDING
from vibroimpact.orbits import newton
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import GRAZE, IMPACT, Event, Pushing
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.newton import Solved

TIED = 1e-9  # radians of the fastest rate: events of different stops that are this close happen at the same time


class Leg(NamedTuple):
    """The motion between two events: state and drive just after the first, and the stops that push.

    `age` is the angle since an event, if the leg begins later.
    """

    flow: Flow
    start: Floats
    duration: float
    pushing: Pushing = ()
    age: float = 0.0


@dataclass(frozen=True, eq=False)
class Cycle:
    """The events of one cycle, or of half of one that is mirrored, and its equations.

    `events` are in the order of time, and the stops `pushing` push just before the first. If `images` holds the mirror
    images of all stops, it is half of a cycle of `n_periods`. The unknown is an array of p angles and the 2n numbers of
    the state before the first event.
    """

    flow: Flow
    n_periods: int
    events: tuple[Event, ...]
    images: tuple[int, ...] = ()
    pushing: Pushing = ()

    @property
    def sign(self) -> float:
        """Factor of the state over the cycle: 1, or -1 for a mirrored half cycle."""
        return -1.0 if self.images else 1.0

    @property
    def length(self) -> float:
        """Driving angle of the cycle, or of half of it."""
        return TURN * self.n_periods * (0.5 if self.images else 1.0)

    @property
    def impacts(self) -> list[int]:
        """The indices of the events that are impacts."""
        return [at for at, event in enumerate(self.events) if event.kind in (IMPACT, GRAZE)]

    @property
    def stops(self) -> tuple[int, ...]:
        """The stops struck or touched, one after the other."""
        return tuple(self.events[at].stop for at in self.impacts)

    @cached_property
    def phases(self) -> list[Pushing]:
        """The stops that push before each event, and after the last."""
        pushing = [self.pushing]
        for event in self.events:
            pushing.append(self.flow.after(event, pushing[-1]))
        return pushing

    @property
    def fastest(self) -> float:
        """The fastest rate in the cycle, per unit of the driving angle."""
        return max(self.flow.phase(pushing).fastest for pushing in self.phases)

    @cached_property
    def next_events(self) -> tuple[Event, ...]:
        """The events of the next cycle, or of the other half of this one."""
        return tuple(event.in_mirror(self.images) for event in self.events) if self.images else self.events

    def event_after(self, i: int) -> Event:
        """Return the event that leg i ends with."""
        return (*self.events, self.next_events[0])[i + 1]

    def angles(self, unknown: Floats) -> Floats:
        """Return the driving angles of the events, and of the first one of the next cycle."""
        p = len(self.events)
        return np.append(unknown[:p], unknown[0] + self.length)

    def whole(self, unknown: Floats) -> tuple[Cycle, Floats]:
        """Return the whole cycle of a half cycle, and its unknown."""
        p = len(self.events)
        cycle = replace(self, events=self.events + self.next_events, images=())
        return cycle, np.concatenate([unknown[:p], unknown[:p] + self.length, unknown[p:]])

    def rotated(self, unknown: Floats, first: int) -> tuple[Self, Floats]:
        """Return the same cycle from another event on, and its unknown."""
        p = len(self.events)
        cycle = replace(self, events=self.events[first:] + self.next_events[:first], pushing=self.phases[first])
        angles = np.append(unknown[first:p], unknown[:first] + self.length)
        return cycle, np.append(angles, self.states(unknown)[first])

    @cached_property
    def _latest(self) -> dict[Any, Any]:
        return {}

    def latest(self, unknown: Floats) -> dict[Any, Any]:
        """Return the cache of results for an unknown; only the latest unknown is cached."""
        content = unknown.tobytes()
        if self._latest.get("unknown") != content:
            self._latest.clear()
            self._latest["unknown"] = content
        return self._latest

    def states(self, unknown: Floats) -> list[Floats]:
        """Return the states just before the events, and before the first one of the next cycle."""
        return self._flown(unknown)[0]

    def _flown(self, unknown: Floats) -> tuple[list[Floats], list[Floats]]:
        """Return these states, and those in which the events are made."""
        latest = self.latest(unknown)
        if "states" not in latest:
            states, places, angles = [unknown[len(self.events) :].copy()], [], self.angles(unknown)
            drives = self.flow.drive(angles)
            for i, event in enumerate(self.events):
                places.append(self.flow.placed(event, states[-1], drives[i]))
                after = self.flow.struck(event.stop, places[-1], drives[i])
                grown, driven = self.flow.over(angles[i + 1] - angles[i], self.phases[i + 1])
                states.append(after + grown @ after + driven @ drives[i])
            latest["states"] = states, places
        flown: tuple[list[Floats], list[Floats]] = latest["states"]
        return flown

    def leg(self, unknown: Floats, i: int) -> Leg:
        """Return the leg from event i on."""
        angles, drive = self.angles(unknown), self.flow.drive(unknown[i])
        after = self.flow.struck(self.events[i].stop, self._flown(unknown)[1][i], drive)
        return Leg(self.flow, np.append(after, drive), float(angles[i + 1] - angles[i]), self.phases[i + 1])

    def state_at(self, unknown: Floats, i: int, angle: float) -> tuple[Floats, Floats]:
        """Return state and drive at an angle in leg i."""
        leg = self.leg(unknown, i)
        return self.flow.fly(leg.start[: 2 * self.flow.n], unknown[i], angle, leg.pushing), self.flow.drive(angle)

    def repeats(self, unknown: Floats, near: float) -> bool:
        """Whether the motion repeats within the whole cycle, with states that differ by at most `near`."""
        cycle, unknown = self.whole(unknown) if self.images else (self, unknown)
        angles = cycle.angles(unknown)
        leg = int(np.argmax(np.diff(angles)))
        middle = 0.5 * float(angles[leg] + angles[leg + 1])
        state, _ = cycle.state_at(unknown, leg, middle)
        for times in (times for times in range(2, cycle.n_periods + 1) if cycle.n_periods % times == 0):
            angle = angles[0] + (middle - angles[0] + cycle.length / times) % cycle.length
            later, _ = cycle.state_at(unknown, int(np.searchsorted(angles, angle)) - 1, angle)
            if np.abs(later - state).max() <= near:
                return True
        return False

    def speeds(self, unknown: Floats) -> Floats:
        """Return the rates at the events per unit of driving angle, divided by the lengths of their stops' directions.

        They are infinite at events that are no impacts.
        """
        flow, states = self.flow, self.states(unknown)
        speeds = np.full(len(self.events), math.inf)
        for at in self.impacts:
            speeds[at] = -flow.closing(self.events[at].stop, states[at], flow.drive(unknown[at]))
        return speeds

    def velocities(self, unknown: Floats) -> Floats:
        """Return the velocities of the impacts in m/s."""
        velocities: Floats = self.speeds(unknown)[self.impacts] * self.flow.lengths[list(self.stops)] * self.flow.omega
        return velocities

    def solve(self, start: Floats) -> Solved:
        """Return the solution that Newton's method reaches."""
        unknown, p = np.array(start, dtype=float), len(self.events)
        unknown[p:][self.flow.neutral] = 0.0  # the position of a free centre must not set the scale
        size = float(np.abs(unknown[p:]).max()) or 1.0
        rates = [self.flow.phase(pushing).fastest for pushing in self.phases]
        angles = [self.flow.phase().fastest / max(pair) for pair in pairwise(rates)]  # 1 where no stop is compliant
        misses = np.full(len(unknown), size)
        close = max(newton.CLOSE, ROUNDING * self.length * max(rates))  # flights are rounded per radian
        return newton.solve(self.linearised, unknown, (misses, np.append(angles, misses[p:])), self.in_order, close)

    def in_order(self, unknown: Floats) -> bool:
        """Whether the events follow one another, the first of the next cycle included, or happen at the same time."""
        later = np.diff(self.angles(unknown)) > 0.0
        return bool(later.all() or (later | self.tied(unknown)).all())

    def tied(self, unknown: Floats) -> NDArray[np.bool_]:
        """Return whether each event happens at the same time as the next, on another stop, in whichever order."""
        latest = self.latest(unknown)
        if "tied" not in latest:
            close = np.abs(np.diff(self.angles(unknown))) <= TIED / self.fastest
            for at in np.flatnonzero(close):
                close[at] = self.flow.commute(self.events[at].stop, self.event_after(int(at)).stop)
            latest["tied"] = close
        tied: NDArray[np.bool_] = latest["tied"]
        return tied

    def together(self, unknown: Floats, i: int) -> set[int]:
        """Return the stops that have an event at the time of event i; event p is the first of the next cycle."""
        events, tied = self.next_events + self.events + self.next_events, np.tile(self.tied(unknown), 3)
        first = last = len(self.events) + i
        while tied[first - 1]:
            first -= 1
        while tied[last]:
            last += 1
        return {event.stop for event in events[first : last + 1]}

    def misses(self, unknown: Floats) -> Floats:
        """Return the residuals: the levels at the events, then the closure error of the cycle."""
        p, states, drives = len(self.events), self.states(unknown), self.flow.drive(self.angles(unknown))
        levels = [self.flow.level(*at)[0] for at in zip(self.events, states, drives, strict=False)]
        closure = states[-1] - self.sign * unknown[p:]
        if len(self.flow.centre):
            closure = self.pinned(closure[:, None], unknown[p:, None])[:, 0]
        return np.concatenate([levels, closure])

    def linearised(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Return the residuals and their derivative."""
        return self.misses(unknown), self.derivative(unknown)

    def derivative(self, unknown: Floats) -> Floats:
        """Return the derivative of the residuals."""
        flow, p, n = self.flow, len(self.events), self.flow.n
        angles, (states, places) = self.angles(unknown), self._flown(unknown)
        drives = flow.drive(angles)
        slope = np.hstack([np.zeros((2 * n, p)), np.eye(2 * n)])
        matrix = np.zeros((p + 2 * n, p + 2 * n))
        for i, event in enumerate(self.events):
            x, z, pushing = states[i], drives[i], self.phases[i + 1]
            _, row, rise = flow.level(event, x, z)
            matrix[i] = row @ slope
            matrix[i, i] += rise
            slope = slope - np.outer(row / (row @ row), matrix[i])
            after = flow.struck(event.stop, places[i], z)
            by_state, by_angle = flow.impact_slopes(event.stop, places[i], z)
            slope = by_state @ slope
            slope[:, i] += by_angle
            slope[:, i] -= flow.rate(after, z, pushing)
            grown, _ = flow.over(angles[i + 1] - angles[i], pushing)
            slope = slope + grown @ slope
            slope[:, (i + 1) % p] += flow.rate(states[i + 1], drives[i + 1], pushing)
        matrix[p:] = slope
        matrix[p:, p:] -= self.sign * np.eye(2 * n)
        if len(flow.centre):
            matrix[p:] = self.pinned(matrix[p:], np.eye(2 * n, p + 2 * n, p))
        return matrix

    @cached_property
    def _pin(self) -> tuple[Floats, Floats]:
        """Solvable combinations of a free centre's closure equations, and the combinations of its state set to 0."""
        drift = self.flow.drift(self.length)
        left, sizes, right = np.linalg.svd(drift - self.sign * np.eye(len(drift)))
        closes = (sizes > len(drift) * ROUNDING * sizes.max(initial=0.0))[:, None]
        return np.where(closes, left.T, 0.0), np.where(closes, 0.0, right)

    def pinned(self, closures: Floats, states: Floats) -> Floats:
        """Return the closure equations of the cycle, one per row, with those of a free centre made solvable.

        `states` holds the same columns of the equations that set the state to zero.
        """
        centre = self.flow.centre
        if len(centre):
            closes, stays = self._pin
            closures = closures.copy()
            closures[..., centre, :] = closes @ closures[..., centre, :] + stays @ states[..., centre, :]
        return closures

    def monodromy(self, unknown: Floats) -> Floats:
        """Return the Jacobian of the cycle from just before its first event, in scaled modes, without a free centre."""
        flow, angles = self.flow, self.angles(unknown)
        jacobian: Floats = self.sign * np.eye(2 * flow.n)
        for i, (event, x) in enumerate(zip(self.events, self.states(unknown), strict=False)):
            jacobian = flow.saltation(event, x, flow.drive(angles[i]), self.phases[i]) @ jacobian
            jacobian = jacobian + flow.over(angles[i + 1] - angles[i], self.phases[i + 1])[0] @ jacobian
        return jacobian[np.ix_(~flow.neutral, ~flow.neutral)]

    def multipliers(self, unknown: Floats) -> tuple[complex, ...]:
        """Return the Floquet multipliers of the cycle, or of half of it, the largest first."""
        return multipliers_of(self.monodromy(unknown))

    def neutral(self) -> tuple[complex, ...]:
        """Return the multipliers of a free centre, which `multipliers` leaves out."""
        return multipliers_of(self.sign * self.flow.drift(self.length))


def multipliers_of(jacobian: Floats) -> tuple[complex, ...]:
    """Return the eigenvalues of a cycle's Jacobian, the largest first."""
    if not np.isfinite(jacobian).all():  # at a graze
        return (complex(math.inf), *(0j for _ in jacobian[1:]))
    eigenvalues: NDArray[np.complex128] = np.linalg.eigvals(jacobian).astype(complex)
    return tuple(complex(value) for value in sorted(eigenvalues, key=lambda value: (-abs(value), -value.imag)))


def cycle_of(orbit: Any) -> tuple[Cycle, Floats]:
    """Return the whole cycle of an orbit, and its unknown.

    Raises
    ------
    ValueError
        The orbit rests at a stop.
    """
    orbit.check_flies()
    flow, names = Flow(orbit.system), orbit.system.stop_names
    events = tuple(Event(names.index(stop), kind) for _, kind, stop in orbit.events)
    pushing = tuple(sorted(names.index(stop) for stop in orbit.pushing))
    state = np.append(orbit.start.displacement, orbit.start.velocity)
    angles = TURN * np.array([turn for turn, _, _ in orbit.events])
    unknown = np.append(angles, np.linalg.solve(flow.physical, state))
    return Cycle(flow, orbit.n_periods, events, (), pushing), unknown
