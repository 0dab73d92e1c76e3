"""Periodic orbits of systems, and their construction from solutions of the equations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model import Model, State
from vibroimpact.model.elements import Contact
from vibroimpact.model.system import ImpactSystem
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.orbit import Orbit, Rest, family_of, phases_of
from vibroimpact.orbits.systems.admissibility import objection
from vibroimpact.orbits.systems.contacts import contacts_of
from vibroimpact.orbits.systems.cycle import Cycle
from vibroimpact.orbits.systems.events import GRAZE, IMPACT, Event
from vibroimpact.orbits.systems.flow import Flow
from vibroimpact.orbits.systems.symmetry import mirror
from vibroimpact.parameters import ENERGY


@dataclass(frozen=True, kw_only=True, repr=False)
class SystemOrbit(Orbit):
    """A period-n impact-p orbit, stable or unstable, of a system with rigid or compliant stops.

    Its `oscillator` is the system. On a compliant stop, an impact is the beginning of a contact. With several rests,
    `stick_phase` and `release_phase` are those of the first rest, and `stuck_time` is the sum.

    Parameters
    ----------
    stops : tuple of str
        Names of the stops struck, in the order of time.
    turns : tuple of float
        Times of these impacts in driving periods, the first in [0, 1).
    impulses : tuple of float
        Impulses of the impacts in N s; on a compliant stop, the integral of its force over the contact.
    start : State
        Coordinates, their rates and time just before the first impact; for an orbit with rests, at a time without
        events.
    half_multipliers : tuple of 2n complex
        Multipliers of the half map (half a cycle, then the mirror) if the orbit is its own mirror image half a cycle
        later; else empty.
    events : tuple of (float, str, str)
        Times in driving periods, kinds and stops of all events in a cycle: "impact", and for compliant stops "let_go",
        when the force has fallen to zero, and "push_again", when the force begins again before the clearance is
        positive.
    pushing : tuple of str
        Stops that push just before the first impact.
    contacts : tuple of Contact
        For each impact, the `impulse` in N s, the `energy_lost` at the stop in J, the `exit_velocity` in m/s and, on a
        compliant stop, `contact_time` (for which it pushes) in s, `peak_force` in N and `penetration` in m, NaN on a
        rigid stop; `exit_time`, `peak_force_time` and `penetration_time` in s from the beginning of the contact.
    rests : tuple of Rest
        Rests at rigid stops: the `stop`, and its `begin` and `end` in driving periods, on the same time axis as
        `turns`. The impacts of a chatter are listed down to 1e-9 V. A cycle with rests is listed from the end of the
        longest rest, at the first of the system's stops that has one.
    neutral : tuple of complex
        Multipliers of a free centre of mass, if masses without a spring to the ground strike one another: 1 for its
        position, and 1, or less with drag, for its drift. They affect no stop and do not count for stability;
        `multipliers` holds the others, the largest first. The drift is the one with which the centre returns to its
        position, if there is one.

    Examples
    --------
    >>> from vibroimpact import Force, ImpactSystem, Stop, find_orbit
    >>> ball = ImpactSystem(mass=1.0, stiffness=0.0, force=Force(omega=10.0, constant=-9.81),
    ...     stops=[Stop(direction=-1, gap=0.0, restitution=0.5, name="table", motion={1: 0.12})])
    >>> orbit = find_orbit(ball)[0]
    >>> orbit.name, orbit.stops, orbit.stable, round(orbit.velocities[0], 9)
    ('period-1 impact-1', ('table',), True, 4.109203191)
    """

    stops: tuple[str, ...] = field()
    turns: tuple[float, ...]
    impulses: tuple[float, ...] = field()
    start: State = field()
    half_multipliers: tuple[complex, ...] = ()
    events: tuple[tuple[float, str, str], ...] = ()
    pushing: tuple[str, ...] = ()
    contacts: tuple[Contact, ...] = ()
    rests: tuple[Rest, ...] = ()
    neutral: tuple[complex, ...] = ()

    @property
    def twin(self) -> SystemOrbit:
        """The mirror image half a driving period later, which is also an orbit of the system if that is symmetric.

        Raises
        ------
        ValueError
            The system is not symmetric; the message says why.
        """
        images, why = mirror(self.system)
        if why:
            raise ValueError(f"the orbit has no twin: its system is {why}")
        start, half, first = self.start, 0.5 * self.system.period, self.turns[0] + 0.5
        image = dict(zip(self.system.stop_names, (self.system.stop_names[at] for at in images), strict=True))
        later = first % 1.0 - self.turns[0]
        place, rate = (tuple(-number for number in part) for part in (start.displacement, start.velocity))
        turns = tuple(turn + later for turn in self.turns)
        rests = tuple(Rest(image[stop], begin + later, end + later) for stop, begin, end in self.rests)
        stick, release, _ = at_rest(rests, self.n_periods, self.system.period)
        return replace(
            self,
            stops=tuple(image[stop] for stop in self.stops),
            turns=turns,
            phases=phases_of(turns),
            start=State(place, rate, start.time + (half if first < 1.0 else -half)),
            events=tuple((turn + later, kind, image[stop]) for turn, kind, stop in self.events),
            pushing=tuple(image[stop] for stop in self.pushing),
            rests=rests,
            stick_phase=stick,
            release_phase=release,
        )

    @property
    def symmetric(self) -> bool:
        """Whether the orbit is its own mirror image half a cycle later."""
        return bool(self.half_multipliers)

    @property
    def energy(self) -> float:
        """Energy in J, kinetic and elastic, if it is constant; else NaN."""
        if self.system.energy_changes:
            return math.nan
        cycle, unknown = cycle_of(self)
        return cycle.flow.energy(unknown[len(cycle.events) :], cycle.pushing)[0] * cycle.flow.omega**2

    def value(self, parameter: str) -> float:
        """Return the value of a parameter of its model, or the "energy" (J) if that is constant."""
        free = parameter == ENERGY.name and not self.system.energy_changes
        return self.energy if free else super().value(parameter)

    def _columns(self) -> dict[str, Sequence[Any]]:
        columns = {"stop": self.stops, **super()._columns()}
        if any(contact.peak_force > 0.0 for contact in self.contacts):
            columns["largest force [N]"] = [contact.peak_force for contact in self.contacts]
            columns["contact time [s]"] = [contact.contact_time for contact in self.contacts]
        return columns

    def _row(self) -> dict[str, Any]:
        return {**super()._row(), "stops": ", ".join(dict.fromkeys(self.stops))}

    @property
    def determinant(self) -> float:
        """Product of the multipliers."""
        if self.sticks:
            return 0.0
        flow, (cycle, unknown) = Flow(self.system), cycle_of(self)
        form = self.system.modal()
        rates = form.viscosity * np.diag(form.mobility)
        lost = float(np.diag(form.damping)[~form.neutral[1]].sum()) * self.period
        for duration, pushing in zip(np.diff(cycle.angles(unknown)), cycle.phases[1:], strict=True):
            lost += float(rates[list(pushing)].sum()) * duration / flow.omega
        struck = zip((self.system.stops[stop].element for stop in cycle.stops), self.velocities, strict=True)
        shrinks = (element.rebound(v) * element.sensitivity(v) for element, v in struck)  # by 1 on a compliant stop
        return float(math.prod(shrinks, start=math.exp(-lost)))


def at_rest(rests: Sequence[Rest], n_periods: int, period: float) -> tuple[float, float, float]:
    """Return the phases at which the first rest in a cycle begins and ends, and the total time at rest in s."""
    if not rests:
        return math.nan, math.nan, 0.0
    _, begin, end = rests[0]
    release = end % 1.0 if end - begin < n_periods else math.nan
    return begin % 1.0, release, sum(rest.end - rest.begin for rest in rests) * period


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


def at_first_contact(orbit: SystemOrbit) -> SystemOrbit:
    """Return an orbit whose impacts all have velocity 0 as the steady motion, one such impact per driving period."""
    cycle, unknown = cycle_of(orbit)
    first = cycle.events[0].stop
    event = Event(first, GRAZE if cycle.flow.compliant[first] else IMPACT)
    steady = Cycle(cycle.flow, 1, (event,))
    return make_orbit(orbit.model, steady, np.append(unknown[:1], unknown[len(cycle.events) :]))


def make_orbit(model: Model, cycle: Cycle, unknown: Floats) -> SystemOrbit:
    """Return the orbit of a solution of a cycle's equations, for a system or the family that makes it."""
    system: ImpactSystem = model.at()
    flow, p, names = cycle.flow, len(cycle.events), system.stop_names
    message = objection(cycle, unknown, names)
    halves: tuple[complex, ...] = ()
    speeds = cycle.speeds(unknown)
    speeds[np.abs(speeds) <= ROUNDING * np.abs(unknown[p:]).max()] = 0.0
    grazes_rigid = any(not flow.compliant[cycle.events[at].stop] for at in np.flatnonzero(speeds == 0.0))
    number, neutral = np.count_nonzero(~flow.neutral), cycle.neutral()
    multipliers = (complex(math.inf), *(0j for _ in range(number - 1))) if grazes_rigid else cycle.multipliers(unknown)
    if cycle.images:
        halves = multipliers
        multipliers, neutral = (tuple(value * value for value in values) for values in (multipliers, neutral))
        speeds, (cycle, unknown) = np.tile(speeds, 2), cycle.whole(unknown)
    contacts = contacts_of(cycle, unknown, speeds)
    angles, state = unknown[: len(cycle.events)], flow.physical @ unknown[len(cycle.events) :]
    velocities = speeds[cycle.impacts] * flow.lengths[list(cycle.stops)] * flow.omega
    turns = (angles / TURN - math.floor(angles[0] / TURN)).tolist()
    return SystemOrbit(
        oscillator=system,
        n_periods=cycle.n_periods,
        n_impacts=len(cycle.impacts),
        stops=tuple(names[stop] for stop in cycle.stops),
        turns=tuple(turns[at] for at in cycle.impacts),
        velocities=tuple(velocities.tolist()),
        phases=phases_of(turns[at] for at in cycle.impacts),
        impulses=tuple(contact.impulse for contact in contacts),
        start=State(state[: flow.n].tolist(), state[flow.n :].tolist(), turns[0] * system.period),
        multipliers=multipliers,
        half_multipliers=halves,
        admissible=not message,
        message=message,
        family=family_of(model),
        events=tuple((turn, kind, names[stop]) for turn, (stop, kind) in zip(turns, cycle.events, strict=True)),
        pushing=tuple(names[stop] for stop in cycle.pushing),
        contacts=contacts,
        neutral=neutral,
    )
