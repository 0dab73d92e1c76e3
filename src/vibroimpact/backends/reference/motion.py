"""One trajectory as a chain of flights, contacts and rests, for the `reference` back end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from vibroimpact.backends.reference.contact import fly
from vibroimpact.backends.reference.flight import FreeMotion, State

CERTAIN = 0.6  # of the time to release: a chatter that should end sooner is certainly complete
SHORT = 1e-4  # radians of the fastest rate: over a shorter tail its second-order end is exact to rounding
HOLD = 1e-3  # of the cut: an impact this slow under a pressing force is held


@dataclass(frozen=True)
class Contact:
    """An impact: the state just after it, the speed before it, and whether it is fast enough to count."""

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
    """The mass stays on the stop; it is at rest from `settled` on, until `release` (None: for ever)."""

    settled: State
    release: State | None


def motion(free: FreeMotion, restitution: float, start: State, cut: float) -> Iterator[Contact | Flight | Rest]:
    """Yield flights, contacts and rests in turn; it ends only with a rest for ever."""
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
    """Return the state after an impact and, where it ends a chatter, the state at the end of the tail.

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
    left = math.inf if release is None else time_between(free, at, release)
    if tail < CERTAIN * left and tail * free.fastest < SHORT:
        tail -= tail * tail * (free.jerk(at.phase) / (3.0 * push) + free.damp / 6.0)
        return at_rest, at_rest.later(tail / free.period)
    return (at_rest, at_rest) if speed < HOLD * cut else (leaving, leaving)


def time_between(free: FreeMotion, first: State, second: State) -> float:
    """Return the time in s from one state to another."""
    return ((second.periods - first.periods) + (second.phase - first.phase)) * free.period
