"""The cross-check for systems of several coordinates and stops: one motion, event by event, slow and simple.

All phases are exact (`phases`). The first event is bracketed on a grid that is fine compared with the fastest rate.
Impacts and closed stops satisfy complementarity, solved by trying every subset (`contacts`). The effects of pushing
compliant stops are integrated (`pushes`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends.reference.contacts import held_closed, impact_law
from vibroimpact.backends.reference.events import Event, Moment, Trajectory
from vibroimpact.backends.reference.phases import (
    AWAY,
    CLEARANCE,
    DEEP,
    DEPTH,
    FORCE,
    LASTING,
    Equations,
    LinearSystem,
    Phase,
    Watch,
    Which,
)
from vibroimpact.backends.reference.pushes import pushes
from vibroimpact.backends.reference.stops import Floats

__all__ = ["Event", "LinearSystem", "Moment", "Trajectory", "follow"]

TOUCH = 1e-13  # relative to a clearance's terms: a smaller clearance is contact
CUT = 1e-10  # of the fastest impact so far: chatter below it is completed
SHORT = 1e-6  # radians of the fastest rate: a shorter remainder of a chatter is summed as a geometric series
HOLD = 1e-3  # of the cutoff: a slower impact under a pressing force sticks
EVENTS = 1000  # per requested impact, including those too weak to be recorded


def follow(
    system: LinearSystem,
    displacement: ArrayLike,
    velocity: ArrayLike,
    time: float = 0.0,
    *,
    impacts: int = 20,
    most_periods: float = 1000.0,
    cut: float | None = None,
) -> Trajectory:
    """Follow a system from a state for a number of impacts or driving periods, whichever ends first.

    Parameters
    ----------
    system : LinearSystem
        Matrices, forces and stops.
    displacement, velocity : array, shape (n,)
        The state at `time`, not beyond any rigid stop.
    time : float
        In s.
    impacts : int
        Number of impacts to record; contacts with compliant stops are followed to their end.
    most_periods : float
        Largest number of driving periods.
    cut : float, optional
        Impacts slower than this, in m/s, are not recorded; a chatter below it that certainly completes is replaced by
        its end. None means 1e-10 of the fastest impact so far.

    Returns
    -------
    Trajectory
        The events in order; its method `at` returns states at any time.

    Raises
    ------
    ValueError
        The state lies beyond a rigid stop, or a mass is squeezed between rigid stops.

    Notes
    -----
    The motion is exact up to rounding and its growth. Two events of one stop are resolved down to a tenth of a radian
    of the fastest rate. An impact takes a few milliseconds.

    Examples
    --------
    >>> from vibroimpact.backends.reference.stops import RigidStop
    >>> ball = LinearSystem(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), 1.0, np.array([2.0]), {},
    ...                     (RigidStop(np.array([1.0]), 0.0, 0.5),))
    >>> motion = follow(ball, [-1.0], [0.0], impacts=3)
    >>> [round(event.velocity, 12) for event in motion.events]
    [2.0, 1.0, 0.5]
    """
    walk = _Walk(system, np.array(displacement, float), np.array(velocity, float), float(time), cut)
    last = walk.turns + most_periods
    ended: Literal["impacts", "time", "events"] = "events"
    for _ in range(EVENTS * (impacts + 1)):
        walk.meet()
        walk.full = walk.recorded >= impacts
        if walk.full and not walk.in_contact:
            ended = "impacts"
            break
        if walk.turns >= last:
            ended = "time"
            break
        walk.move((last - walk.turns) * walk.eq.period)
    return Trajectory(tuple(walk.events), walk.at, walk.closed, walk.pushing, ended, tuple(walk.pieces))


class _Walk:
    """A motion as far as it has been computed."""

    def __init__(self, system: LinearSystem, q: Floats, v: Floats, time: float, cut: float | None) -> None:
        self.eq = eq = Equations(system)
        turns = time / eq.period
        basis = eq.basis(turns - math.floor(turns))
        clearance, rate = eq.places @ basis - eq.directions @ q, eq.stop_rates(basis) - eq.directions @ v
        self.at = Moment(math.floor(turns), turns - math.floor(turns), q, v, clearance, rate)
        self.cut, self.fastest = cut, 0.0
        self.closed: tuple[int, ...] = ()  # stops that stay closed, and those of them that push
        self.held: tuple[int, ...] = ()
        self.pushing: tuple[int, ...] = ()  # those that push; those that let go and are still pressed in
        self.away: tuple[int, ...] = ()
        self.contacts: dict[int, int | None] = {}  # for the pushing ones, the index of their event if it is recorded
        self.events: list[Event] = []
        self.pieces: list[tuple[float, Phase, Floats]] = []
        self.recorded, self.full = 0, False
        if (clearance < -self._touch())[eq.impenetrable].any():
            raise ValueError(f"the state lies beyond a stop: clearances {clearance.tolist()}")

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

    def _touch(self) -> Floats:
        reach = np.abs(self.eq.places).sum(axis=1) + np.abs(self.eq.directions) @ np.abs(self.at.displacement)
        touch: Floats = TOUCH * reach
        return touch

    def _vector(self, rate: Floats | None = None) -> Floats:
        at, basis = self.at, self.eq.basis(self.at.phase)
        rates = at.rate if rate is None else rate
        return np.concatenate([at.displacement, at.velocity, at.clearance, rates, self.eq.length * basis])

    def _note(self, kind: Literal["impact", "stick", "release"], stop: int, **what: object) -> None:
        event = Event(kind, self.time, float(self.at.phase), stop)
        self.events.append(replace(event, **what))  # type: ignore[arg-type]

    def meet(self) -> None:
        """Resolve all events at this instant: impacts, then the set of closed stops."""
        before, late, impenetrable = self.closed, 0.0, self.eq.impenetrable
        for _ in range(EVENTS):
            clearance, touch = self.at.clearance, self._touch()
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
                late = tail
                break
        self._settle([int(j) for j in touching if self.at.rate[j] == 0.0])
        self._begin_contacts()
        for j in sorted({*before} - {*self.closed}):
            self._note("release", j)
        for j in sorted({*self.closed} - {*before}):
            turns = self.at.later(late / self.eq.period)
            self._note("stick", j, time=float(sum(turns) * self.eq.period), phase=float(turns[1]))

    def _settle(self, resting: list[int]) -> None:
        """Determine which penetrable stops push, and which of the others at rest stay closed."""
        eq, x, signs = self.eq, self._vector(), {}
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
        clear, touch = self.at.clearance[j], self._touch()[j]
        if clear >= -touch:
            nears = clear <= touch and self.at.rate[j] <= 0.0
            return int(nears and phase.leading(phase.rows[CLEARANCE, j, 0], x)[1] < 0.0)
        return 1 if phase.leading(self.eq.ending[j], x)[1] < 0.0 else -1

    def _begin_contacts(self) -> None:
        """Record the contacts that begin now, and discard those that are over."""
        self.contacts = {j: index for j, index in self.contacts.items() if j in self.pushing or j in self.away}
        new = [j for j in self.pushing if j not in self.contacts]
        struck = [j for j in new if self.at.clearance[j] == 0.0 > self.at.rate[j]]
        self.fastest = max(self.fastest, *(-float(self.at.rate[j]) for j in struck), 0.0)
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
        moved = at.displacement + eq.kappa[:, stops] @ _solved(eq.coupling[np.ix_(stops, stops)], beyond)
        self.at = replace(at, displacement=moved, clearance=clearance)

    def _match_rates(self, stops: Which) -> None:
        """Adjust the velocities of the coordinates to given rates of the stops' clearances."""
        eq, at = self.eq, self.at
        beyond = (eq.stop_rates(eq.basis(at.phase)) - eq.directions @ at.velocity - at.rate)[stops]
        moved = at.velocity + eq.kappa[:, stops] @ _solved(eq.coupling[np.ix_(stops, stops)], beyond)
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
        speeds = {j: float(-at.rate[j]) for j in struck}
        self.fastest = max(self.fastest, *speeds.values())
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

    def _cut(self) -> float:
        return CUT * self.fastest if self.cut is None else self.cut

    def _held_from(self, struck: list[int], touching: Which) -> float | None:
        """Close the struck stops if this completes a chatter, and return the remaining duration of the chatter.

        Under a pressing acceleration a the remaining duration is 2 r v/((1 - r) a) for a velocity v, and its total
        impulse equals that of a stop held from now on. None means that the impact rebounds.
        """
        eq, cut = self.eq, self._cut()
        speed, law = max(-self.at.rate[j] for j in struck), eq.restitution(self.at.rate)
        if speed >= cut or any(law[j] == 1.0 for j in struck):
            return None
        slow = [int(j) for j in touching if abs(self.at.rate[j]) <= cut]
        rate = self.at.rate.copy()
        rate[slow] = 0.0
        x = self._vector(rate)
        held, _ = held_closed(eq, x, slow, self.pushing)
        if not {*struck} <= {*held}:
            return None
        tails = []
        for j in struck:
            phase = eq.phase(tuple(k for k in held if k != j), self.pushing)
            pressing, change = -float(phase.bending[j] @ x), abs(float(phase.bending[j] @ phase.matrix @ x))
            r = law[j]
            tail = 2.0 * r * -self.at.rate[j] / ((1.0 - r) * pressing) if pressing > 0.0 else math.inf
            tails.append(tail if tail * change < 0.5 * pressing and tail * phase.fastest < SHORT else math.inf)
        late = max(tails)
        if late == math.inf:
            if speed >= HOLD * cut:
                return None
            late = 0.0
        index = np.array(held)
        self._close_gaps(index)
        push = np.zeros(eq.s)
        push[index] = _solved(eq.coupling[np.ix_(index, index)], -self.at.rate[index])
        still = self.at.rate + eq.coupling @ push
        still[index] = 0.0
        self.at = replace(self.at, rate=still)
        self._match_rates(index)
        return late

    def move(self, longest: float) -> None:
        """Advance to the next event, or to the end of a block of the grid."""
        eq, phase, x = self.eq, self.eq.phase(self.held, self.pushing), self._vector()
        self.pieces.append((self.time, phase, x))
        time, end, met = phase.next_event(x, self._watched(phase, x), longest)
        if self.in_contact:
            for j, push in pushes(phase, x, time).items():
                index = self.contacts[j]
                if index is not None:
                    self.events[index] = self.events[index].after(push)
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
        touching = self.at.clearance <= self._touch()
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


def _solved(square: Floats, right: Floats) -> Floats:
    """Return the minimum-norm solution; the matrix is singular if directions of stops are parallel."""
    return np.asarray(np.linalg.lstsq(square, right, rcond=None)[0], float) if len(right) else right
