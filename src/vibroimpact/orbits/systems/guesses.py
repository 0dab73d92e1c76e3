"""Initial guesses of Newton's method for orbits of systems: an orbit, times of impacts, or a simulated motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.matrices import ROUNDING
from vibroimpact.orbits.cycle import Cycle, Leg, cycle_of
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import IMPACT, LET_GO, PUSH_AGAIN, Event, Pushing
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.results import Guess
from vibroimpact.orbits.systems.admissibility import comes_to_rest, courses
from vibroimpact.orbits.systems.sampling import stages
from vibroimpact.parameters import invalid, real_number, several

CHUNK = 15.0  # radians of the fastest rate per block of samples
HALVINGS = 50
MOST_EVENTS = 1000
SHARE = 0.4  # of the time to the next event: longest guess for a contact


def beginning(
    flow: Flow, n_periods: int, stops: tuple[int, ...], images: tuple[int, ...], guess: Guess
) -> tuple[Cycle, Floats]:
    """Return the cycle and the unknown from which Newton's method starts."""
    orbit, parts = guess.orbit, 2 if images and guess.symmetric else 1
    if orbit is not None and len(orbit.system.mass) == flow.n:
        cycle, unknown = cycle_of(orbit)
        state = cycle.flow.physical @ unknown[len(cycle.events) :]
        p = len(cycle.events) // parts
        cycle = replace(cycle, flow=flow, n_periods=n_periods, events=cycle.events[:p], images=images)
        if cycle.stops == stops:
            return cycle, np.append(unknown[:p], np.linalg.solve(flow.physical, state))
    elif guess.only_state:
        cycle_and_unknown = traced(flow, n_periods, guess.state, stops)
        if cycle_and_unknown is None:
            raise invalid("near", guess.state, f"a state from which these stops are struck in {n_periods} periods")
        return cycle_and_unknown
    if guess.none:
        raise invalid("near", None, "an orbit or the times of the impacts", "orbits of several impacts need a guess")
    if orbit is not None:
        angles = TURN * np.array(orbit.turns[: orbit.n_impacts // parts])
    else:
        times = several("near", guess.near, "an orbit or times")
        angles = flow.omega * np.array([real_number(f"near[{i}]", time) for i, time in enumerate(times)])
        angles -= TURN * np.floor(angles[:1] / TURN)  # rounding of later angles would stay in the solution
    if len(angles) != len(stops):
        raise invalid("near", guess.near, f"one time for each of the {len(stops)} stops struck")
    length = TURN * n_periods * (0.5 if images else 1.0)
    if not (np.diff(np.append(angles, angles[0] + length)) > 0.0).all():
        raise invalid("near", guess.near, f"times in order, within {length / flow.omega:.6g} s")
    events, angles = _with_releases(flow, stops, angles, angles[0] + length)
    cycle = Cycle(flow, n_periods, events, images)
    return cycle, _from_angles(cycle, angles)


class Occurrence(NamedTuple):
    """An event of a motion: the event, its driving angle, the state just before it, and the stops that pushed then."""

    event: Event
    angle: float
    x: Floats
    pushing: Pushing


def traced(flow: Flow, n_periods: int, state: Any, stops: tuple[int, ...] | int) -> tuple[Cycle, Floats] | None:
    """Return the cycle in which the motion from a state strikes these stops, hardest impact first, and its unknown.

    A number of impacts in place of stops allows any stops. None if the motion does not strike them, or in a time too
    far from the cycle's for Newton's method.
    """
    number = stops if isinstance(stops, int) else len(stops)
    x = np.linalg.solve(flow.physical, np.append(state.displacement, state.velocity))
    angle = state.time * flow.omega
    passed: list[Occurrence] = []
    for occurrence in occurrences(flow, x, angle, angle + TURN * (2 * n_periods + 1)):
        if passed or occurrence.event.kind == IMPACT:
            passed.append(occurrence)
        if sum(each.event.kind == IMPACT for each in passed) > number:
            break
    else:
        return None
    *events, again = passed
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


def occurrences(flow: Flow, x: Floats, angle: float, last: float) -> Iterator[Occurrence]:
    """Yield the events of the motion from a state at an angle, up to another angle or a rest, at most `MOST_EVENTS`."""
    pushing, last_stop, number = flow.pressed(x, flow.drive(angle)), -1, 0
    age = 0.0  # since the last event
    while angle <= last and number <= MOST_EVENTS:
        longest = CHUNK / stages(flow, pushing, age)[-1].fastest
        leg = Leg(flow, np.append(x, flow.drive(angle)), longest, pushing, age)
        occurrence = _next(leg, angle, last_stop)
        if occurrence is None:
            x, angle, last_stop = flow.fly(x, angle, angle + longest, pushing), angle + longest, -1
            age += longest
            continue
        age = 0.0
        yield occurrence
        event, x, angle, number = occurrence.event, occurrence.x, occurrence.angle, number + 1
        x, last_stop = flow.struck(event.stop, x, flow.drive(angle)), event.stop
        pushing = flow.after(event, pushing)
        if comes_to_rest(flow, event.stop, x, flow.drive(angle), pushing):
            return


def _next(leg: Leg, angle: float, last_stop: int) -> Occurrence | None:
    """Return the first event in a leg that begins at an angle; the last event was on `last_stop`."""
    flow, pushing, first, stop = leg.flow, leg.pushing, leg.duration, None
    for course in courses(leg, last_stop):
        heights = course.gaps
        if course.stop == last_stop or heights[0] < 0.0:
            heights[0] = max(heights[0], 0.0)
        falls = np.flatnonzero((heights[:-1] >= 0.0) & (heights[1:] < 0.0))
        ends = np.append(course.places[course.lowest < 0.0], course.angles[falls + 1])
        if not len(ends):
            continue
        end, level = float(ends.min()), _level(leg, course.stop)
        begin = float(course.angles[int(np.searchsorted(course.angles, end)) - 1])
        at = _crossing(level, begin, end) if begin < first else first
        if at < first:
            first, stop = at, course.stop
    if stop is None:
        return None
    before = flow.fly(leg.start[: 2 * flow.n], angle, angle + first, pushing)
    kind = LET_GO if stop in pushing else IMPACT
    if kind == IMPACT and flow.clearance(stop, before, flow.drive(angle + first))[1] > 0.0:
        kind = PUSH_AGAIN
    return Occurrence(Event(stop, kind), angle + first, before, pushing)


def _level(leg: Leg, stop: int) -> Callable[[float], float]:
    """Return the function of the angle since a leg's begin that falls through zero at a stop's next event."""
    row, pull = (np.concatenate(leg.flow.watched(Event(stop, kind))) for kind in (IMPACT, LET_GO))
    size = 2 * leg.flow.n

    def level(angle: float) -> float:
        grown, driven = leg.flow.over(angle, leg.pushing)
        x, z = leg.start[:size], leg.start[size:]
        later = np.concatenate([x + grown @ x + driven @ z, leg.flow.rotation(angle) @ z])
        return float(-pull @ later if stop in leg.pushing else max(row @ later, pull @ later))

    return level


def _crossing(level: Callable[[float], float], low: float, high: float) -> float:
    """Return the angle at which a level that is negative at `high` falls through zero: halving, then Illinois."""
    above, below, fell = 0.0, level(high), True  # the level at `low` counts once it is known to be positive
    if below >= 0.0:  # a touch, which rounding made a crossing
        return high
    close = ROUNDING * abs(below)
    for _ in range(HALVINGS):
        middle = low + (above / (above - below) if above > 0.0 else 0.5) * (high - low)
        if not low < middle < high:
            break
        value = level(middle)
        if abs(value) <= close:
            return middle
        if value < 0.0:
            high, below, above, fell = middle, value, above * (0.5 if fell else 1.0), True
        else:
            low, above, below, fell = middle, value, below * (1.0 if fell else 0.5), False
    return high


def _from_angles(cycle: Cycle, angles: Floats) -> Floats:
    """Return the unknown whose state comes nearest to an orbit with impacts at these angles.

    At fixed angles the residuals are linear in the state.
    """
    unknown = np.append(angles, np.zeros(2 * cycle.flow.n))
    misses, matrix = cycle.linearised(unknown)
    unknown[len(angles) :] = -np.linalg.lstsq(matrix[:, len(angles) :], misses, rcond=None)[0]
    return unknown


def _with_releases(flow: Flow, stops: tuple[int, ...], angles: Floats, end: float) -> tuple[tuple[Event, ...], Floats]:
    """Return the events of contacts that each last half a period of a mass on the stop's spring, or no time.

    `end` is the angle of the first impact of the next cycle.
    """
    events: list[tuple[float, Event]] = []
    for stop, touch, after in zip(stops, angles, [*angles[1:], end], strict=True):
        lasting = min(np.pi / flow.phase((stop,)).fastest, SHARE * (after - touch))
        events += zip((touch, touch + lasting), flow.contact(stop), strict=False)
    return tuple(event for _, event in events), np.array([angle for angle, _ in events])
