"""The witness for systems of several coordinates and rigid stops: one motion, event by event, slow and plain.

Flights and closed phases are exact (`phases`), the first event is bracketed on a grid that is dense against the fastest
rate, and impacts and closed stops obey complementarity, solved by trying every subset (`contacts`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends.reference.contacts import held_closed, impact_law
from vibroimpact.backends.reference.phases import DEPTH, Equations, Floats, LinearSystem, Phase, RigidStop, Which

__all__ = ["Event", "LinearSystem", "Moment", "RigidStop", "Trajectory", "follow"]

TOUCH = 1e-13  # of a clearance's terms: one this small is contact
CUT = 1e-10  # of the fastest impact so far: chatter below it is closed
SHORT = 1e-6  # radians of the fastest rate: the rest of a chatter this short ends as the geometric series says
HOLD = 1e-3  # of the cut: an impact this slow under a pressing force is held
EVENTS = 1000  # per impact asked for, those too weak to be recorded included


@dataclass(frozen=True)
class Moment:
    """A state: coordinates, velocities, clearances and their rates, at the time (periods + phase) T."""

    periods: float
    phase: float
    displacement: Floats
    velocity: Floats
    clearance: Floats
    rate: Floats

    def later(self, turns: float) -> tuple[float, float]:
        """Return periods and phase so many driving periods later."""
        phase = self.phase + turns
        whole = math.floor(phase)
        return self.periods + whole, phase - whole


@dataclass(frozen=True)
class Event:
    """What happened to one stop, and when.

    Parameters
    ----------
    kind : "impact", "stick" or "release"
        The stop is struck; it closes for a while; it opens.
    time, phase : float
        In s, and (t mod T)/T.
    stop : int
        Its index.
    velocity, impulse : float
        Of an impact: the closing speed just before it in m/s, > 0, and the impulse of this stop in N s.
    impulses : tuple of float
        Of an impact: those of all stops at this instant; a closed stop has one, too.
    simultaneous : bool
        Whether other stops are struck at the same instant; each has its own event.
    closed : tuple of int
        The stops that were closed just before.
    """

    kind: Literal["impact", "stick", "release"]
    time: float
    phase: float
    stop: int
    velocity: float = 0.0
    impulse: float = 0.0
    impulses: tuple[float, ...] = ()
    simultaneous: bool = False
    closed: tuple[int, ...] = ()


@dataclass(frozen=True)
class Trajectory:
    """One motion: its events in order, its end, the stops closed then, and why it ended.

    `ended` is "impacts" (as many as asked for), "time", or "events" (too many too weak to be recorded).
    """

    events: tuple[Event, ...]
    end: Moment
    closed: tuple[int, ...]
    ended: Literal["impacts", "time", "events"]
    pieces: tuple[tuple[float, Phase, Floats], ...] = field(repr=False)

    @property
    def impacts(self) -> tuple[Event, ...]:
        """The impacts alone."""
        return tuple(event for event in self.events if event.kind == "impact")

    def at(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Return displacements and velocities at times in s, shape (times, n); just after an impact at its instant."""
        begins = np.array([begin for begin, _, _ in self.pieces])
        n = len(self.end.displacement)
        found = np.empty((np.size(times), 2 * n))
        for row, time in zip(found, np.ravel(times), strict=True):
            begin, phase, x = self.pieces[max(int(np.searchsorted(begins, time, side="right")) - 1, 0)]
            row[:] = phase.moved(x, time - begin)[: 2 * n]
        return found[:, :n], found[:, n:]


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
    """Follow a system from a state for so many impacts or driving periods, whichever end first.

    Parameters
    ----------
    system : LinearSystem
        Matrices, forces and stops.
    displacement, velocity : array, shape (n,)
        The state at `time`, in front of every stop or touching it.
    time : float
        In s.
    impacts : int
        Impacts to be recorded.
    most_periods : float
        Driving periods to follow at most.
    cut : float, optional
        Impacts slower than this, in m/s, are not recorded; a chatter below it that is sure to be complete is closed.
        None is 1e-10 of the fastest impact so far.

    Returns
    -------
    Trajectory
        The events in order; states at any time by its `at`.

    Raises
    ------
    ValueError
        The state lies beyond a stop, or stops squeeze a mass between them.

    Notes
    -----
    Exact to rounding and the growth of errors along the motion. Two events of one stop within a tenth of a radian of
    the fastest rate are told apart; some milliseconds per impact.

    Examples
    --------
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
        if walk.recorded >= impacts:
            ended = "impacts"
            break
        if walk.turns >= last:
            ended = "time"
            break
        walk.move((last - walk.turns) * walk.eq.period)
    return Trajectory(tuple(walk.events), walk.at, walk.closed, ended, tuple(walk.pieces))


class _Walk:
    """A motion as far as it is known."""

    def __init__(self, system: LinearSystem, q: Floats, v: Floats, time: float, cut: float | None) -> None:
        self.eq = eq = Equations(system)
        turns = time / eq.period
        basis = eq.basis(turns - math.floor(turns))
        clearance, rate = eq.places @ basis - eq.directions @ q, eq.stop_rates(basis) - eq.directions @ v
        self.at = Moment(math.floor(turns), turns - math.floor(turns), q, v, clearance, rate)
        self.cut, self.fastest = cut, 0.0
        self.closed: tuple[int, ...] = ()  # all that stay closed, and those of them that push
        self.held: tuple[int, ...] = ()
        self.events: list[Event] = []
        self.pieces: list[tuple[float, Phase, Floats]] = []
        self.recorded = 0
        if (clearance < -self._touch()).any():
            raise ValueError(f"the state lies beyond a stop: clearances {clearance.tolist()}")

    @property
    def turns(self) -> float:
        """Driving periods since time zero."""
        return self.at.periods + self.at.phase

    @property
    def time(self) -> float:
        """Time in s."""
        return float(self.turns * self.eq.period)

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
        """Settle all that happens at this instant: impacts, then which stops are closed."""
        before, late = self.closed, 0.0
        for _ in range(EVENTS):
            touching = np.flatnonzero(self.at.clearance <= self._touch())
            self._close_gaps(touching[self.at.rate[touching] <= 0.0])
            struck = [int(j) for j in touching if self.at.rate[j] < 0.0]
            if not struck:
                break
            tail = self._held_from(struck, touching)
            if tail is None:
                self._strike(struck, [int(j) for j in touching if self.at.rate[j] <= 0.0])
            else:
                late = tail
                break
        resting = [int(j) for j in touching if self.at.rate[j] == 0.0]
        self.held, self.closed = held_closed(self.eq, self._vector(), resting)
        for j in sorted({*before} - {*self.closed}):
            self._note("release", j)
        for j in sorted({*self.closed} - {*before}):
            turns = self.at.later(late / self.eq.period)
            self._note("stick", j, time=float(sum(turns) * self.eq.period), phase=float(turns[1]))

    def _close_gaps(self, stops: Which) -> None:
        """Set the clearances of stops to zero, the coordinates with them."""
        eq, at = self.eq, self.at
        clearance = at.clearance.copy()
        clearance[stops] = 0.0
        beyond = (eq.places @ eq.basis(at.phase) - eq.directions @ at.displacement)[stops]
        moved = at.displacement + eq.kappa[:, stops] @ _solved(eq.coupling[np.ix_(stops, stops)], beyond)
        self.at = replace(at, displacement=moved, clearance=clearance)

    def _match_rates(self, stops: Which) -> None:
        """Let the velocities of the coordinates have the rates that these stops are said to have."""
        eq, at = self.eq, self.at
        beyond = (eq.stop_rates(eq.basis(at.phase)) - eq.directions @ at.velocity - at.rate)[stops]
        moved = at.velocity + eq.kappa[:, stops] @ _solved(eq.coupling[np.ix_(stops, stops)], beyond)
        self.at = replace(at, velocity=moved)

    def _strike(self, struck: list[int], contact: list[int]) -> None:
        """Let the stops in contact push: those struck, and those closed."""
        eq, at = self.eq, self.at
        after, parts = impact_law(eq.coupling[np.ix_(contact, contact)], eq.restitution[contact], at.rate[contact])
        impulses = np.zeros(eq.s)
        impulses[contact] = parts
        rate = at.rate + eq.coupling @ impulses
        rate[contact] = after
        self.at = replace(at, velocity=at.velocity - eq.kappa @ impulses, rate=rate)
        self._match_rates(np.array(contact))
        speeds = {j: float(-at.rate[j]) for j in struck}
        self.fastest = max(self.fastest, *speeds.values())
        for j, speed in speeds.items():
            if speed >= self._cut():
                self.recorded += 1
                self._note(
                    "impact",
                    j,
                    velocity=speed,
                    impulse=float(impulses[j]),
                    impulses=tuple(impulses.tolist()),
                    simultaneous=len(struck) > 1,
                    closed=tuple(k for k in self.closed if at.rate[k] == 0.0),
                )

    def _cut(self) -> float:
        return CUT * self.fastest if self.cut is None else self.cut

    def _held_from(self, struck: list[int], touching: Which) -> float | None:
        """Close the stops struck if that ends a chatter, and return for how long it would have gone on.

        Under a pressing acceleration a that is left of a velocity v takes 2 r v/((1 - r) a), and as a whole it pushes
        as much as a stop that is held from now on. None: the impact rebounds.
        """
        eq, cut = self.eq, self._cut()
        speed = max(-self.at.rate[j] for j in struck)
        if speed >= cut or any(eq.restitution[j] == 1.0 for j in struck):
            return None
        slow = [int(j) for j in touching if abs(self.at.rate[j]) <= cut]
        rate = self.at.rate.copy()
        rate[slow] = 0.0
        x = self._vector(rate)
        held, _ = held_closed(eq, x, slow)
        if not {*struck} <= {*held}:
            return None
        tails = []
        for j in struck:
            phase = eq.phase(tuple(k for k in held if k != j))
            pressing, change = -float(phase.bending[j] @ x), abs(float(phase.bending[j] @ phase.matrix @ x))
            r = eq.restitution[j]
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
        """Move to the next event, or to the end of a block of the grid."""
        eq, phase, x = self.eq, self.eq.phase(self.held), self._vector()
        self.pieces.append((self.time, phase, x))
        watched = {}
        touching = self.at.clearance <= self._touch()
        for j in range(eq.s):
            if j in self.closed and j not in self.held:
                continue
            sure = 0.0
            if j in self.held:
                order, value = phase.leading(phase.force[j], x)
                if 0 < order < DEPTH:
                    sure = phase.surely_positive(phase.force[j], x, order, value)
            elif touching[j]:
                row = phase.rows[j, 0]
                order, value = 1, float(self.at.rate[j])
                if value == 0.0:
                    order, value = phase.leading(phase.bending[j], x)
                    order += 2
                sure = phase.surely_positive(row, x, order, value)
            watched[j] = sure
        time, end, met = phase.next_event(x, watched, longest)
        n, s = eq.n, eq.s
        q, v, u, w = np.split(end[: 2 * n + 2 * s], [n, 2 * n, 2 * n + s])
        u[[j for j in met if j not in self.held]] = 0.0
        u[list(self.closed)] = w[list(self.closed)] = 0.0
        self.at = Moment(*self.at.later(time / eq.period), q, v, u, w)
        closed = np.array(self.closed, int)
        self._close_gaps(closed)
        self._match_rates(closed)


def _solved(square: Floats, right: Floats) -> Floats:
    """Return the solution of least size; the matrix is singular where directions of stops are parallel."""
    return np.asarray(np.linalg.lstsq(square, right, rcond=None)[0], float) if len(right) else right
