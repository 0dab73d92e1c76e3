"""How far around its present value a parameter is varied, and what a change of it is measured in."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from vibroimpact.orbits.orbit import value_of
from vibroimpact.oscillator import ImpactOscillator, Model, check_names
from vibroimpact.parameters import Parameter, invalid

LIGHT = 0.05  # of critical damping: how much is tried where there is none
CROWDED = 1.5  # values along a path lie at (j/n)^1.5 of its way: a near boundary matters more than a far one
TRIALS = 24  # bisections of a range whose end is no design of a family


@dataclass(frozen=True)
class Range:
    """A parameter, its present value, the range around it, and what a change is measured in.

    `of` names what a relative change refers to; empty where it is the present value itself.
    """

    name: str
    value: float
    low: float
    high: float
    scale: float
    of: str = ""

    def end(self, direction: int) -> float:
        """Return the last value downwards (-1) or upwards (+1)."""
        return self.low if direction < 0 else self.high

    def path(self, direction: int, number: int) -> list[float]:
        """Return values from beside the present one to the end, close together at first; none without room."""
        end = self.end(direction)
        if end == self.value:
            return []
        shares = [(j / number) ** CROWDED for j in range(1, number + 1)]
        return [self.between(self.value, end, share) for share in shares[:-1]] + [end]

    def between(self, first: float, last: float, share: float) -> float:
        """Return the value a share of the way along: equal ratios where both are positive, else equal differences."""
        if not self.of and first > 0.0 and last > 0.0:
            return first * math.exp(share * math.log(last / first))
        return first + share * (last - first)

    def change(self, value: float) -> float:
        """Return the change to a value, signed, relative to the scale."""
        return (value - self.value) / self.scale

    def percent(self, value: float) -> str:
        """Return the size of a change in words: '3.1 %', or '12 % of f/k'."""
        size = percent(abs(self.change(value)))
        return f"{size} of {self.of}" if self.of else size


def percent(share: float) -> str:
    """Return a share in per cent, two digits of it or all before the point."""
    size = f"{100.0 * share:.2g}"
    return f"{100.0 * share:.0f} %" if float(size) >= 100.0 else f"{size} %"


def range_of(model: Model, name: str, within: float) -> Range:
    """Return the range from value / (1 + within) to value * (1 + within), or around zero what its physics scales with.

    The gap is measured against the static deflection f/k where that is larger, damping that is zero against critical
    damping, a force that is zero against k |g|, a restitution that is zero against 1. A parameter of a family is varied
    by `within` times its size where it is not positive, and no further than the family makes a design.
    """
    value, parameter = value_of(model, name), model.parameters[name]
    if isinstance(model, ImpactOscillator) and (name == "gap" or value <= 0.0):
        return _gap(model, value, within) if name == "gap" else _from_zero(model, name, within)
    if value > 0.0:
        chosen = Range(name, value, value / (1.0 + within), min(value * (1.0 + within), parameter.high), value)
    else:
        size = abs(value) or 1.0
        low, high = max(value - within * size, parameter.low), min(value + within * size, parameter.high)
        chosen = Range(name, value, low, high, size, "" if value else f"1 {parameter.unit}".removesuffix(" 1"))
    if isinstance(model, ImpactOscillator):
        return chosen
    return replace(chosen, low=_possible(model, chosen, -1), high=_possible(model, chosen, 1))


def _gap(osc: ImpactOscillator, value: float, within: float) -> Range:
    deflection = osc.amplitude / osc.stiffness
    scale = max(abs(value), deflection)
    of = "f/k" if deflection >= abs(value) else ""
    if scale == 0.0:
        scale, of = 1.0, "1 m"
    return Range("gap", value, value - within * scale, value + within * scale, scale, of)


def _from_zero(osc: ImpactOscillator, name: str, within: float) -> Range:
    if name in ("damping", "damping_ratio"):
        critical = 1.0 if name == "damping_ratio" else 2.0 * math.sqrt(osc.stiffness * osc.mass)
        return Range(name, 0.0, 0.0, LIGHT * within * critical, critical, "critical damping")
    if name == "restitution":
        return Range(name, 0.0, 0.0, min(1.0, within), 1.0, "1")
    hold = osc.stiffness * abs(osc.gap)
    return Range(name, 0.0, 0.0, within * (hold or 1.0), hold or 1.0, "k |g|" if hold else "1 N")


def _possible(model: Model, chosen: Range, direction: int) -> float:
    """Return the end of a family's range, drawn in to where the family still makes a design."""
    inside, end = chosen.value, chosen.end(direction)
    outside = end
    for _ in range(TRIALS):
        try:
            model.at(**{chosen.name: outside})
        except ValueError:
            end = outside
        else:
            inside = outside
        if inside == end:
            break
        outside = 0.5 * (inside + end)
    return inside


def check_parameters(model: Model, names: Iterable[str] | None) -> tuple[str, ...]:
    """Return the names of the parameters to vary, or say which there are."""
    if names is None:
        return tuple(model.values)
    chosen = (names,) if isinstance(names, str) else tuple(names)
    check_names(model.parameters, chosen)
    if len(set(chosen)) < len(chosen):
        raise invalid("parameters", chosen, "each parameter once", "drop the repeated one")
    return chosen


def check_within(within: float) -> float:
    """Return how far parameters are varied, relative to their present values."""
    hint = "3 varies from a quarter to fourfold"
    return Parameter("within", "range", low=0.0, closed=False, hint=hint).check(within)
