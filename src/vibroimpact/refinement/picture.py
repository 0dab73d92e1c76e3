"""The fine grid, as far as it is known, and its order of computation: finer and finer where motions change."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.dataset import missing
from vibroimpact.motion import NAMING, MotionClass, decide, stored
from vibroimpact.request import Places
from vibroimpact.status import Status

FILLED = -1  # the level of a cell that was not computed
KINDS = 8  # a motion code modulo this is its class; the quotient is its n and p
BAND = 256  # rows filled at a time, to save memory
Arrays = Mapping[str, NDArray[Any]]
Flags = NDArray[np.bool_]
# Computes cells and puts them into the picture at a level; returns whether all were computed.
Compute = Callable[[Places, int], bool]
# The difference of an index between neighbours above which a boundary lies between them.
Jumps = Mapping[str, float]


class Picture:
    """Indices, status, motion code and level of every cell of the fine grid.

    `sample_impacts` is the number sampled in each cell, which decides chaos and, for motions of `several` coordinates,
    quasi-periodicity.
    """

    def __init__(
        self, shape: tuple[int, ...], names: tuple[str, ...], sample_impacts: int, several: bool = False
    ) -> None:
        self.shape, self.sample_impacts, self.several = shape, sample_impacts, several
        self.values: dict[str, NDArray[Any]] = {name: missing(name, shape) for name in names}
        self.values["status"] = np.full(shape, Status.INTERRUPTED, np.int8)
        self.level = np.full(shape, FILLED, np.int8)
        self.motion = np.zeros(shape, np.uint32)

    @property
    def computed(self) -> int:
        """Cells computed so far."""
        return int(np.count_nonzero(self.level >= 0))

    def put(self, at: Places, result: Arrays, level: int) -> None:
        """Write computed cells into the picture."""
        for name, values in self.values.items():
            values.ravel()[at] = result[name]
        self.motion.ravel()[at] = motion_codes(result, self.sample_impacts, self.several)
        self.level.ravel()[at] = level

    def fill(self, step: int) -> None:
        """Estimate the cells of the lattice of `step` from those of twice the step.

        Between two cells of the same motion an index is their mean, so that it is bilinear in a square of one motion;
        otherwise the first of the two cells is copied.
        """
        coarse, fine = slice(None, None, 2 * step), slice(None, None, step)
        self._fill_between((slice(0, None, 2 * step), coarse), (slice(step, None, 2 * step), coarse), 0)
        self._fill_between((fine, slice(0, None, 2 * step)), (fine, slice(step, None, 2 * step)), 1)

    def _fill_between(self, lattice: tuple[slice, slice], new: tuple[slice, slice], axis: int) -> None:
        below, above = _neighbours(self.motion[lattice], axis)
        for low in range(0, len(below), BAND):
            band = slice(low, low + BAND)
            unknown = self.level[new][band] < 0
            same = below[band] == above[band]
            for field in self.values.values():
                lower, upper = (side[band] for side in _neighbours(field[lattice], axis))
                guess = lower
                if field.dtype.kind == "f":
                    guess = np.where(same & (lower != upper), 0.5 * (lower + upper), lower)
                np.copyto(field[new][band], guess, where=unknown)
            np.copyto(self.motion[new][band], below[band], where=unknown)


def _neighbours(field: NDArray[Any], axis: int) -> tuple[NDArray[Any], NDArray[Any]]:
    return (field[:-1], field[1:]) if axis == 0 else (field[:, :-1], field[:, 1:])


def motion_codes(result: Arrays, sample_impacts: int, several: bool = False) -> NDArray[np.uint32]:
    """Return one number per cell for its class, for one or `several` coordinates, and its n and p if it is periodic."""
    periods, impacts = (np.asarray(result[name], np.int64) for name in ("n_periods", "n_impacts"))
    growth = sample_impacts * result["lyapunov_per_impact"]
    kind = stored(decide(result["status"], growth, periods, impacts, sample_impacts * several)).astype(np.uint32)
    name = np.where(kind == MotionClass.PERIODIC, periods * 8192 + impacts, 0)  # a cycle has at most 4096 impacts
    codes: NDArray[np.uint32] = (kind + KINDS * name).astype(np.uint32)
    return codes


def finer(values: Floats, levels: int) -> Floats:
    """Return an axis with every interval cut into 2^levels equal ones; the given values stay as they are.

    Examples
    --------
    >>> finer(np.array([0.0, 1.0, 3.0]), 1).tolist()
    [0.0, 0.5, 1.0, 2.0, 3.0]
    """
    cuts = 1 << levels
    parts = np.arange(cuts) / cuts
    between = values[:-1, None] + np.diff(values)[:, None] * parts
    return np.append(between.ravel(), values[-1])


def refine_picture(picture: Picture, levels: int, jump: float | None, compute: Compute) -> bool:
    """Compute and fill the picture, a coarse lattice first; return whether it is complete.

    A cell that would be filled in as having no impacts is computed: that costs little, and missing an impact is the
    worst error. Each batch depends only on the ones before, so that a stopped run repeats the same steps.
    """
    step = 1 << levels
    everywhere = np.ones([side - 1 for side in picture.level[::step, ::step].shape], bool)
    going = compute(_unknown(picture, step, everywhere, 1), 0)
    jumps = {} if jump is None else _jumps(picture, step, jump)
    for level in range(1, levels + 1):
        # No margin around mixed squares: boundaries that slip between samples are found below, at less cost.
        mixed = _mixed_squares(picture, step, jumps)
        step //= 2
        picture.fill(step)
        batch = _unknown(picture, step, mixed, 2) if going else None
        while batch is not None and len(batch):
            going = compute(batch, level)
            # cells that were filled in but turn out to lie next to a boundary
            batch = _unknown(picture, step, _mixed_squares(picture, step, jumps), 1) if going else None
    return going


def _unknown(picture: Picture, step: int, squares: Flags, cuts: int) -> Places:
    """Return the cells of the lattice of `step` that must be computed and are not yet.

    They are those in or on marked squares of `cuts` steps per side, and those that would be filled in as having no
    impacts. They are flat indices of the fine grid, ascending.
    """
    rows, columns = (cuts * side for side in squares.shape)
    points: Flags = picture.motion[::step, ::step] % KINDS == MotionClass.NO_IMPACT
    for i in range(cuts + 1):
        for j in range(cuts + 1):
            points[i : i + rows : cuts, j : j + columns : cuts] |= squares
    along_x, along_y = np.nonzero(points & (picture.level[::step, ::step] < 0))
    at: Places = along_x * picture.shape[1]
    at += along_y
    at *= step
    return at


def _quads(field: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return the four corners of every square of a lattice."""
    return field[:-1, :-1], field[1:, :-1], field[:-1, 1:], field[1:, 1:]


def _mixed_squares(picture: Picture, step: int, jumps: Jumps) -> Flags:
    """Return the squares of a lattice whose corners differ in motion, or in an index by more than a jump."""
    first, *others = _quads(picture.motion[::step, ::step])
    mixed: Flags = np.zeros(first.shape, bool)
    for other in others:
        mixed |= first != other
    for name, most in jumps.items():
        corners = _quads(picture.values[name][::step, ::step])
        with np.errstate(invalid="ignore"):  # a missing value is not a boundary: the class shows it
            mixed |= np.max(corners, axis=0) - np.min(corners, axis=0) > most
    return mixed


def _jumps(picture: Picture, step: int, jump: float) -> Jumps:
    """Return the differences that count as a jump: this fraction of an index's range over the coarse lattice."""
    limits = {}
    for name, values in picture.values.items():
        if name not in NAMING and values.dtype == np.float64:
            coarse = values[::step, ::step]
            finite = coarse[np.isfinite(coarse)]
            if finite.size:
                limits[name] = jump * float(np.ptp(finite))
    return limits
