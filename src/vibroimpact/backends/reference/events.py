"""What a motion consists of: states at instants, events, and the flights between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends.reference.phases import Equations, Phase
from vibroimpact.backends.reference.stops import Floats
from vibroimpact.model.elements import Contact


@dataclass(frozen=True)
class Moment:
    """A state: coordinates, velocities, clearances and their rates, at the time (periods + phase) T."""

    periods: float
    phase: float
    displacement: Floats
    velocity: Floats
    clearance: Floats
    rate: Floats

    @classmethod
    def of(cls, eq: Equations, periods: float, phase: float, displacement: ArrayLike, velocity: ArrayLike) -> Moment:
        """Return the state of given coordinates and velocities."""
        q, v, basis = np.array(displacement, float), np.array(velocity, float), eq.basis(phase)
        return cls(
            periods, phase, q, v, eq.places @ basis - eq.directions @ q, eq.stop_rates(basis) - eq.directions @ v
        )

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
    time, periods, phase : float
        In s; whole driving periods, and (t mod T)/T.
    stop : int
        Its index.
    velocity, impulse : float
        For an impact: the closing speed just before it in m/s, > 0, and the impulse of this stop in N s.
    energy_lost, peak_force, penetration, contact_time : float
        For an impact: the energy lost at this stop in J and, for a compliant stop, the peak force in N, the penetration
        in m and the contact time in s, up to the present if the contact is unfinished.
    exit_time, exit_velocity : float
        For an impact: the time in s from it to the end of its force, and the rate of the clearance then in m/s.
    peak_force_time, penetration_time : float
        For an impact on a compliant stop: the times in s from it to the largest force and penetration.
    impulses : tuple of float
        For an impact: the impulses of all stops at this instant; a closed stop has one, too.
    simultaneous : bool
        Whether other stops are struck at the same instant; each has its own event.
    closed : tuple of int
        The stops that were closed just before.
    """

    kind: Literal["impact", "stick", "release"]
    time: float
    periods: float
    phase: float
    stop: int
    velocity: float = 0.0
    impulse: float = 0.0
    energy_lost: float = 0.0
    peak_force: float = 0.0
    penetration: float = 0.0
    contact_time: float = 0.0
    exit_time: float = 0.0
    exit_velocity: float = 0.0
    peak_force_time: float = 0.0
    penetration_time: float = 0.0
    impulses: tuple[float, ...] = ()
    simultaneous: bool = False
    closed: tuple[int, ...] = ()

    def after(self, push: Contact, since: float) -> Event:
        """Return the event updated by a later push of the stop, which began `since` the impact, in s."""
        so_far = Contact(*(getattr(self, name) for name in Contact._fields))
        times = {name: since + getattr(push, name) for name in ("exit_time", "peak_force_time", "penetration_time")}
        return replace(self, **so_far.joined(push._replace(**times))._asdict())


class Flight(NamedTuple):
    """The motion between two events: where it began, its phase and X there, how long it took in s, and X at its end.

    `event` is the row whose product with X vanishes there, if that is what ended it.
    """

    begin: Moment
    phase: Phase
    x: Floats
    time: float
    end: Floats
    event: Floats | None
