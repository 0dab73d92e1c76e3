r"""All orbits with one contact of a stop that gives in a cycle, or one in each half of a symmetric one.

At a given duration tau of the contact everything is linear: with the flows of the contact and of the flight after it,
the state x where contact begins follows from 2n equations, and

    u = 0 where it begins,    force = 0 where it ends

are trigonometric polynomials in its driving angle. At the angles at which the first holds and u falls the force at the
end is a function of tau, and where it changes sign Newton's method for the orbit begins. So no guess is needed, and
unstable orbits are found, too. Durations are looked at on a grid, finer than a tenth of a radian of the fastest rate in
contact up to one turn of it, then ever coarser, and angles on one of 256 a turn: pairs of orbits between two of either
are missed (of angles those that are about to graze), as are contacts in which a stop pushes for many such turns.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.systems.admissibility import Leg, courses
from vibroimpact.orbits.systems.cycle import Cycle
from vibroimpact.orbits.systems.events import IMPACT, LET_GO, Event
from vibroimpact.orbits.systems.newton import solve

FINE = 0.1  # radians of the fastest rate in contact
COARSE = 1.03  # ratio of durations beyond one turn of it
NEAR = 0.5  # radians: angles at neighbouring durations that belong together
SAME = 1e-8  # of the orbit's size
ANGLES = 256  # a turn of the highest order at which contact may begin


def one_contact(cycle: Cycle) -> tuple[list[tuple[Cycle, Floats]], str]:
    """Return the cycles of all orbits with one contact in a cycle, their unknowns, and why there are none."""
    ((stop, _),) = cycle.events
    made = Cycle(cycle.flow, cycle.n_periods, (Event(stop, IMPACT), Event(stop, LET_GO)), cycle.images)
    found: list[Floats] = []
    for start in _starts(made, stop):
        solved = solve(made, start)
        if solved.converged and not _pulls(made, solved.z, stop):
            apart = [np.abs(_on_circle(solved.z, made) - _on_circle(known, made)).max() for known in found]
            if not apart or min(apart) > SAME * np.abs(solved.z[2:]).max():
                solved.z[:2] -= TURN * np.floor(solved.z[0] / TURN)
                found.append(solved.z)
    what = "half a cycle" if cycle.images else f"{cycle.n_periods} driving period{'s' if cycle.n_periods > 1 else ''}"
    return [(made, z) for z in found], "" if found else f"no contact was found that repeats after {what}"


def _on_circle(z: Floats, cycle: Cycle) -> Floats:
    size = np.abs(z[2:]).max()
    return np.concatenate([size * np.cos(z[:2]), size * np.sin(z[:2]), z[2:]])


def _pulls(cycle: Cycle, z: Floats, stop: int) -> bool:
    """Return whether the force falls below zero before contact ends: that is no orbit of any system."""
    begin = cycle.flow.drive(z[0])
    leg = Leg(cycle.flow, np.append(z[2:], begin), float(z[1] - z[0]), (stop,))
    course = next(course for course in courses(leg) if course.stop == stop)
    least = np.append(course.gaps[1:-1], course.lowest).min()
    return bool(least < -ROUNDING * course.size)


def _durations(cycle: Cycle, stop: int) -> Floats:
    fastest = cycle.flow.phase((stop,)).fastest
    turn = min(TURN / fastest, cycle.length)
    fine = np.arange(FINE / fastest, turn, FINE / fastest)
    coarse = turn * COARSE ** np.arange(max(0.0, np.log(cycle.length / turn) / np.log(COARSE)))
    both = np.concatenate([fine, coarse, cycle.length - coarse])
    return np.unique(both[(both > 0.0) & (both < cycle.length)])


def _starts(cycle: Cycle, stop: int) -> Iterator[Floats]:
    """Yield where Newton's method begins: between durations at which the force at the end changes sign."""
    before: list[tuple[float, float, Floats]] = []
    durations = _durations(cycle, stop)
    for last, duration, here in zip([0.0, *durations], durations, _contacts(cycle, stop, durations), strict=False):
        for angle, level, x in here:
            near = [other for other in before if abs((other[0] - angle + 0.5 * TURN) % TURN - 0.5 * TURN) < NEAR]
            for old, was, y in sorted(near, key=lambda other: abs(np.sin(0.5 * (other[0] - angle))))[:1]:
                if (was < 0.0) != (level < 0.0):
                    share = was / (was - level)
                    turned = (angle - old + 0.5 * TURN) % TURN - 0.5 * TURN
                    begin = old + share * turned
                    end = begin + last + share * (duration - last)
                    yield np.concatenate([[begin, end], y + share * (x - y)])
        before = here


def _contacts(cycle: Cycle, stop: int, durations: Floats) -> list[list[tuple[float, float, Floats]]]:
    """Return the angles at which contacts of each duration begin, their forces' levels at the end, and the states."""
    flow, n = cycle.flow, 2 * cycle.flow.n
    grown, driven = flow.over(durations, (stop,))
    flown, blown = flow.over(cycle.length - durations)
    turned = flow.rotation(durations)
    whole, load = grown + flown + flown @ grown, driven + flown @ driven + blown @ turned
    closing = cycle.pinned((cycle.sign - 1.0) * np.eye(n) - whole, np.eye(n))
    states = _solutions(closing, cycle.pinned(load, np.zeros_like(load)))
    ends = states + grown @ states + driven
    (begin, bound), (end, force) = map(flow.watched, cycle.events)
    rates = -flow.beta[stop] @ states[:, flow.n :] + flow.bounds[stop] @ flow.turning
    levels = end @ ends + force @ turned
    angles = np.linspace(0.0, TURN, ANGLES * int(flow.orders.max(initial=1.0)) + 1)
    heights = (begin @ states + bound) @ flow.drive(angles).T
    found: list[list[tuple[float, float, Floats]]] = [[] for _ in durations]
    for i, j in np.argwhere((heights[:, :-1] < 0.0) != (heights[:, 1:] < 0.0)).tolist():
        low, high = heights[i, j : j + 2]
        angle = angles[j] + low / (low - high) * (angles[j + 1] - angles[j])
        z = flow.drive(angle)
        if rates[i] @ z < 0.0:
            found[i].append((float(angle), float(levels[i] @ z), states[i] @ z))
    return found


def _solutions(matrices: Floats, loads: Floats) -> Floats:
    """Return the solutions of many linear equations, NaN where there is none."""
    singular = np.linalg.det(matrices) == 0.0
    found = np.linalg.solve(np.where(singular[:, None, None], np.eye(matrices.shape[-1]), matrices), loads)
    return np.where(singular[:, None, None], np.nan, found)
