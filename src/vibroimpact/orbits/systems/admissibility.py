"""Check that a system can move along an orbit: the clearances and forces of all stops between its events."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vibroimpact.backends.base import Counts
from vibroimpact.cells import Floats
from vibroimpact.matrices import block_matrix
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import FEWEST_SAMPLES, STRIDE, TURN
from vibroimpact.orbits.systems.cycle import Cycle, Leg
from vibroimpact.orbits.systems.events import PUSH_AGAIN, Pushing
from vibroimpact.orbits.systems.flow import Flow

MOST_SAMPLES = 1 << 16  # samples of one leg, at most
GLANCES = 64  # places in each leg at which most inadmissible orbits are far beyond a stop
FAR = 1e-6  # of its size: a deeper penetration is no rounding, and no solution's error
TERMS = 14  # of a power series over one stride: 0.15^14/14! is below rounding
BISECTIONS = 60
RESOLVED = float(np.finfo(float).eps)  # of a step: accuracy of the place of a minimum, whose value is flat there


def objection(cycle: Cycle, unknown: Floats, names: tuple[str, ...]) -> str:
    """Return the reason why the system cannot move along this orbit; empty if it can.

    Each leg is sampled every 0.15 rad of the fastest rate. Power series give every minimum between samples of every
    clearance, and of the force of every pushing stop. A minimum above -1e-12 of its size does not count as penetration.
    At the beginning and end of a leg, the value for the stop of that event is taken as 0, as the equations require.
    """
    flow, states = cycle.flow, cycle.states(unknown)
    speeds, angles, size = cycle.speeds(unknown), cycle.angles(unknown), np.abs(states[0]).max()
    for i, (event, speed) in enumerate(zip(cycle.events, speeds, strict=True)):
        name, number = names[event.stop], sum(at <= i for at in cycle.impacts)
        if speed < -ROUNDING * size:
            velocity = speed * flow.lengths[event.stop] * flow.omega
            return f"impact {number} would have velocity {velocity:.3g} m/s, away from {name!r}"
        if event.kind == PUSH_AGAIN and flow.clearance(event.stop, states[i], flow.drive(angles[i]))[0] > 0.0:
            return f"after impact {number} {name!r} would push again before contact begins"
    for i, event in enumerate(cycle.events):
        leg, number = cycle.leg(unknown, i), sum(at <= i for at in cycle.impacts)
        turned = leg.duration * flow.phase(leg.pushing).fastest
        if turned > STRIDE * MOST_SAMPLES:
            turns = turned / TURN
            return f"the flight after impact {number} takes {turns:.2g} periods of the fastest mode and was not checked"
        after, drive = np.split(leg.start, [2 * flow.n])
        if flow.restitution[event.stop] == 0.0 and flow.clearance(event.stop, after, drive, leg.pushing)[2] < 0.0:
            return f"after impact {number} the system comes to rest at {names[event.stop]!r}"
        penetration = _first_beyond(*flown(cycle, unknown, i), event.stop, cycle.event_after(i).stop)
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


def far_beyond(cycle: Cycle, unknown: Floats) -> bool:
    """Whether an orbit is far beyond a stop at one of a few places between events, so that `objection` has a reason.

    A stop that pushes, or whose force may have ended while u < 0, does not count.
    """
    flow = cycle.flow
    for i in range(len(cycle.events)):
        leg = cycle.leg(unknown, i)
        free = [stop for stop in range(len(flow.beta)) if stop not in leg.pushing and not flow.lag(stop)]
        gaps = sampled(leg, GLANCES).along(clearances(flow, leg.pushing)[free, 0])
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


def _first_beyond(leg: Leg, courses: list[Course], beginning: int, ending: int) -> tuple[float, int, float] | None:
    """Return the first penetration of a stop, or pulling force, in a leg: angle since its begin, stop, depth.

    If another stop is reached at the end of the leg as well, the depth there is 0.
    """
    firsts, penetrations = [], []
    for course in courses:
        gaps, ends = course.gaps.copy(), [at for at, stop in ((0, beginning), (-1, ending)) if stop == course.stop]
        gaps[ends] = np.maximum(gaps[ends], 0.0)
        places, depths = np.append(course.places, course.angles), -np.append(course.lowest, gaps)
        beyond = depths > ROUNDING * course.size
        if beyond.any():
            deepest = int(np.argmax(depths))
            firsts.append(float(places[beyond].min()))
            penetrations.append(
                (float(places[deepest]), course.stop, float(depths[deepest] * leg.flow.lengths[course.stop]))
            )
        elif course.stop != ending and gaps[-1] <= ROUNDING * course.size and course.closing:
            firsts.append(leg.duration)
            penetrations.append((leg.duration, course.stop, 0.0))
    return penetrations[int(np.argmin(firsts))] if penetrations else None


def nearest_of(cycle: Cycle, unknown: Floats) -> tuple[int, float, float, int, float]:
    """Return the closest approach of an orbit to a contact, or to the loss of one, between events and at events.

    The result holds the leg, the driving angle, the relative clearance (infinite without a minimum) and the stop of
    this approach, and the smallest relative clearance of any stop at an event of another stop.
    """
    nearest, beside = (0, math.nan, math.inf, 0), math.inf
    for i, angle in enumerate(unknown[: len(cycle.events)]):
        for course in flown(cycle, unknown, i)[1]:
            if len(course.lowest) and course.lowest.min() / course.size < nearest[2]:
                at = int(np.argmin(course.lowest))
                nearest = i, float(angle + course.places[at]), float(course.lowest[at] / course.size), course.stop
            if course.stop != cycle.event_after(i).stop:
                beside = min(beside, float(course.gaps[-1] / course.size))
    return *nearest, beside


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
    flow, n, samples = leg.flow, 2 * leg.flow.n, sampled(leg)
    for stop, row in enumerate(clearances(flow, leg.pushing)):
        lag, bound = flow.lag(stop), row[0].copy()
        bound[:n] = 0.0
        pull = pulls(row, lag)
        gaps, rates, bounds = samples.along(np.stack([row[0], row[1], bound]))
        size = float(max(np.abs(gaps - bounds).max(), np.abs(bounds).max()))
        if stop == struck and flow.restitution[stop] == 0.0:
            rates[0] = 0.0
        closing = bool(rates[-1] < 0.0)
        if stop in leg.pushing:
            forces, slopes = samples.along(-pull[:2])
            yield Course(stop, samples.angles, forces, *turning_points(-pull, samples, slopes), size, closing)
            continue
        places, lowest = turning_points(row, samples, rates)
        if lag:
            pulled, slopes = samples.along(pull[:2])
            others, least = turning_points(pull, samples, slopes)
            pressed = np.interp(others, samples.angles, gaps) < 0.0
            places, lowest = np.append(places, others[pressed]), np.append(lowest, least[pressed])
            gaps = np.maximum(gaps, pulled)
        yield Course(stop, samples.angles, gaps, places, lowest, size, closing)


class Samples(NamedTuple):
    """States and drives at equal steps of a leg, at `angles` from its beginning.

    The columns of `coarse` are the states after every so many steps; the matrices `fine` carry them on by 0, 1, ...
    steps. Linear forms of all samples then cost about one product per sample, without computing each state.
    """

    angles: Floats
    fine: Floats
    coarse: Floats

    def along(self, forms: Floats) -> Floats:
        """Return linear forms of state and drive at all samples, one row per form."""
        rows = self.coarse.T @ (forms @ self.fine).transpose(1, 2, 0)
        return rows.reshape(len(forms), len(self.fine) * self.coarse.shape[1])[:, : len(self.angles)]

    def at(self, forms: Floats, which: Counts) -> Floats:
        """Return linear forms of state and drive at some samples, one row per form."""
        block, step = np.divmod(which, len(self.fine))
        rows: Floats = ((forms @ self.fine)[step] @ self.coarse.T[block][..., None])[..., 0].T
        return rows


def turning_points(series: Floats, samples: Samples, slopes: Floats) -> tuple[Floats, Floats]:
    """Return the minima between samples of linear forms given as power series, and their values."""
    turning = np.flatnonzero((slopes[:-1] < 0.0) & (slopes[1:] >= 0.0))
    offsets, lowest = _minima(samples.at(series, turning), float(samples.angles[1]))
    return samples.angles[turning] + offsets, lowest


def sampled(leg: Leg, number: int = 0) -> Samples:
    """Return samples of a leg, every 0.15 rad of the fastest rate, or after each of a number of equal steps."""
    flow, n, size = leg.flow, 2 * leg.flow.n, len(leg.start)
    number = number or max(FEWEST_SAMPLES, math.ceil(leg.duration * flow.phase(leg.pushing).fastest / STRIDE))
    step = leg.duration / number
    grown, driven = flow.over(step, leg.pushing)
    power = np.eye(size)
    power[:n, :n] += grown
    power[:n, n:] = driven
    power[n:, n:] = flow.rotation(step)
    fine, coarse = np.eye(size)[None], leg.start[:, None]
    for _ in range((number + 1).bit_length() // 2):
        fine = np.concatenate([fine, power @ fine])
        power = power @ power
    while coarse.shape[1] * len(fine) <= number:
        coarse = np.hstack([coarse, power @ coarse])
        power = power @ power
    return Samples(step * np.arange(number + 1.0), fine, coarse)


def clearances(flow: Flow, pushing: Pushing) -> Floats:
    """Return the coefficients of the power series of each clearance as linear forms of state and drive."""
    return series_of(flow, pushing, np.hstack([-flow.beta / flow.units, np.zeros_like(flow.beta), flow.bounds]))


def series_of(flow: Flow, pushing: Pushing, forms: Floats) -> Floats:
    """Return the coefficients of the power series of linear forms of state and drive, as such forms."""
    phase = flow.phase(pushing)
    whole = block_matrix(phase.matrix, phase.load, np.zeros(phase.load.T.shape), flow.turning)
    series = np.zeros((len(forms), TERMS, len(whole)))
    series[:, 0] = forms
    for j in range(1, TERMS):
        series[:, j] = series[:, j - 1] @ whole / j
    return series


def pulls(row: Floats, lag: float) -> Floats:
    """Return the series of (u + l u')/(1 + l), which vanishes with the force, from the series of u."""
    rates = row[1:] * np.arange(1.0, len(row))[:, None]
    series: Floats = (row[:-1] + lag * rates) / (1.0 + lag)
    return series


def _minima(series: Floats, step: float) -> tuple[Floats, Floats]:
    """Return the places between 0 and a step where slopes of power series rise through zero, and the values there.

    By Newton's method; where it leaves the bracketing interval, the interval is halved.
    """
    low, high = np.zeros(series.shape[1]), np.full(series.shape[1], step)
    slopes = series[1:] * np.arange(1, len(series))[:, None]
    bends = slopes[1:] * np.arange(1, len(slopes))[:, None]
    at = 0.5 * (low + high)
    for _ in range(BISECTIONS):
        slope, bend = (np.polynomial.polynomial.polyval(at, each, tensor=False) for each in (slopes, bends))
        low, high = np.where(slope < 0.0, at, low), np.where(slope < 0.0, high, at)
        with np.errstate(divide="ignore", invalid="ignore"):
            following = at - slope / bend
        before, at = at, np.where((following >= low) & (following <= high), following, 0.5 * (low + high))
        if np.abs(at - before).max(initial=0.0) <= RESOLVED * step:
            break
    return at, np.polynomial.polynomial.polyval(at, series, tensor=False)
