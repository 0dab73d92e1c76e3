"""The fine grid as far as it is known: computed where it matters, filled in elsewhere; and the lattices in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.classes import NEEDED
from vibroimpact.dataset import missing
from vibroimpact.motion import MotionClass, decide, stored
from vibroimpact.request import Places
from vibroimpact.status import Status

FILLED = -1  # the level of a cell that was not computed
NAMING = NEEDED[:3]  # the indices that a class is decided from
BAND = 256  # rows filled at a time, to save memory
Arrays = Mapping[str, NDArray[Any]]
Flags = NDArray[np.bool_]


class Picture:
    """Indices, status, name of the motion and level of every cell of the fine grid.

    Parameters
    ----------
    shape : tuple of int
        Cells along each axis of the fine grid.
    names : tuple of str
        The indices.
    sample_impacts : int
        Impacts sampled in each cell, by which chaos is recognised.
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
    """Return one number per cell for its class and, of a periodic motion, its n and p."""
    periods, impacts = (np.asarray(result[name], np.int64) for name in ("n_periods", "n_impacts"))
    growth = sample_impacts * result["lyapunov_per_impact"]
    kind = stored(decide(result["status"], growth, periods, impacts)).astype(np.uint32)
    name = np.where(kind == MotionClass.PERIODIC, periods * 8192 + impacts, 0)  # impacts of a cycle are at most 4096
    codes: NDArray[np.uint32] = (kind + 8 * name).astype(np.uint32)
    return codes


def finer(values: Floats, levels: int) -> Floats:
    """Return an axis whose every interval is cut into 2^levels equal ones; its own values stay as they are.

    Examples
    --------
    >>> finer(np.array([0.0, 1.0, 3.0]), 1).tolist()
    [0.0, 0.5, 1.0, 2.0, 3.0]
    """
    cuts = 1 << levels
    parts = np.arange(cuts) / cuts
    between = values[:-1, None] + np.diff(values)[:, None] * parts
    return np.append(between.ravel(), values[-1])


def quads(field: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return the four corners of every square of neighbours of a lattice."""
    return field[:-1, :-1], field[1:, :-1], field[:-1, 1:], field[1:, 1:]


def points_of(squares: Flags) -> Flags:
    """Return the points of the lattice of half the step that lie in or on the marked squares."""
    rows, columns = squares.shape
    points = np.zeros((2 * rows + 1, 2 * columns + 1), bool)
    for i in range(3):
        for j in range(3):
            points[i : i + 2 * rows - 1 : 2, j : j + 2 * columns - 1 : 2] |= squares
    return points


def places(points: Flags, step: int, shape: tuple[int, ...]) -> Places:
    """Return where marked points of a lattice lie on the fine grid, as flat indices in ascending order."""
    i, j = np.nonzero(points)
    at = i * shape[1]
    at += j
    at *= step
    return at
