"""The `reference` back end: an independent cross-check in plain NumPy and SciPy, one oscillator at a time.

It shares neither code nor methods with the kernels: flights are matrix exponentials (`flight`), and the first contact
is found by halving intervals (`motion`). Impact times and velocities agree with 50-digit values to 1e-13 of their
scales times the growth of errors along the orbit. An impact takes about 0.5 ms. To audit a cell, read `motion.motion`,
which contains all the physics on one page.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, field

import numpy as np

from vibroimpact.backends.base import (
    Floats,
    ImpactWindow,
    LooksWindow,
    Samples,
    Window,
    energy_loss,
    impacts_status,
    looks_status,
)
from vibroimpact.backends.one_by_one import OneByOne, impact_indices
from vibroimpact.backends.reference.flight import FreeMotion, State
from vibroimpact.backends.reference.indices import Account, Ledger
from vibroimpact.backends.reference.motion import Contact, Rest, motion, time_between
from vibroimpact.indices import INDICES
from vibroimpact.options import Tolerances
from vibroimpact.status import Status


@dataclass
class Record:
    """The record of one cell in a window so far."""

    impacts: list[tuple[float, float, float]] = field(default_factory=list)
    sticks: list[tuple[float, float, float, float]] = field(default_factory=list)
    looks: list[tuple[float, float]] = field(default_factory=list)
    recorded: int = 0
    steps: int = 0
    ended: Status = Status.OK

    def stick(self, rest: Rest, released: bool) -> None:
        """Record a rest at the stop."""
        let_go = (rest.release.periods, rest.release.phase) if rest.release and released else (math.nan, math.nan)
        self.sticks.append((rest.settled.periods, rest.settled.phase, *let_go))


class ReferenceCell:
    """One oscillator, followed from its initial condition until a window is full or its motion certainly ends."""

    def __init__(self, cell: dict[str, float], tolerances: Tolerances) -> None:
        self.start = State(**{name: cell.pop(name) for name in ("clearance", "velocity", "periods", "phase")})
        self.design = cell.copy()
        self.restitution = cell.pop("restitution")
        self.loss = energy_loss(cell["mass"], self.restitution)
        self.free = free = FreeMotion(**cell)
        force = max(free.drive, abs(free.preload))
        own_speed = math.hypot(self.start.velocity, free.natural * self.start.clearance)
        self.unforced_at_stop = force == 0.0
        self.speed_scale = force / free.natural if force > 0.0 else own_speed
        self.cut = tolerances.chatter * self.speed_scale
        slowest = min(free.omega, free.natural)
        self.longest_flight = tolerances.flight_periods * 2.0 * math.pi / slowest
        self.steps_per_impact = tolerances.steps_per_impact * free.fastest / slowest

    def indices(self, window: ImpactWindow) -> tuple[Samples, int, dict[str, float]]:
        """Return the impacts that a window keeps, the number recorded in all, and the indices."""
        ledger = Ledger(self.free)
        samples, computed = self.impacts(window, ledger)
        if not Status(samples.status).has_indices:
            return samples, computed, {}
        account = Account(ledger, self.restitution, self.speed_scale, self.loss)
        return samples, computed, impact_indices(samples, self.loss) | account.indices(window.transient)

    def impacts(self, window: ImpactWindow, ledger: Ledger | None = None) -> tuple[Samples, int]:
        """Return the impacts that a window keeps, and the number recorded in all; a ledger records all events."""
        record = Record()
        wanted = window.transient + window.keep
        state, age, weak = self.start, 0.0, False
        for event in motion(self.free, self.restitution, self.start, self.cut):
            record.steps += 1
            if ledger is not None:
                ledger.write(event)
            if isinstance(event, Contact):
                state, age = event.after, 0.0
                if event.counts:
                    record.recorded += 1
                    if record.recorded > window.transient:
                        record.impacts.append((state.periods, state.phase, event.speed))
                    if record.recorded == wanted:
                        break
                # Unforced rebounds only become weaker; the second one below the cutoff shows that the stop stays in
                # reach.
                elif weak and self.free.drive == 0.0 and self.free.preload >= 0.0:
                    record.ended = Status.DECAYING
                    break
                weak = not event.counts
            elif isinstance(event, Rest):
                state = event.release or event.settled
                if record.impacts:
                    record.stick(event, True)
                if event.release is None:
                    record.ended = Status.STUCK_FOREVER
            else:
                state, age = event.end, age + event.duration
                record.ended = self._ending(state, age, record, self.steps_per_impact * wanted)
                if record.ended != Status.OK:
                    break
        return self._samples(record, window, state), record.recorded

    def _ending(self, state: State, age: float, record: Record, granted: float) -> Status:
        free = self.free
        # Without force and gap no later impact is faster than this one.
        fastest_left = math.hypot(state.velocity, free.natural * state.clearance)
        if state.clearance > 0.0 and (free.never_again(state) or (self.unforced_at_stop and fastest_left < self.cut)):
            dying = Status.DECAYING if self.unforced_at_stop else Status.STOPPED_IMPACTING
            return dying if record.recorded else Status.NO_IMPACT
        return Status.BUDGET if age > self.longest_flight or record.steps > granted else Status.OK

    def looks(self, window: LooksWindow) -> Samples:
        """Return the samples of a window of times."""
        record = Record()
        periods, phase = window.schedule(self.start.periods, self.start.phase)
        granted = self.steps_per_impact * (math.ceil(window.length) + 1)
        for event in motion(self.free, self.restitution, self.start, self.cut):
            record.steps += 1
            pending = slice(len(record.looks), None)
            if isinstance(event, Contact):
                if event.counts:
                    record.impacts.append((event.after.periods, event.after.phase, event.speed))
                continue
            if isinstance(event, Rest):
                # The sample that ends the window may come before the release, which is then not recorded.
                ahead = self._ahead(event.settled, periods[pending], phase[pending])
                stays = math.inf if event.release is None else time_between(self.free, event.settled, event.release)
                record.looks += [(0.0, 0.0)] * int(np.sum(ahead < stays))
                record.stick(event, len(record.looks) < len(periods))
            else:
                ahead = self._ahead(event.start, periods[pending], phase[pending])
                clearance, velocity = self.free.after(event.start, ahead[ahead < event.duration])
                record.looks += zip(clearance.tolist(), velocity.tolist(), strict=True)
            if len(record.looks) == len(periods):
                break
            if record.steps > granted:
                record.ended = Status.BUDGET
                break
        at = len(record.looks) - 1
        last = State(*record.looks[at], periods[at], phase[at]) if record.looks else self.start
        return self._samples(record, window, last, periods, phase)

    def _ahead(self, state: State, periods: Floats, phase: Floats) -> Floats:
        ahead: Floats = ((periods - state.periods) + (phase - state.phase)) * self.free.period
        return ahead

    def _samples(self, record: Record, window: Window, last: State, *schedule: Floats) -> Samples:
        impacts = np.array(record.impacts).reshape(-1, 3)
        sticks = np.array(record.sticks).reshape(-1, 4)
        clearance, velocity = np.array(record.looks).reshape(-1, 2).T
        times = [part[: len(clearance)] for part in schedule or (np.empty(0), np.empty(0))]
        status = record.ended
        if isinstance(window, ImpactWindow):
            status = impacts_status(impacts, sticks, window, status)
        elif status == Status.OK:
            status = looks_status(sticks, times[0][0] + times[1][0], self.free.preload <= -self.free.drive)
        return Samples.of_one_mass(
            self.design,
            impacts=impacts,
            looks=np.column_stack([*times, self.free.gap - clearance, velocity]),
            sticks=sticks,
            status=status,
            last=astuple(last),
            steps=record.steps,
        )


class ReferenceBackend(OneByOne):
    """The independent cross-check as a back end."""

    name = sampler = "reference"
    known_indices = frozenset(INDICES)

    def run(self, cell: dict[str, float], tolerances: Tolerances) -> ReferenceCell:
        """Return the run of a cell."""
        return ReferenceCell(cell, tolerances)


def create() -> ReferenceBackend:
    """Return the back end."""
    return ReferenceBackend()
