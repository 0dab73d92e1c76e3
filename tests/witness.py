"""One motion by the independent back end, as the list of its events and its states at any time."""

import math
from dataclasses import dataclass

import numpy as np

from vibroimpact.backends.reference.events import Event, Moment
from vibroimpact.backends.reference.phases import Equations
from vibroimpact.backends.reference.walk import EVENTS, Walk


@dataclass(frozen=True)
class Trajectory:
    """One motion: its events in order, its final state, the stops that are closed and that push then, and why it ended.

    `ended` is "impacts" (the requested number is reached), "time", or "events" (too many are too weak to be recorded).
    Each piece is a time, and phase and state from there on.
    """

    events: tuple[Event, ...]
    end: Moment
    closed: tuple
    pushing: tuple
    ended: str
    pieces: tuple

    @property
    def impacts(self):
        """The impacts among the events."""
        return tuple(event for event in self.events if event.kind == "impact")

    def at(self, times):
        """Return displacements and velocities at times in s, shape (times, n); just after an impact at its instant."""
        begins = np.array([begin for begin, _, _ in self.pieces])
        n = len(self.end.displacement)
        states = np.empty((np.size(times), 2 * n))
        for row, time in zip(states, np.ravel(times), strict=True):
            begin, phase, x = self.pieces[max(int(np.searchsorted(begins, time, side="right")) - 1, 0)]
            row[:] = phase.moved(x, time - begin)[: 2 * n]
        return states[:, :n], states[:, n:]


def follow(system, displacement, velocity, time=0.0, *, impacts=20, most_periods=1000.0, cut=None):
    """Follow a linear system from a state for a number of impacts or driving periods, whichever ends first.

    Contacts with compliant stops are followed to their end. Impacts slower than `cut`, in m/s, are not recorded; a
    chatter below it that certainly completes is replaced by its end. None means 1e-10 of the fastest impact so far.
    """
    eq = Equations(system)
    turns = time / eq.period
    walk = Walk(eq, Moment.of(eq, math.floor(turns), turns - math.floor(turns), displacement, velocity), cut)
    last, ended, pieces = walk.turns + most_periods, "events", []
    for _ in range(EVENTS * (impacts + 1)):
        walk.meet()
        walk.full = walk.recorded >= impacts
        if walk.full and not walk.in_contact:
            ended = "impacts"
            break
        if walk.turns >= last:
            ended = "time"
            break
        begin = walk.time
        walk.move((last - walk.turns) * walk.eq.period)
        pieces.append((begin, walk.flight.phase, walk.flight.x))
    return Trajectory(tuple(walk.events), walk.at, walk.closed, walk.pushing, ended, tuple(pieces))
