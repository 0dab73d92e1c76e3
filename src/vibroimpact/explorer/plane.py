"""The plane: its cells, computed from coarse to fine lattices; a diagram; and boundaries."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.dataset import bifurcation_name
from vibroimpact.explorer.limits import FINEST, Range, budget
from vibroimpact.explorer.state import View
from vibroimpact.indices import INDICES
from vibroimpact.model import State
from vibroimpact.motion import WITHOUT, MotionClass
from vibroimpact.orbits import Orbit
from vibroimpact.plotting.diagrams import with_index

Floats = NDArray[np.float64]
Places = NDArray[np.int64]  # indices of cells along an axis of the finest lattice
KeepGoing = Callable[[], bool]

SIDES = (64, 128, 256)  # sides of the lattices; each contains the one before
COARSER = (16, 32)  # before these if rests keep memory: a cell may then take milliseconds
BAND, USUAL = 2048, 500  # approximate cells per job at this number of impacts per cell; fewer if more are sampled
TRANSIENT = 100  # transient impacts skipped
TRIED = (2, 5, 17)  # initial conditions, rest included, tried until one leads to impacts
OTHERS = TRIED[-1] - 1
WORST = f"worst of {TRIED[-1]} initial conditions"
ONLY_OTHERS = f"no impact from rest; impacts from other initial conditions ({OTHERS} tried)"

FOLLOWED = (1, 2)  # driving periods of motions whose boundaries are followed
VALUES, PART = 200, 100  # values along the line, and values computed at a time
IMPACTS = 48  # impacts per value
BUDGETED = 5000  # impacts for which the budget is granted; the few impacts of a diagram get a share of it
RESOLUTION = 10_000  # number of velocities that a diagram distinguishes, up to the largest


def lattice(side: int) -> Places:
    """Return the indices along an axis of the finest cells that belong to a lattice of `side`."""
    stride = FINEST // side
    return np.arange(0x55 & (stride - 1), FINEST, stride)  # 1, 1, 5, 5 for strides 2, 4, 8, 16: each holds the coarser


def positions(low: float, high: float, cells: Places) -> Floats:
    """Return the parameter at the centres of the finest cells."""
    return np.asarray(low + (cells + 0.5) * ((high - low) / FINEST), dtype=np.float64)


def sides(view: View) -> tuple[int, ...]:
    """Return the sides of a view's lattices, from coarse to fine."""
    return SIDES if view.system.forgets else (*COARSER, *SIDES)


