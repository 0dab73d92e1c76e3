"""The colours of a plane: a scale or categories, and their legend."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import NDArray

from vibroimpact.explorer.plane import Floats, Plane
from vibroimpact.explorer.state import GREEK, RAISED, written
from vibroimpact.figures import EXPONENTS, MOTION
from vibroimpact.indices import INDICES
from vibroimpact.motion import motion_name, refined
from vibroimpact.plotting.categories import COUNTS, missing_layers, motion_layers, number_layers
from vibroimpact.plotting.cells import COLORS, SIGNED, symmetric_limit
from vibroimpact.plotting.labels import WORDS
from vibroimpact.plotting.style import STICKING, Layer
from vibroimpact.plotting.ticks import power_of, unit_label

KIND, PERIOD = 1e10, 1e5  # kind of motion, periods and impacts in one number
SCALES: dict[bool, tuple[str, ...]] = {
    signed: tuple(map(to_hex, colormaps[name].resampled(number)(range(number))))
    for signed, name, number in ((True, SIGNED, 255), (False, COLORS, 256))  # odd: has a middle
}
DECADES = 6  # largest ratio spanned by a logarithmic scale
PERCENT = 99.5  # share of the cells that the colours distinguish


@dataclass(frozen=True)
class Shades:
    """A plane as colours: the colour number, value and name of every cell, a scale, and a legend."""

    number: NDArray[np.uint16]  # of `colors`
    value: Floats
    name: Floats  # class, periods and impacts in one number
    colors: tuple[str, ...]  # the colours of the scale come first
    scale: int  # number of its colours; 0 if there are only categories
    low: float
    high: float
    title: str
    ticks: tuple[tuple[float, str], ...]  # of the colour bar
    legend: tuple[tuple[str, str], ...]  # colours and their meanings


def shades(plane: Plane) -> Shades:
    """Return a plane as colours; the rows of its arrays run along y, as in a picture."""
    view, sweep = plane.view, plane.dataset()
    motion, n, p = (plane.array(key).astype(np.float64).T for key in ("motion", "n_periods", "n_impacts"))
    name = refined(motion, plane.array("status").T) * KIND + n * PERIOD + (p + 1.0)
    if view.index == MOTION:
        return _categories(motion, name, MOTION, motion_layers(motion, n.astype(int), p.astype(int)))
    index, field = INDICES[view.index], sweep[view.index].T
    value = field.values.astype(np.float64)
    title = index.long_name
    if index.symbol not in (*WORDS, "λ per impact"):
        title += f" {GREEK.get(index.symbol, index.symbol)}"
    if view.index in COUNTS:
        return _categories(value, name, title, number_layers(sweep, field))
    signed, log = view.index in EXPONENTS, view.log and view.index not in EXPONENTS
    low, high = _limits(value[np.isfinite(value)], signed, log)
    power = power_of([low, high])
    ticks = tuple(_ticks(low, high, log, 10.0**power))
    place = np.clip(value, low, high)
    if log:
        place, low, high = np.log10(place), math.log10(low), math.log10(high)
    colors = SCALES[signed]
    with np.errstate(invalid="ignore"):
        place = np.clip((place - low) / (high - low) * len(colors), 0, len(colors) - 1)
    others = [(mask, color, _plain(color, text)) for mask, color, text in missing_layers(sweep, field, "")]
    return Shades(
        number=_numbers(others, np.nan_to_num(place).astype(np.uint16), len(colors)),
        value=value,
        name=name,
        colors=(*colors, *(color for _, color, _ in others)),
        scale=len(colors),
        low=low,
        high=high,
        title=title + unit_label(index.units, power, lambda power: f"10{str(power).translate(RAISED)}"),
        ticks=ticks,
        legend=tuple((color, text) for _, color, text in others),
    )


def name_of(code: float) -> str:
    """Return the name of the motion for a number of `Shades.name`."""
    kind, rest = divmod(code, KIND)
    n, p = divmod(rest, PERIOD)
    return motion_name(int(kind), int(n), int(p) - 1)


def _categories(value: Any, name: Floats, title: str, categories: Iterator[Layer]) -> Shades:
    """Return a plane of categories, each with its colour; the legend shows their shares of the cells."""
    layers = [layer for layer in categories if layer[0].any()]
    return Shades(
        number=_numbers(layers, np.zeros(value.shape, np.uint16), 0),
        value=value,
        name=name,
        colors=tuple(color for _, color, _ in layers),
        scale=0,
        low=0.0,
        high=1.0,
        title=title,
        ticks=(),
        legend=tuple((color, f"{text} ({_share(mask)})") for mask, color, text in layers),
    )


def _numbers(layers: Sequence[Layer], number: NDArray[np.uint16], first: int) -> NDArray[np.uint16]:
    """Return colour numbers, with those of the layers set from `first` on."""
    for at, (mask, _, _) in enumerate(layers, first):
        number[mask] = at
    return number


def _plain(color: str, text: str) -> str:
    return "sticking: −∞" if color == STICKING else text


def _ticks(low: float, high: float, log: bool, unit: float) -> Iterator[tuple[float, str]]:
    """Yield positions and labels of the colour bar's ticks."""
    values: Sequence[float] = []
    if log and high > 3.0 * low:
        values = LogLocator(subs=(1.0, 2.0, 5.0) if high < 3e3 * low else (1.0,)).tick_values(low, high)
    if len([value for value in values if low <= value <= high]) < 2:
        values = MaxNLocator(7).tick_values(low, high)
    for value in values:
        if low <= value <= high:
            yield (math.log10(value) if log else float(value)), written(value / unit, 6)


def _limits(finite: Floats, signed: bool, log: bool) -> tuple[float, float]:
    if not finite.size:
        return (-1.0, 1.0) if signed else (0.1, 1.0)
    if signed:
        most = symmetric_limit(finite)
        return -most, most
    low, high = float(finite.min()), float(np.percentile(finite, PERCENT))
    if log:
        high = max(high, float(finite.max()) * 1e-3, 1e-300)
        above = finite[finite > high * 10.0**-DECADES]
        low = float(above.min()) if above.size else high * 10.0**-DECADES
    if high - low <= 1e-9 * max(abs(high), abs(low)):
        middle = 0.5 * (low + high)
        return (middle / 1.1, middle * 1.1) if middle > 0.0 else (middle - 0.1, middle + 1.0)
    return low, high


def _share(where: Any) -> str:
    part = 100.0 * float(where.mean())
    return f"{part:.0f} %" if part >= 0.95 else "<1 %"
