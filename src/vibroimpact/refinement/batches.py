"""Batches of scattered cells, computed into the picture or taken from a store."""

from __future__ import annotations

from contextlib import closing, suppress
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from vibroimpact.execution import Gathered, Place
from vibroimpact.execution.tiling import listed_tile
from vibroimpact.progress import Report, Stop
from vibroimpact.refinement.picture import Picture
from vibroimpact.request import Places, Request

if TYPE_CHECKING:
    from vibroimpact.execution.store import SweepStore
    from vibroimpact.execution.store.writer import TileWriter


class Batches:
    """Computes batches of cells of the fine grid into the picture; takes from a store what it holds and keeps the rest.

    In the lists of a store every batch begins a tile, so that the place of a cell follows from the request alone.

    Parameters
    ----------
    dataset : xarray.Dataset
        The picture as a map, in whose attributes impacts and steps are counted.
    tile : int or None
        Cells of a part that is computed together; None is what suits the place.
    report : callable
        Gets cells computed, cells known to be needed, and the dataset; False asks to stop.
    kept : pair, optional
        The store and what writes to it.
    """

    def __init__(
        self,
        request: Request,
        picture: Picture,
        dataset: xr.Dataset,
        place: Place,
        tile: int | None,
        report: Report,
        kept: tuple[SweepStore, TileWriter] | None,
    ) -> None:
        self.request, self.picture, self.dataset = request, picture, dataset
        self.place, self.tile, self.report, self.kept = place, tile, report, kept
        self.stop = Stop(report)
        self.chunk = kept[0].tiling.tile[0] if kept else listed_tile(request)
        self.chunks = self.done = self.needed = 0

    def __call__(self, at: Places, level: int) -> bool:
        """Compute the cells `at`, flat indices of the fine grid; return whether all are known."""
        self.needed += len(at)
        if self.kept:
            self.kept[1].need(self.needed)
        waiting = {}
        for low in range(0, len(at), self.chunk):
            cells = at[low : low + self.chunk]
            if not self._recalled(self.chunks, cells, level):
                waiting[self.chunks] = cells
            self.chunks += 1
        self._tell()
        if waiting and not self.stop.is_set():
            self._compute(waiting, self.tile or self.place.part_size(self.request, len(at)), level)
        return not waiting and not self.stop.is_set()

    def _recalled(self, number: int, cells: Places, level: int) -> bool:
        """Whether a chunk is in the store, for these cells and undamaged, and has been taken from there."""
        if not self.kept:
            return False
        store, writer = self.kept
        if not writer.is_done(number):
            return False
        with suppress(Exception):  # a damaged chunk: computed again
            found = {name: values[: len(cells)] for name, values in store.read(number).items()}
            if np.array_equal(found["cell"], cells):
                self.picture.put(cells, found, level)
                self._count(len(cells), *writer.cost(number))
                return True
        return False

    def _compute(self, waiting: dict[int, Places], size: int, level: int) -> None:
        """Compute chunks by their numbers, in parts of so many cells; take those that have ended from `waiting`."""
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
                    if self.kept and number < len(self.kept[0].tiling):  # more batches are not kept
                        self.kept[1].write(number, chunk | {"cell": cells}, perf_counter() - began)
                        began = perf_counter()
                self._tell()

    def _count(self, cells: int, impacts: int, steps: int) -> None:
        self.done += cells
        self.dataset.attrs["impacts_computed"] += impacts
        self.dataset.attrs["steps_computed"] += steps

    def _tell(self) -> None:
        if self.report(self.done, self.needed, self.dataset) is False:
            self.stop.set()
