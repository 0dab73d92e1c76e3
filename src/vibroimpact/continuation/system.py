r"""The equations that a branch or a boundary obeys, in scaled unknowns.

The unknown x holds turns and velocities of the impacts, for a graze in mid-flight the turns at which it touches, and
the free parameters as parts of their ranges. The misses of the flights, and on a boundary one condition more, vanish:

    fold: 1 - trace + determinant,   period doubling: 1 + trace + determinant,
    grazing: the velocity of one impact, or gap and rate at the touch.

One equation fewer than unknowns leaves a curve; with as many the point is isolated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property, partial
from typing import Any

import numpy as np

from vibroimpact.axes import NAMES
from vibroimpact.orbits.equations import TURN, Cycle, Floats, flight_of, parameters_of, slope
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, parameter_value
from vibroimpact.parameters import real_number

BRANCH, FOLD, DOUBLING, TOUCH, LAST_IMPACT = "branch", "fold", "period_doubling", "touch", "last_impact"


@dataclass(frozen=True)
class System:
    """Equations of a cycle with free parameters; `condition` says which boundary, `where` which flight or impact."""

    oscillator: ImpactOscillator
    cycle: Cycle
    names: tuple[str, ...]
    ranges: tuple[tuple[float, float], ...]
    speed: float
    condition: str = BRANCH
    where: int = 0

    @cached_property
    def inner(self) -> int:
        """How many of the unknowns are no parameters."""
        return 2 * self.cycle.n_impacts + (self.condition == TOUCH)

    def pack(self, z: Floats, osc: ImpactOscillator, touch: float = math.nan) -> Floats:
        """Return the unknown of a solution z of an oscillator."""
        p = self.cycle.n_impacts
        free = [
            (getattr(osc, name) - low) / (high - low) for name, (low, high) in zip(self.names, self.ranges, strict=True)
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

    def parameters(self, x: Floats) -> list[float]:
        """Return the seven numbers."""
        numbers = parameters_of(self.oscillator)
        for name, value in zip(self.names, self.values(x), strict=True):
            if name == "frequency":
                numbers[PARAMETERS.index("omega")] = TURN * value
            else:
                numbers[PARAMETERS.index(name)] = value
        return numbers

    def possible(self, x: Floats) -> bool:
        """Whether the flights have a meaning: there is a mass, a spring and a driving frequency."""
        m, _, k, _, w, _, _ = self.parameters(x)
        return m > 0.0 and k > 0.0 and w > 0.0

    def oscillator_at(self, x: Floats) -> ImpactOscillator:
        """Return the oscillator, its free parameters inside their ranges."""
        pairs = zip(self.names, self.values(x), self.ranges, strict=True)
        return self.oscillator.replace(**{name: min(max(value, low), high) for name, value, (low, high) in pairs})

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
        size = {
            "mass": m * slow,
            "damping": min(math.sqrt(k * m), m * w / self.cycle.n_periods),
            "stiffness": k * slow,
            "amplitude": force,
            "omega": w * slow,
            "frequency": w * slow / TURN,
            "restitution": 1.0,
            "gap": force / k,
        }
        free = [size[name] / (high - low) for name, (low, high) in zip(self.names, self.ranges, strict=True)]
        turns = np.full(self.inner - p, min(1.0, w / natural))
        speeds = np.maximum(np.abs(x[p : 2 * p]), 1e-3)
        return np.concatenate([turns[:p], speeds, turns[p:], free])


def check_parameter(name: Any) -> str:
    """Return the name of a parameter, or say which there are."""
    if name not in NAMES:
        close = get_close_matches(str(name), NAMES, 1)
        remedy = f"did you mean {close[0]!r}?" if close else "check the spelling"
        raise ValueError(f"`parameter` is {name!r}; allowed are {', '.join(NAMES)}; {remedy}")
    return str(name)


def check_range(name: str, given: Any, value: float) -> tuple[float, float]:
    """Return the ends of a range of a parameter that holds a value."""
    try:
        low, high = given
    except (TypeError, ValueError):
        raise ValueError(f"`range` is {given!r}; allowed are two numbers; give (lowest, highest) {name}") from None
    low, high = parameter_value(name, low), parameter_value(name, high)
    if not low < high:
        raise ValueError(f"`range` is ({low!r}, {high!r}); allowed is a lower number before a higher one; swap them")
    if not low <= value <= high:
        raise ValueError(
            f"`range` is ({low:g}, {high:g}); allowed is one that holds the orbit's {name}, {value:.12g}; widen it"
        )
    return low, high


def check_step(step: Any) -> float:
    """Return the longest step, a part of the range."""
    value = real_number("step", step, "a number above 0 and up to 0.5")
    if not 0.0 < value <= 0.5:
        raise ValueError(f"`step` is {step!r}; allowed is a number above 0 and up to 0.5; 0.01 is usual")
    return value


def check_orbit(name: str, orbit: Any) -> Orbit:
    """Return an orbit that flies from impact to impact."""
    if not isinstance(orbit, Orbit):
        raise ValueError(f"`{name}` is {orbit!r}; allowed is an Orbit; give one that find_orbit returned")
    if orbit.n_impacts < 1 or orbit.sticks:
        raise ValueError(
            f"`{name}` is a {orbit.name} orbit; allowed is one that never rests at the stop; "
            "follow its end of sticking with continue_boundary instead"
        )
    return orbit
