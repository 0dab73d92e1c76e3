r"""The free flight of a system, and what an impact does to it, without an infinite term at any damping and resonance.

Time is the driving angle, theta = w t. The state x = (sigma y, y') holds the mass-normalised modes y and their rates
by theta, with sigma = max(Omega/w, 1), so that both parts of a mode are of one size. Load and stops are linear in the
drive z = (1, sin h theta, ..., cos h theta, ...) over all orders h:

    x' = A x + F z,    z' = W z,    b - beta . y = clearance,    b = bounds z,

where each clearance is divided by the length of its direction in modes, sqrt(a . M^-1 a), so that |beta| = 1. Then
an impact of restitution r turns y' to y' - (1 + r) v beta, with v = beta . y' - b' its velocity. Where r is a law of v,
derivatives take R = d(r v)/dv in its place.

Over a flight of length tau the state becomes x(tau) = Phi x(0) + Psi z(0). Both are blocks of one matrix exponential
(C. F. Van Loan, IEEE Trans. Automat. Control 23 (1978) 395-404): no steady state is used, which a free mass or an
undamped mode in resonance would not have.
"""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.system import ImpactSystem

TERMS = 18  # 1/19! is below rounding


def growth(matrix: Floats) -> Floats:
    """Return exp(`matrix`) - 1, accurate also where that is small: a Taylor series, then squared as often as needed."""
    size = float(np.abs(matrix).sum(axis=0).max(initial=0.0))
    squarings = max(0, math.frexp(size)[1])
    part = matrix * 0.5**squarings
    found: Floats = part / TERMS
    for j in range(TERMS - 1, 0, -1):
        found = (part + part @ found) / j
    for _ in range(squarings):
        found = 2.0 * found + found @ found
    return found


