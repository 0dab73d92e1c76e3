r"""Free flight in closed form: one formula at any damping, at resonance and beside it.

The gap u = g - y obeys m u'' + c u' + k u = k g - f sin(w t). With the response q to a unit kick,

    u(tau) = q u0' + (k g/m) E(0) - (f/m) Im(e^{i angle} E(i w)),
    E(nu)  = integral of q(tau - s) e^{nu s} over the flight, from u = 0.

E is the divided difference of exp(tau x) over the two rates of free motion and nu, so nothing is infinite where two of
the three meet, and a short flight is as exact as a long one.
"""

from __future__ import annotations

import cmath
import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

NEAR = 0.5  # of rate times duration: nearer nodes than this are not told apart by subtraction
STRIDE = 0.15  # radians of the fastest rate between two samples of a flight
MOST_SAMPLES = 1 << 15


def sinhc(z2: complex) -> complex:
    """Return sinh(z)/z of z squared, for |z| < 1."""
    total = term = 1.0 + 0.0j
    for j in range(1, 10):
        term *= z2 / ((2 * j) * (2 * j + 1))
        total += term
    return total


class Flight:
    """The motion of one oscillator away from its stop."""

    def __init__(
        self, mass: float, damping: float, stiffness: float, amplitude: float, omega: float, gap: float
    ) -> None:
        self.damp, self.stiff, self.drive = damping / mass, stiffness / mass, amplitude / mass
        self.omega, self.gap = omega, gap
        self.preload = self.stiff * gap
        self.split2 = 0.25 * self.damp * self.damp - self.stiff

    @cached_property
    def rates(self) -> tuple[complex, complex]:
        """The rates of free motion, the slower first; their product, not a difference, gives the slower one."""
        fast = -(0.5 * self.damp + cmath.sqrt(self.split2))
        return self.stiff / fast, fast

    @property
    def fastest(self) -> float:
        """The largest rate in 1/s at which anything changes."""
        return max(abs(self.omega), abs(self.rates[1]))

    def kick(self, tau: float) -> tuple[float, float]:
        """Return displacement q and velocity q' at tau after a unit kick in velocity."""
        z2 = self.split2 * tau * tau
        if abs(z2) < NEAR * NEAR:
            fade, shape = math.exp(-0.5 * self.damp * tau), tau * sinhc(z2).real
            # cosh z = 1 + 2 sinh^2(z/2)
            half = sinhc(0.25 * z2).real
            return fade * shape, fade * (1.0 + 0.5 * z2 * half * half - 0.5 * self.damp * shape)
        slow, fast = self.rates
        a, b = cmath.exp(slow * tau), cmath.exp(fast * tau)
        return ((a - b) / (slow - fast)).real, ((slow * a - fast * b) / (slow - fast)).real

    def driven(self, nu: complex, tau: float, q: float, dq: float) -> complex:
        """Return E(nu), the response from rest to the force e^{nu t}, given q and q' at tau."""
        slow, fast = self.rates
        if abs(nu - fast) < abs(nu - slow):
            slow, fast = fast, slow
        if abs(nu - slow) * abs(tau) >= NEAR:
            return (cmath.exp(nu * tau) - dq - (self.damp + nu) * q) / ((nu + self.damp) * nu + self.stiff)
        if abs(nu - fast) * abs(tau) >= 2.0 * NEAR:
            half = 0.5 * (nu - slow) * tau
            near = tau * cmath.exp(0.5 * (nu + slow) * tau) * sinhc(half * half)
            far = (cmath.exp(nu * tau) - cmath.exp(fast * tau)) / (nu - fast)
            return (near - far) / (slow - fast)
        return self._close_nodes(nu, tau)

    def _close_nodes(self, nu: complex, tau: float) -> complex:
        """Return the divided difference by its series about the mean of the nodes, whose symmetric sums are known."""
        mean = (nu - self.damp) / 3.0
        # About the mean the nodes are roots of x^3 + e2 x - e3.
        e2 = (self.stiff - self.damp * nu - 3.0 * mean * mean) * tau * tau
        e3 = (nu - mean) * (mean * mean + self.damp * mean + self.stiff) * tau * tau * tau
        h = [1.0 + 0.0j, 0.0j, -e2]
        for _ in range(18):
            h.append(e3 * h[-3] - e2 * h[-2])
        total, factorial = 0.0j, 1.0
        for j, term in enumerate(h):
            factorial *= max(j, 1)
            total += term / (factorial * (j + 1) * (j + 2))
        return total * tau * tau * cmath.exp(mean * tau)

    def after(self, angle: float, rate: float, tau: float) -> tuple[float, float]:
        """Return gap and rate at tau after leaving the stop at that rate and driving angle."""
        q, dq = self.kick(tau)
        steady, driven = self.driven(0.0, tau, q, dq).real, self.driven(1j * self.omega, tau, q, dq)
        turn = self.drive * cmath.exp(1j * angle)
        gap = q * rate + self.preload * steady - (turn * driven).imag
        return gap, dq * rate + self.preload * q - (turn * (q + 1j * self.omega * driven)).imag

    def slopes(self, angle: float, rate: float, tau: float) -> tuple[tuple[float, float], ...]:
        """Return gap and rate at tau, then their derivatives by angle, by the leaving rate, and by tau."""
        q, dq = self.kick(tau)
        driven = self.driven(1j * self.omega, tau, q, dq)
        turn = self.drive * cmath.exp(1j * angle)
        moved, hurried = turn * driven, turn * (q + 1j * self.omega * driven)
        gap = q * rate + self.preload * self.driven(0.0, tau, q, dq).real - moved.imag
        speed = dq * rate + self.preload * q - hurried.imag
        bend = self.bend(angle + self.omega * tau, gap, speed)
        return (gap, speed), (-moved.real, -hurried.real), (q, dq), (speed, bend)

    def bend(self, angle: float, gap: float, rate: float) -> float:
        """Return the second derivative of the gap."""
        return self.preload - self.drive * math.sin(angle) - self.damp * rate - self.stiff * gap

    def sampled(self, angle: float, rate: float, tau: float) -> tuple[Floats, Floats, Floats]:
        """Return times, gaps and rates along a flight from the stop, dense enough to show every near-miss."""
        number = min(MOST_SAMPLES, max(16, math.ceil(abs(tau) * self.fastest / STRIDE)))
        step = tau / number
        q, dq = self.kick(step)
        steady, driven = self.driven(0.0, step, q, dq).real, self.driven(1j * self.omega, step, q, dq)
        hurried = q + 1j * self.omega * driven
        sine, cosine = math.sin(self.omega * step), math.cos(self.omega * step)
        p, f, g = dq + self.damp * q, self.drive, self.preload
        # x = (u, u', sin, cos, 1) moves by one matrix a step; doubling fills the table.
        hop: Floats = np.array(
            [
                [p, q, -f * driven.real, -f * driven.imag, g * steady],
                [-self.stiff * q, dq, -f * hurried.real, -f * hurried.imag, g * q],
                [0.0, 0.0, cosine, sine, 0.0],
                [0.0, 0.0, -sine, cosine, 0.0],
                [0.0, 0.0, 0.0, 0.0, 1.0],
            ]
        )
        table: Floats = np.array([[0.0, rate, math.sin(angle), math.cos(angle), 1.0]]).T
        while table.shape[1] <= number:
            table = np.concatenate([table, hop @ table], axis=1)
            hop = hop @ hop
        times = np.asarray(step * np.arange(number + 1), dtype=np.float64)
        return times, table[0, : number + 1], table[1, : number + 1]
