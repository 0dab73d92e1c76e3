"""The motion of one cell in a window, and what is sampled of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.backends.base import (
    ImpactWindow,
    LooksWindow,
    Samples,
    looks_status,
    within_impacts,
)
from vibroimpact.backends.reference.designs import Design, LawlessError
from vibroimpact.backends.reference.endings import Endings
from vibroimpact.backends.reference.ledger import Ledger
from vibroimpact.backends.reference.stops import Floats
from vibroimpact.backends.reference.walk import Walk
from vibroimpact.model.elements import Contact
from vibroimpact.options import Tolerances
from vibroimpact.status import Status

OF_COMPLIANT = "peak_force", "contact_time", "penetration", "peak_force_time", "penetration_time"  # not of an impulse


class Run:
    """One cell, followed from its initial condition until a window is full or its motion certainly ends."""

    def __init__(self, design: Design, tolerances: Tolerances) -> None:
        self.design, self.cut = design, tolerances.chatter * design.speed
        self.walk = Walk(design.eq, design.start, self.cut)
        self.endings = Endings(design)
        self.longest = tolerances.flight_periods * 2.0 * math.pi / design.slowest / design.eq.period  # in periods
        self.each = tolerances.steps_per_impact * design.eq.fastest / design.slowest
        self.steps, self.quiet_since, self.weak = 0, self.walk.turns, False

    def _meet(self) -> Status:
        """Resolve the events of this instant; return OK, or why the motion ends here."""
        before = self.walk.recorded
        try:
            self.walk.meet()
        except LawlessError:
            return Status.INVALID_RESTITUTION
        except ValueError:  # stops squeeze a mass
            return Status.BUDGET
        if self.walk.struck:
            self.quiet_since, weak = self.walk.turns, self.walk.recorded == before
            # Without a load rebounds only become weaker; the second one below the cutoff shows that the stop stays in
            # reach.
            if weak and self.weak and self.endings.undriven and not self.walk.closed:
                return Status.DECAYING
            self.weak = weak
        elif self.walk.closed:
            self.weak = False
        return Status.OK

    def _ending(self, granted: float) -> Status:
        """Return why no further impact will come, BUDGET if that is not known in time, or OK."""
        walk, hit = self.walk, self.walk.recorded > 0
        touches = bool(walk.closed or walk.pushing or walk.away)
        if (not walk.struck or touches) and self.endings.lasts(walk):
            touches |= bool(((walk.at.clearance == 0.0) & (walk.at.rate == 0.0)).any())  # else it parts from there
            return Status.STUCK_FOREVER if touches else Status.STOPPED_IMPACTING if hit else Status.NO_IMPACT
        if not walk.struck and self.endings.fades(walk, self.cut):
            return Status.DECAYING if hit else Status.NO_IMPACT
        calm = walk.turns - self.quiet_since
        if touches and calm > 1.0 and self.endings.repeats(walk, self.quiet_since):
            return Status.STUCK_FOREVER
        return Status.BUDGET if calm > self.longest or self.steps > granted else Status.OK

    def _move(self) -> None:
        self.walk.move(math.inf)
        self.steps += 1

    def impacts(self, window: ImpactWindow, ledger: Ledger | None = None) -> Samples:
        """Return the impacts that a window keeps; a ledger sums up the whole motion."""
        walk, wanted = self.walk, window.transient + window.keep
        while True:
            ended = self._meet()
            if ledger is not None:
                ledger.meet(walk)
            walk.full = walk.recorded >= wanted
            if ended == Status.OK and not (walk.full and not walk.in_contact):
                ended = self._ending(self.each * wanted)
                if ended == Status.OK:
                    self._move()
                    if ledger is not None:
                        ledger.fly(walk)
                    continue
            break
        kept = walk.impacts[window.transient : wanted]
        impacts, rests = self._impacts(kept), self._rests()
        rests, status = within_impacts(np.column_stack([impacts["periods"], impacts["phase"]]), rests, window, ended)
        at = walk.at
        return self._samples(impacts, rests, status, (at.displacement, at.velocity, at.phase))

    def looks(self, window: LooksWindow) -> Samples:
        """Return the samples of a window of times."""
        walk, (periods, phase), eq = (
            self.walk,
            window.schedule(self.walk.at.periods, self.walk.at.phase),
            self.design.eq,
        )
        granted, rows, ended = self.each * (math.ceil(window.length) + 1), [], Status.OK
        taken, last = 0, (walk.at.displacement, walk.at.velocity, walk.at.phase)
        while taken < len(periods) and ended == Status.OK:
            ended = self._meet()
            if ended not in (Status.INVALID_RESTITUTION, Status.BUDGET):
                ended = Status.BUDGET if self.steps > granted else Status.OK
            if ended != Status.OK:
                break
            self._move()
            flight: Any = walk.flight
            ahead = ((periods[taken:] - flight.begin.periods) + (phase[taken:] - flight.begin.phase)) * eq.period
            ahead = np.maximum(ahead[ahead < flight.time], 0.0)
            if len(ahead):
                rows.append(flight.phase.states(flight.x, ahead)[:, : 2 * eq.n])
                taken += len(ahead)
        states = np.concatenate(rows) if rows else np.empty((0, 2 * eq.n))
        q, v = self._in_front(states[:, : eq.n], phase[:taken]), states[:, eq.n :]
        impacts, rests = self._impacts(walk.impacts), self._rests()
        if taken:
            last = (q[-1], v[-1], phase[taken - 1])
            end = periods[taken - 1] + phase[taken - 1]
            over = impacts["periods"] + impacts["phase"] + impacts["exit_time"] / eq.period
            for name in Contact._fields:
                impacts[name][over > end] = math.nan
            rests[rests[:, 3] + rests[:, 4] > end, 3:] = math.nan
        if ended == Status.OK:
            stays = bool(walk.closed) and self.endings.lasts(walk)
            ended = looks_status(rests[:, 1:], periods[0] + phase[0], stays)
        return self._samples(impacts, rests, ended, last, periods[:taken], phase[:taken], q, v)

    def _in_front(self, q: Floats, phases: Floats) -> Floats:
        """Return coordinates, those that rounding puts beyond a rigid stop moved to it."""
        eq = self.design.eq
        bases = np.array([eq.basis(phase) for phase in phases.tolist()]).reshape(len(q), -1)
        for j in np.flatnonzero(eq.impenetrable):
            depth = np.maximum(q @ eq.directions[j] - bases @ eq.places[j], 0.0)
            q = q - np.outer(depth, eq.kappa[:, j]) / eq.coupling[j, j]
        return q

    def _impacts(self, events: Any) -> dict[str, Any]:
        """Return impacts as arrays; what an unfinished contact comes to is not known."""
        compliant = ~self.design.eq.impenetrable
        pending = [self.walk.contacts[j] for j in self.walk.pushing]
        unfinished = [self.walk.events[index] for index in pending if index is not None]
        names = "periods", "phase", "stop", "velocity", "simultaneous", *Contact._fields
        table = {name: np.array([getattr(event, name) for event in events]) for name in names}
        stops = table["stop"] = table["stop"].astype(np.int64)
        soft = compliant[stops] if len(compliant) else np.zeros(0, bool)
        open_ = np.array([any(event is one for one in unfinished) for event in events], bool)
        for name in Contact._fields:
            table[name] = table[name].astype(float)
            table[name][open_ | (~soft & (name in OF_COMPLIANT))] = math.nan
        return table

    def _rests(self) -> Floats:
        """Return the rests: stop, beginning and end in whole periods and phase, NaN if it has none."""
        rows: list[list[float]] = []
        last: dict[int, list[float]] = {}
        for event in self.walk.events:
            if event.kind == "stick":
                last[event.stop] = [event.stop, event.periods, event.phase, math.nan, math.nan]
                rows.append(last[event.stop])
            elif event.kind == "release":
                last[event.stop][3:] = event.periods, event.phase
        return np.array(rows).reshape(-1, 5)

    def _samples(
        self, impacts: dict[str, Any], rests: Floats, status: Status, last: tuple[Floats, Floats, float], *looks: Floats
    ) -> Samples:
        shapes = self.design.shapes
        periods, phase, q, v = looks or (np.empty(0), np.empty(0), *np.empty((2, 0, len(shapes))))
        return Samples(
            impact_periods=impacts["periods"],
            impact_phase=impacts["phase"],
            impact_stop=impacts["stop"],
            impact_velocity=impacts["velocity"],
            impact_simultaneous=impacts["simultaneous"].astype(bool),
            contacts=Contact(*(impacts[name] for name in Contact._fields)),
            look_periods=periods,
            look_phase=phase,
            look_displacement=q @ shapes.T,
            look_velocity=v @ shapes.T,
            rest_stop=rests[:, 0].astype(np.int64),
            rest_begin=rests[:, 1:3],
            rest_end=rests[:, 3:],
            status=int(status),
            steps=self.steps,
            last_displacement=shapes @ last[0],
            last_velocity=shapes @ last[1],
            last_phase=float(last[2]),
        )
