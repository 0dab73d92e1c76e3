"""heyoka, as many orbits at once as the processor's vectors hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.effort import Effort
from benchmarks.measure import Job
from benchmarks.problem import CUT, LOW, LOW_PERIODS, START, Floats, LowRun, frequencies
from benchmarks.taylor import NOTE, R, chatter_is_complete, equations, heyoka, next_release


class TaylorBatch:
    """As `Taylor`; the lanes of a batch run in lockstep, each to its own end."""

    def __init__(self, sticking: bool) -> None:
        self.name = "heyoka, batch, sticking added" if sticking else "heyoka, batch"
        self.note = NOTE
        self.sticking = sticking
        self.found: list[float] = []  # of the first lane
        self.held: list[int] = []
        self.count = 0
        if heyoka:
            self.size = heyoka.recommended_simd_size()
            self.integrator = self._build()

    def _build(self) -> Any:
        y = heyoka.make_vars("y")
        sticking, found, held = self.sticking, self.found, self.held

        def turn_round(ta: Any, direction: int, lane: int) -> bool:
            state = ta.state
            velocity = state[1, lane]
            state[1, lane] = -R * velocity
            self.count += 1
            if lane == 0:
                found.append(velocity)
            if sticking and velocity < CUT and chatter_is_complete(ta.pars[0, lane], ta.time[lane], velocity):
                held.append(lane)
                return False
            return True

        event = heyoka.t_event_batch(y, callback=turn_round, direction=heyoka.event_direction.positive)
        start = np.repeat([[START.displacement], [START.velocity]], self.size, axis=1)
        return heyoka.taylor_adaptive_batch(equations(), start, t_events=[event], pars=np.ones((1, self.size)))

    def run(self, omega: Floats, periods: float, watch: Callable[[Any], bool] | None = None) -> int:
        """Compute so many periods in every lane from `START`; return the impacts of all lanes."""
        ta = self.integrator
        ta.pars[0] = omega
        ta.state[0], ta.state[1] = START.displacement, START.velocity
        ta.set_time(np.zeros(self.size))
        ta.reset_cooldowns()
        self.found.clear()
        self.count = 0
        end = list(periods * 2 * np.pi / omega)
        more = {} if watch is None else {"callback": watch}
        while True:
            self.held.clear()
            ta.propagate_until(end, **more)
            if not self.held:
                return self.count
            time = ta.time.copy()
            for lane in self.held:
                time[lane] = next_release(omega[lane], time[lane])
                ta.state[:, lane] = 0.0
            ta.set_time(time)

    def velocities(self, omega: float, count: int) -> Floats:
        self.run(np.full(self.size, omega), 1.5 * count)  # at 2 and 2.8 rad/s there is an impact a period, or more
        return np.array(self.found[:count])

    def low_frequency(self) -> LowRun:
        reached: list[float] = []

        def watch(ta: Any) -> bool:
            reached.append(ta.state[0].max())
            return True

        self.run(np.full(self.size, LOW), LOW_PERIODS, watch)
        return LowRun(list(self.found), max(reached))

    def job(self, case: str, effort: Effort) -> Job | None:
        if case == "spread" and not self.sticking:
            return None
        groups = effort.spread // self.size if case == "spread" else 1
        omega = frequencies(case, max(groups, 1) * self.size).reshape(-1, self.size)  # neighbours share a batch
        periods = max(effort.batch_periods // len(omega), 20)
        return lambda: sum(self.run(w, periods) for w in omega)
