"""SciPy's `solve_ivp` with a terminal event, started anew after each impact."""

from __future__ import annotations

import math
import time

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.effort import Effort
from benchmarks.measure import Job
from benchmarks.problem import CASES, LOW, LOW_PERIOD, LOW_PERIODS, OSCILLATOR, START, Floats, LowRun

TOLERANCE = 1e-12
PATIENCE = 20.0  # s
MOST = 1000  # impacts in three periods at w = 0.1; about 270 are there


def _contact(_: float, state: Floats) -> float:
    return float(state[0])


_contact.terminal = True  # type: ignore[attr-defined]
_contact.direction = 1.0  # type: ignore[attr-defined]


class EventSolver:
    """DOP853 at a relative and absolute tolerance of 1e-12."""

    name = "SciPy DOP853, one orbit"
    note = ""

    def run(self, omega: float, count: int, end: float = math.inf) -> tuple[list[float], float, str]:
        """Return the velocities, the largest displacement, and where it stalled if it did."""

        def motion(t: float, state: Floats) -> tuple[float, float]:
            return state[1], math.sin(omega * t) - OSCILLATOR.damping * state[1] - state[0]

        clock = time.perf_counter()
        t, state = START.time, [START.displacement, START.velocity]
        found: list[float] = []
        highest = START.displacement
        while len(found) < count:
            until = min(t + 1000.0, end)
            flight = solve_ivp(motion, (t, until), state, "DOP853", rtol=TOLERANCE, atol=TOLERANCE, events=_contact)
            highest = max(highest, float(flight.y[0].max()))
            if flight.status != 1:
                return found, highest, "" if flight.status == 0 and until == end else str(flight.message)
            ahead, velocity = float(flight.t[-1]) - t, float(flight.y[1, -1])
            t, state = t + ahead, [0.0, -OSCILLATOR.restitution * velocity]
            found.append(velocity)
            if ahead == 0.0 or time.perf_counter() - clock > PATIENCE:
                return found, highest, f"stalls at {t:.1f} s, after {len(found)} impacts"
        return found, highest, f"stalls at {t:.1f} s, after {len(found)} impacts" if t < end < math.inf else ""

    def velocities(self, omega: float, count: int) -> Floats:
        return np.array(self.run(omega, count)[0])

    def low_frequency(self) -> LowRun:
        return LowRun(*self.run(LOW, MOST, LOW_PERIODS * LOW_PERIOD))

    def job(self, case: str, effort: Effort) -> Job | None:
        low, high = CASES[case]
        if low != high:
            return None  # it does not come to the end of the slow ones

        def work() -> int:
            return len(self.run(low, effort.slow_impacts)[0])

        return work
