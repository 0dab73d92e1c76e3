"""How far around its present value a parameter is looked at, and how a change of it is told."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches

from vibroimpact.axes import NAMES
from vibroimpact.dataset import VARIABLES
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator
from vibroimpact.parameters import real_number

LIGHT = 0.05  # of critical damping: how much is tried where there is none
CROWDED = 1.5  # values along a path lie at (j/n)^1.5 of its way: a near boundary matters more than a far one


@dataclass(frozen=True)
class Reach:
    """A parameter, its present value, the range around it, and what a change is measured in.

    `of` says of what a relative change is a part; nothing where it is the value itself.
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
        """Return the change to a value, signed, as a part of the scale."""
        return (value - self.value) / self.scale

    def percent(self, value: float) -> str:
        """Return the size of a change in words: '3.1 %', or '12 % of f/k'."""
        size = percent(abs(self.change(value)))
        return f"{size} of {self.of}" if self.of else size

    def at(self, osc: ImpactOscillator, value: float) -> ImpactOscillator:
        """Return the oscillator with the parameter at a value."""
        return osc.replace(**{self.name: value})

    def told(self, value: float, digits: int = 4) -> str:
        """Return a value of the parameter with its unit."""
        units = VARIABLES[self.name][1]
        return f"{value:.{digits}g}" + ("" if units == "1" else f" {units}")


def percent(share: float) -> str:
    """Return a share in per cent, two digits of it or all before the point."""
    size = f"{100.0 * share:.2g}"
    return f"{100.0 * share:.0f} %" if float(size) >= 100.0 else f"{size} %"


def reach_of(osc: ImpactOscillator, name: str, within: float) -> Reach:
    """Return the range from value / (1 + within) to value * (1 + within), or around zero what its physics scales with.

    The gap is measured against the static deflection f/k where that is larger, damping that is zero against critical
    damping, a force that is zero against k |g|, a restitution that is zero against 1.
    """
    value = float(getattr(osc, name))
    if name == "gap":
        return _gap(osc, value, within)
    if value > 0.0:
        high = value * (1.0 + within)
        return Reach(name, value, value / (1.0 + within), min(high, 1.0) if name == "restitution" else high, value)
    if name == "damping":
        critical = 2.0 * math.sqrt(osc.stiffness * osc.mass)
        return Reach(name, 0.0, 0.0, LIGHT * within * critical, critical, "critical damping")
    if name == "restitution":
        return Reach(name, 0.0, 0.0, min(1.0, within), 1.0, "1")
    hold = osc.stiffness * abs(osc.gap)
    return Reach(name, 0.0, 0.0, within * (hold or 1.0), hold or 1.0, "k |g|" if hold else "1 N")


def _gap(osc: ImpactOscillator, value: float, within: float) -> Reach:
    deflection = osc.amplitude / osc.stiffness
    scale = max(abs(value), deflection)
    of = "f/k" if deflection >= abs(value) else ""
    if scale == 0.0:
        scale, of = 1.0, "1 m"
    return Reach("gap", value, value - within * scale, value + within * scale, scale, of)


def check_parameters(names: Iterable[str] | None) -> tuple[str, ...]:
    """Return the names of the parameters to look at, or say which there are."""
    if names is None:
        return PARAMETERS
    chosen = (names,) if isinstance(names, str) else tuple(names)
    for name in chosen:
        if name not in NAMES:
            close = get_close_matches(str(name), NAMES, 1)
            remedy = f"did you mean {close[0]!r}?" if close else "check the spelling"
            raise ValueError(f"`parameters` holds {name!r}; allowed are {', '.join(NAMES)}; {remedy}")
    if len(set(chosen)) < len(chosen):
        raise ValueError(f"`parameters` is {chosen!r}; allowed is each parameter once; drop the repeated one")
    return chosen


def check_within(within: float) -> float:
    """Return how far to look, a part of the present value."""
    value = real_number("within", within, "a number above 0")
    if value <= 0.0:
        raise ValueError(f"`within` is {within!r}; allowed is a number above 0; 3 looks from a quarter to fourfold")
    return value
