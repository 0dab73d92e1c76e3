"""The report of a motion: its events in order, and its states at any time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends.reference.phases import Phase
from vibroimpact.backends.reference.pushes import Push
from vibroimpact.backends.reference.stops import Floats


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
        """Return periods and phase a number of driving periods later."""
        phase = self.phase + turns
        whole = math.floor(phase)
        return self.periods + whole, phase - whole


@dataclass(frozen=True)
class Event:
    """An event of one stop.

    Parameters
    ----------
    kind : "impact", "stick" or "release"
        The stop is struck, or begins to push; it closes for some time; it opens.
    time, phase : float
        In s, and (t mod T)/T.
    stop : int
        Its index.
    velocity, impulse : float
        For an impact: the closing speed just before it in m/s, > 0, and the impulse of this stop in N s.
    energy_lost, peak_force, penetration, contact_time : float
        For an impact: the energy lost at this stop in J and, for a compliant stop, the peak force in N, the penetration
        in m and the contact time in s, up to the present if the contact is unfinished.
    impulses : tuple of float
        For an impact: the impulses of all stops at this instant; a closed stop has one, too.
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
    energy_lost: float = 0.0
    peak_force: float = 0.0
    penetration: float = 0.0
    contact_time: float = 0.0
    impulses: tuple[float, ...] = ()
    simultaneous: bool = False
    closed: tuple[int, ...] = ()

    def after(self, push: Push) -> Event:
        """Return the event updated by the later action of the stop."""
        return replace(
            self,
            impulse=self.impulse + push.impulse,
            energy_lost=self.energy_lost + push.energy_lost,
            peak_force=max(self.peak_force, push.peak_force),
            penetration=max(self.penetration, push.penetration),
            contact_time=self.contact_time + push.contact_time,
        )


@dataclass(frozen=True)
class Trajectory:
    """One motion: its events in order, its final state, the stops that are closed and that push then, and why it ended.

    `ended` is "impacts" (the requested number is reached), "time", or "events" (too many are too weak to be recorded).
    """

    events: tuple[Event, ...]
    end: Moment
    closed: tuple[int, ...]
    pushing: tuple[int, ...]
    ended: Literal["impacts", "time", "events"]
    pieces: tuple[tuple[float, Phase, Floats], ...] = field(repr=False)

    @property
    def impacts(self) -> tuple[Event, ...]:
        """The impacts among the events."""
        return tuple(event for event in self.events if event.kind == "impact")

    def at(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Return displacements and velocities at times in s, shape (times, n); just after an impact at its instant."""
        begins = np.array([begin for begin, _, _ in self.pieces])
        n = len(self.end.displacement)
        states = np.empty((np.size(times), 2 * n))
        for row, time in zip(states, np.ravel(times), strict=True):
            begin, phase, x = self.pieces[max(int(np.searchsorted(begins, time, side="right")) - 1, 0)]
            row[:] = phase.moved(x, time - begin)[: 2 * n]
        return states[:, :n], states[:, n:]
