"""Newton's method for the equations of a cycle of a system, and where to begin it."""

from __future__ import annotations

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits import newton
from vibroimpact.orbits.newton import Solved
from vibroimpact.orbits.systems.cycle import Cycle
from vibroimpact.orbits.systems.events import IMPACT, LET_GO, Event
from vibroimpact.orbits.systems.flow import Flow

LEAST = 0.4  # of the time to the next event: a contact is guessed to be that long at most


def from_angles(cycle: Cycle, angles: Floats) -> Floats:
    """Return the unknown with the state that comes nearest to an orbit with impacts at these angles.

    At fixed angles the misses are linear in the state.
    """
    unknown = np.append(angles, np.zeros(2 * cycle.flow.n))
    misses, matrix = cycle.linearised(unknown)
    unknown[len(angles) :] = -np.linalg.lstsq(matrix[:, len(angles) :], misses, rcond=None)[0]
    return unknown


def solve(cycle: Cycle, start: Floats) -> Solved:
    """Return the solution that damped Newton's method reaches."""
    unknown = np.array(start, dtype=float)
    unknown[len(cycle.events) :][cycle.flow.neutral] = 0.0  # where a free centre is must not set the size
    return newton.solve(cycle, unknown)


def with_releases(flow: Flow, stops: tuple[int, ...], angles: Floats, end: float) -> tuple[tuple[Event, ...], Floats]:
    """Return the events of impacts and of the ends of their contacts, if each lasts half a turn of its stop's spring.

    `end` is the angle of the first impact of the next cycle.
    """
    events, times = [], []
    for stop, begin, after in zip(stops, angles, [*angles[1:], end], strict=True):
        events.append(Event(stop, IMPACT))
        times.append(begin)
        if flow.compliant[stop]:
            events.append(Event(stop, LET_GO))
            times.append(begin + min(np.pi / flow.phase((stop,)).fastest, LEAST * (after - begin)))
    return tuple(events), np.array(times)
