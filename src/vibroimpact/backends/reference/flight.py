"""Free flight and its first contact with the stop, for the `reference` back end.

The gap u = g - y and the driving force are one linear system with constant coefficients,

    u'' = -(c/m) u' - (k/m) u + k g/m - e,     e'' = -w^2 e,     e = (f/m) sin wt,

so x = (u, u', e, e', k g/m) moves as x(t + tau) = exp(A tau) x(t): one formula covers any damping, at resonance and
near it. SciPy's matrix exponential evaluates it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Floats = NDArray[np.float64]

STRIDE = 0.25  # radians of the fastest rate per interval of a block
BLOCK = 64  # intervals per block
BALANCE = 4e-15  # relative to f + k |g|: a smaller net force is rounding


@dataclass(frozen=True)
class State:
    """Distance to the stop u = g - y in m, velocity y' in m/s, time (periods + phase) T."""

    clearance: float
    velocity: float
    periods: float
    phase: float

    @property
    def rests_on_stop(self) -> bool:
        """Whether the mass touches the stop with zero velocity."""
        return self.clearance == 0.0 and self.velocity == 0.0

    def later(self, turns: float) -> State:
        """Return the same position and velocity `turns` driving periods later; whole periods are stored separately."""
        phase = self.phase + turns
        whole = math.floor(phase)
        return replace(self, periods=self.periods + whole, phase=phase - whole)


def sine_cosine(phase: float) -> tuple[float, float]:
    """Return sin and cos of 2 pi phase, exact at the quarters of a turn."""
    quarter = round(4.0 * phase)
    angle = 2.0 * math.pi * (phase - 0.25 * quarter)
    s, c = math.sin(angle), math.cos(angle)
    return ((s, c), (c, -s), (-s, -c), (-c, s))[quarter % 4]


class FreeMotion:
    """The motion of one oscillator away from its stop."""

    def __init__(
        self, *, mass: float, damping: float, stiffness: float, amplitude: float, omega: float, gap: float
    ) -> None:
        self.damp, self.stiff, self.omega, self.gap = damping / mass, stiffness / mass, omega, gap
        self.drive, self.preload = amplitude / mass, stiffness * gap / mass
        self.period = 2.0 * math.pi / omega
        self.natural = math.sqrt(self.stiff)
        half = 0.5 * self.damp
        decay = half + math.sqrt(max(half * half - self.stiff, 0.0)) if half > self.natural else 0.0
        self.fastest = max(omega, self.natural, decay)
        self.stride = STRIDE / self.fastest

    def propagators(self, times: Floats | list[float]) -> Floats:
        """Return exp(A tau) for each tau > 0, shape (n, 5, 5).

        In units of tau (of 1/fastest for longer flights) every entry is of order 1, so each has full relative accuracy
        even for short flights.
        """
        times = np.asarray(times, dtype=float)
        unit = np.minimum(times, 1.0 / self.fastest)
        rates = np.zeros((len(times), 5, 5))
        rates[:, 0, 1] = rates[:, 2, 3] = rates[:, 1, 4] = 1.0
        rates[:, 1, 0] = -self.stiff * unit**2
        rates[:, 1, 1] = -self.damp * unit
        rates[:, 1, 2] = -1.0
        rates[:, 3, 2] = -((self.omega * unit) ** 2)
        scale = unit[:, None] ** np.array([0, 1, 2, 3, 2])
        grown: Floats = expm(rates * (times / unit)[:, None, None])
        grown *= scale[:, None, :] / scale[:, :, None]
        return grown

    @cached_property
    def block(self) -> Floats:
        """Propagators over 1 ... BLOCK strides, by doubling."""
        table = self.propagators([self.stride])
        while len(table) < BLOCK:
            table = np.concatenate([table, table @ table[-1]])
        return table

    def vector(self, state: State) -> Floats:
        """Return x = (u, u', e, e', k g/m); a mass at rest in balance is assigned zero acceleration."""
        sine, cosine = sine_cosine(state.phase)
        force = self.drive * sine
        if state.rests_on_stop and self._balanced(sine):
            force = self.preload
        return np.array([state.clearance, -state.velocity, force, self.drive * self.omega * cosine, self.preload])

    def after(self, state: State, times: Floats) -> tuple[Floats, Floats]:
        """Return clearance and velocity at times >= 0 after a state, no contact in between."""
        x = self.vector(state)
        moved = np.tile(x, (len(times), 1))
        ahead = times > 0.0
        moved[ahead] = self.propagators(times[ahead]) @ x
        return moved[:, 0], -moved[:, 1]

    def acceleration(self, x: Floats) -> Any:
        """Return u'' of states x, shape (..., 5)."""
        return -self.damp * x[..., 1] - self.stiff * x[..., 0] + (x[..., 4] - x[..., 2])

    def _balanced(self, sine: float) -> bool:
        return abs(self.drive * sine - self.preload) <= BALANCE * (self.drive + abs(self.preload))

    def push(self, phase: float) -> float:
        """Return (f sin wt - k g)/m, the acceleration that presses the mass on the stop; zero in balance."""
        sine, _ = sine_cosine(phase)
        return 0.0 if self._balanced(sine) else self.drive * sine - self.preload

    def jerk(self, phase: float) -> float:
        """Return J = f w cos(wt)/m."""
        return self.drive * self.omega * sine_cosine(phase)[1]

    def pressed(self, phase: float) -> bool:
        """Whether a mass at rest on the stop stays: the first non-zero of y'', y''', y'''' is positive."""
        if self.preload <= -self.drive:
            return True
        if self.preload >= self.drive:
            return False
        return (self.push(phase) or sine_cosine(phase)[1]) > 0.0

    def release(self, state: State) -> State | None:
        """Return the state at which a mass pressed on the stop is released: f sin wt - k g falls through zero."""
        if self.preload <= -self.drive:
            return None
        sine = self.preload / self.drive
        turn = math.atan2(sine, -math.sqrt((1.0 - sine) * (1.0 + sine))) / (2.0 * math.pi)
        phase = turn % 1.0
        return State(0.0, 0.0, state.periods + (phase <= state.phase), phase)

    def bounds(self, x: Floats, span: float | Floats) -> tuple[Any, Any, Any, Any]:
        """Return bounds of |u''|, |u'''|, |u''''|, |u^(5)| on the time `span` after states x.

        sqrt(y'^2 + (k/m) y^2) grows at most at the rate f/m, since damping only takes energy out.
        """
        speed = np.hypot(x[..., 1], self.natural * (self.gap - x[..., 0])) + self.drive * span
        b2 = (self.damp + self.natural) * speed + self.drive
        b3 = self.damp * b2 + self.stiff * speed + self.drive * self.omega
        b4 = self.damp * b3 + self.stiff * b2 + self.drive * self.omega**2
        b5 = self.damp * b4 + self.stiff * b3 + self.drive * self.omega**3
        return b2, b3, b4, b5

    def never_again(self, state: State) -> bool:
        """Whether the stop stays out of reach: R + sqrt(z^2 + (m/k) z'^2) < g, with z = y - steady motion."""
        inertia, damper = self.stiff - self.omega**2, self.damp * self.omega
        impedance = inertia**2 + damper**2
        if impedance == 0.0 or self.gap <= 0.0:
            return False
        sine, cosine = sine_cosine(state.phase)
        a, b = self.drive * inertia / impedance, -self.drive * damper / impedance
        z = self.gap - state.clearance - (a * sine + b * cosine)
        dz = state.velocity - self.omega * (a * cosine - b * sine)
        return math.hypot(a, b) + math.hypot(z, dz / self.natural) < self.gap
