"""Construct orbits from solutions of the equations of a cycle."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model import Model, State
from vibroimpact.model.system import ImpactSystem
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.cycle import Cycle, cycle_of
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import GRAZE, IMPACT, Event
from vibroimpact.orbits.orbit import Orbit, family_of, phases_of
from vibroimpact.orbits.systems.admissibility import objection
from vibroimpact.orbits.systems.contacts import contacts_of


def at_first_contact(orbit: Orbit) -> Orbit:
    """Return an orbit whose impacts all have velocity 0 as the steady motion, one such impact per driving period."""
    cycle, unknown = cycle_of(orbit)
    first = cycle.events[0].stop
    event = Event(first, GRAZE if cycle.flow.compliant[first] else IMPACT)
    steady = Cycle(cycle.flow, 1, (event,))
    return make_orbit(orbit.model, steady, np.append(unknown[:1], unknown[len(cycle.events) :]))


def _squared(value: complex) -> complex:
    """Return the square of a multiplier, which is infinite at a graze."""
    return value * value if math.isfinite(value.real) else value


def make_orbit(model: Model, cycle: Cycle, unknown: Floats) -> Orbit:
    """Return the orbit of a solution of a cycle's equations, for a system or the family that makes it."""
    system: ImpactSystem = model.at()
    flow, p, names = cycle.flow, len(cycle.events), system.stop_names
    message = objection(cycle, unknown)
    halves: tuple[complex, ...] = ()
    speeds = cycle.speeds(unknown)
    speeds[np.abs(speeds) <= ROUNDING * np.abs(unknown[p:]).max()] = 0.0
    grazes_rigid = any(not flow.compliant[cycle.events[at].stop] for at in np.flatnonzero(speeds == 0.0))
    number, neutral = np.count_nonzero(~flow.neutral), cycle.neutral()
    multipliers = (complex(math.inf), *(0j for _ in range(number - 1))) if grazes_rigid else cycle.multipliers(unknown)
    if cycle.images:
        halves = multipliers
        multipliers, neutral = (tuple(map(_squared, values)) for values in (multipliers, neutral))
        speeds, (cycle, unknown) = np.tile(speeds, 2), cycle.whole(unknown)
    angles, state = unknown[: len(cycle.events)], flow.physical @ unknown[len(cycle.events) :]
    velocities = speeds[cycle.impacts] * flow.lengths[list(cycle.stops)] * flow.omega
    turns = (angles / TURN - math.floor(angles[0] / TURN)).tolist()
    return Orbit(
        oscillator=system,
        n_periods=cycle.n_periods,
        n_impacts=len(cycle.impacts),
        stops=tuple(names[stop] for stop in cycle.stops),
        turns=tuple(turns[at] for at in cycle.impacts),
        velocities=tuple(velocities.tolist()),
        phases=phases_of(turns[at] for at in cycle.impacts),
        start=State(state[: flow.n].tolist(), state[flow.n :].tolist(), turns[0] * system.period),
        multipliers=multipliers,
        half_multipliers=halves,
        admissible=not message,
        message=message,
        family=family_of(model, system),
        events=tuple((turn, kind, names[stop]) for turn, (stop, kind) in zip(turns, cycle.events, strict=True)),
        pushing=tuple(names[stop] for stop in cycle.pushing),
        contacts=contacts_of(cycle, unknown, speeds),
        neutral=neutral,
    )
