"""The colours of a plane: its scale or its categories, and the legend that explains them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import NDArray

from vibroimpact.explorer.plane import Floats, Plane
from vibroimpact.explorer.state import GREEK, MOTION
from vibroimpact.indices import INDICES
from vibroimpact.motion import MotionClass, motion_name, refined
from vibroimpact.plotting.categories import motion_layers
from vibroimpact.plotting.cells import symmetric_limit
from vibroimpact.plotting.style import STICKING

KIND, PERIOD = 1e10, 1e5  # kind of motion, periods and impacts in one number
NOTHING = "#c9c9c9"  # no impact, or no value
SIGNED = frozenset({"lyapunov", "lyapunov_per_impact"})
DECADES = 6  # that a logarithmic scale spans at most
PERCENT = 99.5  # of the cells that the colours distinguish


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
    name = refined(motion, plane.array("status").T) * KIND + n * PERIOD + (p + 1.0)
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
    legend = tuple(_special(value, motion, plane.origin))
    return Shades(shade.astype(np.float32), value, name, low, high, palette, (), title, ticks, legend)


def name_of(code: float) -> str:
    """Return the motion's name that a number of `Shades.name` stands for."""
    kind, rest = divmod(code, KIND)
    n, p = divmod(rest, PERIOD)
    return motion_name(int(kind), int(n), int(p) - 1)


def _ticks(low: float, high: float, log: bool) -> Iterator[tuple[float, str]]:
    """Yield where the colour bar has ticks, and their labels."""
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


def _special(value: Floats, motion: Floats, origin: str) -> list[tuple[str, str]]:
    entries = []
    if np.isneginf(value).any():
        entries.append((STICKING, "−∞: sticks"))
    without = np.isnan(value)
    if (without & (motion == MotionClass.NO_IMPACT)).any():
        entries.append((NOTHING, f"no impact {origin}"))
    if (without & (motion != MotionClass.NO_IMPACT)).any():
        entries.append((NOTHING, "or no value" if entries and entries[-1][0] == NOTHING else "no value"))
    return entries


def _names(motion: Floats, n: Floats, p: Floats, name: Floats) -> Shades:
    layers = list(motion_layers(motion, n.astype(int), p.astype(int)))
    shade = np.zeros(motion.shape, np.float32)
    for number, (where, _, _) in enumerate(layers):
        shade[where] = number
    legend = tuple((color, f"{_share(where)} {label}") for where, color, label in layers if where.any())
    colors = tuple(color for _, color, _ in layers)
    return Shades(shade, motion, name, -0.5, len(layers) - 0.5, "names", colors, "motion", (), legend)


def _share(where: Any) -> str:
    part = 100.0 * float(where.mean())
    return f"{part:.0f} %" if part >= 0.95 else "<1 %"
