"""Lines of values of a parameter, with the benefit that advice would have at each, and where benefits begin."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from vibroimpact.verdict.ranges import Range

TRIED = 6  # values beyond the first good one at which advice is tested
ANY, ENDS = ("softer", "no_chaos", "no_impact"), ("no_impact",)  # benefits that are looked for


@dataclass
class Line:
    """Values of a parameter to one side of the present one, from there outwards, and the benefit at each."""

    range: Range
    values: list[float]
    benefits: list[str] = field(default_factory=list)

    def begin(self, wanted: Sequence[str]) -> int | None:
        """Return the place of the first value with a benefit that its next neighbour has too; None without one."""
        good = [benefit in wanted for benefit in self.benefits]
        pairs = zip(good, [*good[1:], good[-1]], strict=True)
        return next((j for j, (this, neighbour) in enumerate(pairs) if this and neighbour), None)

    def between(self, nearer: float) -> list[float]:
        """Return values between neighbours, where a change is smaller than one and only one, or none, has a benefit."""
        ends = zip([self.range.value, *self.values], ["", *self.benefits], strict=True)
        return [
            self.range.between(inner, outer, 0.5)
            for (inner, one), (outer, other) in pairwise(ends)
            if abs(self.range.change(inner)) < nearer and not (one and other)
        ]

    def add(self, values: Sequence[float], benefits: Iterable[str]) -> None:
        """Add values and the benefits there."""
        pairs = [*zip(self.values, self.benefits, strict=True), *zip(values, benefits, strict=True)]
        pairs.sort(key=lambda pair: abs(self.range.change(pair[0])))
        self.values, self.benefits = [value for value, _ in pairs], [benefit for _, benefit in pairs]


@dataclass
class Search:
    """A line, the benefits looked for, and the step of it in which they begin."""

    line: Line
    wanted: tuple[str, ...]
    inside: float = math.nan
    outside: float = math.nan
    values: list[float] = field(default_factory=list)

    @property
    def range(self) -> Range:
        """The parameter that is varied."""
        return self.line.range

    def begins(self) -> bool:
        """Note where on the line the benefits begin, and the values beyond that have them; return whether they do."""
        first, values = self.line.begin(self.wanted), self.line.values
        if first is not None:
            self.inside, self.outside = values[first - 1] if first else self.range.value, values[first]
            beyond = zip(values[first:], self.line.benefits[first:], strict=True)
            self.values = [value for value, benefit in beyond if benefit in self.wanted][:TRIED]
        return first is not None

    def candidates(self) -> list[float]:
        """Return rounded values, the smallest change first."""
        near, outwards = [rounded(self.outside, self.range, 0)], 1 if self.outside > self.range.value else -1
        return near + [rounded(value, self.range, outwards) for value in (self.outside, *self.values)]


def rounded(value: float, varied: Range, outwards: int) -> float:
    """Return a value whose change has two digits, rounded outwards or (0) to the nearest, inside the varied.

    The change is that relative to the scale: so advice is the same in any unit.
    """
    change = varied.change(value)
    power = math.floor(math.log10(abs(change)) - 1.0)
    steps = change / 10.0**power - outwards * 1e-9
    whole = round(steps) if not outwards else math.ceil(steps) if outwards > 0 else math.floor(steps)
    return min(max(varied.value + float(f"{whole}e{power}") * varied.scale, varied.low), varied.high)
