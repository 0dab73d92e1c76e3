"""The account of a motion: what happened up to each recorded impact since the one before."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibroimpact.backends.reference.designs import Design
from vibroimpact.backends.reference.endings import Endings
from vibroimpact.backends.reference.pushes import drained
from vibroimpact.backends.reference.stops import Floats
from vibroimpact.backends.reference.tangent import Tangent
from vibroimpact.backends.reference.walk import Walk


@dataclass
class Leg:
    """What happened since the last recorded impact, up to the next one; sums and extremes are one number per stop.

    Parameters
    ----------
    impulse, energy, force : array, shape (s,)
        Impulses and energies that the impact at its end and contacts within took, and the largest force.
    rest : array, shape (s + 1,)
        Times in s at which each stop, and any of them, is closed.
    miss : array, shape (s,)
        The closest near-misses in m; infinite if there is none.
    drained : float
        The energy in J that dampers took.
    chatters : bool
        Whether a chatter was completed.
    release : tuple, optional
        The stops, periods and phase of the last release of all that a stop feels, which erased all deviations.
    fresh : array, shape (2n, 2n)
        The deviations at its end, by those at its beginning, or since that release.
    matrix : array, shape (2n, 2n)
        The same, zero if there was such a release.
    turns : tuple of float
        Periods and phase at its end.
    stop : int
        The stop that is struck there.
    state, rate : array, shape (2n,)
        The state just after, and its derivative.
    """

    impulse: Floats
    energy: Floats
    force: Floats
    rest: Floats
    miss: Floats
    drained: float = 0.0
    chatters: bool = False
    release: Any = None
    fresh: Any = None
    matrix: Any = None
    turns: tuple[float, float] = (0.0, 0.0)
    speed: float = 0.0
    stop: int = 0
    state: Any = None
    rate: Any = None


class Ledger:
    """All legs of a motion, in the order of time."""

    def __init__(self, design: Design, walk: Walk, endings: Endings) -> None:
        self.design, self.endings = design, endings
        self.tangent = Tangent(walk)
        self.pinned: tuple[int, ...] = ()  # stops whose rest left nothing free to move
        self.before: tuple[int, ...] = ()
        self.legs: list[Leg] = []
        self.leg = self._new()
        self.listed = 0

    def _new(self) -> Leg:
        s = self.design.eq.s
        return Leg(np.zeros(s), np.zeros(s), np.zeros(s), np.zeros(s + 1), np.full(s, np.inf))

    def meet(self, walk: Walk) -> None:
        """Take down what the walk has just resolved."""
        leg, eq = self.leg, self.design.eq
        self.tangent.cross(walk)
        closing = sorted({*walk.closed} - {*self.before})
        if closing:
            leg.rest[closing] -= walk.late
            leg.rest[-1] -= 0.0 if self.before else walk.late
            leg.chatters |= walk.late > 0.0
        if self.endings.holds_all(walk.closed):
            self.pinned = walk.closed
        elif self.pinned:
            leg.release = self.pinned, float(walk.at.periods), float(walk.at.phase)
            self.pinned = ()
            self.tangent.restart(walk)
        self.before = walk.closed
        for event in walk.events[self.listed :]:
            if event.kind != "impact":
                continue
            leg.turns, leg.speed, leg.stop = (event.periods, event.phase), event.velocity, event.stop
            if eq.impenetrable[event.stop]:
                leg.impulse[event.stop] += event.impulse
                leg.energy[event.stop] += event.energy_lost
            leg.fresh = self.design.felt[:, None] * self.tangent.matrix * self.design.felt
            lost = leg.release is not None or bool(self.pinned)
            leg.matrix = np.zeros_like(leg.fresh) if lost else leg.fresh
            x = walk.vector()
            leg.state, leg.rate = x[: 2 * eq.n], (eq.phase(walk.held, walk.pushing).matrix @ x)[: 2 * eq.n]
            self.legs.append(leg)
            self.leg = leg = self._new()
            self.tangent.restart(walk)
        self.listed = len(walk.events)

    def fly(self, walk: Walk) -> None:
        """Take down the flight that the walk has just made."""
        leg, flight, eq = self.leg, walk.flight, self.design.eq
        assert flight is not None
        self.tangent.fly(flight.phase, flight.time)
        for j, push in walk.pushes.items():
            leg.impulse[j] += push.impulse
            leg.energy[j] += push.energy_lost
            leg.force[j] = max(leg.force[j], push.peak_force)
        leg.rest[list(walk.closed)] += flight.time
        leg.rest[-1] += flight.time if walk.closed else 0.0
        leg.drained += drained(flight.phase, eq.damping, flight.x, flight.time)
        touch = walk.touch()
        clear = [j for j in range(eq.s) if j not in (*walk.closed, *walk.pushing, *walk.away)]
        for j in clear:
            dips = flight.phase.dips(j, flight.x, flight.time, flight.end)
            leg.miss[j] = min([leg.miss[j], *(u for u in dips if u > touch[j])])


def seconds(first: Leg, last: Leg, period: float) -> float:
    """Return the time in s between the ends of two legs."""
    return math.fsum((last.turns[0] - first.turns[0], last.turns[1] - first.turns[1])) * period
