"""Construct orbits from solutions of the equations of a cycle, with the effects of their impacts on the stops."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model import Model, State
from vibroimpact.model.elements import Contact
from vibroimpact.model.system import ImpactSystem
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.cycle import Cycle, Leg, cycle_of
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import GRAZE, IMPACT, Event
from vibroimpact.orbits.orbit import Orbit, family_of, phases_of
from vibroimpact.orbits.systems.admissibility import clearances, objection
from vibroimpact.orbits.systems.sampling import Samples, pulls, sampled, turning_points

NODES = 8  # of Gauss-Legendre quadrature over one stride of the samples: exact to rounding


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


def contacts_of(cycle: Cycle, unknown: Floats, speeds: Floats) -> tuple[Contact, ...]:
    """Return the effect of each impact of a cycle: impulses, and on compliant stops forces, depths and losses.

    The speeds at its events are given.
    """
    flow, contacts = cycle.flow, []
    for at in cycle.impacts:
        stop = cycle.events[at].stop
        if flow.compliant[stop]:
            contacts.append(_on_compliant(cycle, unknown, at))
        else:
            r, speed = float(flow.rebound(stop, -speeds[at])[0]), float(speeds[at] * flow.omega)
            length = float(flow.lengths[stop])
            impulse, velocity = (1.0 + r) * speed / length, speed * length
            ends = {"exit_velocity": r * velocity, "exit_time": 0.0}
            contacts.append(Contact(impulse, energy_lost=0.5 * (1.0 - r) * velocity * impulse, **ends))
    return tuple(contacts)


def _on_compliant(cycle: Cycle, unknown: Floats, at: int) -> Contact:
    """Return the sums over the legs of one contact."""
    flow, struck = cycle.flow, cycle.events[at].stop
    time = impulse = lost = since = ended = speed = 0.0
    force = depth = 0.0, 0.0  # the least of what pulls, of the clearance, and when
    for stop, leg in _legs(cycle, unknown, at):
        for samples in sampled(leg) if stop in leg.pushing else ():
            (row,) = samples.series(clearances(flow)[[stop]])
            pull = pulls(row, flow.lag(stop))
            nodes, weights = np.polynomial.legendre.leggauss(NODES)
            nodes, weights = 0.5 * samples.step * (nodes + 1.0), 0.5 * samples.step * weights
            slopes, pulling, gaps = row[1:] * np.arange(1.0, len(row))[:, None], samples.along(pull), samples.along(row)
            pulled = np.polynomial.polynomial.polyval(nodes, pulling[:, :-1])
            impulse -= float((pulled @ weights).sum())
            if flow.lag(stop):
                rates = np.polynomial.polynomial.polyval(nodes, samples.along(slopes)[:, :-1])
                lost += float(((pulled * rates) @ weights).sum())
            force, depth = (
                min(force, _least(pull, pulling, samples, since)),
                min(depth, _least(row, gaps, samples, since)),
            )
            time, ended, speed = time + samples.angles[-1] - samples.angles[0], since + samples.angles[-1], gaps[1, -1]
        since += leg.duration
    length, omega = float(flow.lengths[struck]), flow.omega
    unit = float(flow.stiffness[struck]) * (1.0 + flow.lag(struck)) * omega  # of impulses over the length
    whole = impulse * unit / length, time / omega, -force[0] * unit * omega / length, -depth[0] * length
    ends = length * omega * speed, ended / omega, force[1] / omega, depth[1] / omega
    return Contact(*map(float, (*whole, unit * omega * lost, *ends)))


def _least(form: Floats, along: Floats, samples: Samples, since: float) -> tuple[float, float]:
    """Return the least value of a linear form on a leg that begins at an angle `since` an impact, and its angle."""
    places, lowest = turning_points(form, samples, along)
    values, angles = np.append(along[0], lowest), np.append(samples.angles, places)
    at = values.argmin()
    return float(values[at]), since + float(angles[at])


def _legs(cycle: Cycle, unknown: Floats, at: int) -> Iterator[tuple[int, Leg]]:
    """Yield the legs from an impact to the next on the same stop, and the stop (its image in the mirrored half)."""
    p, stop = len(cycle.events), cycle.events[at].stop
    for i in range(at, at + p):
        if i == p and cycle.images:
            stop = cycle.images[stop]
        if i > at and cycle.events[i % p] == (stop, IMPACT):
            return
        yield stop, cycle.leg(unknown, i % p)
