"""The range over which each parameter is varied, the scale of its changes, and where along it a benefit begins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

from vibroimpact.model import Model, check_names
from vibroimpact.model.scales import LIGHT, is_own_scale, scale_of
from vibroimpact.orbits.orbit import value_of
from vibroimpact.parameters import Parameter, invalid, several

PLACES = 36  # values along a path, at least
CROWDED = 1.5  # values along a path lie at (j/n)^1.5 of its way: a near boundary matters more than a far one
FARTHEST = 1000.0  # how many times a parameter may be varied, at most
TRIALS = 24  # bisections of a range whose end is no design of a family
CANDIDATES = 6  # values beyond the first good one at which advice is tested
ANY, ENDS = ("softer", "no_chaos", "no_impact"), ("no_impact",)  # benefits that are looked for


@dataclass(frozen=True)
class Range:
    """A parameter of a model, its present value, the range around it, and the scale of changes.

    `of` names what a relative change refers to; empty if it is the present value itself.
    """

    model: Model
    name: str
    value: float
    low: float
    high: float
    scale: float
    of: str = ""

    @property
    def only_scales(self) -> bool:
        """Whether the motion is proportional to the parameter: the force on one mass with zero gap."""
        design = self.model.at()
        force = design is self.model and self.name == "amplitude" and self.value > 0.0
        return force and not any(stop.gap for stop in design.stops)

    def at(self, value: float) -> Any:
        """Return the oscillator or system of the model at another value."""
        return self.model.at(**{self.name: value})

    def end(self, direction: int) -> float:
        """Return the end of the range downwards (-1) or upwards (+1)."""
        return self.low if direction < 0 else self.high

    def path(self, direction: int, number: int) -> list[float]:
        """Return values from next to the present one to the end, close together at first; none if there is no range."""
        end = self.end(direction)
        return [*self.before(end, number), end] if end != self.value else []

    def before(self, end: float, number: int) -> list[float]:
        """Return values between the present one and an end, close together at first, without these two."""
        return [self.between(self.value, end, (j / number) ** CROWDED) for j in range(1, number)]

    def between(self, first: float, last: float, share: float) -> float:
        """Return the value at a fraction of the way: equal ratios if both ends are positive, else equal differences."""
        if not self.of and first > 0.0 and last > 0.0:
            return first * math.exp(share * math.log(last / first))
        return first + share * (last - first)

    def cut(self, first: float, last: float, parts: int) -> list[float]:
        """Return the values that divide the way between two values into a number of parts, with both ends."""
        return [first, *(self.between(first, last, j / parts) for j in range(1, parts)), last]

    def change(self, value: float) -> float:
        """Return the change to a value, signed, relative to the scale."""
        return (value - self.value) / self.scale

    def widest_step(self, values: Sequence[float]) -> float:
        """Return the largest change from one value to the next."""
        changes = map(self.change, values)
        return max((abs(after - before) for before, after in pairwise(changes)), default=0.0)

    def percent(self, value: float) -> str:
        """Return the size of a change in words: '3.1 %', or '12 % of f/k'."""
        size = percent(abs(self.change(value)))
        return f"{size} of {self.of}" if self.of else size


def percent(share: float) -> str:
    """Return a share in per cent, with two digits, or with all digits before the point."""
    size = f"{100.0 * share:.2g}"
    return f"{100.0 * share:.0f} %" if float(size) >= 100.0 else f"{size} %"


def range_of(model: Model, name: str, within: float) -> Range:
    """Return the range from value / (1 + within) to value * (1 + within), or one around zero of the physical scale.

    The gap of one mass, and a number that is not positive, is varied by `within` times its `scale_of`, damping by
    `LIGHT` of that; and no further than the family makes a design.
    """
    present, parameter = present_value(model, name), model.parameters[name]
    value = present.value
    if is_own_scale(model, name, value):
        low, high = value / (1.0 + within), min(value * (1.0 + within), parameter.high)
    else:
        reach = within * present.scale * (LIGHT if present.of == "critical damping" else 1.0)
        low, high = max(value - reach, parameter.low), min(value + reach, parameter.high)
    varied = replace(present, low=low, high=high)
    return replace(varied, low=_possible(varied, -1), high=_possible(varied, 1))


def present_value(model: Model, name: str) -> Range:
    """Return the present value of a parameter with the scale of its changes, and without a range around it."""
    value = value_of(model, name)
    return Range(model, name, value, value, value, *scale_of(model, name, value))


def _possible(varied: Range, direction: int) -> float:
    """Return the end of a range; for a family, reduced to a value at which it still makes a design."""
    inside, end = varied.value, varied.end(direction)
    outside = end
    for _ in range(TRIALS):
        try:
            varied.at(outside)
        except ValueError:
            end = outside
        else:
            inside = outside
        if inside == end:
            break
        outside = 0.5 * (inside + end)
    return inside


def check_parameters(model: Model, names: Iterable[str] | None) -> tuple[str, ...]:
    """Return the names of the parameters to vary, or raise and list the parameters."""
    if names is None:
        return tuple(name for name in model.values if not model.parameters[name].whole)
    chosen = several("parameters", names, "a list of names")
    check_names(model.parameters, chosen)
    if whole := [name for name in chosen if model.parameters[name].whole]:
        raise invalid("parameters", chosen, "names of numbers that vary continuously", f"drop {whole[0]}")
    if len(set(chosen)) < len(chosen):
        raise invalid("parameters", chosen, "each parameter once", "drop the repeated one")
    return chosen


def check_within(within: float) -> float:
    """Return the range over which parameters are varied, relative to their present values."""
    hint = "3 varies from a quarter to fourfold"
    return Parameter("within", "range", low=0.0, high=FARTHEST, closed=False, hint=hint).check(within)


@dataclass
class Line:
    """The path from the present value to one end of a range, the values looked at so far, and the benefit at each.

    The nearest come first.
    """

    range: Range
    path: list[float]
    values: list[float] = field(default_factory=list)
    benefits: list[str] = field(default_factory=list)

    def first(self, wanted: Sequence[str]) -> int | None:
        """Return the index of the first value with a benefit that the next value has too; None if there is none."""
        good = [benefit in wanted for benefit in self.benefits]
        pairs = zip(good, [*good[1:], good[-1]], strict=True)
        return next((place for place, (value, neighbour) in enumerate(pairs) if value and neighbour), None)

    def bracket(self, wanted: tuple[str, ...]) -> Bracket | None:
        """Return the step in which benefits begin, and the values beyond that have them; None if there are none."""
        first = self.first(wanted)
        if first is None:
            return None
        outwards = zip(self.values[first:], self.benefits[first:], strict=True)
        further = [value for value, benefit in outwards if benefit in wanted][:CANDIDATES]
        inside = self.values[first - 1] if first else self.range.value
        return Bracket(self.range, wanted, inside, self.values[first], further)

    def midpoints(self, change: float) -> list[float]:
        """Return values midway between neighbours that do not both have a benefit, for changes below `change`."""
        ends = zip([self.range.value, *self.values], ["", *self.benefits], strict=True)
        return [
            self.range.between(inner, outer, 0.5)
            for (inner, inner_benefit), (outer, outer_benefit) in pairwise(ends)
            if abs(self.range.change(inner)) < change and not (inner_benefit and outer_benefit)
        ]

    def add(self, values: Sequence[float], benefits: Iterable[str]) -> None:
        """Add values and the benefits there."""
        pairs = [*zip(self.values, self.benefits, strict=True), *zip(values, benefits, strict=True)]
        pairs.sort(key=lambda pair: abs(self.range.change(pair[0])))
        self.values, self.benefits = [value for value, _ in pairs], [benefit for _, benefit in pairs]


@dataclass
class Bracket:
    """The step of a line in which the wanted benefits begin, and values further on that have them."""

    range: Range
    wanted: tuple[str, ...]
    inside: float
    outside: float
    further: list[float]

    def candidates(self) -> list[float]:
        """Return rounded values, the smallest change first."""
        outwards = 1 if self.outside > self.range.value else -1
        values = [rounded(value, self.range, outwards) for value in (self.outside, *self.further)]
        return [rounded(self.outside, self.range, 0), *values]


def rounded(value: float, varied: Range, outwards: int) -> float:
    """Return a value whose change has two significant digits, rounded outwards or (0) to nearest, inside its range.

    The change is relative to the scale, so advice does not depend on units.
    """
    change = varied.change(value)
    power = math.floor(math.log10(abs(change)) - 1.0)
    steps = change / 10.0**power - outwards * 1e-9
    whole = round(steps) if not outwards else math.ceil(steps) if outwards > 0 else math.floor(steps)
    return min(max(varied.value + float(f"{whole}e{power}") * varied.scale, varied.low), varied.high)
