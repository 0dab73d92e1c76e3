"""Running sweeps on a cluster: into a store, by whoever sees it, or into memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cluster.connection import connect
from vibroimpact.cluster.farm import farm_out
from vibroimpact.cluster.tiles import WritableTile, cut_out, marked
from vibroimpact.stores.records import Record
from vibroimpact.stores.request import SweepRequest
from vibroimpact.stores.run import Executor, _StoredTile
from vibroimpact.stores.tiling import CELLS, cut

if TYPE_CHECKING:
    from distributed import Client


def on_cluster(cluster: Client | str) -> Executor:
    """Return an executor that computes a store's tiles on a cluster; `connect` tells what may be given.

    A worker that sees the store writes its tiles there itself; the tiles of the others are written here.
    """

    def run(job: Callable[[int], Any], numbers: list[int], stop: Event) -> Iterator[tuple[int, Any]]:
        if not isinstance(job, _StoredTile):
            raise TypeError(f"a cluster computes the tiles of a store, not {job!r}")
        tiling, writer = job.tiling, job.writer
        if not numbers or stop.is_set():
            return
        folder = os.path.abspath(writer.path)
        with connect(cluster) as client, marked(writer.path) as mark:

            def task(number: int) -> WritableTile:
                part = tiling[number]
                return WritableTile(cut_out(job.request, part), number, part, folder, mark)

            for number, told in farm_out(client, task, numbers, stop):
                yield number, told if isinstance(told, Record) else writer.write(number, tiling[number], *told)

    return run


def in_memory(
    cluster: Client | str, request: SweepRequest, cells: int | None, stop: Event
) -> Iterator[tuple[NDArray[np.int64], dict[str, NDArray[Any]]]]:
    """Yield which cells, counted along the grid, have ended, and their indices, until all have or `stop` is set."""
    tiling = cut(request.shape, cells or CELLS)
    with connect(cluster) as client:
        tiles = farm_out(client, lambda number: cut_out(request, tiling[number]), range(len(tiling)), stop)
        for number, (result, _) in tiles:
            places = np.ix_(*(np.arange(along.start, along.stop) for along in tiling[number]))
            which = np.ravel_multi_index(places, request.shape).ravel()
            yield which, {name: values.ravel() for name, values in result.items()}
