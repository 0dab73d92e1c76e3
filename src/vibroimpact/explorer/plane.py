"""The plane: its cells, a coarse lattice first and then the cells between, a diagram, and boundaries."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.limits import FINEST, Range, budget
from vibroimpact.explorer.state import View
from vibroimpact.indices import INDICES
from vibroimpact.model import State
from vibroimpact.motion import MotionClass
from vibroimpact.orbits import Orbit
from vibroimpact.plotting.diagrams import with_index

Floats = NDArray[np.float64]
Places = NDArray[np.int64]  # of cells along an axis of the finest lattice
KeepGoing = Callable[[], bool]

SIDES = (64, 128, 256)  # of the lattices; each contains the one before
COARSER = (16, 32)  # before them, where a rest at a stop erases no memory: a cell may take some milliseconds
BAND, USUAL = 2048, 500  # cells per job, about, with so many impacts per cell; fewer where more are sampled
TRANSIENT = 100  # impacts left out
TRIED = (2, 5, 17)  # initial conditions in turn, rest among them, of cells without impact from rest: until one hits
OTHERS = TRIED[-1] - 1
WORST = f"worst of {TRIED[-1]} initial conditions"
ONLY_OTHERS = f"no impact from rest; impacts from other initial conditions ({OTHERS} tried)"

FOLLOWED = (1, 2)  # driving periods of the motions whose boundaries are followed
VALUES, PART = 200, 100  # along the line; computed at a time
IMPACTS = 48  # of each value
BUDGETED = 5000  # impacts for which a budget is granted: the few of a diagram get a share of it
RESOLUTION = 10_000  # velocities that a diagram distinguishes, up to the largest


def lattice(side: int) -> Places:
    """Return which of the finest cells along an axis belong to a lattice of `side`."""
    stride = FINEST // side
    return np.arange(0x55 & (stride - 1), FINEST, stride)  # 1, 1, 5, 5 of strides 2, 4, 8, 16: each holds the coarser


def positions(low: float, high: float, cells: Places) -> Floats:
    """Return the parameter at the middle of the finest cells."""
    return np.asarray(low + (cells + 0.5) * ((high - low) / FINEST), dtype=np.float64)


def sides(view: View) -> tuple[int, ...]:
    """Return the lattices of a view in turn."""
    return SIDES if view.system.forgets else (*COARSER, *SIDES)


def bands(side: int, samples: int = USUAL, first: int = SIDES[0]) -> list[tuple[Places, Places]]:
    """Return the cells that a lattice adds to the one before, as rectangles small enough for a job."""
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
    """Return indices of a view's cells over some axes, or points, the impacts sampled and budgeted as pages do."""
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
    """The cells of a view, as far as they are known."""

    view: View
    side: int
    values: dict[str, NDArray[Any]]  # each FINEST x FINEST, the first axis along x
    elsewhere: NDArray[np.float32]  # m/s: a hardest impact from other initial conditions; 0 from none, NaN not tried
    seconds: float = 0.0
    stored: str = ""  # the stored sweep that they were taken from
    origin: str = "from rest"
    indices: frozenset[str] = frozenset(INDICES)  # those that are known
    tried: bool | None = None  # whether `elsewhere` is complete, or was given up; None is not yet

    @classmethod
    def unknown(cls, view: View) -> Plane:
        """Return a plane of which nothing is known."""
        values: dict[str, NDArray[Any]] = {
            name: np.full((FINEST, FINEST), index.fill, index.dtype) for name, index in INDICES.items()
        }
        values["motion"] = np.zeros((FINEST, FINEST), np.int8)
        values["status"] = np.full((FINEST, FINEST), vi.Status.INTERRUPTED, np.int8)
        return cls(view, 0, values, np.full((FINEST, FINEST), np.nan, np.float32))

    def fill(self, columns: Places, rows: Places, keep_going: KeepGoing) -> bool:
        """Compute a rectangle of cells; return whether it was finished."""
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
        """Return the places of the cells that have no impact from rest, in rows of two, in parts for a job each."""
        places = np.argwhere(self.values["motion"] == MotionClass.NO_IMPACT)
        parts = round(len(places) * max(self.view.samples, USUAL) / (BAND * USUAL))
        return np.array_split(places, max(1, parts)) if len(places) else []

    def try_others(self, places: Places, keep_going: KeepGoing) -> bool:
        """Look for impacts from other initial conditions in some cells; return whether that was finished."""
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
        point = {view.x: [view.osc_value("x")], view.y: [view.osc_value("y")]}
        # attributes and nothing else: no cell is computed
        sweep = compute_cells(view, point, keep_going=lambda: False)
        axes = {name: (name, self.axis(axis), sweep[name].attrs) for axis, name in zip("xy", dims, strict=True)}
        names = [str(name) for name in sweep.data_vars if name == "status" or name in self.indices]
        content = {name: (dims, self.array(name), sweep[name].attrs) for name in names}
        origin = {} if self.origin == Plane.origin else {"origin": f" {self.origin}"}
        if view.worst:
            origin = {"origin": f" from rest, none that last from the other {OTHERS}", "note": WORST}
        return xr.Dataset(content, coords=axes, attrs=sweep.attrs | origin)


Stored = Callable[[View], Plane | None]  # gives a view its plane from a stored sweep, if that has its cells

# ---- what is drawn below and over the plane


@dataclass(frozen=True)
class Line:
    """Impact velocities over one parameter, each given once."""

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
    return Line((low, high), values[rows[distinct]], velocity[finite][distinct])


def _velocities(view: View, parameter: str, values: Floats) -> Floats:
    """Return the velocities of some impacts at each value, NaN where there are fewer."""
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
    """Return the boundaries in the view's plane, as far as time is left."""
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
        descriptions=[f"{curve.kind.replace('_', ' ')}, {_motion_at(curve.orbits[0])}" for curve in boundaries],
    )


def _motion_at(orbit: Orbit) -> str:
    """Return the orbit's name; where the swing without impacts first touches the stop, it hits at velocity 0."""
    return orbit.name if max(orbit.velocities, default=1.0) > 0.0 else "the steady swing without impacts"
