"""Running sweeps on a cluster: into a store, by whoever sees it, or into memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.execution.cluster.connection import connect
from vibroimpact.execution.cluster.farm import farm_out
from vibroimpact.execution.cluster.tiles import WritableTile, cut_out, marked, wait_for_writers
from vibroimpact.execution.store.records import Record
from vibroimpact.execution.store.run import Executor, StoredTile
from vibroimpact.execution.store.tiling import CELLS, cut
from vibroimpact.request import Request

if TYPE_CHECKING:
    from distributed import Client


def on_cluster(cluster: Client | str) -> Executor:
    """Return an executor that computes a store's tiles on a cluster; `connect` tells what may be given.

    A worker that sees the store writes its tiles there itself; the tiles of the others are written here.
    """

    def run(job: Callable[[int], Any], numbers: list[int], stop: Event) -> Iterator[tuple[int, Any]]:
        if not isinstance(job, StoredTile):
            raise TypeError(f"a cluster computes the tiles of a store, not {job!r}")
        if numbers and not stop.is_set():
            with connect(cluster) as client:
                yield from _into_store(client, job, numbers, stop)

    return run


def _into_store(client: Client, job: StoredTile, numbers: list[int], stop: Event) -> Iterator[tuple[int, Record]]:
    tiling, writer = job.tiling, job.writer
    folder = os.path.abspath(writer.path)
    left = len(numbers)
    try:
        with marked(writer.path) as mark:

            def task(number: int) -> WritableTile:
                part = tiling[number]
                return WritableTile(cut_out(job.request, part), number, part, folder, mark)

            with closing(farm_out(client, task, numbers, stop)) as finished:
                for number, told in finished:
                    yield number, told if isinstance(told, Record) else writer.write(number, tiling[number], *told)
                    left -= 1
    finally:
        if left:  # workers whose tiles were cancelled finish what they are writing before the store is handed back
            with suppress(Exception):  # what cannot be reached is lost, and finds no mark
                client.run(wait_for_writers, on_error="ignore")


def in_memory(
    cluster: Client | str, request: Request, cells: int | None, stop: Event
) -> Iterator[tuple[NDArray[np.int64], dict[str, NDArray[Any]]]]:
    """Yield which cells, counted along the grid, have ended, and their indices, until all have or `stop` is set."""
    tiling = cut(request.shape, cells or CELLS)

    def task(number: int) -> Any:
        return cut_out(request, tiling[number])

    with connect(cluster) as client, closing(farm_out(client, task, range(len(tiling)), stop)) as finished:
        for number, (result, _) in finished:
            places = np.ix_(*(np.arange(along.start, along.stop) for along in tiling[number]))
            which = np.ravel_multi_index(places, request.shape).ravel()
            yield which, {name: values.ravel() for name, values in result.items()}
