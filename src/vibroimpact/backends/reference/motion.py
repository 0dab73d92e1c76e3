"""One trajectory as a chain of flights, contacts and rests, for the `reference` back end.

The first contact with the stop is never missed: a flight is divided into intervals, and an interval is halved until
bounds of the derivatives prove whether the gap u falls through zero on it. Only then is the root computed, in a bracket
that contains exactly one. Near-misses, where u' rises through zero in front of the stop, are found in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.backends.reference.flight import BLOCK, Floats, FreeMotion, State

ROUNDING = 1e-16
HALVINGS = 50  # halvings, after which an undecided interval is shorter than rounding
CLEAR, CONTACT, BOWL, DOUBT = range(4)
CERTAIN = 0.6  # of the time to release: a chatter expected to end sooner is certainly complete
SHORT = 1e-4  # radians of the fastest rate: the second-order end of a shorter tail is exact to rounding
HOLD = 1e-3  # of the cutoff: a slower impact under a pressing force sticks


@dataclass(frozen=True)
class Contact:
    """An impact: the state just after it, the speed just before, and whether it is fast enough to be recorded."""

    after: State
    speed: float
    counts: bool


@dataclass(frozen=True)
class Flight:
    """Free motion from a state for a duration in s."""

    start: State
    duration: float
    end: State


@dataclass(frozen=True)
class Rest:
    """The mass stays on the stop, at rest from `settled` to `release` (None: permanently)."""

    settled: State
    release: State | None


def motion(free: FreeMotion, restitution: float, start: State, cut: float) -> Iterator[Contact | Flight | Rest]:
    """Yield flights, contacts and rests in order; it ends only with a permanent rest."""
    state = start
    speed = state.velocity if state.clearance == 0.0 and state.velocity > 0.0 else None
    while True:
        settled = state
        if speed is not None:
            state, settled = rebound(free, restitution, state, speed, cut)
            yield Contact(state, speed, speed >= cut)
        if state.rests_on_stop and free.pressed(state.phase):
            release = free.release(settled)
            yield Rest(settled, release)
            if release is None:
                return
            state = release
        duration, end, speed = fly(free, state)
        yield Flight(state, duration, end)
        state = end


def rebound(free: FreeMotion, restitution: float, at: State, speed: float, cut: float) -> tuple[State, State]:
    """Return the state after an impact and, if it completes a chatter, the state at the end of the chatter's tail.

    Under a pressing acceleration a the tail takes t1 = 2 r v/((1 - r) a) to leading order and
    t1 - t1^2 (J/(3 a) + c/(6 m)) to second, with J = f w cos(wt)/m.
    """
    on_stop = replace(at, clearance=0.0)
    leaving = replace(on_stop, velocity=-restitution * speed if restitution > 0.0 else 0.0)
    push = free.push(at.phase)
    if speed >= cut or push <= 0.0 or restitution == 1.0:
        return leaving, leaving
    at_rest = replace(on_stop, velocity=0.0)
    tail = 2.0 * restitution * speed / ((1.0 - restitution) * push)
    release = free.release(at)
    until_release = math.inf if release is None else time_between(free, at, release)
    if tail < CERTAIN * until_release and tail * free.fastest < SHORT:
        tail -= tail * tail * (free.jerk(at.phase) / (3.0 * push) + free.damp / 6.0)
        return at_rest, at_rest.later(tail / free.period)
    return (at_rest, at_rest) if speed < HOLD * cut else (leaving, leaving)


def time_between(free: FreeMotion, first: State, second: State) -> float:
    """Return the time in s from one state to another."""
    return ((second.periods - first.periods) + (second.phase - first.phase)) * free.period


class Piece(NamedTuple):
    """A piece of flight: its duration, its final state, and the speed of the contact that ends it."""

    duration: float
    end: State
    speed: float | None


def fly(free: FreeMotion, state: State) -> Piece:
    """Return the next piece of flight, up to a contact or to the end of a block, whichever comes first."""

    def piece(duration: float, clearance: float, velocity: float, speed: float | None) -> Piece:
        end = replace(state, clearance=clearance, velocity=velocity).later(duration / free.period)
        return Piece(duration, end, speed)

    x = free.vector(state)
    if state.clearance <= 0.0:
        safe = _take_off(free, x)
        x = free.propagators([safe])[0] @ x
        return piece(safe, float(x[0]), -float(x[1]), None)
    ends = free.block @ x
    starts = np.concatenate([x[None], ends[:-1]])
    for i in np.flatnonzero(verdict(free, starts, ends, free.stride) != CLEAR):
        contact = _first_within(free, starts[i], ends[i], free.stride, HALVINGS)
        if contact is not None:
            time, speed = contact
            return piece(float(i) * free.stride + time, 0.0, speed, speed)
    return piece(BLOCK * free.stride, float(ends[-1, 0]), -float(ends[-1, 1]), None)


def _take_off(free: FreeMotion, x: Floats) -> float:
    """Return a time during which a mass that leaves the stop certainly does not return.

    With b the first positive derivative of u, of order n: u >= b t^n/n! - B t^(n+1)/(n+1)!, which is half
    its first term at t = (n + 1) b/(2 B).
    """
    b2 = float(free.acceleration(x))
    b3 = -free.damp * b2 - free.stiff * x[1] - x[3]
    b4 = -free.damp * b3 - free.stiff * b2 + free.omega**2 * x[2]
    bounds = free.bounds(x, free.stride)
    for n, (b, bound) in enumerate(zip((x[1], b2, b3, b4), bounds, strict=True), start=1):
        if b > 0.0:
            return min(free.stride, float((n + 1) * b / (2.0 * bound)))
    return float(free.stride * 0.5**HALVINGS)


def verdict(free: FreeMotion, start: Floats, end: Floats, span: float) -> Any:
    """Classify intervals as CLEAR, CONTACT, BOWL or in DOUBT.

    CLEAR: u > 0 throughout; CONTACT: u falls through zero once; BOWL: u is convex with its minimum inside.
    A function with |F''| <= B differs from its chord by at most B span^2/8, and one with |F''''| <= B from the cubic
    through its end values and slopes by at most B span^4/384; a cubic lies above the least of its
    Bezier ordinates.
    """
    _, b3, b4, _ = free.bounds(start, span)
    u0, u1, p0, p1 = start[..., 0], end[..., 0], start[..., 1], end[..., 1]
    a0, a1 = free.acceleration(start), free.acceleration(end)
    falls = np.maximum(p0, p1) + b3 * span**2 / 8 < 0.0
    rises = np.minimum(p0, p1) - b3 * span**2 / 8 > 0.0
    bends_down = np.maximum(a0, a1) + b4 * span**2 / 8 < 0.0
    bends_up = np.minimum(a0, a1) - b4 * span**2 / 8 > 0.0
    above = np.minimum.reduce([u0, u0 + p0 * span / 3, u1 - p1 * span / 3, u1]) > b4 * span**4 / 384
    ends_decide = falls | bends_down | (bends_up & (p1 <= 0.0))
    clear = above | rises | (bends_up & (p0 >= 0.0)) | (ends_decide & (u1 > 0.0))
    return np.select([clear, ends_decide, bends_up], [CLEAR, CONTACT, BOWL], DOUBT)


def _first_within(
    free: FreeMotion, start: Floats, end: Floats, span: float, halvings: int
) -> tuple[float, float] | None:
    """Return time and speed of the first contact on an interval, or None; a graze to within rounding."""
    shape = verdict(free, start, end, span)
    if shape == BOWL:
        span, end = root(free, start, span, 1)
        shape = CONTACT if end[0] <= 0.0 else CLEAR
    if shape == DOUBT and halvings > 0:
        half = 0.5 * span
        middle = free.propagators([half])[0] @ start
        early = _first_within(free, start, middle, half, halvings - 1)
        if early is not None:
            return early
        late = _first_within(free, middle, end, half, halvings - 1)
        return None if late is None else (half + late[0], late[1])
    if shape == CLEAR or end[0] > 0.0:
        return None
    time, there = root(free, start, span, 0)
    return time, max(-float(there[1]), 0.0)


def root(free: FreeMotion, start: Floats, span: float, order: int) -> tuple[float, Floats]:
    """Return the time at which u (order 0, from above) or u' (order 1, from below) crosses zero, and x there.

    By bracketed Newton's method, from the root of the Taylor parabola or line.
    """
    u, p, a = float(start[0]), float(start[1]), float(free.acceleration(start))
    steep = math.sqrt(max(p * p - 2.0 * u * a, 0.0)) - p
    time = (2.0 * u / steep if steep > 0.0 else 0.0) if order == 0 else -p / a
    low, high = 0.0, span
    for _ in range(100):
        if not low < time < high:
            time = 0.5 * (low + high)
        x = free.propagators([time])[0] @ start
        value, slope = x[order], (x[1] if order == 0 else free.acceleration(x))
        low, high = (time, high) if (value > 0.0) == (order == 0) else (low, time)
        step = value / slope if slope else math.inf
        if abs(step) <= 2e-16 * time or high - low <= 2e-16 * high:
            break
        time -= step
    return time, x


def closest_miss(free: FreeMotion, start: State, duration: float, end: State) -> float:
    """Return the smallest local minimum of the gap u > 0 in a piece of flight; infinite if there is none.

    A piece that begins on the stop is a take-off, in which u only grows.
    """
    if start.clearance <= 0.0 or duration == 0.0:
        return math.inf
    return min(_minima(free, *_intervals(free, start, duration, end)), default=math.inf)


def _intervals(free: FreeMotion, start: State, duration: float, end: State) -> tuple[Floats, Floats, Floats]:
    """Return the beginnings, ends and lengths of the intervals of a flight; all but the last are one stride long."""
    whole = math.ceil(duration / free.stride) - 1
    first = free.vector(start)
    points = np.concatenate([first[None], free.block[:whole] @ first, free.vector(end)[None]])
    spans = np.full(whole + 1, free.stride)
    spans[-1] = duration - whole * free.stride
    return points[:-1], points[1:], spans


def _minima(free: FreeMotion, starts: Floats, ends: Floats, spans: Floats) -> list[float]:
    """Return the local minima of u on intervals.

    A function with |F''| <= B differs from its chord by at most B span^2/8: u' with B a bound of |u'''|, u'' with one
    of |u''''|. Intervals on which u changes by rounding only have no minimum.
    """
    minima = []
    for _ in range(HALVINGS):
        b2, b3, b4, _ = free.bounds(starts, spans)
        p0, p1 = starts[:, 1], ends[:, 1]
        a0, a1 = free.acceleration(starts), free.acceleration(ends)
        moves_on = (np.minimum(p0, p1) > b3 * spans**2 / 8) | (np.maximum(p0, p1) < -b3 * spans**2 / 8)
        bends_down = np.maximum(a0, a1) + b4 * spans**2 / 8 < 0.0
        bends_up = np.minimum(a0, a1) - b4 * spans**2 / 8 > 0.0
        for i in np.flatnonzero(bends_up & (p0 < 0.0) & (p1 >= 0.0)):
            minima.append(max(float(root(free, starts[i], spans[i], 1)[1][0]), 0.0))
        still = (np.maximum(np.abs(p0), np.abs(p1)) + b2 * spans) * spans <= ROUNDING * np.abs(starts[:, 0])
        doubt = ~(moves_on | bends_down | bends_up | still)
        if not doubt.any():
            break
        starts, ends, spans = starts[doubt], ends[doubt], 0.5 * spans[doubt]
        middles = np.einsum("nij,nj->ni", free.propagators(spans), starts)
        starts, ends = np.concatenate([starts, middles]), np.concatenate([middles, ends])
        spans = np.tile(spans, 2)
    return minima
