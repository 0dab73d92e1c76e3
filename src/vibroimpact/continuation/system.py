r"""The equations that a branch or a boundary obeys, in scaled unknowns.

The unknown x holds turns and velocities of the impacts, for a graze in mid-flight the turns at which it touches, and
the free parameters as parts of their ranges. The misses of the flights, and on a boundary one condition more, vanish:

    fold: 1 - trace + determinant,   period doubling: 1 + trace + determinant,
    grazing: the velocity of one impact, or gap and rate at the touch.

One equation fewer than unknowns leaves a curve; with as many the point is isolated.

A free parameter may be any of the model's. Of a family's own parameters the oscillator's numbers are known only as the
function that makes them: their derivatives are central differences of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from vibroimpact.orbits.equations import TURN, Cycle, Floats, flight_of, parameters_of, slope
from vibroimpact.orbits.orbit import Orbit, value_of
from vibroimpact.oscillator import ImpactOscillator, Model, check_names
from vibroimpact.parameters import invalid, real_number

BRANCH, FOLD, DOUBLING, TOUCH, LAST_IMPACT = "branch", "fold", "period_doubling", "touch", "last_impact"
NUDGE = 1e-6  # of a range: by so much a family's parameter is moved to see how the oscillator depends on it


@dataclass(frozen=True)
class System:
    """Equations of a cycle with free parameters; `condition` says which boundary, `where` which flight or impact."""

    model: Model
    cycle: Cycle
    names: tuple[str, ...]
    ranges: tuple[tuple[float, float], ...]
    speed: float
    condition: str = BRANCH
    where: int = 0

    @cached_property
    def oscillator(self) -> ImpactOscillator:
        """The model's own oscillator, which is where the curve begins."""
        return self.model.at()

    @cached_property
    def inner(self) -> int:
        """How many of the unknowns are no parameters."""
        return 2 * self.cycle.n_impacts + (self.condition == TOUCH)

    def pack(self, z: Floats, touch: float = math.nan) -> Floats:
        """Return the unknown of a solution z of the model at its own values."""
        p = self.cycle.n_impacts
        free = [
            (value_of(self.model, name) - low) / (high - low)
            for name, (low, high) in zip(self.names, self.ranges, strict=True)
        ]
        return np.concatenate([z[:p], z[p:] / self.speed, [touch] if self.condition == TOUCH else [], free])

    def solution(self, x: Floats) -> Floats:
        """Return turns and velocities."""
        p = self.cycle.n_impacts
        z = x[: 2 * p].copy()
        z[p:] *= self.speed
        return z

    def values(self, x: Floats) -> list[float]:
        """Return the free parameters."""
        return [
            low + float(part) * (high - low) for part, (low, high) in zip(x[self.inner :], self.ranges, strict=True)
        ]

    def _inside(self, values: list[float]) -> list[float]:
        return [min(max(value, low), high) for value, (low, high) in zip(values, self.ranges, strict=True)]

    @cached_property
    def _own(self) -> list[tuple[int, float]] | None:
        """Which of the oscillator's numbers each free parameter is, and times what; None where it is no such number."""
        if not isinstance(self.model, ImpactOscillator):
            return None
        places = {name: (i, 1.0) for i, name in enumerate(self.model.values)}
        places["frequency"] = places["omega"][0], TURN
        return [places[name] for name in self.names] if set(self.names) <= set(places) else None

    def parameters(self, x: Floats) -> list[float]:
        """Return the oscillator's numbers; those of a family go on in a straight line beyond the ranges."""
        values = self.values(x)
        if self._own is not None:
            numbers = parameters_of(self.oscillator)
            for (i, factor), value in zip(self._own, values, strict=True):
                numbers[i] = factor * value
            return numbers
        inside = self._inside(values)
        beyond = np.subtract(values, inside)
        numbers = self._numbers(inside)
        return numbers if not beyond.any() else (np.array(numbers) + beyond @ self._slopes(inside)).tolist()

    def _numbers(self, values: list[float]) -> list[float]:
        return parameters_of(self.model.at(**dict(zip(self.names, values, strict=True))))

    def _slopes(self, values: list[float]) -> Floats:
        """Return the derivatives of the oscillator's numbers by the free parameters, a row for each of these."""
        if self._own is not None:
            own = np.zeros((len(values), len(parameters_of(self.oscillator))))
            for row, (i, factor) in zip(own, self._own, strict=True):
                row[i] = factor
            return own
        rows = []
        for j, (low, high) in enumerate(self.ranges):
            below, above = (max(low, values[j] - NUDGE * (high - low)), min(high, values[j] + NUDGE * (high - low)))
            moved = [np.array(self._numbers([*values[:j], value, *values[j + 1 :]])) for value in (below, above)]
            rows.append((moved[1] - moved[0]) / (above - below))
        return np.array(rows)

    def possible(self, x: Floats) -> bool:
        """Whether the flights have a meaning: there is a mass, a spring and a driving frequency."""
        try:
            m, _, k, _, w, _, _ = self.parameters(x)
        except ValueError:  # a family makes no oscillator of these values
            return False
        return m > 0.0 and k > 0.0 and w > 0.0

    def model_at(self, x: Floats) -> Model:
        """Return the model, its free parameters inside their ranges."""
        return self.model.replace(**dict(zip(self.names, self._inside(self.values(x)), strict=True)))

    def oscillator_at(self, x: Floats) -> ImpactOscillator:
        """Return the oscillator that the model is there."""
        return self.model_at(x).at()

    def misses(self, x: Floats) -> Floats:
        """Return what must vanish, in parts of the speed and of the length that goes with it."""
        parameters, z = self.parameters(x), self.solution(x)
        misses = self.cycle.misses(parameters, z) / self._rows
        return misses if self.condition == BRANCH else np.append(misses, self._conditions(x, parameters, z))

    @cached_property
    def _rows(self) -> Floats:
        length = self.speed / max(self.oscillator.natural_frequency, self.oscillator.omega)
        return np.repeat([length, self.speed], self.cycle.n_impacts)

    def _conditions(self, x: Floats, parameters: list[float], z: Floats) -> list[float]:
        cycle = self.cycle
        if self.condition == FOLD:
            return [1.0 - cycle.trace(parameters, z) + cycle.determinant(parameters)]
        if self.condition == DOUBLING:
            return [1.0 + cycle.trace(parameters, z) + cycle.determinant(parameters)]
        if self.condition == LAST_IMPACT:
            return [float(z[cycle.n_impacts + self.where]) / self.speed]
        if self.condition == TOUCH:
            angle, rate, _ = cycle.takeoff(parameters, z, self.where)
            ahead = (float(x[self.inner - 1]) - cycle.span(z, self.where)[0]) * TURN / parameters[4]
            gap, speed = flight_of(parameters).after(angle, rate, ahead)
            return [gap / self._rows[0], speed / self.speed]
        return []

    def jacobian(self, x: Floats) -> Floats:
        """Return the derivative of the misses: of the flights by turns and velocities in closed form, the rest not."""
        p, inner = self.cycle.n_impacts, self.inner
        parameters, z, rows = self.parameters(x), self.solution(x), self._rows
        columns = np.repeat([1.0, self.speed], p)
        sizes = self._sizes(x, parameters)
        matrix = np.zeros((2 * p + len(self._conditions(x, parameters, z)), len(x)))
        matrix[: 2 * p, : 2 * p] = self.cycle.jacobian(parameters, z) * columns / rows[:, None]
        for j in range(len(x)):
            first = 0 if j >= inner else 2 * p
            if first < len(matrix):
                matrix[first:, j] = slope(partial(self._moved, x, j, first), x[j], sizes[j])
        return matrix

    def _moved(self, x: Floats, j: int, first: int, value: float) -> Floats:
        """Return the misses, those of the flights only if `first` is 0, with one unknown changed."""
        moved = x.copy()
        moved[j] = value
        if first == 0:
            return self.misses(moved)
        return np.array(self._conditions(moved, self.parameters(moved), self.solution(moved)))

    def _sizes(self, x: Floats, parameters: list[float]) -> Floats:
        """Return by how much each unknown must change to change the flights by something of order one."""
        m, _, k, f, w, _, g = parameters
        p, natural = self.cycle.n_impacts, math.sqrt(k / m)
        slow = min(1.0, w / (self.cycle.n_periods * natural))  # free turns in a cycle multiply a change of pace
        force = max(abs(f), k * abs(g), 1e-3 * self.speed * math.sqrt(k * m))
        damping = min(math.sqrt(k * m), m * w / self.cycle.n_periods)
        numbers = np.array([m * slow, damping, k * slow, force, w * slow, 1.0, force / k])
        slopes = np.abs(self._slopes(self._inside(self.values(x))))
        with np.errstate(divide="ignore", invalid="ignore"):
            sizes = np.where(slopes > 0.0, numbers / slopes, math.inf).min(axis=1)
        free = [
            (size if math.isfinite(size) else high - low) / (high - low)
            for size, (low, high) in zip(sizes.tolist(), self.ranges, strict=True)
        ]
        turns = np.full(self.inner - p, min(1.0, w / natural))
        speeds = np.maximum(np.abs(x[p : 2 * p]), 1e-3)
        return np.concatenate([turns[:p], speeds, turns[p:], free])


