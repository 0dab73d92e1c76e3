"""Indices of a motion, from its account.

If the motion is certainly a cycle, indices other than those of impact velocities are those of one cycle, else of the
window: from its first impact to its last one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.backends.base import ImpactWindow
from vibroimpact.backends.reference.designs import Design
from vibroimpact.backends.reference.ledger import Ledger, Leg, seconds
from vibroimpact.backends.reference.stops import Floats
from vibroimpact.backends.reference.tangent import product

CLOSE = 1e-9  # of V, and of a radian: tolerance of recurring impacts, and of the distance to the periodic orbit
UNRESOLVED = math.log(1e13)  # ln of the growth of deviations at which rounding decides when all rests again
STEP = 2.4  # radians of the fastest rate
NOT_SMALL = 1e-3  # of the cycle's weakest impact: convergence over a longer distance might pass a graze


class Account:
    """The evaluation of a ledger over a window of impacts."""

    def __init__(self, ledger: Ledger, design: Design, window: ImpactWindow) -> None:
        self.design, self.period = design, design.eq.period
        self.legs = ledger.legs[: window.transient + window.keep]
        self.kept = self.legs[window.transient :]
        # The length of a deviation is the sum of |eta| L/2.4 and |eta'|, with L the fastest rate.
        n, rate = design.eq.n, design.eq.fastest / STEP
        self.units = np.repeat([rate, 1.0], n)
        self.deviation = np.outer([1.0, 0.7 * rate], 1.0 / np.arange(1.0, n + 1.0)).ravel() * design.felt
        self.periods, self.span = self._cycle()

    def indices(self, by_stop: bool) -> dict[str, Any]:
        """Return all indices, one number per stop if asked for those that have one."""
        stops: Any = np.array([leg.stop for leg in self.kept])
        which = [stops == j for j in range(self.design.eq.s)] if by_stop else [stops >= 0]
        parts = [self._of_velocities(each) for each in which]
        found: dict[str, Any] = {name: np.array([part[name] for part in parts]) for name in parts[0]}
        found |= self._of_stops(by_stop)
        return (found if by_stop else {name: values[0] for name, values in found.items()}) | self._of_motion()

    def _of_velocities(self, which: Any) -> dict[str, float]:
        """Return the indices of the kept impacts that a mask selects."""
        span = seconds(self.kept[0], self.kept[-1], self.period) / self.period
        found = {"impacts_per_period": float(which[1:].sum()) / span if span else math.nan}
        if not which.any():
            return found | dict.fromkeys(("std", "mean_velocity", "max_velocity", "impact_phase_spread"), math.nan)
        velocity = np.array([leg.speed for leg in self.kept])[which]
        angle = 2.0 * math.pi * np.array([leg.turns[1] for leg in self.kept])[which]
        # Shifted by the first one, so that nearly equal velocities keep the digits of their differences.
        shifted = velocity - velocity[0]
        return found | {
            "std": float(np.std(shifted)),
            "mean_velocity": float(velocity[0] + shifted.mean()),
            "max_velocity": float(velocity.max()),
            "impact_phase_spread": max(1.0 - abs(complex(np.exp(1j * angle).mean())), 0.0),
        }

    def _of_stops(self, by_stop: bool) -> dict[str, Floats]:
        """Return what stops take and how they are touched, over the span."""

        def over(values: Any) -> Floats:
            return np.asarray(values if by_stop else [np.sum(values)])

        span, time = self.span, self.time
        energy, impulse, force = (
            sum((getattr(leg, name) for leg in span), np.zeros(self.design.eq.s))
            for name in ("energy", "impulse", "force")
        )
        force = np.max([leg.force for leg in span], axis=0, initial=0.0) if span else force
        force = np.where(self.design.eq.impenetrable, np.nan, force)
        miss = np.min([leg.miss for leg in span], axis=0, initial=math.inf) if span else np.full(len(energy), math.inf)
        rest = sum((leg.rest for leg in span), np.zeros(len(energy) + 1))
        with np.errstate(divide="ignore", invalid="ignore"):
            return {
                "dissipation": over(energy) * self.period / time,
                "work_rate": over(energy) / time,
                "mean_force": over(impulse) / time,
                "max_force": force if by_stop else np.array([np.fmax.reduce(force, initial=np.nan)]),
                "stick_fraction": (rest[:-1] if by_stop else rest[-1:]) / time,
                "grazing_margin": miss if by_stop else miss.min(keepdims=True, initial=math.inf),
            }

    def _of_motion(self) -> dict[str, float]:
        """Return the exponents, the name, and what dampers take."""
        span, time = self.span, self.time
        found = {"damper_rate": sum(leg.drained for leg in span) / time if span else math.nan}
        if self.periods:
            resolved = not self.forgets or self._parting() < UNRESOLVED
            grown, number = self.log_radius, len(span)
            chatters = any(leg.chatters for leg in span)
            found["n_periods"] = self.periods if resolved else 0
            found["n_impacts"] = number if resolved and not chatters else -1
        else:
            grown, number = self._grown(self.legs[: len(self.legs) - len(span)], span), len(span)
        return found | {
            "lyapunov": grown / time if span else math.nan,
            "lyapunov_per_impact": grown / number if number else math.nan,
        }

    @property
    def time(self) -> float:
        """The length of the span in s."""
        if self.periods:
            return self.periods * self.period
        return seconds(self.kept[0], self.kept[-1], self.period)

    def _length(self, deviation: Any) -> float:
        return float(np.abs(self.units * deviation).sum())

    def _grown(self, before: list[Leg], within: list[Leg]) -> float:
        """Return ln of the growth of a deviation over legs; those before give it its direction.

        Where a rest takes all of it, it begins anew before these legs; within them the growth is minus infinity.
        """
        vector, grown = self.deviation, 0.0
        for leg in before:
            vector = leg.matrix @ vector
            vector = vector if self._length(vector) > 0.0 else leg.fresh @ self.deviation
            vector = vector / self._length(vector) if self._length(vector) > 0.0 else self.deviation
        for leg in within:
            vector = leg.matrix @ vector
            length = self._length(vector)
            if length == 0.0:
                return -math.inf
            vector, grown = vector / length, grown + math.log(length)
        return grown

    def _parting(self) -> float:
        """Return ln of the largest growth of a deviation from any impact of the cycle to a later one."""
        fresh = self.deviation / self._length(self.deviation)
        vector, grown, most = fresh, 0.0, 0.0
        for leg in self.span:
            vector = leg.fresh @ vector
            length = self._length(vector)
            grown += math.log(length) if length > 0.0 else -math.inf
            vector, grown = (vector / length, grown) if grown > 0.0 else (fresh, 0.0)
            most = max(most, grown)
        return most

    def _cycle(self) -> tuple[int, list[Leg]]:
        """Return the periods and the legs of a certain cycle; or 0, and the legs of the window but its first."""
        self.forgets, self.log_radius = False, -math.inf
        for find in (self._released, self._recurred):
            first, last, periods = find()
            if periods:
                return periods, self.legs[first + 1 : last + 1]
        return 0, self.kept[1:]

    def _released(self) -> tuple[int, int, int]:
        """Return the last two releases from a rest in which nothing was free to move: what follows is the same."""
        rests = [i for i, leg in enumerate(self.legs) if leg.release is not None]
        for earlier, later in zip(rests[-2::-1], rests[:0:-1], strict=False):
            (stops, *before), (again, *after) = self.legs[earlier].release, self.legs[later].release
            turns = (after[0] - before[0]) + (after[1] - before[1])
            if stops == again and abs(turns - round(turns)) * 2.0 * math.pi <= CLOSE and round(turns) >= 1:
                self.forgets = True
                return earlier, later, round(turns)
            break
        return 0, 0, 0

    def _recurred(self) -> tuple[int, int, int]:
        """Return the shortest recurrence of the last impacts, if its Jacobian makes it certain.

        With M the Jacobian and d the difference after one recurrence, the periodic orbit is at the distance (I - M)^-1
        d; the motion converges to it if the spectral radius of M is below 1.
        """
        if not self.legs:
            return 0, 0, 0
        speed, felt = self.design.speed, self.design.felt
        states = np.array([leg.state for leg in self.legs]) * self.units / speed
        angle = 2.0 * math.pi * np.array([leg.turns[1] for leg in self.legs])
        marks = np.column_stack([states[:, felt], np.cos(angle), np.sin(angle), [leg.stop for leg in self.legs]])
        last = len(marks) - 1
        back = (np.abs(marks[-1] - marks[::-1][1 : len(marks) // 2 + 1]) <= CLOSE).all(axis=1)
        for p in (np.flatnonzero(back) + 1).tolist():
            if not (np.abs(marks[-p:] - marks[-2 * p : -p]) <= CLOSE).all():
                continue
            first = last - p
            turns = seconds(self.legs[first], self.legs[last], 1.0)
            if round(turns) < 1:  # in a chatter successive impacts are close to each other
                continue
            radius, matrix = product([leg.matrix for leg in self.legs[first + 1 :]])
            if radius >= 0.0:
                return 0, 0, 0
            late = (turns - round(turns)) * self.period
            missing = (self.legs[last].state - self.legs[first].state - self.legs[last].rate * late) * felt
            away = np.abs(self.units * np.linalg.solve(np.eye(len(matrix)) - matrix, missing)).max()
            weakest = min(leg.speed for leg in self.legs[first + 1 :])
            if away > min(CLOSE * speed, NOT_SMALL * weakest):
                return 0, 0, 0
            self.log_radius = radius
            return first, last, round(turns)
        return 0, 0, 0
