"""The plane, cell by cell: a coarse lattice first, then the cells between, none of them twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.limits import granted
from vibroimpact.explorer.state import FINEST, View
from vibroimpact.indices import INDICES

Floats = NDArray[np.float64]
Cells = NDArray[np.int64]

SIDES = (64, 128, 256)  # of the lattices; each holds the one before
BAND, USUAL = 2048, 500  # cells a job, about, where so many impacts a cell are sampled; fewer where more are
TRANSIENT = 100
NAMES = (*INDICES, "motion", "status")


def lattice(side: int) -> Cells:
    """Return which of the finest cells along an axis belong to a lattice of `side`."""
    stride = FINEST // side
    return np.arange(stride // 2 - (side < FINEST and stride > 2), FINEST, stride)


def positions(low: float, high: float, cells: Cells) -> Floats:
    """Return the parameter at the middle of the finest cells."""
    return np.asarray(low + (cells + 0.5) * ((high - low) / FINEST), dtype=np.float64)


def bands(side: int, samples: int = USUAL) -> list[tuple[Cells, Cells]]:
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


@dataclass
class Plane:
    """The cells of a view, as far as they are known."""

    view: View
    side: int
    values: dict[str, NDArray[Any]]  # each FINEST x FINEST, the first axis along x
    seconds: float = 0.0
    stored: str = ""  # the study that they were taken from

    @classmethod
    def unknown(cls, view: View) -> Plane:
        """Return a plane of which nothing is known."""
        values: dict[str, NDArray[Any]] = {name: np.full((FINEST, FINEST), np.nan) for name in INDICES}
        values["n_periods"] = np.zeros((FINEST, FINEST), np.int32)
        values["n_impacts"] = np.zeros((FINEST, FINEST), np.int32)
        values["motion"] = np.zeros((FINEST, FINEST), np.int8)
        values["status"] = np.full((FINEST, FINEST), vi.Status.INTERRUPTED, np.int8)
        return cls(view, 0, values)

    def fill(self, columns: Cells, rows: Cells, going: Callable[[], bool]) -> bool:
        """Compute a rectangle of cells; return whether it was finished."""
        view = self.view
        axes: dict[str, Any] = {
            view.x: positions(*view.x_range, columns),
            view.y: positions(*view.y_range, rows),
        }
        sweep = vi.parameter_map(
            view.osc,
            indices=tuple(INDICES),
            transient_impacts=TRANSIENT,
            sample_impacts=view.samples,
            tolerances=granted(view.stiffness, TRANSIENT + view.samples),
            workers=1,
            progress=lambda done, total, partial: going(),
            **axes,
        )
        if not going():
            return False
        told = sweep.assign(motion=vi.classify(sweep)["motion"])
        for name, array in self.values.items():
            array[np.ix_(columns, rows)] = told[name].values
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
        one: dict[str, Any] = {view.x: [view.osc_value("x")], view.y: [view.osc_value("y")]}
        sweep = vi.parameter_map(
            view.osc, indices=tuple(INDICES), transient_impacts=TRANSIENT, sample_impacts=view.samples,
            tolerances=granted(view.stiffness, TRANSIENT + view.samples), workers=1,
            progress=lambda done, total, partial: False,
            **one,
        )  # fmt: skip
        axes = {name: (name, self.axis(axis), sweep[name].attrs) for axis, name in zip("xy", dims, strict=True)}
        content = {str(name): (dims, self.array(str(name)), sweep[name].attrs) for name in sweep.data_vars}
        return xr.Dataset(content, coords=axes, attrs=sweep.attrs)
