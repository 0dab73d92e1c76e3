"""Colours of the plane: what is sent to the page for every cell, and the words of its legend."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import NDArray

from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.state import GREEK, MOTION
from vibroimpact.indices import INDICES
from vibroimpact.motion import MotionClass, cycle_name
from vibroimpact.plotting.classes import COLORS, OTHER_PERIODIC, WORDS, name_colors
from vibroimpact.plotting.style import STICKING

Floats = NDArray[np.float64]

NOTHING = "#c9c9c9"  # no impact, or no value
SIGNED = frozenset({"lyapunov", "lyapunov_per_impact"})
DECADES = 6  # that a logarithmic scale spans at most
PERCENT = 99.5  # of the cells that colours tell apart


@dataclass(frozen=True)
class Shades:
    """A plane as colours: what is mapped to colours, exact values and names to be read, limits, and a legend."""

    shade: NDArray[np.float32]
    value: Floats
    name: Floats  # class, periods and impacts in one number
    low: float
    high: float
    palette: str  # "sequential", "signed" or "names"
    colors: tuple[str, ...]
    title: str
    ticks: tuple[tuple[float, str], ...]  # of the colour bar
    legend: tuple[tuple[str, str], ...]


def shades(plane: Plane) -> Shades:
    """Return a plane as colours; arrays have rows along y, as a picture has."""
    view = plane.view
    motion, n, p = (plane.array(key).astype(np.float64).T for key in ("motion", "n_periods", "n_impacts"))
    name = motion * 1e10 + n * 1e5 + (p + 1.0)
    if view.index == MOTION:
        return _names(motion, n, p, name)
    index = INDICES[view.index]
    value = plane.array(view.index).astype(np.float64).T
    if view.index in ("n_periods", "n_impacts"):
        value = np.where(value == 0, np.nan, value)
    finite = value[np.isfinite(value)]
    title = f"{index.long_name} {GREEK.get(index.symbol, index.symbol)}"
    title += "" if index.units == "1" else f" [{index.units}]"
    palette = "signed" if view.index in SIGNED else "sequential"
    low, high = _limits(finite, palette == "signed", view.log and palette == "sequential")
    shade = np.clip(value, low, high)
    shade[np.isneginf(value)] = low - 1.0 - abs(low)
    log = view.log and palette == "sequential"
    ticks = tuple(_ticks(low, high, log))
    if log:
        shade, low, high = np.log10(shade), math.log10(low), math.log10(high)
    legend = tuple(_special(value, motion))
    return Shades(shade.astype(np.float32), value, name, low, high, palette, (), title, ticks, legend)


def _ticks(low: float, high: float, log: bool) -> Iterator[tuple[float, str]]:
    """Yield where the colour bar has ticks, and their words."""
    values: Sequence[float] = []
    if log and high > 3.0 * low:
        values = LogLocator(subs=(1.0, 2.0, 5.0) if high < 3e3 * low else (1.0,)).tick_values(low, high)
    if len([value for value in values if low <= value <= high]) < 2:
        values = MaxNLocator(7).tick_values(low, high)
    for value in values:
        if low <= value <= high:
            yield (math.log10(value) if log else float(value)), f"{float(f'{value:.6g}'):g}".replace("-", "−")


def _limits(finite: Floats, signed: bool, log: bool) -> tuple[float, float]:
    if not finite.size:
        return (-1.0, 1.0) if signed else (0.1, 1.0)
    if signed:
        most = float(np.percentile(np.abs(finite), 99.0)) or 1.0
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


def _special(value: Floats, motion: Floats) -> list[tuple[str, str]]:
    entries = []
    if np.isneginf(value).any():
        entries.append((STICKING, "−∞: sticks"))
    without = np.isnan(value)
    if (without & (motion == MotionClass.NO_IMPACT)).any():
        entries.append((NOTHING, "no impact"))
    if (without & (motion != MotionClass.NO_IMPACT)).any():
        entries.append((NOTHING, "no value" if not entries or entries[-1][1] != "no impact" else "or no value"))
    return entries


def _names(motion: Floats, n: Floats, p: Floats, name: Floats) -> Shades:
    rest = motion == MotionClass.PERIODIC
    counts = Counter(zip(n[rest].astype(int).tolist(), p[rest].astype(int).tolist(), strict=True))
    layers: list[tuple[Any, str, str]] = []
    for (periods, impacts), color in name_colors(counts, motion.size).items():
        here = (motion == MotionClass.PERIODIC) & (n == periods) & (p == impacts)
        rest = rest & ~here
        layers.append((here, color, cycle_name(periods, impacts)))
    layers.append((rest, OTHER_PERIODIC, "other periodic"))
    layers += [(motion == kind, COLORS[kind], word) for kind, word in WORDS.items()]
    shade = np.zeros(motion.shape, np.float32)
    for number, (where, _, _) in enumerate(layers):
        shade[where] = number
    legend = tuple((color, f"{_share(where)} {word}") for where, color, word in layers if where.any())
    colors = tuple(color for _, color, _ in layers)
    return Shades(shade, motion, name, -0.5, len(layers) - 0.5, "names", colors, "name of the motion", (), legend)


def _share(where: Any) -> str:
    part = 100.0 * float(where.mean())
    return f"{part:.0f} %" if part >= 0.95 else "<1 %"
