"""Lines of values of a parameter, with the benefit of advice at each value, and the values at which benefits begin."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from vibroimpact.verdict.ranges import Range

CANDIDATES = 6  # values beyond the first good one at which advice is tested
ANY, ENDS = ("softer", "no_chaos", "no_impact"), ("no_impact",)  # benefits that are looked for


@dataclass
class Line:
    """Values of a parameter on one side of the present value, the nearest first, and the benefit at each."""

    range: Range
    values: list[float]
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
