"""How neighbours of an orbit move, for the `reference` back end: by the Jacobian of the impact map.

With a0 the acceleration just after impact 0 and a1 just before impact 1, a neighbour that hits dt0 later and dv0
faster hits next dt1 later and dv1 faster,

    (dt1, dv1) = [[-1/v1, 0], [-a1/v1, 1]] Phi(tau) [[r v0, 0], [-a0, -r]] (dt0, dv0),

where Phi is the transition matrix of (y, y') in free flight and tau how long it lasts. Its determinant is
r^2 (v0/v1) exp(-c tau/m). Just after impact 0 the deviation of (y, y') is the last of these matrices times (dt0, dv0);
its length is |y| + h |y'| with h = STEP/L, L the fastest rate. Length and first direction matter as one part in the
number of impacts, and not at all on a cycle.
"""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.backends.reference.flight import Floats, FreeMotion

STEP = 2.4  # radians of the fastest rate
BEGIN = (1.0, 0.7)  # (y, h y'): a direction that no oscillator singles out


class Tangent:
    """The Jacobians along a chain of contacts, given their phases and speeds and the flight times that led to them."""

    def __init__(self, free: FreeMotion, restitution: float, phase: Floats, speed: Floats, flight: Floats) -> None:
        self.restitution, self.damp = restitution, free.damp
        self.units = np.array([1.0, STEP / free.fastest])
        push = free.drive * np.sin(2.0 * math.pi * phase) - free.preload
        nothing, one = np.zeros_like(speed), np.ones_like(speed)
        before, after = push - free.damp * speed, push + free.damp * restitution * speed
        self.flight = flight
        self.leaving = _matrices(restitution * speed, nothing, -after, -restitution * one)
        landing = _matrices(-1.0 / speed, nothing, -before / speed, one)
        flow = np.tile(np.eye(2), (len(flight), 1, 1))
        flow[flight > 0.0] = free.propagators(flight[flight > 0.0])[:, :2, :2]
        self.arriving = landing @ flow  # from (y, y') where the flight begins to (t, v) of its contact
        self.step = np.concatenate([self.arriving[:1], self.arriving[1:] @ self.leaving[:-1]])

    def growth(self, first: int, last: int, begun: int) -> float:
        """Return ln of the growth of a tangent vector from just after contact `first` to just after contact `last`.

        The vector is `BEGIN` where the flight to contact `begun`, not later than `first`, begins.
        """
        deviation = self.arriving[begun] @ (np.array(BEGIN) / self.units)
        size = size_first = 0.0
        for i in range(begun, last + 1):
            if i > begun:
                deviation = self.step[i] @ deviation
            largest = float(np.abs(deviation).max())
            if largest == 0.0:
                return -math.inf
            deviation, size = deviation / largest, size + math.log(largest)
            if i == first:
                size_first = size + self._log_length(i, deviation)
        return size + self._log_length(last, deviation) - size_first

    def parting(self, first: int, last: int) -> float:
        """Return ln of the largest growth of a tangent vector between any two contacts from `first` to `last`.

        It is `BEGIN` where the flight to contact `first` begins, and wherever it has shrunk to less than it was there.
        """
        fresh = np.array(BEGIN) / self.units / sum(BEGIN)
        state, grown, most = fresh, 0.0, 0.0
        for i in range(first, last + 1):
            after = self.leaving[i] @ (self.arriving[i] @ state)
            length = float(np.abs(self.units * after).sum())
            grown += math.log(length) if length > 0.0 else -math.inf
            state, grown = (after / length, grown) if grown > 0.0 else (fresh, 0.0)
            most = max(most, grown)
        return most

    def _log_length(self, contact: int, deviation: Floats) -> float:
        length = float(np.abs(self.units * (self.leaving[contact] @ deviation)).sum())
        return math.log(length) if length > 0.0 else -math.inf

    def cycle(self, first: int, last: int) -> tuple[float, Floats]:
        """Return ln of the spectral radius of the Jacobian M from contact `first` to contact `last`, and M.

        The determinant of a closed cycle is known: r^(2 contacts) exp(-c time/m). The matrix is kept at size one, so
        that long cycles do not underflow.
        """
        matrix, size = np.eye(2), 0.0
        for step in self.step[first + 1 : last + 1]:
            matrix = step @ matrix
            largest = float(np.abs(matrix).max())
            if largest == 0.0:
                return -math.inf, matrix
            matrix, size = matrix / largest, size + math.log(largest)
        contacts, time = last - first, float(self.flight[first + 1 : last + 1].sum())
        twice_ln_r = 2.0 * math.log(self.restitution) if self.restitution > 0.0 else -math.inf
        determinant = contacts * twice_ln_r - self.damp * time
        half_trace = 0.5 * abs(float(np.trace(matrix)))
        apart = half_trace**2 - math.exp(min(determinant - 2.0 * size, 1.0))
        if apart <= 0.0:
            return 0.5 * determinant, math.exp(size) * matrix
        return size + math.log(half_trace + math.sqrt(apart)), math.exp(size) * matrix


def _matrices(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    return np.stack([a, b, c, d], axis=-1).reshape(-1, 2, 2)
