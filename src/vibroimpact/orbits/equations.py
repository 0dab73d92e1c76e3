r"""The equations of a period-n impact-p orbit, and its stability.

Unknown are the turns s_i (times of impacts in driving periods) and the velocities v_i just before them, i = 1 ... p,
with s_{p+1} = s_1 + n. Flight i leaves the stop at s_i with velocity -r v_i and must come back at s_{i+1} with
v_{i+1}:

    u_i(s_{i+1}) = 0,    -u_i'(s_{i+1}) = v_{i+1}.

They are smooth also where the mass could not really move so, which is how a branch passes a graze.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orbits.flights import Flight
from vibroimpact.oscillator import ImpactOscillator

Floats = NDArray[np.float64]
Parameters = Sequence[float]  # in the order of oscillator.PARAMETERS

TURN = 2.0 * math.pi
STEP = 1e-5  # of a variable's size: differences are then right to about 1e-10, enough for Newton's method


def parameters_of(osc: ImpactOscillator) -> list[float]:
    """Return the seven numbers."""
    return [osc.mass, osc.damping, osc.stiffness, osc.amplitude, osc.omega, osc.restitution, osc.gap]


def flight_of(parameters: Parameters) -> Flight:
    """Return the free flight of an oscillator given by its seven numbers."""
    m, c, k, f, w, _, g = parameters
    return Flight(m, c, k, f, w, g)


@dataclass(frozen=True)
class Cycle:
    """The equations for one name: n driving periods and p impacts. The unknown is z = (s_1 ... s_p, v_1 ... v_p)."""

    n_periods: int
    n_impacts: int

    def span(self, z: Floats, i: int) -> tuple[float, float]:
        """Return the turns at which flight i begins and ends."""
        return float(z[i]), float(z[i + 1] if i + 1 < self.n_impacts else z[0] + self.n_periods)

    def takeoff(self, parameters: Parameters, z: Floats, i: int) -> tuple[float, float, float]:
        """Return driving angle and rate with which flight i leaves the stop, and its duration in s."""
        begin, end = self.span(z, i)
        return TURN * begin, parameters[5] * float(z[self.n_impacts + i]), (end - begin) * TURN / parameters[4]

    def misses(self, parameters: Parameters, z: Floats) -> Floats:
        """Return by how much each flight misses its impact: p gaps, then p velocities."""
        p, flight = self.n_impacts, flight_of(parameters)
        ends = [flight.after(*self.takeoff(parameters, z, i)) for i in range(p)]
        late = [-rate - float(z[p + (i + 1) % p]) for i, (_, rate) in enumerate(ends)]
        return np.array([gap for gap, _ in ends] + late)

    def jacobian(self, parameters: Parameters, z: Floats) -> Floats:
        """Return the derivative of the misses by z: a flight knows its two ends and its start's velocity alone."""
        p, flight, matrix = self.n_impacts, flight_of(parameters), np.zeros((2 * self.n_impacts, 2 * self.n_impacts))
        period = TURN / parameters[4]
        for i in range(p):
            _, by_angle, by_rate, by_time = flight.slopes(*self.takeoff(parameters, z, i))
            after = (i + 1) % p
            for row, sign, j in ((i, 1.0, 0), (p + i, -1.0, 1)):
                matrix[row, i] += sign * (TURN * by_angle[j] - period * by_time[j])
                matrix[row, after] += sign * period * by_time[j]
                matrix[row, p + i] += sign * parameters[5] * by_rate[j]
            matrix[p + i, p + after] -= 1.0
        return matrix

    def determinant(self, parameters: Parameters) -> float:
        """Return the determinant of the cycle's Jacobian, r^(2p) exp(-c n T/m)."""
        m, c, _, _, w, r, _ = parameters
        return r ** (2 * self.n_impacts) * math.exp(-c * self.n_periods * TURN / (w * m))

    def trace(self, parameters: Parameters, z: Floats) -> float:
        """Return the trace of the cycle's Jacobian in (y, y'): flows and saltations in turns."""
        p, flight, r = self.n_impacts, flight_of(parameters), parameters[5]
        a, b, c, d = 1.0, 0.0, 0.0, 1.0
        for i in range(p):
            begin, end = self.span(z, i)
            q, dq = flight.kick((end - begin) * TURN / parameters[4])
            held, back = dq + flight.damp * q, -flight.stiff * q
            a, b, c, d = held * a + q * c, held * b + q * d, back * a + dq * c, back * b + dq * d
            v = float(z[p + (i + 1) % p])
            # y'' = -u'' just before (y' = v) and just after (y' = -r v).
            before, after = -flight.bend(TURN * end, 0.0, -v), -flight.bend(TURN * end, 0.0, r * v)
            kick = (after + r * before) / v if v else math.inf
            a, b, c, d = -r * a, -r * b, kick * a - r * c, kick * b - r * d
        return a + d

    def multipliers(self, parameters: Parameters, z: Floats) -> tuple[complex, complex]:
        """Return the Floquet multipliers, the larger first, or the one above the real axis first."""
        return multipliers(self.trace(parameters, z), self.determinant(parameters))


def multipliers(trace: float, determinant: float) -> tuple[complex, complex]:
    """Return the two numbers of given sum and product; the smaller as a quotient, not a difference."""
    if not math.isfinite(trace):
        return complex(math.inf), 0j  # at a graze the Jacobian is singular
    half = 0.5 * trace
    split = half * half - determinant
    if split < 0.0:
        side = math.sqrt(-split)
        return complex(half, side), complex(half, -side)
    large = half + math.copysign(math.sqrt(split), half)
    return complex(large), complex(determinant / large if large else 0.0)


def slope(function: Callable[[float], Floats], at: float, size: float) -> Floats:
    """Return the derivative of a function at a number of that size, by differences."""
    h = STEP * size
    return (function(at + h) - function(at - h)) / (2.0 * h)
