"""Units with prefixes, and tick labels that fit: an axis of small numbers shows [mm], not ticks such as 0.0002."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axis import Axis
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from vibroimpact.parameters import labelled, with_unit

PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 3: "k", 6: "M", 9: "G", 12: "T"}
PREFIXED = re.compile(r"(m|s|N|J|Hz|g)(?=$|[ /])(.*)")  # units that take a prefix, to the first power
PLAIN = (0.01, 1e5)  # largest value shown without a prefix
WIDE, HIGH = 0.66, 1.5  # width of a character and height of a line, relative to the font size


def power_of(values: Any) -> int:
    """Return the power of ten, a multiple of three, in whose units values are shown.

    Examples
    --------
    >>> power_of([-4e-4, 9e-4]), power_of([0.05, 3.0]), power_of([3.62e7])
    (-3, 0, 6)
    """
    sizes = np.abs(np.asarray(values, dtype=float))
    largest = float(sizes[np.isfinite(sizes)].max(initial=0.0))
    if largest == 0.0 or PLAIN[0] <= largest < PLAIN[1]:
        return 0
    return 3 * math.floor((math.log10(largest) + 1.0) / 3.0)  # 0.1 to 100 of the unit


def prefixed(units: str, power: int) -> str | None:
    """Return a unit times a power of ten as a unit with a prefix; None if there is none.

    Examples
    --------
    >>> prefixed("m/s", -3), prefixed("kg", -6), prefixed("rad/s", 3)
    ('mm/s', 'mg', None)
    """
    base, power = ("g", power + 3) if units == "kg" and power else (units, power)
    match = PREFIXED.fullmatch(base)
    if power == 0 or (match and power in PREFIXES and not (units == "kg" and power > 0)):
        return PREFIXES.get(power, "") + base
    return None


def quantity(value: float, units: str, digits: int = 5) -> str:
    """Return a value with its unit, such as 0.5 mm for 0.0005 m; pure numbers have no unit.

    Examples
    --------
    >>> quantity(0.5e-3, "m"), quantity(26860.0, "N/m"), quantity(0.8, "1")
    ('0.5 mm', '26860 N/m', '0.8')
    """
    power = power_of(value)
    unit = prefixed(units, power)
    if unit is None:
        unit, power = units, 0
    return with_unit(f"{value / 10.0**power:.{digits}g}", unit)


def unit_label(units: str, power: int, ten: Callable[[int], str] = "$10^{{{}}}$".format) -> str:
    """Return the label of a unit times a power of ten, which `ten` writes, in brackets; empty for pure numbers."""
    unit = prefixed(units, power)
    if unit is None:
        unit = with_unit(ten(power), units)
    return labelled("", unit)


class _Shown:
    """An axis in the unit in which it is shown: its data times a factor."""

    def __init__(self, axis: Any, factor: float) -> None:
        self._axis, self._factor = axis, factor

    def get_view_interval(self) -> Any:
        """Return the limits of the axis in the unit shown."""
        return np.asarray(self._axis.get_view_interval()) * self._factor

    def __getattr__(self, name: str) -> Any:
        return getattr(self._axis, name)


class Scaled(ScalarFormatter):
    """Formatter of numbers in units of a power of ten, which the axis label includes; no separate factor or offset.

    Data are multiplied by `factor` first, which turns them into the unit shown.
    """

    def __init__(self, power: int, factor: float = 1.0) -> None:
        super().__init__(useOffset=False)
        self.factor = factor
        if power:
            self.set_powerlimits((power, power))
        else:
            self.set_scientific(False)

    def set_axis(self, axis: Any) -> None:
        """Take the limits of the axis in the unit shown."""
        shown: Any = axis if self.factor == 1.0 else _Shown(axis, self.factor)
        super().set_axis(shown)

    def set_locs(self, locs: Any) -> None:
        """Take the ticks in the unit shown."""
        super().set_locs((np.asarray(locs) * self.factor).tolist())

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of a tick."""
        return super().__call__(x * self.factor, pos)

    def format_data_short(self, value: Any) -> str:
        """Return the value under the cursor, in the unit shown."""
        return super().format_data_short(value * self.factor)

    def get_offset(self) -> str:
        """Return an empty string: the axis label includes the power."""
        return ""


class Round(MaxNLocator):
    """Locator of ticks at round numbers of the unit shown, which is `factor` times that of the data."""

    def __init__(self, most: Any, whole: bool = False, factor: float = 1.0) -> None:
        super().__init__(most, steps=[1, 2, 2.5, 5, 10], integer=whole)
        self._whole, self._factor = whole, factor

    def __call__(self) -> Sequence[float]:
        """Return the positions of the ticks."""
        low, high = sorted(np.asarray(self.axis.get_view_interval()) * self._factor)  # type: ignore[union-attr]
        return np.asarray(self.shown(low, high)) / self._factor  # type: ignore[return-value]

    def shown(self, low: float, high: float) -> Any:
        """Return the ticks between two limits, all in the unit shown."""
        return self.tick_values(low, high)


class Fitting(Round):
    """Locator of ticks at round numbers, as many as fit without overlapping labels."""

    def __init__(self, whole: bool = False, factor: float = 1.0) -> None:
        super().__init__("auto", whole, factor)

    def shown(self, low: float, high: float) -> Any:
        """Return the ticks between two limits, all in the unit shown."""
        ticks = super().shown(low, high)
        for most in range(len(ticks) - 1, 0, -1):
            if self._fits(np.asarray(ticks), low, high):
                break
            ticks = MaxNLocator(most, steps=[1, 2, 2.5, 5, 10], integer=self._whole).tick_values(low, high)
        return ticks

    def _fits(self, ticks: Any, low: float, high: float) -> bool:
        """Return whether the labels of the visible ticks do not overlap."""
        axis: Any = self.axis
        shown = ticks[(ticks >= low) & (ticks <= high)]
        if len(shown) < 2:
            return True
        size = axis.majorTicks[0].label1.get_size() if axis.majorTicks else 10.0
        sides = axis.axes.bbox.size * 72.0 / axis.get_figure(root=True).dpi
        letters = max(len(text) for text in axis.major.formatter.format_ticks(shown / self._factor))
        needed, length = ((WIDE * letters + 1.0), sides[0]) if axis.axis_name == "x" else (HIGH, sides[1])
        return bool(needed * size <= length * np.diff(shown).min() / (high - low))


def scale_axis(axis: Axis, data: xr.DataArray, power: int, factor: float = 1.0) -> None:
    """Set ticks in units of a power of ten, at whole numbers for counts; a logarithmic axis keeps its own ticks."""
    if axis.get_scale() == "linear":
        axis.set_major_formatter(Scaled(power, factor))
        axis.set_major_locator(Fitting(data.dtype.kind in "iu", factor))
