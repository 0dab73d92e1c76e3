"""The fine grid as far as it is known: computed where it matters, filled in elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.classes import NEEDED
from vibroimpact.dataset import missing, plain_variable
from vibroimpact.motion import MotionClass, decide, stored
from vibroimpact.refinement.lattice import Places
from vibroimpact.status import Status

FILLED = -1  # the level of a cell that was not computed
NAMING = NEEDED[:3]  # the indices that a class is decided from
BAND = 256  # rows filled at a time, to save memory
Arrays = Mapping[str, NDArray[Any]]


class Picture:
    """Indices, status, name of the motion and level of every cell of the fine grid.

    Parameters
    ----------
    shape : tuple of int
        Cells along each axis of the fine grid.
    names : tuple of str
        The indices.
    sample_impacts : int
        Impacts sampled in each cell, by which chaos is told.
    """

    def __init__(self, shape: tuple[int, ...], names: tuple[str, ...], sample_impacts: int) -> None:
        self.shape, self.sample_impacts = shape, sample_impacts
        self.values: dict[str, NDArray[Any]] = {name: missing(name, shape) for name in names}
        self.values["status"] = np.full(shape, Status.INTERRUPTED, np.int8)
        self.level = np.full(shape, FILLED, np.int8)
        self.motion = np.zeros(shape, np.uint32)

    @property
    def computed(self) -> int:
        """Cells computed so far."""
        return int(np.count_nonzero(self.level >= 0))

    def put(self, at: Places, result: Arrays, level: int) -> None:
        """Write computed cells down."""
        for name, values in self.values.items():
            values.ravel()[at] = result[name]
        self.motion.ravel()[at] = motion_codes(result, self.sample_impacts)
        self.level.ravel()[at] = level

    def fill(self, step: int) -> None:
        """Guess the cells of the lattice of `step` from that of twice the step.

        Between two cells of the same motion an index is their mean, so that it is bilinear in a square of one motion;
        elsewhere the first of the two speaks for both.
        """
        coarse, fine = slice(None, None, 2 * step), slice(None, None, step)
        self._fill_between((slice(0, None, 2 * step), coarse), (slice(step, None, 2 * step), coarse), 0)
        self._fill_between((fine, slice(0, None, 2 * step)), (fine, slice(step, None, 2 * step)), 1)

    def _fill_between(self, known: tuple[slice, slice], new: tuple[slice, slice], axis: int) -> None:
        below, above = _neighbours(self.motion[known], axis)
        for low in range(0, len(below), BAND):
            band = slice(low, low + BAND)
            unknown = self.level[new][band] < 0
            same = below[band] == above[band]
            for field in self.values.values():
                lower, upper = (side[band] for side in _neighbours(field[known], axis))
                guess = lower
                if field.dtype.kind == "f":
                    guess = np.where(same & (lower != upper), 0.5 * (lower + upper), lower)
                np.copyto(field[new][band], guess, where=unknown)
            np.copyto(self.motion[new][band], below[band], where=unknown)


def _neighbours(field: NDArray[Any], axis: int) -> tuple[NDArray[Any], NDArray[Any]]:
    return (field[:-1], field[1:]) if axis == 0 else (field[:, :-1], field[:, 1:])


def motion_codes(result: Arrays, sample_impacts: int) -> NDArray[np.uint32]:
    """Return one number a cell for its class and, of a periodic motion, its name."""
    periods, impacts = (np.asarray(result[name], np.int64) for name in ("n_periods", "n_impacts"))
    growth = sample_impacts * result["lyapunov_per_impact"]
    kind = stored(decide(result["status"], growth, periods, impacts)).astype(np.uint32)
    name = np.where(kind == MotionClass.PERIODIC, periods * 8192 + impacts, 0)  # impacts of a cycle are at most 4096
    codes: NDArray[np.uint32] = (kind + 8 * name).astype(np.uint32)
    return codes


def level_variable(dims: tuple[str, ...], levels: NDArray[np.int8]) -> xr.Variable:
    """Return levels with their meaning."""
    meaning = f"level of refinement at which a cell was computed, {FILLED} where it was filled in"
    return plain_variable(dims, levels, {"long_name": meaning, "units": "1", "symbol": "level"})
