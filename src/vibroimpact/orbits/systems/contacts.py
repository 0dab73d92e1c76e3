"""Effects of the impacts of a cycle on the stops: impulses, and on compliant stops forces, depths and losses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model.elements import Contact
from vibroimpact.orbits.cycle import Cycle, Leg
from vibroimpact.orbits.events import IMPACT
from vibroimpact.orbits.systems.admissibility import clearances
from vibroimpact.orbits.systems.sampling import Samples, pulls, sampled, turning_points

NODES = 8  # of Gauss-Legendre quadrature over one stride of the samples: exact to rounding


def contacts_of(cycle: Cycle, unknown: Floats, speeds: Floats) -> tuple[Contact, ...]:
    """Return the effect of each impact of a cycle, from the speeds at its events."""
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
