"""Whether a system can move along an orbit: the clearances of all stops between its impacts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import STRIDE, TURN
from vibroimpact.orbits.systems.cycle import Cycle
from vibroimpact.orbits.systems.flow import Flow

MOST_SAMPLES = 1 << 16  # in a flight
FEWEST_SAMPLES = 16
TERMS = 14  # of a power series over one stride: 0.15^14/14! is below rounding
BISECTIONS = 60


def objection(cycle: Cycle, unknown: Floats, names: tuple[str, ...]) -> str:
    """Return why the system cannot move along this orbit; empty if it can.

    Each flight is sampled every 0.15 rad of the fastest rate, and every minimum of every clearance between samples is
    found by power series. A clearance above -1e-12 of its size is none beyond the stop; that of a stop which the
    flight leaves or strikes is 0 at its ends, where the equations hold, whatever they leave of it.
    """
    flow, states = cycle.flow, cycle.states(unknown)
    speeds, angles = cycle.speeds(unknown), cycle.angles(unknown)
    for i, (stop, speed) in enumerate(zip(cycle.stops, speeds, strict=True)):
        if speed < -ROUNDING * np.abs(states[0]).max():
            velocity = speed * flow.lengths[stop] * flow.omega
            return f"impact {i + 1} would have velocity {velocity:.3g} m/s, away from {names[stop]!r}"
    for i, stop in enumerate(cycle.stops):
        duration, begin = float(angles[i + 1] - angles[i]), flow.drive(angles[i])
        if duration * flow.fastest > STRIDE * MOST_SAMPLES:
            turns = duration * flow.fastest / TURN
            return f"the flight after impact {i + 1} takes {turns:.2g} periods of the fastest mode: it was not checked"
        after = flow.struck(stop, states[i], begin)
        if flow.restitution[stop] == 0.0 and flow.clearance(stop, after, begin)[2] < 0.0:
            return f"after impact {i + 1} it comes to rest at {names[stop]!r}"
        start = np.append(after, begin)
        met = _first_contact(flow, start, duration, stop, cycle.struck_after(i))
        if met is not None:
            angle, other, depth = met
            if depth == 0.0:
                return f"the impact after impact {i + 1} would strike {names[other]!r} at the same time"
            phase = (angles[i] + angle) / TURN % 1.0
            return f"after impact {i + 1} it would penetrate {names[other]!r}, by {depth:.3g} m at phase {phase:.6g}"
    return ""


def _first_contact(
    flow: Flow, start: Floats, duration: float, left: int, ending: int
) -> tuple[float, int, float] | None:
    """Return where a flight first gets beyond a stop: the angle since its impact, the stop, and the depth in m.

    A flight that ends on another stop than expected, too, has depth 0 there.
    """
    firsts, found = [], []
    for course in _courses(flow, start, duration):
        ends = [at for at, stop in ((0, left), (-1, ending)) if stop == course.stop]
        course.gaps[ends] = np.maximum(course.gaps[ends], 0.0)
        places, depths = np.append(course.places, course.angles), -np.append(course.lowest, course.gaps)
        beyond = depths > ROUNDING * course.size
        if beyond.any():
            deepest = int(np.argmax(depths))
            firsts.append(float(places[beyond].min()))
            found.append((float(places[deepest]), course.stop, float(depths[deepest] * flow.lengths[course.stop])))
        elif course.stop != ending and course.gaps[-1] <= ROUNDING * course.size and course.closing:
            firsts.append(duration)
            found.append((duration, course.stop, 0.0))
    return found[int(np.argmin(firsts))] if found else None


def nearest_of(cycle: Cycle, unknown: Floats) -> tuple[int, float, float, int, float]:
    """Return where an orbit comes closest to a stop between impacts, and how close others are at the impacts.

    They are the flight, the driving angle and the clearance over its size (infinite where no clearance has a minimum),
    the stop, and the least clearance over its size of another stop than the struck one at an impact.
    """
    flow, states, angles = cycle.flow, cycle.states(unknown), cycle.angles(unknown)
    nearest, beside = (0, math.nan, math.inf, 0), math.inf
    for i, stop in enumerate(cycle.stops):
        begin = flow.drive(angles[i])
        start = np.append(flow.struck(stop, states[i], begin), begin)
        for course in _courses(flow, start, float(angles[i + 1] - angles[i]), stop):
            if len(course.lowest) and course.lowest.min() / course.size < nearest[2]:
                at = int(np.argmin(course.lowest))
                nearest = i, float(angles[i] + course.places[at]), float(course.lowest[at] / course.size), course.stop
            if course.stop != cycle.struck_after(i):
                beside = min(beside, float(course.gaps[-1] / course.size))
    return *nearest, beside


class _Course(NamedTuple):
    """The clearance of a stop over its length during a flight: samples, its minima between them, and its size."""

    stop: int
    angles: Floats
    gaps: Floats
    places: Floats
    lowest: Floats
    size: float
    closing: bool


def _courses(flow: Flow, start: Floats, duration: float, struck: int = -1) -> Iterator[_Course]:
    """Yield the course of each clearance; of a stop `struck` at r = 0 its rise from rest is no minimum."""
    angles, states = sampled(flow, start, duration)
    for stop, row in enumerate(_derivatives(flow)):
        gaps, rates = row[:2] @ states
        if stop == struck and flow.restitution[stop] == 0.0:
            rates[0] = 0.0
        parts = row[0][:, None] * states
        size = float(max(np.abs(parts[: 2 * flow.n].sum(axis=0)).max(), np.abs(parts[2 * flow.n :].sum(axis=0)).max()))
        turning = np.flatnonzero((rates[:-1] < 0.0) & (rates[1:] >= 0.0))
        offsets, lowest = _minima(row @ states[:, turning], float(angles[1]))
        yield _Course(stop, angles, gaps, angles[turning] + offsets, lowest, size, bool(rates[-1] < 0.0))


def sampled(flow: Flow, start: Floats, duration: float) -> tuple[Floats, Floats]:
    """Return angles since the start of a flight, and the states and drives (columns) there."""
    number = max(FEWEST_SAMPLES, math.ceil(duration * flow.fastest / STRIDE))
    step = duration / number
    grown, driven = flow.over(step)
    n, size = 2 * flow.n, len(start)
    power = np.eye(size)
    power[:n, :n] += grown
    power[:n, n:] = driven
    sine, cosine = np.diag(np.sin(flow.orders * step)), np.diag(np.cos(flow.orders * step))
    power[n + 1 :, n + 1 :] = np.block([[cosine, sine], [-sine, cosine]])
    states = start[:, None]
    while states.shape[1] <= number:
        states = np.hstack([states, power @ states])
        power = power @ power
    angles: Floats = step * np.arange(number + 1.0)
    return angles, states[:, : number + 1]


def _derivatives(flow: Flow) -> Floats:
    """Return the coefficients of the power series of each clearance as linear forms of state and drive."""
    whole = np.block([[flow.matrix, flow.load], [np.zeros(flow.load.T.shape), flow.turning]])
    found = np.zeros((len(flow.beta), TERMS, len(whole)))
    found[:, 0] = np.hstack([-flow.beta / flow.units, np.zeros_like(flow.beta), flow.bounds])
    for j in range(1, TERMS):
        found[:, j] = found[:, j - 1] @ whole / j
    return found


def _minima(series: Floats, step: float) -> tuple[Floats, Floats]:
    """Return where the slopes of power series pass zero upwards between 0 and a step, and their values there."""
    low, high = np.zeros(series.shape[1]), np.full(series.shape[1], step)
    slopes = series[1:] * np.arange(1, len(series))[:, None]
    at = 0.5 * (low + high)
    for _ in range(BISECTIONS):
        falling = np.polynomial.polynomial.polyval(at, slopes, tensor=False) < 0.0
        low, high = np.where(falling, at, low), np.where(falling, high, at)
        at = 0.5 * (low + high)
    return at, np.polynomial.polynomial.polyval(at, series, tensor=False)