def check_range(owner: Orbit | Model, name: Any, given: Any) -> tuple[float, float]:
    """Return the ends of a range of a parameter of a model, or of an orbit's model, whose value it must then hold."""
    model = owner.model if isinstance(owner, Orbit) else owner
    check_names(model.parameters, [name])
    try:
        low, high = given
    except (TypeError, ValueError):
        raise invalid("range", given, "two numbers", f"give (lowest, highest) {name}") from None
    low, high = model.parameters[name].check(low), model.parameters[name].check(high)
    if not low < high:
        raise invalid("range", (low, high), "a lower number before a higher one")
    if isinstance(owner, Orbit) and not low <= owner.value(name) <= high:
        raise invalid("range", (low, high), f"one that holds the orbit's {name}, {owner.value(name):.12g}", "widen it")
    return low, high


def check_share(name: str, share: Any) -> float:
    """Return a length that is a share of the ranges, of a driving period and of the orbit's speed."""
    allowed = "a number above 0 and up to 0.5"
    value = real_number(name, share, allowed)
    if not 0.0 < value <= 0.5:
        raise invalid(name, share, allowed, "0.01 is usual")
    return value


def check_orbit(name: str, orbit: Any) -> Orbit:
    """Return an orbit that flies from impact to impact."""
    if not isinstance(orbit, Orbit):
        raise invalid(name, orbit, "an Orbit", "give one that find_orbit returned")
    if orbit.n_impacts < 1 or orbit.sticks:
        raise invalid(
            name,
            orbit.name,
            "an orbit that never rests at the stop",
            "follow its end of sticking with continue_boundary instead",
        )
    return orbit