def bands(side: int, samples: int = USUAL, first: int = SIDES[0]) -> list[tuple[Places, Places]]:
    """Return the cells that a lattice adds to the previous one, as rectangles of a job's size."""
    cells, most = lattice(side), BAND * USUAL / max(samples, USUAL) * (1 if first == SIDES[0] else 1 / 16)
    if side == first:
        parts = [(cells, cells)]
    else:
        old = lattice(side // 2)
        new = np.setdiff1d(cells, old)
        parts = [(old, new), (new, old), (new, new)]
    return [
        (columns, rows)
        for columns, all_rows in parts
        for rows in np.array_split(all_rows, max(1, round(len(columns) * len(all_rows) / most)))
    ]


def compute_cells(
    view: View,
    axes: dict[str, Any],
    start: State | int | None = None,
    keep_going: KeepGoing = lambda: True,
    indices: Iterable[str] = tuple(INDICES),
) -> xr.Dataset:
    """Return indices over some axes or points of a view, with the impacts and budget used by pages."""
    sweep: xr.Dataset = vi.parameter_map(
        view.osc,
        indices=tuple(indices),
        start=start,
        transient_impacts=TRANSIENT,
        sample_impacts=view.samples,
        tolerances=budget(view.stiffness, TRANSIENT + view.samples),
        workers=1,
        progress=lambda done, total, partial: keep_going(),
        **axes,
    )
    return sweep


@dataclass
class Plane:
    """The cells of a view computed so far."""

    view: View
    side: int
    values: dict[str, NDArray[Any]]  # each FINEST x FINEST, the first axis along x
    elsewhere: NDArray[np.float32]  # m/s: an impact from other initial conditions; 0: none, NaN: not tried
    seconds: float = 0.0
    stored: str = ""  # the stored sweep from which they were read
    origin: str = "from rest"
    indices: frozenset[str] = frozenset(INDICES)  # the indices known
    tried: bool | None = None  # whether `elsewhere` is complete (True) or was abandoned (False); None: in progress

    @classmethod
    def unknown(cls, view: View) -> Plane:
        """Return an empty plane."""
        values: dict[str, NDArray[Any]] = {
            name: np.full((FINEST, FINEST), index.fill, index.dtype) for name, index in INDICES.items()
        }
        values["motion"] = np.zeros((FINEST, FINEST), np.int8)
        values["status"] = np.full((FINEST, FINEST), vi.Status.INTERRUPTED, np.int8)
        return cls(view, 0, values, np.full((FINEST, FINEST), np.nan, np.float32))

    def fill(self, columns: Places, rows: Places, keep_going: KeepGoing) -> bool:
        """Compute a rectangle of cells; return whether it is complete."""
        view = self.view
        axes = {view.x: positions(*view.x_range, columns), view.y: positions(*view.y_range, rows)}
        start = TRIED[-1] if view.worst else None
        sweep = compute_cells(view, axes, start, keep_going)
        if not keep_going():
            return False
        first = sweep.isel(start=0) if view.worst else sweep
        computed = {name: with_index(sweep, name)[1] if name in INDICES else first[name] for name in first.data_vars}
        computed["motion"] = vi.classify(first)["motion"]
        for name, array in self.values.items():
            array[np.ix_(columns, rows)] = computed[name].values
        return True

    def quiet(self) -> list[Places]:
        """Return the indices of the cells without impact from rest, one row per cell, split into jobs."""
        places = np.argwhere(self.values["motion"] == MotionClass.NO_IMPACT)
        parts = round(len(places) * max(self.view.samples, USUAL) / (BAND * USUAL))
        return np.array_split(places, max(1, parts)) if len(places) else []

    def try_others(self, places: Places, keep_going: KeepGoing) -> bool:
        """Search for impacts from other initial conditions in some cells; return whether the search is complete."""
        view, hardest = self.view, np.zeros(len(places), np.float32)
        for number in TRIED:
            silent = np.flatnonzero(hardest == 0.0)
            if not len(silent):
                break
            columns, rows = places[silent].T
            points = {view.x: positions(*view.x_range, columns), view.y: positions(*view.y_range, rows)}
            sweep = compute_cells(view, {"points": points}, number, keep_going, ["max_velocity"])
            if not keep_going():
                return False
            hardest[silent] = sweep["max_velocity"].fillna(0.0).max("start").values
        self.elsewhere[tuple(places.T)] = hardest
        return True

    def array(self, name: str) -> NDArray[Any]:
        """Return an index over the finest complete lattice, with the first axis along x."""
        cells = lattice(self.side)
        return self.values[name][np.ix_(cells, cells)]

    def axis(self, name: str) -> Floats:
        """Return the values of the parameter along an axis of the lattice, "x" or "y"."""
        low, high = getattr(self.view, f"{name}_range")
        return positions(low, high, lattice(self.side))

    def dataset(self) -> xr.Dataset:
        """Return the finest complete lattice in the form of a `parameter_map` result."""
        view, dims = self.view, (self.view.x, self.view.y)
        point = {view.x: [view.osc_value("x")], view.y: [view.osc_value("y")]}
        # for its attributes only: no cell is computed
        sweep = compute_cells(view, point, keep_going=lambda: False)
        axes = {name: (name, self.axis(axis), sweep[name].attrs) for axis, name in zip("xy", dims, strict=True)}
        names = [str(name) for name in sweep.data_vars if name == "status" or name in self.indices]
        content = {name: (dims, self.array(name), sweep[name].attrs) for name in names}
        origin = {} if self.origin == Plane.origin else {"origin": f" {self.origin}"}
        if view.worst:
            origin = {"origin": f" from rest, none that last from the other {OTHERS}", "note": WORST}
        return xr.Dataset(content, coords=axes, attrs=sweep.attrs | origin)


Stored = Callable[[View], Plane | None]  # returns the plane of a view from a stored sweep that has its cells, else None

# ---- the diagram below the plane and the boundaries in it


@dataclass(frozen=True)
class Line:
    """Impact velocities over one parameter, without duplicates."""

    ends: Range
    values: Floats
    velocities: Floats


@dataclass(frozen=True)
class Curves:
    """Boundaries in the plane."""

    points: list[Floats]  # (n, 2) of each
    kinds: list[str]
    descriptions: list[str]


def compute_line(view: View, keep_going: KeepGoing) -> Line:
    """Return the impact velocities along the view's line, computed until time is up."""
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
    return Line((low, high), values[rows[distinct]], velocity[finite][distinct])


def _velocities(view: View, parameter: str, values: Floats) -> Floats:
    """Return the velocities of some impacts at each value, padded with NaN."""
    axis: dict[str, Any] = {parameter: values}
    diagram = vi.bifurcation_diagram(
        view.osc,
        transient_impacts=TRANSIENT,
        sample_impacts=IMPACTS,
        tolerances=budget(view.stiffness, BUDGETED),
        workers=1,
        **axis,
    )
    velocity = diagram["velocity"].values
    if view.stop:
        velocity = np.where(diagram["stop"].values == view.stop - 1, velocity, np.nan)
    return np.pad(velocity, ((0, 0), (0, IMPACTS - velocity.shape[1])), constant_values=np.nan)


def find_curves(view: View, keep_going: KeepGoing) -> Curves:
    """Return the boundaries in the view's plane, computed until time is up."""
    boundaries = vi.boundary_curves(
        view.osc,
        (view.x, view.y),
        (view.x_range, view.y_range),
        n_periods=FOLLOWED,
        progress=lambda *progress: keep_going(),
    )
    return Curves(
        points=[np.asarray(curve.values, dtype=np.float64) for curve in boundaries],
        kinds=[curve.kind for curve in boundaries],
        descriptions=[f"{bifurcation_name(curve.kind)}, {_motion_at(curve.orbits[0])}" for curve in boundaries],
    )


def _motion_at(orbit: Orbit) -> str:
    """Return the orbit's name; an impact at velocity 0 means the impact-free motion that first touches the stop."""
    return orbit.name if max(orbit.velocities, default=1.0) > 0.0 else WITHOUT
