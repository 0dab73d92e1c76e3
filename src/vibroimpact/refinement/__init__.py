"""Fine maps at the cost of their boundaries: computed where motions change, and filled in elsewhere."""

from __future__ import annotations

import os
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.dataset import level_variable, plain_variable
from vibroimpact.execution.base import Gathered, Place, usual_tile
from vibroimpact.execution.places import check_place, computing
from vibroimpact.motion import NAMING, may_wind
from vibroimpact.parameters import invalid, real_number, several, whole_number
from vibroimpact.progress import Report, Stop, reporter
from vibroimpact.refinement.picture import Picture, finer, refine_picture
from vibroimpact.request import Places, Request, map_of

if TYPE_CHECKING:
    import xarray as xr
    from distributed import Client

    from vibroimpact.execution.layout import TileWriter
    from vibroimpact.execution.store import SweepStore

DEEPEST = 12  # levels: one cell of the grid becomes 4096 along each axis


def refine_map(
    coarse: Request,
    refine: int,
    jump: float | None,
    *,
    workers: int | None,
    store: str | os.PathLike[str] | None,
    cluster: Client | str | None,
    tile: int | None,
    progress: bool | Report | None,
) -> xr.Dataset:
    """Return the refined map of a request's grid; see `refined_map`."""
    request = refined(coarse, refine, jump)
    check_place(request, workers, cluster, tile)
    if tile is not None and cluster is None:
        raise ValueError("with `refine`, `tile` needs a `cluster`; leave it out")
    with reporter(progress, "cells") as report, ExitStack() as stack:
        stored, writer = None, None
        if store is not None:
            from vibroimpact.execution.store import open_or_create

            stored = open_or_create(store, request, usual_tile(request, listed=True))
            if stored.is_whole():
                return stored.dataset()
            writer = stack.enter_context(stored.writing())
        place = stack.enter_context(computing(cluster, workers))
        picture = Picture(request.shape, request.indices, request.measurement.impacts.keep, may_wind(request.model))
        level = {"level": level_variable(request.dims, picture.level)}
        dataset = map_of(request, picture.values).assign(level)
        batches = Batches(request, picture, dataset, place, tile, report, stored, writer)
        complete = refine_picture(picture, request.further["refine"], request.further["jump"], batches)
        dataset.attrs |= {
            "complete": int(complete),
            "cells_computed": picture.computed,
            "fraction_computed": picture.computed / picture.level.size,
            "filled_in": _filled_in(coarse.shape, complete),
        }
        if stored is None or writer is None:
            return dataset
        writer.draw({**picture.values, "level": picture.level}, dataset.attrs)
        return stored.dataset()


def _filled_in(coarse: tuple[int, ...], complete: bool) -> str:
    """Return the values of cells that were not computed, and what these may hide."""
    if not complete:
        return "stopped early: the other cells hold the motion of the nearest ones, even if that is no impact"
    grid = " x ".join(map(str, coarse))
    return (
        "all cells without impacts were computed; the others hold the motion of their neighbours, so islands of "
        f"another motion between the points of the given {grid} grid may be missing"
    )


def refined(coarse: Request, refine: int, jump: float | None) -> Request:
    """Return the request of the fine grid; the refinement is part of its identity."""
    levels = whole_number("refine", refine, 1)
    if levels > DEEPEST:
        raise invalid("refine", refine, f"between 1 and {DEEPEST}", "give a finer grid instead")
    allowed = "None or a number above 0 and up to 1"
    part = None if jump is None else real_number("jump", jump, allowed)
    if part is not None and not 0.0 < part <= 1.0:
        raise invalid("jump", jump, allowed, "0.1 is usual")
    _check_plane(coarse)
    names = (*coarse.indices, *(name for name in NAMING if name not in coarse.indices))
    axes = {name: finer(values, levels) for name, values in coarse.axes.items()}
    measurement = replace(coarse.measurement, indices=names)
    return replace(coarse, axes=axes, measurement=measurement, further={"refine": levels, "jump": part})


