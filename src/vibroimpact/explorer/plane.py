"""The plane: its cells, a coarse lattice first and then the cells between, their colours, a diagram, and boundaries."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.state import FINEST, GREEK, MOTION, Range, View, granted
from vibroimpact.indices import INDICES
from vibroimpact.motion import MotionClass, motion_name, refined
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.plotting.categories import motion_layers
from vibroimpact.plotting.cells import symmetric_limit
from vibroimpact.plotting.style import STICKING

Floats = NDArray[np.float64]
Places = NDArray[np.int64]  # of cells along an axis of the finest lattice
KeepGoing = Callable[[], bool]

SIDES = (64, 128, 256)  # of the lattices; each contains the one before
BAND, USUAL = 2048, 500  # cells per job, about, with so many impacts per cell; fewer where more are sampled
TRANSIENT = 100  # impacts left out

KIND, PERIOD = 1e10, 1e5  # kind of motion, periods and impacts in one number
NOTHING = "#c9c9c9"  # no impact, or no value
SIGNED = frozenset({"lyapunov", "lyapunov_per_impact"})
DECADES = 6  # that a logarithmic scale spans at most
PERCENT = 99.5  # of the cells that the colours distinguish

VALUES, PART = 200, 100  # along the line; computed at a time
IMPACTS = 48  # of each value
BUDGETED = 5000  # impacts for which a budget is granted: the few of a diagram get a share of it
RESOLUTION = 10_000  # velocities that a diagram distinguishes, up to the largest


def lattice(side: int) -> Places:
    """Return which of the finest cells along an axis belong to a lattice of `side`."""
    stride = FINEST // side
    return np.arange(stride // 2 - (side < FINEST and stride > 2), FINEST, stride)


def positions(low: float, high: float, cells: Places) -> Floats:
    """Return the parameter at the middle of the finest cells."""
    return np.asarray(low + (cells + 0.5) * ((high - low) / FINEST), dtype=np.float64)


def bands(side: int, samples: int = USUAL) -> list[tuple[Places, Places]]:
    """Return the cells that a lattice adds to the one before, as rectangles small enough for a job."""
    here, most = lattice(side), BAND * USUAL / max(samples, USUAL)
    if side == SIDES[0]:
        parts = [(here, here)]
    else:
        old = lattice(side // 2)
        new = np.setdiff1d(here, old)
        parts = [(old, new), (new, old), (new, new)]
    return [
        (columns, rows)
        for columns, all_rows in parts
        for rows in np.array_split(all_rows, max(1, round(len(columns) * len(all_rows) / most)))
    ]


def compute_cells(
    osc: ImpactOscillator,
    samples: int,
    stiff: float,
    axes: dict[str, Any],
    start: State | None = None,
    keep_going: KeepGoing = lambda: True,
) -> xr.Dataset:
    """Return all indices of a page's cells over some axes, the impacts sampled and budgeted as pages do."""
    sweep: xr.Dataset = vi.parameter_map(
        osc,
        indices=tuple(INDICES),
        start=start,
        transient_impacts=TRANSIENT,
        sample_impacts=samples,
        tolerances=granted(stiff, TRANSIENT + samples),
        workers=1,
        progress=lambda done, total, partial: keep_going(),
        **axes,
    )
    return sweep


