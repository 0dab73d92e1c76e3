"""Check that a system can move along an orbit: the clearances and forces of all stops between its events."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.cycle import Cycle, Leg
from vibroimpact.orbits.equations import STRIDE, TURN
from vibroimpact.orbits.events import PUSH_AGAIN, Nearest, Pushing
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.systems.sampling import Samples, evenly, places_of, pulls, sampled, turning_points

MOST_SAMPLES = 1 << 16  # samples of one leg, at most
GLANCES = 64  # places in each leg at which most inadmissible orbits are far beyond a stop
FAR = 1e-6  # of its size: a deeper penetration is no rounding, and no solution's error


def objection(cycle: Cycle, unknown: Floats) -> str:
    """Return the reason why the system cannot move along this orbit; empty if it can.

    Each leg is sampled every 0.15 rad of the fastest rate that has not decayed. Power series give every minimum between
    samples of every clearance, and of the force of every pushing stop. A minimum above -1e-12 of its size does not
    count as penetration. At the beginning and end of a leg, the value for the stop of that event is taken as 0, as the
    equations require.
    """
    flow, names, states = cycle.flow, cycle.flow.names, cycle.states(unknown)
    speeds, angles, size = cycle.speeds(unknown), cycle.angles(unknown), np.abs(states).max()
    for i, (event, speed) in enumerate(zip(cycle.events, speeds, strict=True)):
        name, number = names[event.stop], sum(at <= i for at in cycle.impacts)
        if speed < -ROUNDING * size:
            velocity = speed * flow.lengths[event.stop] * flow.omega
            return f"impact {number} would have velocity {velocity:.3g} m/s, away from {name!r}"
        gap = flow.clearance(event.stop, states[i], flow.drive(angles[i]))[0] if event.kind == PUSH_AGAIN else 0.0
        if gap > ROUNDING * size:
            return f"after impact {number} {name!r} would push again before contact begins"
    tied = cycle.tied(unknown)
    for i, event in enumerate(cycle.events):
        if tied[i]:
            continue
        leg, number = cycle.leg(unknown, i), sum(at <= i for at in cycle.impacts)
        places = sum(steps for *_, steps in places_of(leg))
        if places > MOST_SAMPLES:
            turns = places * STRIDE / TURN
            return f"the flight after impact {number} takes {turns:.2g} periods of the fastest mode and was not checked"
        after, drive = np.split(leg.start, [2 * flow.n])
        if comes_to_rest(flow, event.stop, after, drive, leg.pushing):
            return f"after impact {number} the system comes to rest at {names[event.stop]!r}"
        ends = cycle.together(unknown, i), cycle.together(unknown, i + 1)
        penetration = _first_beyond(*flown(cycle, unknown, i), *ends)
        if penetration is not None:
            angle, other, depth = penetration
            if depth == 0.0:
                return f"the impact after impact {number} would strike {names[other]!r} at the same time"
            phase = (angles[i] + angle) / TURN % 1.0
            if other in leg.pushing:
                return f"after impact {number} {names[other]!r} would lose its force earlier, at phase {phase:.6g}"
            how = "touch {} too early, {:.3g} m deep" if flow.compliant[other] else "penetrate {}, by {:.3g} m"
            return f"after impact {number} it would {how.format(repr(names[other]), depth)} at phase {phase:.6g}"
    return ""


def comes_to_rest(flow: Flow, stop: int, after: Floats, drive: Floats, pushing: Pushing) -> bool:
    """Return whether a state after an impact remains at the stop, which takes all speed, as it is pressed on it."""
    return bool(flow.restitution[stop] == 0.0 and flow.clearance(stop, after, drive, pushing)[2] < 0.0)


def far_beyond(cycle: Cycle, unknown: Floats) -> bool:
    """Whether an orbit is far beyond a stop at one of a few places between events, so that `objection` has a reason.

    A stop that pushes, or whose force may have ended while u < 0, does not count.
    """
    flow = cycle.flow
    for i in range(len(cycle.events)):
        leg = cycle.leg(unknown, i)
        free = [stop for stop in range(len(flow.beta)) if stop not in leg.pushing and not flow.lag(stop)]
        gaps = evenly(leg, GLANCES).along(clearances(flow)[free])
        sizes = np.abs(gaps).max(axis=1) + np.abs(flow.bounds[free]).sum(axis=1)
        if (gaps[:, 1:-1] < -FAR * sizes[:, None]).any():
            return True
    return False


def flown(cycle: Cycle, unknown: Floats, i: int) -> tuple[Leg, list[Course]]:
    """Return leg i of an orbit, and the `Course` of each stop in it."""
    latest = cycle.latest(unknown)
    if i not in latest:
        leg = cycle.leg(unknown, i)
        latest[i] = leg, list(courses(leg, cycle.events[i].stop))
    flown_leg: tuple[Leg, list[Course]] = latest[i]
    return flown_leg


def _first_beyond(
    leg: Leg, courses: list[Course], beginning: set[int], ending: set[int]
) -> tuple[float, int, float] | None:
    """Return the first penetration of a stop, or pulling force, in a leg: angle since its begin, stop, depth.

    Stops with an event at its beginning and at its end are given. If another is reached at the end, the depth is 0.
    """
    firsts, penetrations = [], []
    for course in courses:
        gaps, ends = course.gaps.copy(), [at for at, stops in ((0, beginning), (-1, ending)) if course.stop in stops]
        gaps[ends] = np.maximum(gaps[ends], 0.0)
        places, depths = np.append(course.places, course.angles), -np.append(course.lowest, gaps)
        beyond = depths > ROUNDING * course.size
        if beyond.any():
            deepest = int(np.argmax(depths))
            firsts.append(float(places[beyond].min()))
            penetrations.append(
                (float(places[deepest]), course.stop, float(depths[deepest] * leg.flow.lengths[course.stop]))
            )
        elif course.stop not in ending and gaps[-1] <= ROUNDING * course.size and course.closing:
            firsts.append(leg.duration)
            penetrations.append((leg.duration, course.stop, 0.0))
    return penetrations[int(np.argmin(firsts))] if penetrations else None


def nearest_of(cycle: Cycle, unknown: Floats) -> Nearest:
    """Return the closest approach of an orbit to a contact, or to the loss of one, between events and at events.

    Its clearance is infinite without a minimum.
    """
    nearest, beside = Nearest(0, math.nan, math.inf), math.inf
    tied = cycle.tied(unknown)
    for i, angle in enumerate(unknown[: len(cycle.events)]):
        if tied[i]:
            continue
        ending = cycle.together(unknown, i + 1)
        for course in flown(cycle, unknown, i)[1]:
            if len(course.lowest) and course.lowest.min() / course.size < nearest.margin:
                at = int(np.argmin(course.lowest))
                turns, margin = float(angle + course.places[at]) / TURN, float(course.lowest[at] / course.size)
                nearest = Nearest(i, turns, margin, course.stop)
            if course.stop not in ending:
                beside = min(beside, float(course.gaps[-1] / course.size))
    return nearest._replace(beside=beside)


class Course(NamedTuple):
    """The quantity that must stay positive for a stop during a leg: samples, minima between them, and its size.

    The quantity is the clearance over the length of the stop's direction; for a pushing stop, its force over stiffness
    and length.
    """

    stop: int
    angles: Floats
    gaps: Floats
    places: Floats
    lowest: Floats
    size: float
    closing: bool


def courses(leg: Leg, struck: int = -1) -> Iterator[Course]:
    """Yield the course of each stop; the rise from rest at a stop just `struck` with r = 0 is no minimum.

    A compliant stop whose force has ended while u < 0 exerts no force as long as that force would pull.
    """
    forms, parts = clearances(leg.flow), sampled(leg)
    series = [samples.series(forms) for samples in parts]
    for stop, form in enumerate(forms):
        still = struck == stop and leg.flow.restitution[stop] == 0.0
        bound = np.where(np.arange(len(form)) < 2 * leg.flow.n, 0.0, form)
        pieces = [
            _course(leg, stop, samples, rows[stop], bound, still=still and not i)
            for i, (samples, rows) in enumerate(zip(parts, series, strict=True))
        ]
        yield pieces[0] if len(pieces) == 1 else _joined(pieces)


def _course(leg: Leg, stop: int, samples: Samples, row: Floats, bound: Floats, *, still: bool) -> Course:
    """Return the course of a stop over one part of a leg; `still`: it begins at rest."""
    lag = leg.flow.lag(stop)
    pull = pulls(row, lag)
    *along, bounds = samples.along(np.stack([*row[:3], samples.forms(bound)]))
    gaps, rates = along[:2]
    size = float(max(np.abs(gaps - bounds).max(), np.abs(bounds).max()))
    if still:
        rates[0] = 0.0
    closing = bool(rates[-1] < 0.0)
    if stop in leg.pushing:
        forces = samples.along(-pull[:3])
        return Course(stop, samples.angles, forces[0], *turning_points(-pull, samples, forces), size, closing)
    places, lowest = turning_points(row, samples, np.array(along))
    if lag:
        pulled = samples.along(pull[:3])
        others, least = turning_points(pull, samples, pulled)
        pressed = np.interp(others, samples.angles, gaps) < 0.0
        places, lowest = np.append(places, others[pressed]), np.append(lowest, least[pressed])
        gaps = np.maximum(gaps, pulled[0])
    return Course(stop, samples.angles, gaps, places, lowest, size, closing)


def _joined(pieces: Sequence[Course]) -> Course:
    """Return the courses of the parts of a leg, each of which begins where the one before ends, as one."""
    first, last = pieces[0], pieces[-1]
    angles, gaps = (
        np.concatenate([at[0], *(rest[1:] for rest in at[1:])])
        for at in ([each.angles for each in pieces], [each.gaps for each in pieces])
    )
    places, lowest = (np.concatenate(at) for at in zip(*((each.places, each.lowest) for each in pieces), strict=True))
    return Course(first.stop, angles, gaps, places, lowest, max(each.size for each in pieces), last.closing)


def clearances(flow: Flow) -> Floats:
    """Return the clearance of each stop over its length as a linear form of state and drive."""
    return np.hstack([-flow.beta / flow.units, np.zeros_like(flow.beta), flow.bounds])