class Batches:
    """Computes batches of cells of the fine grid into the picture, using and filling a store if there is one.

    In the lists of a store, every batch begins a new tile, so that the place of a cell follows from the request alone.
    Impacts and steps are counted in the attributes of `dataset`, the picture as a map; `report` gets the number of
    cells computed, the number known to be needed, and the dataset. If `tile` is None, the place chooses the size of
    parts; `writer` writes to the store.
    """

    def __init__(
        self,
        request: Request,
        picture: Picture,
        dataset: xr.Dataset,
        place: Place,
        tile: int | None,
        report: Report,
        store: SweepStore | None,
        writer: TileWriter | None,
    ) -> None:
        self.request, self.picture, self.dataset = request, picture, dataset
        self.place, self.tile, self.report, self.store, self.writer = place, tile, report, store, writer
        self.stop = Stop(report)
        self.chunk = writer.tiling.tile[0] if writer else usual_tile(request, listed=True)
        self.chunks = self.done = self.needed = 0

    def __call__(self, at: Places, level: int) -> bool:
        """Compute the cells `at`, flat indices of the fine grid; return whether all are known."""
        self.needed += len(at)
        if self.writer:
            self.writer.need(self.needed)
        waiting = {}
        for low in range(0, len(at), self.chunk):
            cells = at[low : low + self.chunk]
            if not self._recalled(self.chunks, cells, level):
                waiting[self.chunks] = cells
            self.chunks += 1
        self._report_progress()
        if waiting and not self.stop.is_set():
            self._compute(waiting, self.tile or self.place.part_size(self.request, len(at)), level)
        return not waiting and not self.stop.is_set()

    def _recalled(self, number: int, cells: Places, level: int) -> bool:
        """Return whether an undamaged chunk of these cells is in the store, after taking it from there."""
        if self.store is None or self.writer is None or not self.writer.is_done(number):
            return False
        with suppress(OSError):  # damaged since the store was opened: computed again
            stored = {name: values[: len(cells)] for name, values in self.store.read(number).items()}
            if np.array_equal(stored["cell"], cells):
                self.picture.put(cells, stored, level)
                self._count(len(cells), *self.writer.cost(number))
                return True
        return False

    def _compute(self, waiting: dict[int, Places], size: int, level: int) -> None:
        """Compute chunks by number, in parts of `size` cells; remove those that have ended from `waiting`."""
        gathered, began = Gathered(), perf_counter()
        owners = [(number, low) for number, cells in waiting.items() for low in range(0, len(cells), size)]
        parts = [waiting[number][low : low + size] for number, low in owners]
        with closing(self.place.compute(self.request, parts, self.stop)) as pieces:
            for part, which, outcome in pieces:
                (number, low), cells = owners[part], parts[part][which]
                self.picture.put(cells, outcome, level)
                self._count(len(cells), int(outcome["impacts"].sum()), int(outcome["steps"].sum()))
                ended = low + np.arange(len(parts[part]))[which]
                chunk = gathered.add(number, len(waiting[number]), ended, outcome)
                if chunk is not None:
                    cells = waiting.pop(number)
                    if self.writer and number < len(self.writer.tiling):  # further batches are not kept
                        self.writer.write(number, chunk | {"cell": cells}, perf_counter() - began)
                        began = perf_counter()
                self._report_progress()

    def _count(self, cells: int, impacts: int, steps: int) -> None:
        self.done += cells
        self.dataset.attrs["impacts_computed"] += impacts
        self.dataset.attrs["steps_computed"] += steps

    def _report_progress(self) -> None:
        if self.report(self.done, self.needed, self.dataset) is False:
            self.stop.set()


def to_uniform(plane: xr.Dataset, *, shape: tuple[int, int] | None = None) -> xr.Dataset:
    """Return a refined map on evenly spaced axes; each cell takes the value of the nearest cell of the fine grid.

    Parameters
    ----------
    plane : xarray.Dataset
        The result of `refined_map`.
    shape : pair of int, >= 2, optional
        Cells along each axis; None keeps the numbers of the fine grid.

    Returns
    -------
    xarray.Dataset
        The same variables; nothing is interpolated, so that every value was computed or filled in before.

    Raises
    ------
    ValueError
        `plane` is not a refined map, or `shape` not a pair of whole numbers >= 2.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator, refined_map
    >>> plane = refined_map(ImpactOscillator(), refine=2, omega=[2.0, 2.4, 3.0], mass=[0.9, 1.1], sample_impacts=100)
    >>> dict(to_uniform(plane, shape=(11, 6)).sizes)
    {'omega': 11, 'mass': 6}
    """
    import xarray as xr

    if not isinstance(plane, xr.Dataset) or "level" not in plane or len(plane["level"].dims) != 2:
        raise ValueError(f"`plane` must be a result of `refined_map`, got a {type(plane).__name__} without levels")
    dims = [str(dim) for dim in plane["level"].dims]
    sizes = plane["level"].shape if shape is None else several("shape", shape, "a pair of whole numbers")
    if len(sizes) != 2:
        raise invalid("shape", shape, "a pair of whole numbers")
    targets: dict[str, xr.Variable] = {}
    for dim, size in zip(dims, sizes, strict=True):
        values = plane[dim].values
        even = np.linspace(values[0], values[-1], whole_number("shape", size, 2))
        targets[dim] = plain_variable(dim, even, plane[dim].attrs)
    return plane.sel({dim: target.values for dim, target in targets.items()}, method="nearest").assign_coords(targets)


def _check_plane(request: Request) -> None:
    if request.scattered or request.n_starts:
        raise ValueError(
            "`refine` needs a grid and one initial condition; leave out `points`, and give one `start` or none"
        )
    if len(request.axes) != 2:
        raise ValueError(f"`refine` needs two axes, got {len(request.axes)}; leave it out otherwise")
    for name, values in request.axes.items():
        if len(values) < 2:
            raise ValueError(f"`{name}` must have at least two values with `refine`, got 1; give at least both ends")
