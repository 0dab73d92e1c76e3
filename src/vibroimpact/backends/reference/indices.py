"""Indices that need more than kept impacts, for the `reference` back end: exponents, names, rests, near-misses.

A ledger records every contact, rest and near-miss of a motion. When the window is full, it is decided whether the
motion is certainly a cycle; if so, these indices are computed over one cycle, else over the window.

Perturbations follow the Jacobian of the impact map. With a0 the acceleration just after impact 0 and a1 just before
impact 1, a perturbed motion whose impact 0 is dt0 later and dv0 faster has an impact 1 that is dt1 later and dv1
faster,

    (dt1, dv1) = [[-1/v1, 0], [-a1/v1, 1]] Phi(tau) [[r v0, 0], [-a0, -r]] (dt0, dv0),

where Phi is the transition matrix of (y, y') in free flight and tau how long it lasts. Its determinant is r^2 (v0/v1)
exp(-c tau/m). Just after impact 0 the deviation of (y, y') is the last of these matrices times (dt0, dv0); its length
is |y| + h |y'| with h = STEP/L, L the fastest rate. The choice of length and initial direction changes the exponent by
about one part in the number of impacts, and not at all on a cycle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.reference.flight import Floats, FreeMotion
from vibroimpact.backends.reference.motion import Contact, Flight, Rest, closest_miss, time_between

CLOSE = 1e-9  # of V, and of a radian: tolerance of recurring impacts, and of the distance to the periodic orbit
UNRESOLVED = math.log(1e13)  # ln of the growth of perturbations at which rounding decides when a mass rests again
NOT_SMALL = 1e-3  # of the cycle's weakest impact: convergence over a longer distance might pass a graze
STEP = 2.4  # radians of the fastest rate
BEGIN = (1.0, 0.7)  # initial direction (y, h y'), special for no oscillator


@dataclass
class Ledger:
    """All contacts and rests of a motion, in the order of time."""

    free: FreeMotion
    # (periods, phase, speed, whether it counts, flight time since the contact or release before, closest miss on it)
    contacts: list[tuple[float, float, float, bool, float, float]] = field(default_factory=list)
    # (contacts before it, its duration in s, whole periods at its release)
    rests: list[tuple[int, float, float]] = field(default_factory=list)
    flown: float = 0.0
    miss: float = math.inf

    def write(self, event: Contact | Flight | Rest) -> None:
        """Record an event; a contact without speed is a touch that does not end the flight."""
        if isinstance(event, Flight):
            self.flown += event.duration
            self.miss = min(self.miss, closest_miss(self.free, event.start, event.duration, event.end))
        elif isinstance(event, Rest):
            if event.release is not None:
                stays = time_between(self.free, event.settled, event.release)
                self.rests.append((len(self.contacts), stays, event.release.periods))
            self.flown = 0.0
        elif event.speed > 0.0:
            after = event.after
            self.contacts.append((after.periods, after.phase, event.speed, event.counts, self.flown, self.miss))
            self.flown, self.miss = 0.0, math.inf


@dataclass(frozen=True)
class Cycle:
    """A certain cycle of whole periods: the contacts after `first` up to `last`, and ln of its spectral radius."""

    periods: int
    first: int
    last: int
    log_radius: float


class Account:
    """The evaluation of a ledger; `speed_scale` is V, `loss` is m (1 - r^2)/2."""

    def __init__(self, ledger: Ledger, restitution: float, speed_scale: float, loss: float) -> None:
        self.free, self.restitution, self.speed_scale, self.loss = ledger.free, restitution, speed_scale, loss
        self.periods, self.phase, self.speed, counts, self.flight, self.miss = np.array(ledger.contacts).T
        self.counted = np.flatnonzero(counts)
        self.rests = ledger.rests
        # The tangent begins with the flight to this contact, where no memory of the past is left. After two releases
        # the motion is superstable: it repeats from the first release on, independent of the past.
        self.begun = self.rests[-1][0] if self.rests else 0
        self.superstable = len(self.rests) >= 2
        self.tangent = Tangent(self.free, restitution, self.phase, self.speed, self.flight)

    def indices(self, transient: int) -> dict[str, float]:
        """Return the indices of the cycle, else of the window from the impact after `transient` ones to the last."""
        cycle = self._sticking_cycle() if self.superstable else self._impacting_cycle()
        if cycle is not None:
            return self._of_cycle(cycle)
        return self._of_window(transient)

    def _of_cycle(self, cycle: Cycle) -> dict[str, float]:
        contacts = slice(cycle.first + 1, cycle.last + 1)
        recorded = self.counted[(self.counted > cycle.first) & (self.counted <= cycle.last)]
        resolved = not self.superstable or self.tangent.parting(contacts.start, cycle.last) < UNRESOLVED
        number, time = len(recorded), cycle.periods * self.free.period
        return {
            "lyapunov": cycle.log_radius / time,
            "lyapunov_per_impact": cycle.log_radius / max(number, 1),
            "n_periods": cycle.periods if resolved else 0,
            "n_impacts": -1 if not resolved or (self.superstable and self.restitution > 0.0) else number,
            "dissipation": self.loss * float((self.speed[recorded] ** 2).sum()) / cycle.periods,
            "stick_fraction": self.rests[-1][1] / time if self.superstable else 0.0,
            "grazing_margin": float(self.miss[contacts].min(initial=math.inf)),
        }

    def _of_window(self, transient: int) -> dict[str, float]:
        first, last = int(self.counted[transient]), int(self.counted[-1])
        margin = float(self.miss[first + 1 : last + 1].min(initial=math.inf))
        if first == last:
            return {"grazing_margin": margin}
        time = self._turns(first, last) * self.free.period
        rests = sum(stays for before, stays, _ in self.rests if before > first)
        # A rest in the window erases all memory of the past.
        growth = self.tangent.growth(first, last, self.begun) if self.begun <= first else -math.inf
        return {
            "grazing_margin": margin,
            "stick_fraction": rests / time,
            "lyapunov": growth / time,
            "lyapunov_per_impact": growth / (len(self.counted) - 1 - transient),
        }

    def _turns(self, first: int, last: int) -> float:
        return float((self.periods[last] - self.periods[first]) + (self.phase[last] - self.phase[first]))

    def _sticking_cycle(self) -> Cycle:
        (before, _, earlier), (end, _, later) = self.rests[-2:]
        return Cycle(round(later - earlier), before - 1, end - 1, -math.inf)

    def _impacting_cycle(self) -> Cycle | None:
        """Return the shortest recurrence of the last impacts, if its Jacobian makes it certain.

        With M the Jacobian and d the difference after one recurrence, the periodic orbit is at the distance (I - M)^-1
        d; the motion converges to it if the spectral radius of M is below 1.
        """
        span = self._recurrence(self.counted[self.counted >= self.begun])
        if span is None:
            return None
        first, last = span
        log_radius, matrix = self.tangent.cycle(first, last)
        if log_radius >= 0.0:
            return None
        turns = self._turns(first, last)
        missing = np.array([(turns - round(turns)) * self.free.period, self.speed[last] - self.speed[first]])
        late, faster = np.abs(np.linalg.solve(np.eye(2) - matrix, missing))
        allowed = min(CLOSE * self.speed_scale, NOT_SMALL * float(self.speed[first + 1 : last + 1].min()))
        certain = self.free.omega * late <= CLOSE and faster <= allowed
        return Cycle(round(turns), first, last, log_radius) if certain else None

    def _recurrence(self, recorded: NDArray[np.intp]) -> tuple[int, int] | None:
        """Return the two contacts of the shortest recurrence of all impacts between them, in (v, sin, cos)."""
        angle = 2.0 * math.pi * self.phase[recorded]
        states = np.column_stack([self.speed[recorded] / self.speed_scale, np.sin(angle), np.cos(angle)])
        longest = len(states) // 2
        back = (np.abs(states[-1] - states[::-1][1 : longest + 1]) <= CLOSE).all(axis=1)
        for p in np.flatnonzero(back) + 1:
            first, last = int(recorded[-1 - p]), int(recorded[-1])
            # In a chatter, successive impacts are close to each other, but less than a period apart.
            again = (np.abs(states[-p:] - states[-2 * p : -p]) <= CLOSE).all()
            if again and round(self._turns(first, last)) >= 1:
                return first, last
        return None


class Tangent:
    """The Jacobians along a chain of contacts, from their phases and speeds and the flight times before them."""

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
        self.arriving = landing @ flow  # from (y, y') at the beginning of the flight to (t, v) of its contact
        self.step = np.concatenate([self.arriving[:1], self.arriving[1:] @ self.leaving[:-1]])

    def growth(self, first: int, last: int, begun: int) -> float:
        """Return ln of the growth of a tangent vector from just after contact `first` to just after contact `last`.

        The vector is `BEGIN` at the beginning of the flight to contact `begun`, which is not later than `first`.
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

        The vector is `BEGIN` at the beginning of the flight to contact `first`, and is reset to it whenever it has
        become shorter.
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

        The determinant of a closed cycle is known: r^(2 contacts) exp(-c time/m). The matrix is normalised, so that
        long cycles do not underflow.
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