class Flow:
    """The flights and impacts of one system in scaled modes."""

    def __init__(self, system: ImpactSystem) -> None:
        form = system.modal()
        n, self.omega, self.restitution = len(form.squares), form.omega, form.restitution
        self.laws = [None if stop.ratio is not None else stop.law for stop in system.stops]
        roots, self.orders = np.sqrt(form.masses), form.orders.astype(float)
        rates = np.sqrt(form.squares) / self.omega
        self.units = np.maximum(rates, 1.0)
        self.damping = roots[:, None] * form.damping / roots / self.omega
        self.matrix = np.zeros((2 * n, 2 * n))
        self.matrix[:n, n:] = np.diag(self.units)
        self.matrix[n:, :n] = -np.diag(rates**2 / self.units)
        self.matrix[n:, n:] = -self.damping
        harmonic = [form.forces.T.real, form.forces.T.imag]
        load = np.column_stack([form.constant, *harmonic]) * roots[:, None] / self.omega**2
        self.load = np.vstack([np.zeros_like(load), load])
        towards = form.directions / roots
        self.lengths = np.linalg.norm(towards, axis=1)
        self.beta = towards / self.lengths[:, None]
        self.bounds = np.column_stack([form.gaps, form.motions.real, form.motions.imag]) / self.lengths[:, None]
        self.turning = np.zeros((load.shape[1],) * 2)
        first = 1 + np.arange(len(self.orders))
        self.turning[first, first + len(self.orders)] = self.orders
        self.turning[first + len(self.orders), first] = -self.orders
        to_displacement, to_rate = form.shapes / roots / self.units, self.omega * form.shapes / roots
        self.physical = np.block([[to_displacement, np.zeros((n, n))], [np.zeros((n, n)), to_rate]])

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.units)

    @property
    def fastest(self) -> float:
        """The largest rate, per unit of the driving angle, at which anything changes."""
        return float(max(self.units.max(), np.abs(self.damping).sum(axis=1).max(), self.orders.max(initial=1.0)))

    def drive(self, angle: float) -> Floats:
        """Return z at a driving angle."""
        return np.concatenate([[1.0], np.sin(self.orders * angle), np.cos(self.orders * angle)])

    def over(self, angle: float) -> tuple[Floats, Floats]:
        """Return Phi - 1 and Psi of a flight over an angle."""
        sizes = np.linalg.norm(self.load, axis=0)
        pairs = np.hypot(*sizes[1:].reshape(2, -1))  # sine and cosine of one order have one scale
        sizes = np.concatenate([sizes[:1], pairs, pairs])
        sizes[sizes == 0.0] = 1.0
        whole = np.block([[self.matrix, self.load / sizes], [np.zeros(self.load.T.shape), self.turning]])
        grown = growth(whole * angle)
        return grown[: 2 * self.n, : 2 * self.n], grown[: 2 * self.n, 2 * self.n :] * sizes

    def fly(self, x: Floats, begin: float, end: float) -> Floats:
        """Return the state at the angle `end` of a flight that has the state x at `begin`."""
        grown, driven = self.over(end - begin)
        found: Floats = x + grown @ x + driven @ self.drive(begin)
        return found

    def rate(self, x: Floats, z: Floats) -> Floats:
        """Return x'."""
        found: Floats = self.matrix @ x + self.load @ z
        return found

    def clearance(self, stop: int, x: Floats, z: Floats) -> tuple[float, float, float]:
        """Return the clearance of a stop over its length, and its first two derivatives."""
        beta, rate = self.beta[stop], self.rate(x, z)
        bound, turned = self.bounds[stop], self.turning @ z
        return (
            float(bound @ z - beta @ (x[: self.n] / self.units)),
            float(bound @ turned - beta @ x[self.n :]),
            float(bound @ (self.turning @ turned) - beta @ rate[self.n :]),
        )

    def rebound(self, stop: int, closing: float) -> tuple[float, float]:
        """Return r and R of an impact at which the clearance over its length has that rate."""
        law, r = self.laws[stop], float(self.restitution[stop])
        if law is None:
            return r, r
        v = max(-closing * float(self.lengths[stop]) * self.omega, 0.0)
        return law(v), law(v) + v * law.slope(v)

    def struck(self, stop: int, x: Floats, z: Floats) -> Floats:
        """Return the state just after an impact."""
        found, closing = x.copy(), self.clearance(stop, x, z)[1]
        found[self.n :] += (1.0 + self.rebound(stop, closing)[0]) * closing * self.beta[stop]
        return found

    def reflection(self, stop: int, x: Floats, z: Floats) -> Floats:
        """Return the derivative of the state after an impact by the one before it, at a fixed time."""
        found, factor = np.eye(2 * self.n), 1.0 + self.rebound(stop, self.clearance(stop, x, z)[1])[1]
        found[self.n :, self.n :] -= factor * np.outer(self.beta[stop], self.beta[stop])
        return found

    def kicked(self, stop: int, x: Floats, z: Floats) -> Floats:
        """Return the derivative of the state after an impact by the driving angle, at a fixed state before it."""
        found, bound = np.zeros(2 * self.n), self.bounds[stop]
        factor = 1.0 + self.rebound(stop, self.clearance(stop, x, z)[1])[1]
        found[self.n :] = factor * float(bound @ self.turning @ self.turning @ z) * self.beta[stop]
        return found

    def saltation(self, stop: int, x: Floats, z: Floats) -> Floats:
        r"""Return the saltation matrix of an impact; infinite at a graze.

        In (y, y') it is, with the damping D and u'' of the clearance just before the impact,

        .. math:: \begin{pmatrix} \Gamma(r) & 0 \\
                  ((1 + r) D \beta - (1 + R) \beta u''/v)\beta^T & \Gamma(R) \end{pmatrix}, \qquad
                  \Gamma(r) = 1 - (1 + r) \beta \beta^T,

        whose determinant is r R, also for moving stops.
        """
        n, beta = self.n, self.beta[stop]
        _, closing, bend = self.clearance(stop, x, z)
        r, slope = self.rebound(stop, closing)
        bent = bend / -closing if closing else math.inf
        moved, turned = (np.eye(n) - (1.0 + factor) * np.outer(beta, beta) for factor in (r, slope))
        with np.errstate(invalid="ignore"):
            below = np.outer((1.0 + r) * (self.damping @ beta) - (1.0 + slope) * bent * beta, beta) / self.units
        found: Floats = np.block([[self.units[:, None] * moved / self.units, np.zeros((n, n))], [below, turned]])
        return found
