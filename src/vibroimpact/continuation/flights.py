r"""The equations of a branch or a boundary for one mass, in scaled unknowns.

The unknown x holds turns and velocities of the impacts, for a graze in mid-flight the turns of the touch, and the free
parameters relative to their ranges. The equations set the residuals of the flights to zero and, on a boundary, one more
condition:

    fold: 1 - trace + determinant,   period doubling: 1 + trace + determinant,
    grazing: the velocity of one impact, or gap and rate at the touch.

A free parameter may be any parameter of the model. A family gives the oscillator's parameters only through its
function, so derivatives with respect to its parameters are central differences.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from vibroimpact.continuation.equations import (
    DOUBLING,
    FOLD,
    LAST_IMPACT,
    LEAST,
    NUDGE,
    TOUCH,
    Equations,
    Range,
)
from vibroimpact.continuation.modes import modes_of
from vibroimpact.model.oscillator import ImpactOscillator, the_oscillator
from vibroimpact.orbits.admissibility import closest, nearest_misses, orbit_size
from vibroimpact.orbits.equations import TURN, Cycle, Floats, fastest_of, flight_of, parameters_of
from vibroimpact.orbits.events import Nearest
from vibroimpact.orbits.one_mass import make_orbit, solution_of
from vibroimpact.orbits.orbit import Orbit


@dataclass(frozen=True, kw_only=True)
class Flights(Equations):
    """Equations of a cycle of one mass; `speed` in m/s is the scale of velocities."""

    cycle: Cycle
    speed: float

    @cached_property
    def oscillator(self) -> ImpactOscillator:
        """The model's own oscillator, at the beginning of the curve."""
        return the_oscillator(self.model)

    @property
    def size(self) -> int:
        """Number of turns and velocities of all impacts."""
        return 2 * self.cycle.n_impacts

    @property
    def impacts(self) -> int:
        """Number of impacts of the cycle."""
        return self.cycle.n_impacts

    @property
    def length(self) -> float:
        """Driving periods of the cycle."""
        return self.cycle.n_periods

    def scaled(self, z: Floats) -> Floats:
        """Return turns, and velocities relative to the speed."""
        p = self.cycle.n_impacts
        return np.concatenate([z[:p], z[p:] / self.speed])

    def solution(self, x: Floats) -> Floats:
        """Return turns and velocities."""
        p = self.cycle.n_impacts
        z = x[: 2 * p].copy()
        z[p:] *= self.speed
        return z

    @cached_property
    def _places(self) -> list[tuple[int, float]] | None:
        """The oscillator parameter that each free parameter sets, and a factor; None if it sets none directly."""
        if self.model is not self.oscillator:
            return None
        places = {name: (i, 1.0) for i, name in enumerate(self.model.values)}
        places["frequency"] = places["omega"][0], TURN
        return [places[name] for name in self.names] if set(self.names) <= set(places) else None

    def parameters(self, x: Floats) -> list[float]:
        """Return the oscillator's parameters; those of a family are extrapolated linearly beyond the ranges."""
        values = self.values(x)
        if self._places is not None:
            numbers = parameters_of(self.oscillator)
            for (i, factor), value in zip(self._places, values, strict=True):
                numbers[i] = factor * value
            return numbers
        inside = self.inside(values)
        beyond = np.subtract(values, inside)
        numbers = self._numbers(inside)
        return numbers if not beyond.any() else (np.array(numbers) + beyond @ self._slopes(inside)).tolist()

    def _numbers(self, values: list[float]) -> list[float]:
        return parameters_of(self.model.at(**dict(zip(self.names, values, strict=True))))

    def _slopes(self, values: list[float]) -> Floats:
        """Return the derivatives of the oscillator's parameters with respect to the free ones, one row per free one."""
        rows = []
        for j, (low, high) in enumerate(self.ranges):
            below, above = (max(low, values[j] - NUDGE * (high - low)), min(high, values[j] + NUDGE * (high - low)))
            moved = [np.array(self._numbers([*values[:j], value, *values[j + 1 :]])) for value in (below, above)]
            rows.append((moved[1] - moved[0]) / (above - below))
        return np.array(rows)

    def possible(self, x: Floats) -> bool:
        """Whether the flights are defined: mass, stiffness and driving frequency are positive."""
        try:
            m, _, k, _, w, _, _ = self.parameters(x)
        except ValueError:  # the family rejects these values
            return False
        return m > 0.0 and k > 0.0 and w > 0.0

    def flights(self, x: Floats) -> Floats:
        """Return the residuals of the flights, relative to the speed and the length scale that belongs to it."""
        return self.cycle.misses(self.parameters(x), self.solution(x)) / self.scales[0]

    @cached_property
    def scales(self) -> tuple[Floats, Floats]:
        """The scales of the residuals, and of turns and velocities."""
        return self.cycle.scales(self.oscillator, self.speed)

    def conditions(self, x: Floats) -> list[float]:
        """Return the conditions of the boundary, which vanish on it."""
        parameters, z = self.parameters(x), self.solution(x)
        ahead = (self.touch(x) - self.cycle.span(z, self.impact)[0]) * TURN / parameters[4]
        return self._condition(parameters, z, ahead, self.scales[0][0], self.speed)

    def _condition(self, parameters: list[float], z: Floats, ahead: float, length: float, speed: float) -> list[float]:
        """Return the scaled conditions of the boundary; a touch is `ahead` s away."""
        cycle = self.cycle
        if self.condition == FOLD:
            return [1.0 - cycle.trace(parameters, z) + cycle.determinant(parameters)]
        if self.condition == DOUBLING:
            return [self._doubling(parameters, z, speed)]
        if self.condition == LAST_IMPACT:
            return [float(z[cycle.n_impacts + self.impact]) / speed]
        if self.condition == TOUCH:
            angle, rate, _ = cycle.takeoff(parameters, z, self.impact)
            gap, slope = flight_of(parameters).after(angle, rate, ahead)
            return [gap / length, slope / speed]
        return []

    def _doubling(self, parameters: list[float], z: Floats, speed: float) -> float:
        """Return (1 + mu_1) (1 + mu_2) times the lowest velocity: where that is 0, a multiplier is infinite."""
        cycle = self.cycle
        product = 1.0 + cycle.trace(parameters, z) + cycle.determinant(parameters)
        return product * float(z[cycle.n_impacts :].min()) / speed

    def flights_jacobian(self, x: Floats) -> Floats:
        """Return the scaled derivative of the flights' residuals with respect to turns and velocities."""
        rows, columns = self.scales
        return self.cycle.linearised(self.parameters(x), self.solution(x))[1] * columns / rows[:, None]

    def sizes(self, x: Floats) -> Floats:
        """Return the change of each unknown that changes the flights by order one."""
        m, _, k, f, w, _, g = self.parameters(x)
        p, natural = self.cycle.n_impacts, math.sqrt(k / m)
        slow = min(1.0, w / (self.cycle.n_periods * natural))  # phase errors add up over a cycle
        force = max(abs(f), k * abs(g), LEAST * self.speed * math.sqrt(k * m))
        damping = min(math.sqrt(k * m), m * w / self.cycle.n_periods)
        numbers = [m * slow, damping, k * slow, force, w * slow, 1.0, force / k]
        free = [
            (size if math.isfinite(size) else high - low) / (high - low)
            for size, (low, high) in zip(self._steps(x, numbers), self.ranges, strict=True)
        ]
        turns = np.full(self.inner - p, min(1.0, w / natural))
        speeds = np.maximum(np.abs(x[p : 2 * p]), LEAST)
        return np.concatenate([turns[:p], speeds, turns[p:], free])

    def _steps(self, x: Floats, numbers: list[float]) -> list[float]:
        """Return the change of each free parameter that changes an oscillator parameter by that amount."""
        if self._places is not None:
            return [numbers[i] / factor for i, factor in self._places]
        slopes = np.abs(self._slopes(self.inside(self.values(x))))
        with np.errstate(divide="ignore", invalid="ignore"):
            steps: list[float] = np.where(slopes > 0.0, np.array(numbers) / slopes, math.inf).min(axis=1).tolist()
        return steps

    def oscillator_at(self, x: Floats) -> ImpactOscillator:
        """Return the oscillator, with the free parameters limited to their ranges."""
        osc: ImpactOscillator = self.model_at(x).at()
        return osc

    def orbit(self, x: Floats) -> Orbit:
        """Return the orbit of a solution."""
        return make_orbit(self.model_at(x), self.cycle, self.solution(x))

    def velocities(self, x: Floats) -> Floats:
        """Return the velocities of the impacts in m/s."""
        return self.solution(x)[self.cycle.n_impacts :]

    def speeds(self, x: Floats) -> Floats:
        """Return the velocities of the impacts relative to the speed."""
        return self.velocities(x) / self.speed

    def nearest(self, x: Floats) -> Nearest | None:
        """Return the closest approach of the mass to the stop between impacts."""
        return closest(self.oscillator_at(x), self.cycle, self.solution(x))

    def tests(self, x: Floats) -> dict[str, float]:
        """Return the test of period doublings."""
        return {DOUBLING: self._doubling(self.parameters(x), self.solution(x), self.speed)}

    def residual(self, x: Floats) -> float:
        """Return the residual of the flights and of the condition, relative to the orbit's size."""
        osc, z, p = self.oscillator_at(x), self.solution(x), self.cycle.n_impacts
        parameters, size, speed = parameters_of(osc), orbit_size(osc, z), fastest_of(osc, z[p:])
        flights = self.cycle.misses(parameters, z) / np.repeat([size, speed], p)
        ahead = (self.touch(x) - self.cycle.span(z, self.impact)[0]) * osc.period
        condition = self._condition(parameters, z, ahead, size, speed)
        return max(float(np.abs(flights).max()), *map(abs, condition))

    def touching(self, x: Floats) -> Nearest | None:
        """Return the near-miss whose gap is closest to zero; at a graze, another flight may penetrate the stop."""
        misses = nearest_misses(self.oscillator, self.cycle, self.solution(x))
        return min(misses, key=lambda miss: abs(miss.margin), default=None)

    def halves(self, x: Floats) -> Floats | None:
        """Return the difference between the halves of a doubled orbit."""
        p, n = self.cycle.n_impacts, self.cycle.n_periods
        if p % 2 or n % 2:
            return None
        h = p // 2
        return np.concatenate([x[h:p] - x[:h] - 0.5 * n, x[p + h : 2 * p] - x[p : p + h]])

    def half(self, x: Floats) -> tuple[Equations, Floats]:
        """Return the period doubling at which the halves of a doubled orbit coincide, and their mean."""
        p, n = self.cycle.n_impacts, self.cycle.n_periods
        h = p // 2
        half = replace(self, cycle=Cycle(n // 2, h), condition=DOUBLING)
        turns = 0.5 * (x[:h] + x[h:p] - 0.5 * n)
        return half, np.concatenate([turns, 0.5 * (x[p : p + h] + x[p + h : 2 * p]), x[2 * p :]])

    def twice(self, z: Floats) -> tuple[Equations, Floats]:
        """Return the equations of two rounds, and the orbit traversed twice."""
        n, p = self.cycle.n_periods, self.cycle.n_impacts
        return replace(self, cycle=Cycle(2 * n, 2 * p)), np.concatenate([z[:p], z[:p] + n, z[p:], z[p:]])


def equations_of(orbit: Any, names: tuple[str, ...], ranges: tuple[Range, ...]) -> tuple[Equations, Floats]:
    """Return the equations of an orbit with free parameters, and its solution, for `pack`."""
    if not orbit.oscillator.forgets:
        return modes_of(orbit, names, ranges)
    cycle, z = solution_of(orbit)
    speed = fastest_of(orbit.oscillator, z[cycle.n_impacts :])
    return Flights(model=orbit.model, cycle=cycle, names=names, ranges=ranges, speed=speed), z
