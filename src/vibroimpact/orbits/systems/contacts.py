"""Effects of the impacts of a cycle on the stops: impulses, and on compliant stops forces, depths and losses."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model.elements import Contact
from vibroimpact.orbits.systems.admissibility import clearances
from vibroimpact.orbits.systems.cycle import Cycle, Leg
from vibroimpact.orbits.systems.events import IMPACT
from vibroimpact.orbits.systems.sampling import pulls, sampled, turning_points

NODES = 8  # of Gauss-Legendre quadrature over one stride of the samples: exact to rounding


def contacts_of(cycle: Cycle, unknown: Floats, speeds: Floats) -> tuple[Contact, ...]:
    """Return the effect of each impact of a cycle, from the speeds at its events."""
    flow, contacts = cycle.flow, []
    for at in cycle.impacts:
        stop = cycle.events[at].stop
        if flow.compliant[stop]:
            contacts.append(_on_compliant(cycle, unknown, at))
        else:
            r, speed = flow.rebound(stop, -speeds[at])[0], speeds[at] * flow.omega
            impulse = (1.0 + r) * speed / flow.lengths[stop]
            lost = 0.5 * (1.0 - r) * speed * flow.lengths[stop] * impulse
            contacts.append(Contact(float(impulse), lost=float(lost)))
    return tuple(contacts)


def _on_compliant(cycle: Cycle, unknown: Floats, at: int) -> Contact:
    """Return the sums over the legs of one contact."""
    flow, struck = cycle.flow, cycle.events[at].stop
    time = impulse = lost = force = depth = 0.0
    for stop, leg in _legs(cycle, unknown, at):
        if stop not in leg.pushing:
            continue
        time += leg.duration
        for samples in sampled(leg):
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
            force = -min(-force, pulling[0].min(), turning_points(pull, samples, pulling[1])[1].min(initial=math.inf))
            depth = -min(-depth, gaps[0].min(), turning_points(row, samples, gaps[1])[1].min(initial=math.inf))
    length, omega = float(flow.lengths[struck]), flow.omega
    unit = float(flow.stiffness[struck]) * (1.0 + flow.lag(struck)) * omega  # of impulses over the length
    impulse, force = unit * impulse / length, unit * omega * force / length
    return Contact(impulse, time / omega, float(force), float(length * depth), unit * omega * lost)


def _legs(cycle: Cycle, unknown: Floats, at: int) -> Iterator[tuple[int, Leg]]:
    """Yield the legs from an impact to the next on the same stop, and the stop (its image in the mirrored half)."""
    p, stop = len(cycle.events), cycle.events[at].stop
    for i in range(at, at + p):
        if i == p and cycle.images:
            stop = cycle.images[stop]
        if i > at and cycle.events[i % p] == (stop, IMPACT):
            return
        yield stop, cycle.leg(unknown, i % p)
