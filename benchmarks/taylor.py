"""heyoka, a Taylor integrator with event detection, one orbit at a time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.effort import Effort
from benchmarks.measure import Job
from benchmarks.problem import CUT, LOW, LOW_PERIOD, LOW_PERIODS, OSCILLATOR, START, Floats, LowRun, frequencies

try:
    import heyoka
except Exception:  # not installed, or no build for this platform
    heyoka = None

__all__ = ["NOTE", "R", "Taylor", "chatter_is_complete", "equations", "heyoka", "next_release"]

NOTE = "" if heyoka else "heyoka is not installed"
R = OSCILLATOR.restitution


def equations() -> list[Any]:
    """Return y' = v, v' = sin(w t) - c v - y; w is a parameter, so that one compiled step serves all."""
    y, v = heyoka.make_vars("y", "v")
    return [(y, v), (v, heyoka.sin(heyoka.par[0] * heyoka.time) - OSCILLATOR.damping * v - y)]


def chatter_is_complete(omega: float, time: float, velocity: float) -> bool:
    """Return whether the impacts after this one pile up well before the force lets go of the mass."""
    press = math.sin(omega * time)  # over m = 1
    left = (math.pi - omega * time % (2 * math.pi)) / omega
    return press > 0.0 and 2 * R * velocity / ((1 - R) * press) < 0.6 * left


def next_release(omega: float, time: float) -> float:
    period = 2 * math.pi / omega
    return (math.floor(time / period) + 0.5) * period


class Taylor:
    """Velocity turned round in the callback of a terminal event; with `sticking`, held from chatter to release."""

    def __init__(self, sticking: bool) -> None:
        self.name = "heyoka, one orbit, sticking added" if sticking else "heyoka, one orbit"
        self.note = NOTE
        self.sticking = sticking
        self.found: list[float] = []
        self.wanted = 0
        if heyoka:
            self.integrator = self._build()

    def _build(self) -> Any:
        y = heyoka.make_vars("y")
        sticking, found = self.sticking, self.found

        def turn_round(ta: Any, direction: int) -> bool:
            state = ta.state
            velocity = state[1]
            state[1] = -R * velocity
            found.append(velocity)
            if sticking and velocity < CUT and chatter_is_complete(ta.pars[0], ta.time, velocity):
                return False
            return len(found) < self.wanted

        event = heyoka.t_event(y, callback=turn_round, direction=heyoka.event_direction.positive)
        return heyoka.taylor_adaptive(equations(), [START.displacement, START.velocity], t_events=[event], pars=[1.0])

    def run(self, omega: float, count: int, end: float = 1e12, watch: Callable[[Any], bool] | None = None) -> None:
        """Compute so many impacts from `START`, or up to a time."""
        ta = self.integrator
        ta.pars[0], ta.time = omega, START.time
        ta.state[:] = START.displacement, START.velocity
        ta.reset_cooldowns()
        self.found.clear()
        self.wanted = count
        more = {} if watch is None else {"callback": watch}
        while len(self.found) < count:
            ta.propagate_until(end, **more)
            if ta.time >= end:
                break
            if len(self.found) < count:  # held
                ta.time = next_release(omega, ta.time)
                ta.state[:] = 0.0

    def velocities(self, omega: float, count: int) -> Floats:
        self.run(omega, count)
        return np.array(self.found)

    def low_frequency(self) -> LowRun:
        reached: list[float] = []

        def watch(ta: Any) -> bool:
            reached.append(ta.state[0])
            return True

        self.run(LOW, 100_000, LOW_PERIODS * LOW_PERIOD, watch)
        return LowRun(list(self.found), max(reached))

    def job(self, case: str, effort: Effort) -> Job | None:
        if case == "spread" and not self.sticking:
            return None  # it passes the stop at low w, and counts other impacts
        omega = frequencies(case, effort.spread if case == "spread" else 1)
        each = effort.orbit_impacts // (10 if case == "spread" else 1)

        def work() -> int:
            for w in omega:
                self.run(w, each)
            return each * len(omega)

        return work
