"""Running a sweep tile by tile: in threads or on a cluster, into memory or into a store."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, closing, suppress
from threading import Event
from typing import Any, cast

import numpy as np
import xarray as xr

from vibroimpact.execution.store.records import DONE, Rows
from vibroimpact.execution.store.store import StoreBusy, SweepStore, TileWriter, open_or_create
from vibroimpact.execution.store.tiling import Tiling, usual_tile
from vibroimpact.execution.threads import GivenUp, compute, run_tiles
from vibroimpact.progress import Report, Stop
from vibroimpact.request import Request

# Computes tiles somewhere and yields each with what came of it: (numbers, seconds), or the record of a stored tile.
Executor = Callable[[Callable[[int], Any], list[int], Event], Iterator[tuple[int, Any]]]


def in_threads(workers: int) -> Executor:
    """Return an executor that computes tiles side by side in this process; stopped, it gives up those that run."""

    def run(job: Callable[[int], Any], numbers: list[int], stop: Event) -> Iterator[tuple[int, Any]]:
        def work(part: slice) -> Any:
            with suppress(GivenUp):
                return job(part.start)

        parts = [slice(number, number + 1) for number in numbers]
        tiles = cast("Generator[tuple[slice, Any]]", run_tiles(work, parts, workers, stop))
        with closing(tiles):
            for part, result in tiles:
                if result is not None:
                    yield part.start, result

    return run


def run_into_store(
    request: Request, path: Any, execute: Executor, report: Report, cells: int | None = None
) -> xr.Dataset:
    """Compute the tiles that a store lacks and write them; return the sweep, read from disk where it is looked at."""
    store = open_or_create(path, request, cells or usual_tile(request))
    with ExitStack() as stack:
        try:
            writer = stack.enter_context(store.writing())
        except (StoreBusy, PermissionError):
            if not store.is_whole():
                raise
            tally = _Tally(store.tiling, store.records())  # nothing is left to write
            report(tally.cells, tally.total, tally.dataset)
            return store.dataset()
        records = _mend(store, writer, request)
        tally = _Tally(store.tiling, records)
        waiting = np.flatnonzero(records[:, DONE] == 0).tolist()
        stop = Stop(report)
        if report(tally.cells, tally.total, tally.dataset) is False:
            stop.set()
        tiles = execute(StoredTile(request, store.tiling, writer, stop), waiting, stop)
        # What still computes must end before the store is handed to others, also where this loop is left by Ctrl-C.
        stack.callback(getattr(tiles, "close", lambda: None))
        for number, record in tiles:
            tally.add(number, record.impacts, record.steps)
            if report(tally.cells, tally.total, tally.dataset) is False:
                stop.set()
    return store.dataset()


def _mend(store: SweepStore, writer: TileWriter, request: Request) -> Rows:
    """Return the records of a store cleared of what was left half written, lost or altered since."""
    writer.sweep_up()
    for name in store.damaged_axes():
        writer.write_axis(name, request.axes[name])
    records = store.records()
    for number in store.damaged(records):
        writer.forget(number, store.tiling.place(number), store.names)
        records[number] = 0
    return records


class StoredTile:
    """Computes a tile and writes it, wherever that is done."""

    def __init__(self, request: Request, tiling: Tiling, writer: TileWriter, stop: Event) -> None:
        self.request, self.tiling, self.writer, self.stop = request, tiling, writer, stop

    def __call__(self, number: int) -> Any:
        """Compute tile `number`, write it, and return its record."""
        part = self.tiling[number]
        result, seconds = compute(self.request, part, self.stop)
        return self.writer.write(number, part, result, seconds)


class _Tally:
    """How far a stored sweep is, in the shape in which sweeps in memory report it."""

    def __init__(self, tiling: Tiling, records: Any) -> None:
        done = np.flatnonzero(records[:, DONE]).tolist()
        self.tiling = tiling
        self.total = int(np.prod(tiling.shape))
        self.cells = sum(tiling.cells(number) for number in done)
        skipped = {"cells_skipped": self.cells, "tiles_skipped": len(done)}
        self.dataset = xr.Dataset(attrs={"impacts_computed": 0, "steps_computed": 0, **skipped})

    def add(self, number: int, impacts: int, steps: int) -> None:
        self.cells += self.tiling.cells(number)
        self.dataset.attrs["impacts_computed"] += impacts
        self.dataset.attrs["steps_computed"] += steps
