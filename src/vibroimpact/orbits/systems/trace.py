"""Follow a system from a state, event by event, to where Newton's method for an orbit begins."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.systems.admissibility import Leg, clearances, courses, pulls
from vibroimpact.orbits.systems.cycle import Cycle
from vibroimpact.orbits.systems.events import IMPACT, LET_GO, PUSH_AGAIN, Event, Pushing
from vibroimpact.orbits.systems.flow import Flow

CHUNK = 15.0  # radians of the fastest rate that are looked at at once
HALVINGS = 50
MOST = 1000  # events


class Met(NamedTuple):
    """An event of a motion: which, at which driving angle, the state just before it, and what pushed then."""

    event: Event
    angle: float
    x: Floats
    pushing: Pushing


def pressed(flow: Flow, x: Floats, z: Floats) -> Pushing:
    """Return the stops that push in a state: compliant ones that are pressed in and do not pull."""
    found = []
    for stop in np.flatnonzero(flow.compliant).tolist():
        u, rate, _ = flow.clearance(stop, x, z)
        if u < 0.0 and u + flow.lag(stop) * rate < 0.0:
            found.append(stop)
    return tuple(found)


def cycle_from(
    flow: Flow, n_periods: int, x: Floats, angle: float, stops: tuple[int, ...] | int
) -> tuple[Cycle, Floats] | None:
    """Return the cycle in which a motion from a state strikes these stops in turn, the hardest first, and its unknown.

    Of a number of impacts, whichever stops they are on. None if it does not, or not nearly as long after as Newton's
    method may mend.
    """
    number = stops if isinstance(stops, int) else len(stops)
    met: list[Met] = []
    pushing, last, left = pressed(flow, x, flow.drive(angle)), angle + TURN * (2 * n_periods + 1), -1
    while sum(each.event.kind == IMPACT for each in met) <= number:
        if angle > last or len(met) > MOST:
            return None
        longest = CHUNK / flow.phase(pushing).fastest
        found = _next(flow, x, angle, longest, pushing, left)
        if found is None:
            x, angle, left = flow.fly(x, angle, angle + longest, pushing), angle + longest, -1
            continue
        if met or found.event.kind == IMPACT:
            met.append(found)
        x, angle, left = found.x, found.angle, found.event.stop
        x, pushing = flow.struck(left, x, flow.drive(angle)), found.event.then(pushing, flow.compliant.tolist())
    *events, again = met
    cycle = Cycle(flow, n_periods, tuple(each.event for each in events), (), events[0].pushing)
    if abs(again.angle - events[0].angle - cycle.length) > 0.1 or again.event != events[0].event:
        return None
    unknown = np.append([each.angle for each in events], events[0].x)
    speeds, turns = cycle.speeds(unknown), range(number)
    fitting = [
        cycle.impacts[turn]
        for turn in turns
        if isinstance(stops, int) or cycle.stops[turn:] + cycle.stops[:turn] == stops
    ]
    if not fitting:
        return None
    cycle, unknown = cycle.rotated(unknown, max(fitting, key=lambda at: speeds[at]))
    unknown[: len(events)] -= TURN * np.floor(unknown[0] / TURN)
    return cycle, unknown


def _next(flow: Flow, x: Floats, angle: float, longest: float, pushing: Pushing, left: int) -> Met | None:
    """Return the next event of a motion within an angle; the last one was of the stop `left`."""
    leg = Leg(flow, np.append(x, flow.drive(angle)), longest, pushing)
    first, which = longest, None
    for course in courses(leg):
        heights, step = course.gaps, float(course.angles[1])
        if course.stop == left or heights[0] < 0.0:
            heights[0] = max(heights[0], 0.0)
        falls = np.flatnonzero((heights[:-1] >= 0.0) & (heights[1:] < 0.0))
        ends = np.append(course.places[course.lowest < 0.0], course.angles[falls + 1])
        if not len(ends) or ends.min() - step >= first:
            continue
        end, level = float(ends.min()), _level(leg, course.stop)
        begin = float(course.angles[int(np.searchsorted(course.angles, end)) - 1])
        at = _crossing(level, begin, end)
        if at < first:
            first, which = at, course.stop
    if which is None:
        return None
    there = flow.fly(x, angle, angle + first, pushing)
    kind = LET_GO if which in pushing else IMPACT
    if kind == IMPACT and flow.clearance(which, there, flow.drive(angle + first))[1] > 0.0:
        kind = PUSH_AGAIN
    return Met(Event(which, kind), angle + first, there, pushing)


def _level(leg: Leg, stop: int) -> Callable[[float], float]:
    """Return the level above zero until a stop has its next event, as a function of the angle since a leg's begin."""
    row = clearances(leg.flow, leg.pushing)[stop]
    pull, size = pulls(row, leg.flow.lag(stop))[0], 2 * leg.flow.n

    def level(angle: float) -> float:
        grown, driven = leg.flow.over(angle, leg.pushing)
        x, z = leg.start[:size], leg.start[size:]
        there = np.concatenate([x + grown @ x + driven @ z, leg.flow.rotation(angle) @ z])
        return float(-pull @ there if stop in leg.pushing else max(row[0] @ there, pull @ there))

    return level


def _crossing(level: Callable[[float], float], low: float, high: float) -> float:
    """Return the angle at which a level that is below zero at `high` gets there."""
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if level(middle) < 0.0 else (middle, high)
    return high