@dataclass
class Plane:
    """The cells of a view, as far as they are known."""

    view: View
    side: int
    values: dict[str, NDArray[Any]]  # each FINEST x FINEST, the first axis along x
    seconds: float = 0.0
    stored: str = ""  # the stored sweep that they were taken from

    @classmethod
    def unknown(cls, view: View) -> Plane:
        """Return a plane of which nothing is known."""
        values: dict[str, NDArray[Any]] = {
            name: np.full((FINEST, FINEST), index.fill, index.dtype) for name, index in INDICES.items()
        }
        values["motion"] = np.zeros((FINEST, FINEST), np.int8)
        values["status"] = np.full((FINEST, FINEST), vi.Status.INTERRUPTED, np.int8)
        return cls(view, 0, values)

    def fill(self, columns: Places, rows: Places, keep_going: KeepGoing) -> bool:
        """Compute a rectangle of cells; return whether it was finished."""
        view = self.view
        axes = {view.x: positions(*view.x_range, columns), view.y: positions(*view.y_range, rows)}
        sweep = compute_cells(view.osc, view.samples, view.stiffness, axes, keep_going=keep_going)
        if not keep_going():
            return False
        found = sweep.assign(motion=vi.classify(sweep)["motion"])
        for name, array in self.values.items():
            array[np.ix_(columns, rows)] = found[name].values
        return True

    def array(self, name: str) -> NDArray[Any]:
        """Return an index over the lattice known so far, the first axis along x."""
        cells = lattice(self.side)
        return self.values[name][np.ix_(cells, cells)]

    def axis(self, name: str) -> Floats:
        """Return the values of the parameter along an axis of the lattice, "x" or "y"."""
        low, high = getattr(self.view, f"{name}_range")
        return positions(low, high, lattice(self.side))

    def dataset(self) -> xr.Dataset:
        """Return the lattice known so far as `parameter_map` would return it."""
        view, dims = self.view, (self.view.x, self.view.y)
        one = {view.x: [view.osc_value("x")], view.y: [view.osc_value("y")]}
        # attributes and nothing else: no cell is computed
        sweep = compute_cells(view.osc, view.samples, view.stiffness, one, keep_going=lambda: False)
        axes = {name: (name, self.axis(axis), sweep[name].attrs) for axis, name in zip("xy", dims, strict=True)}
        content = {str(name): (dims, self.array(str(name)), sweep[name].attrs) for name in sweep.data_vars}
        return xr.Dataset(content, coords=axes, attrs=sweep.attrs)


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
    legend = tuple(_special(value, motion))
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


# ---- what is drawn below and over the plane


@dataclass(frozen=True)
class Line:
    """Impact velocities over one parameter, each given once."""

    parameter: str
    ends: Range
    values: Floats
    velocities: Floats


@dataclass(frozen=True)
class Curves:
    """Boundaries in the plane: points, kinds and descriptions."""

    x: list[Floats]
    y: list[Floats]
    kinds: list[str]
    descriptions: list[str]


def compute_line(view: View, keep_going: KeepGoing) -> Line:
    """Return the impact velocities along the view's line, as far as time is left."""
    parameter, (low, high) = view.along
    values: Floats = low + (np.arange(VALUES, dtype=np.float64) + 0.5) * ((high - low) / VALUES)
    parts = [_velocities(view, parameter, values[:PART])]
    for first in range(PART, VALUES, PART):
        if keep_going():
            parts.append(_velocities(view, parameter, values[first : first + PART]))
    velocity = np.concatenate(parts)
    finite = np.isfinite(velocity)
    largest = float(velocity[finite].max(initial=0.0)) or 1.0
    rounded = np.round(velocity[finite] * (RESOLUTION / largest)).astype(np.int64)
    rows = np.broadcast_to(np.arange(len(velocity))[:, None], velocity.shape)[finite]
    _, distinct = np.unique(rows * (RESOLUTION + 1) + rounded, return_index=True)
    return Line(parameter, (low, high), values[rows[distinct]], velocity[finite][distinct])


def _velocities(view: View, parameter: str, values: Floats) -> Floats:
    """Return the velocities of some impacts at each value, NaN where there are fewer."""
    axis: dict[str, Any] = {parameter: values}
    diagram = vi.bifurcation_diagram(
        view.osc,
        transient_impacts=TRANSIENT,
        sample_impacts=IMPACTS,
        tolerances=granted(view.stiffness, BUDGETED),
        workers=1,
        **axis,
    )
    found = diagram["velocity"].values
    return np.pad(found, ((0, 0), (0, IMPACTS - found.shape[1])), constant_values=np.nan)


def find_curves(view: View, keep_going: KeepGoing) -> Curves:
    """Return the boundaries in the view's plane, as far as time is left."""
    found = vi.boundary_curves(
        view.osc, (view.x, view.y), (view.x_range, view.y_range), progress=lambda *progress: keep_going()
    )
    points = [np.asarray(curve.values, dtype=np.float64) for curve in found]
    return Curves(
        x=[at[:, 0] for at in points],
        y=[at[:, 1] for at in points],
        kinds=[curve.kind for curve in found],
        descriptions=[
            f"{curve.kind.replace('_', ' ')}, {curve.orbits[0].name if curve.orbits else 'an orbit'}" for curve in found
        ],
    )
