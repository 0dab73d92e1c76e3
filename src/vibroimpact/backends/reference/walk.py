"""One motion of a system, event by event.

All phases are exact (`phases`). The first event is bracketed on a grid that is fine compared with the fastest rate.
Impacts and closed stops satisfy complementarity, solved by trying every subset (`contacts`). The effects of pushing
compliant stops are integrated (`pushes`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from vibroimpact.backends.reference.contacts import held_closed, impact_law
from vibroimpact.backends.reference.events import Event, Flight, Moment
from vibroimpact.backends.reference.phases import (
    AWAY,
    CLEARANCE,
    DEEP,
    DEPTH,
    FORCE,
    LASTING,
    Equations,
    Phase,
    Watch,
    Which,
)
from vibroimpact.backends.reference.pushes import pushes
from vibroimpact.backends.reference.stops import Floats
from vibroimpact.model.elements import Contact

TOUCH = 1e-13  # relative to a clearance's terms: a smaller clearance is contact
CUT = 1e-10  # of the fastest impact so far: chatter below it is completed
SHORT = 1e-4  # radians of the fastest rate: the second order of a shorter remainder of a chatter is exact to rounding
HOLD = 1e-3  # of the cutoff: a slower impact under a pressing force sticks
EVENTS = 1000  # at one instant, and per requested impact, including those too weak to be recorded


class Walk:
    """A motion as far as it has been computed."""

    def __init__(self, eq: Equations, at: Moment, cut: float | None) -> None:
        self.eq, self.at = eq, at
        self.cut, self.fastest = cut, 0.0
        self.closed: tuple[int, ...] = ()  # stops that stay closed, and those of them that push
        self.held: tuple[int, ...] = ()
        self.pushing: tuple[int, ...] = ()  # those that push; those that let go and are still pressed in
        self.away: tuple[int, ...] = ()
        self.contacts: dict[int, int | None] = {}  # for both, the index of their event if it is recorded
        self.events: list[Event] = []
        self.recorded, self.full = 0, False
        self.flight: Flight | None = None  # the last one, and what stops took from it
        self.pushes: dict[int, Contact] = {}
        self.calm = 0.0  # how long, in s, the present phase has lasted
        self.jumps: list[tuple[Which, Floats]] = []  # stops whose impulses acted in this event, and their 1 + d(r v)/dv
        self.struck = 0.0  # the largest closing speed in this event
        self.late = 0.0  # how much later, in s, the stops close that it closes: the rest of a chatter
        if (at.clearance < -self.touch())[eq.impenetrable].any():
            raise ValueError(f"the state lies beyond a stop: clearances {at.clearance.tolist()}")

    @property
    def turns(self) -> float:
        """Driving periods since time zero."""
        return self.at.periods + self.at.phase

    @property
    def time(self) -> float:
        """Time in s."""
        return float(self.turns * self.eq.period)

    @property
    def in_contact(self) -> bool:
        """Whether a recorded contact is unfinished."""
        return any(index is not None for index in self.contacts.values())

    @property
    def impacts(self) -> list[Event]:
        """The impacts recorded so far."""
        return [event for event in self.events if event.kind == "impact"]

    def touch(self) -> Floats:
        """Return how small clearances are contact."""
        reach = np.abs(self.eq.places).sum(axis=1) + np.abs(self.eq.directions) @ np.abs(self.at.displacement)
        touch: Floats = TOUCH * reach
        return touch

    def vector(self, at: Moment | None = None) -> Floats:
        """Return X, now or of another state."""
        at = self.at if at is None else at
        parts = at.displacement, at.velocity, at.clearance, at.rate, self.eq.length * self.eq.basis(at.phase)
        return np.concatenate(parts)

    def _note(self, kind: Literal["impact", "stick", "release"], stop: int, **what: object) -> None:
        event = Event(kind, self.time, float(self.at.periods), float(self.at.phase), stop)
        self.events.append(replace(event, **what))  # type: ignore[arg-type]

    def meet(self) -> None:
        """Resolve all events at this instant: impacts, then the set of closed stops."""
        before, impenetrable, first = self.closed, self.eq.impenetrable, len(self.events)
        self.jumps, self.struck, self.late = [], 0.0, 0.0
        self.calm = 0.0 if self.flight is None or self.flight.event is not None else self.calm
        for _ in range(EVENTS):
            clearance, touch = self.at.clearance, self.touch()
            touching = np.flatnonzero((clearance <= touch) & (impenetrable | (clearance >= -touch)))
            self._close_gaps(touching[self.at.rate[touching] <= 0.0])
            touching = touching[impenetrable[touching]]
            struck = [int(j) for j in touching if self.at.rate[j] < 0.0]
            if not struck:
                break
            tail = self._held_from(struck, touching)
            if tail is None:
                self._strike(struck, [int(j) for j in touching if self.at.rate[j] <= 0.0])
            else:
                self.late = tail
                break
        self._settle([int(j) for j in touching if self.at.rate[j] == 0.0])
        for at, hit in enumerate(self.events[first:], first):
            self.events[at] = replace(hit, exit_velocity=float(self.at.rate[hit.stop]))
        self._begin_contacts()
        for j in sorted({*before} - {*self.closed}):
            self._note("release", j)
        for j in sorted({*self.closed} - {*before}):
            periods, phase = self.at.later(self.late / self.eq.period)
            time = float((periods + phase) * self.eq.period)
            self._note("stick", j, time=time, periods=float(periods), phase=float(phase))

    def _settle(self, resting: list[int]) -> None:
        """Determine which penetrable stops push, and which of the others at rest stay closed."""
        eq, x, signs = self.eq, self.vector(), {}
        for _ in range(eq.s + 1):
            self.held, self.closed = held_closed(eq, x, resting, self.pushing)
            phase, before = eq.phase(self.held, self.pushing), self.pushing
            signs = {int(j): self._pushes(int(j), phase, x) for j in np.flatnonzero(~eq.impenetrable)}
            self.pushing = tuple(j for j, sign in signs.items() if sign > 0)
            if self.pushing == before:
                break
        self.away = tuple(j for j, sign in signs.items() if sign < 0)

    def _pushes(self, j: int, phase: Phase, x: Floats) -> int:
        """Return 1 if a penetrable stop pushes from now on, -1 if it let go and is still pressed in, 0 if it is free.

        The sign of the first non-zero derivative decides; it is the same with and without the stop's own force.
        """
        clear, touch = self.at.clearance[j], self.touch()[j]
        if clear >= -touch:
            nears = clear <= touch and self.at.rate[j] <= 0.0
            return int(nears and phase.leading(phase.rows[CLEARANCE, j, 0], x)[1] < 0.0)
        return 1 if phase.leading(self.eq.ending[j], x)[1] < 0.0 else -1

    def _begin_contacts(self) -> None:
        """Record the contacts that begin now, and discard those that are over."""
        self.contacts = {j: index for j, index in self.contacts.items() if j in self.pushing or j in self.away}
        new = [j for j in self.pushing if j not in self.contacts]
        struck = [j for j in new if self.at.clearance[j] == 0.0 > self.at.rate[j]]
        self._hit(*(-float(self.at.rate[j]) for j in struck))
        for j in new:
            speed = float(-self.at.rate[j])
            counts = j in struck and speed >= self._cut() and not self.full
            self.contacts[j] = len(self.events) if counts else None
            if counts:
                self.recorded += 1
                self._note("impact", j, velocity=speed, simultaneous=len(struck) > 1, closed=self.closed)

    def _close_gaps(self, stops: Which) -> None:
        """Set the clearances of stops to zero, and adjust the coordinates."""
        eq, at = self.eq, self.at
        clearance = at.clearance.copy()
        clearance[stops] = 0.0
        beyond = (eq.places @ eq.basis(at.phase) - eq.directions @ at.displacement)[stops]
        moved = at.displacement + eq.kappa[:, stops] @ solved(eq.coupling[np.ix_(stops, stops)], beyond)
        self.at = replace(at, displacement=moved, clearance=clearance)

    def _match_rates(self, stops: Which) -> None:
        """Adjust the velocities of the coordinates to given rates of the stops' clearances."""
        eq, at = self.eq, self.at
        beyond = (eq.stop_rates(eq.basis(at.phase)) - eq.directions @ at.velocity - at.rate)[stops]
        moved = at.velocity + eq.kappa[:, stops] @ solved(eq.coupling[np.ix_(stops, stops)], beyond)
        self.at = replace(at, velocity=moved)

    def _strike(self, struck: list[int], contact: list[int]) -> None:
        """Apply the impulses of the stops in contact, both struck and closed."""
        eq, at = self.eq, self.at
        law = eq.restitution(at.rate)[contact]
        after, parts = impact_law(eq.coupling[np.ix_(contact, contact)], law, at.rate[contact])
        impulses = np.zeros(eq.s)
        impulses[contact] = parts
        rate = at.rate + eq.coupling @ impulses
        rate[contact] = after
        self.at = replace(at, velocity=at.velocity - eq.kappa @ impulses, rate=rate)
        self._match_rates(np.array(contact))
        acting = np.flatnonzero(impulses)
        self.jumps.append((acting, 1.0 + eq.sensitivity(at.rate)[acting]))
        speeds = {j: float(-at.rate[j]) for j in struck}
        self._hit(*speeds.values())
        for j, speed in speeds.items():
            if speed >= self._cut() and not self.full:
                self.recorded += 1
                self._note(
                    "impact",
                    j,
                    velocity=speed,
                    impulse=float(impulses[j]),
                    energy_lost=float(impulses[j] * (speed - rate[j]) / 2.0),
                    impulses=tuple(impulses.tolist()),
                    simultaneous=len(struck) > 1,
                    closed=tuple(k for k in self.closed if at.rate[k] == 0.0),
                )

    def _hit(self, *speeds: float) -> None:
        self.struck = max(self.struck, *speeds, 0.0)
        self.fastest = max(self.fastest, self.struck)

    def _cut(self) -> float:
        return CUT * self.fastest if self.cut is None else self.cut

    def _held_from(self, struck: list[int], touching: Which) -> float | None:
        """Close the struck stops if this completes a chatter, and return the remaining duration of the chatter.

        Its total impulse equals that of a stop held from now on. None means that the impact rebounds.
        """
        eq, cut = self.eq, self._cut()
        speed, law = max(-self.at.rate[j] for j in struck), eq.restitution(self.at.rate)
        if speed >= cut or any(law[j] == 1.0 for j in struck):
            return None
        slow = [int(j) for j in touching if abs(self.at.rate[j]) <= cut]
        x = self.vector(self._still(slow))
        held, _ = held_closed(eq, x, slow, self.pushing)
        if not {*struck} <= {*held}:
            return None
        tails = [self._tail(j, float(law[j]), held, x) for j in struck]
        late = max(tails)
        if late == math.inf:
            if speed >= HOLD * cut:
                return None
            late = 0.0
        index = np.array(held)
        self._hit(speed)
        self.jumps.append((index, np.ones(len(index))))
        self._close_gaps(index)
        self.at = self._still(held)
        self._match_rates(index)
        return late

    def _still(self, stops: Which | tuple[int, ...] | list[int]) -> Moment:
        """Return the present state after impulses that set the rates of the clearances of stops to zero."""
        eq, at, index = self.eq, self.at, np.array(stops, int)
        impulses = np.zeros(eq.s)
        impulses[index] = solved(eq.coupling[np.ix_(index, index)], -at.rate[index])
        rate = at.rate + eq.coupling @ impulses
        rate[index] = 0.0
        return replace(at, velocity=at.velocity - eq.kappa @ impulses, rate=rate)

    def _tail(self, j: int, r: float, held: tuple[int, ...], x: Floats) -> float:
        """Return how long a chatter on stop j goes on after an impact, infinite if not shortly; x is at rest there.

        With the clearance's acceleration -a - J t - d u' it takes t1 = 2 r v/((1 - r) a) to first order, and t1 - t1^2
        (J/(3 a) + d/6) to second, if no other stop is held.
        """
        eq, n = self.eq, self.eq.n
        free, closed = eq.phase(tuple(k for k in held if k != j), self.pushing), eq.phase(held, self.pushing)
        a, change = -float(free.bending[j] @ x), -float(free.bending[j] @ closed.matrix @ x)
        if a <= 0.0:
            return math.inf
        first = 2.0 * r * -float(self.at.rate[j]) / ((1.0 - r) * a)
        if first * abs(change) >= 0.5 * a or first * free.fastest >= SHORT:
            return math.inf
        slowing = float(free.bending[j, n : 2 * n] @ eq.kappa[:, j] / eq.coupling[j, j])
        return first - first**2 * (change / (3.0 * a) + slowing / 6.0)

    def move(self, longest: float) -> None:
        """Advance to the next event, or to the end of a block of the grid."""
        eq, phase, x = self.eq, self.eq.phase(self.held, self.pushing), self.vector()
        time, end, met = phase.next_event(x, self._watched(phase, x), longest)
        self.flight = Flight(self.at, phase, x, time, end, phase.rows[met[0]][0] if met else None)
        self.pushes, self.calm = pushes(phase, x, time), self.calm + time
        for j, push in self.pushes.items():
            index = self.contacts.get(j)
            if index is not None:
                hit = self.events[index]
                since = ((self.at.periods - hit.periods) + (self.at.phase - hit.phase)) * eq.period
                self.events[index] = hit.after(push, since)
        n, s = eq.n, eq.s
        q, v, u, w = np.split(end[: 2 * n + 2 * s], [n, 2 * n, 2 * n + s])
        u[[j for kind, j in met if kind != AWAY and (kind != LASTING or eq.stops[j].ending[1] == 0.0)]] = 0.0
        u[list(self.closed)] = w[list(self.closed)] = 0.0
        self.at = Moment(*self.at.later(time / eq.period), q, v, u, w)
        closed = np.array(self.closed, int)
        self._close_gaps(closed)
        self._match_rates(closed)

    def _watched(self, phase: Phase, x: Floats) -> dict[Watch, float]:
        """Return the values that may fall through zero next, their stops, and until when each is certainly positive."""
        watched = {}
        touching = self.at.clearance <= self.touch()
        for j in range(self.eq.s):
            if j in self.closed and j not in self.held:
                continue
            if j in self.away:
                watched[DEEP, j] = 0.0
            kind = AWAY if j in self.away else CLEARANCE
            kind = FORCE if j in self.held else LASTING if j in self.pushing else kind
            row, sure = phase.rows[kind, j, 0], 0.0
            if kind != CLEARANCE:
                order, value = phase.leading(row, x)
                if 0 < order < DEPTH:
                    sure = phase.surely_positive(row, x, order, value)
            elif touching[j]:
                order, value = 1, float(self.at.rate[j])
                if value == 0.0:
                    order, value = phase.leading(phase.bending[j], x)
                    order += 2
                sure = phase.surely_positive(row, x, order, value)
            watched[kind, j] = sure
        return watched


def solved(square: Floats, right: Floats) -> Floats:
    """Return the minimum-norm solution; the matrix is singular if directions of stops are parallel."""
    return np.asarray(np.linalg.lstsq(square, right, rcond=None)[0], float) if len(right) else right
