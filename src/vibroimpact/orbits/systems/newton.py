"""Newton's method for the equations of a cycle of a system, and where to begin it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.search import CLOSE, MOST, SINGULAR, Solved
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
    """Return the solution that damped Newton's method reaches: steps are halved while they raise the misses."""
    p, unknown = len(cycle.events), np.array(start, dtype=float)
    unknown[p:][cycle.flow.neutral] = 0.0  # where a free centre is must not set the size
    size = float(np.abs(unknown[p:]).max()) or 1.0
    paces = [cycle.flow.phase(pushing).fastest for pushing in cycle.phases]
    quick = [cycle.flow.phase().fastest / max(pair) for pair in pairwise(paces)]  # 1 where no stop gives
    columns = np.append(quick, np.full(len(unknown) - p, size))
    misses, matrix = cycle.linearised(unknown)
    for _ in range(MOST):
        scaled = matrix * columns / size
        if not np.isfinite(scaled).all():
            break
        correction = np.linalg.lstsq(scaled, misses / size, rcond=None)[0]
        largest, part = float(np.abs(correction).max()), 1.0
        while part > 1e-3:
            trial = unknown - part * columns * correction
            left, slope = cycle.linearised(trial)
            in_order = bool((np.diff(cycle.angles(trial)) > 0.0).all())
            if largest < CLOSE or (in_order and np.abs(left).max() < np.abs(misses).max()):
                break
            part *= 0.5
        else:
            break
        unknown, misses, matrix = trial, left, slope
        if largest < CLOSE:
            return Solved(unknown, in_order, bool(np.linalg.cond(scaled) > SINGULAR))
    return Solved(unknown, False, bool(not np.isfinite(matrix).all() or np.linalg.cond(matrix * columns / size) > 1e6))


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
