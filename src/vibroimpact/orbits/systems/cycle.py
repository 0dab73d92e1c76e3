r"""The equations of an orbit with given impacts, for Newton's method, and its stability.

Unknown are the driving angles theta_1 ... theta_p of the impacts of one cycle, on stops that are given, and the state
x_1 just before the first. From there flights and impacts give the states x_i before the others and x_{p+1} after a
cycle of length Theta, at theta_1 + Theta. An orbit has

    x_{p+1} = s x_1,    clearance of the struck stop = 0 at theta_1 ... theta_p,

with Theta = 2 pi n and s = 1. In a symmetric system, where with q(t) also -q(t + T/2) is a motion, there are orbits
that are mirrored after half their length: Theta = pi n, n odd, and s = -1, with the impacts of half a cycle.

The derivatives are exact: with x' just before (-) and after (+) an impact, and Gamma and k the derivatives of the state
after it by the state before it and by time,

    dx_{i+1} = Phi_i (Gamma_i dx_i + (k_i - x'_i+) dtheta_i) + x'_{i+1}- dtheta_{i+1}.

Multipliers are those of the product of flows and saltation matrices; for a mirrored half cycle times s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.systems.flow import Flow


@dataclass(frozen=True, eq=False)
class Cycle:
    """The impacts of one cycle, or of half of one that is mirrored, and its equations.

    `stops` are struck one after the other; `images` of all stops in the mirror make it half of a cycle of `n_periods`.
    The unknown is an array of p angles and 2n numbers of the state before the first impact.
    """

    flow: Flow
    n_periods: int
    stops: tuple[int, ...]
    images: tuple[int, ...] = ()

    @property
    def sign(self) -> float:
        """What the state is multiplied by over the cycle."""
        return -1.0 if self.images else 1.0

    @property
    def length(self) -> float:
        """Driving angle of the cycle, or of half of it."""
        return TURN * self.n_periods * (0.5 if self.images else 1.0)

    def struck_after(self, i: int) -> int:
        """Return the stop that flight i ends on."""
        following = (*self.stops, self.images[self.stops[0]] if self.images else self.stops[0])
        return following[i + 1]

    def angles(self, unknown: Floats) -> Floats:
        """Return the driving angles of the impacts, and of the first one of the next cycle."""
        p = len(self.stops)
        return np.append(unknown[:p], unknown[0] + self.length)

    def states(self, unknown: Floats) -> list[Floats]:
        """Return the states just before the impacts, and before the first one of the next cycle."""
        found, angles = [unknown[len(self.stops) :]], self.angles(unknown)
        for i, stop in enumerate(self.stops):
            after = self.flow.struck(stop, found[-1], self.flow.drive(angles[i]))
            found.append(self.flow.fly(after, angles[i], angles[i + 1]))
        return found

    def speeds(self, unknown: Floats) -> Floats:
        """Return the velocities of the impacts over the lengths of their stops' directions, by the driving angle."""
        flow, states = self.flow, self.states(unknown)
        drives = [flow.drive(angle) for angle in unknown[: len(self.stops)]]
        return np.array([-flow.clearance(*at)[1] for at in zip(self.stops, states, drives, strict=False)])

    def velocities(self, unknown: Floats) -> Floats:
        """Return the velocities of the impacts in m/s."""
        found: Floats = self.speeds(unknown) * self.flow.lengths[list(self.stops)] * self.flow.omega
        return found

    def linearised(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Return the misses and their derivative: clearances at the impacts, then by how much the cycle is open."""
        flow, p, n = self.flow, len(self.stops), self.flow.n
        angles, x = self.angles(unknown), unknown[p:]
        slope = np.hstack([np.zeros((2 * n, p)), np.eye(2 * n)])
        misses, matrix = np.zeros(p + 2 * n), np.zeros((p + 2 * n, p + 2 * n))
        for i, stop in enumerate(self.stops):
            z = flow.drive(angles[i])
            misses[i] = flow.clearance(stop, x, z)[0]
            matrix[i] = -(flow.beta[stop] / flow.units) @ slope[:n]
            matrix[i, i] += float(flow.bounds[stop] @ flow.turning @ z)
            after = flow.struck(stop, x, z)
            slope = flow.reflection(stop, x, z) @ slope
            slope[:, i] += flow.kicked(stop, x, z) - flow.rate(after, z)
            grown, driven = flow.over(angles[i + 1] - angles[i])
            x, slope = after + grown @ after + driven @ z, slope + grown @ slope
            slope[:, (i + 1) % p] += flow.rate(x, flow.drive(angles[i + 1]))
        misses[p:] = x - self.sign * unknown[p:]
        matrix[p:] = slope
        matrix[p:, p:] -= self.sign * np.eye(2 * n)
        return misses, matrix

    def monodromy(self, unknown: Floats) -> Floats:
        """Return the Jacobian of the cycle from just before its first impact, in scaled modes."""
        flow, angles = self.flow, self.angles(unknown)
        found: Floats = self.sign * np.eye(2 * flow.n)
        for i, (stop, x) in enumerate(zip(self.stops, self.states(unknown), strict=False)):
            found = flow.saltation(stop, x, flow.drive(angles[i])) @ found
            found = found + flow.over(angles[i + 1] - angles[i])[0] @ found
        return found

    def multipliers(self, unknown: Floats) -> tuple[complex, ...]:
        """Return the Floquet multipliers of the cycle, or of half of it, the largest first."""
        jacobian = self.monodromy(unknown)
        if not np.isfinite(jacobian).all():  # at a graze
            return (complex(math.inf), *(0j for _ in jacobian[1:]))
        found: NDArray[np.complex128] = np.linalg.eigvals(jacobian).astype(complex)
        return tuple(complex(value) for value in sorted(found, key=lambda value: (-abs(value), -value.imag)))
