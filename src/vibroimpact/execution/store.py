"""A sweep on disk: tiles are written as they finish, and a second run goes on where the first one stopped."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import zarr

from vibroimpact.cells import Tiling
from vibroimpact.dataset import dataset_of
from vibroimpact.execution import Gathered, Place
from vibroimpact.execution.layout import (
    CELL,
    COLUMNS,
    DONE,
    DRAWN,
    FIRST_STATUS,
    IMPACTS,
    LIST,
    LOCK,
    MICROSECONDS,
    NEEDED,
    PROGRESS,
    ROWS,
    STEPS,
    Arrays,
    Rows,
    StoreBusy,
    TileWriter,
    create,
    locked,
    refined,
    scratch_of,
)
from vibroimpact.execution.mending import mend
from vibroimpact.files import load_lazily, offered
from vibroimpact.guard import DESCRIPTION, RECORDS, GuardedStore, digest_of, is_as_written
from vibroimpact.parameters import check_fits, invalid
from vibroimpact.progress import Report, Stop
from vibroimpact.request import Request, differences, key_of, mark
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

START = "start"  # the axis of several initial conditions, which are numbered
READ = 64  # tiles read at once, or one row of them: Zarr reads many chunks together in a third of the time


class SweepStore:
    """A stored sweep, opened for reading; `OSError` where there is none, or what describes it is damaged."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path).absolute()  # the same store wherever the process goes
        if not self.path.exists():
            raise FileNotFoundError(
                f"`store` {str(path)!r} does not exist; {offered(self.path) or 'check the spelling'}"
            )
        try:
            self._files = GuardedStore(self.path)
            self._root: Any = zarr.open_group(self._files, mode="r", zarr_format=3)
            self._describe(self._root)
        except Exception as error:
            known = "; the same sweep writes anew what is damaged" if hasattr(self, "key") else ""
            raise OSError(
                f"`store` is {str(path)!r}, which is no stored sweep, or a damaged one ({_reason(error)}); give a "
                f"folder that a sweep with `store` made, or a new name{known}"
            ) from error

    def _describe(self, root: Any) -> None:
        """Take from the store what it holds; raise where that does not fit together."""
        attrs = dict(root.attrs)
        self.identity: dict[str, Any] = json.loads(str(attrs["study"]))
        if key_of(self.identity) != attrs["key"]:
            raise ValueError("its study was altered")
        self.key, self.command = str(attrs["key"]), str(attrs.get("command", ""))
        self.axes = tuple(str(text).split()[0] for key, text in self.identity.items() if key.startswith("axis "))
        self.shape: tuple[int, ...] = root["status"].shape
        self.refined = refined(self.identity)
        names = (*str(self.identity["indices"]).split(", "), "status")
        self.arrays = {name: f"{LIST}/{name}" for name in (*names, CELL)} if self.refined else {n: n for n in names}
        self._arrays = {name: root[place] for name, place in self.arrays.items()}
        self._rows = root[RECORDS]
        self.tiling = Tiling(self._arrays["status"].shape, tuple(attrs["tile"]))
        number = len(self.tiling.tile)  # a further dimension is not cut
        if any(array.chunks != (*self.tiling.tile, *array.shape[number:]) for array in self._arrays.values()):
            raise ValueError("its tiles differ")
        needed = self._rows.attrs.get(NEEDED, 0)
        self._needed = needed if isinstance(needed, int) else 0
        if not all(self.shape) or self._rows.shape != (len(self.tiling), COLUMNS):
            raise ValueError("its records differ")
        check_fits("store", f"has {len(self.tiling):,} tiles, whose records take", 8 * self._rows.size, "it is damaged")

    def records(self) -> Rows:
        """Return the record of every tile, one per row; tiles whose records are damaged count as not done."""
        rows = np.zeros((len(self.tiling), COLUMNS), np.int64)
        try:
            rows[:] = self._rows[:]
        except Exception:
            for low in range(0, len(rows), ROWS):
                with suppress(Exception):
                    rows[low : low + ROWS] = self._rows[low : low + ROWS]
        return rows

    def read(self, number: int) -> Arrays:
        """Return a tile as it lies on disk; raise where a chunk of it is lost or was altered."""
        if not self._has(number):
            raise FileNotFoundError(f"`store` is {str(self.path)!r}, which has not the whole tile {number}")
        return {name: np.asarray(array[self.tiling[number]]) for name, array in self._arrays.items()}

    def _has(self, number: int) -> bool:
        """Whether every chunk of a tile is there: Zarr would read one that is not as missing values."""
        at = tuple(along.start // side for along, side in zip(self.tiling[number], self.tiling.tile, strict=True))
        keys = {
            name: array.metadata.encode_chunk_key((*at, *(0,) * (array.ndim - len(at))))
            for name, array in self._arrays.items()
        }
        return all((self.path / place / keys[name]).is_file() for name, place in self.arrays.items())

    def damaged(self, records: Rows | None = None) -> list[int]:
        """Return the tiles of which a chunk is lost or was altered since it was written."""
        rows = self.records() if records is None else records
        done = np.flatnonzero(rows[:, DONE])
        row = math.prod(self.tiling.counts[1:])  # of tiles, along the first axis
        block = row * max(READ // row, 1)
        return [
            number
            for first in np.unique(done // block).tolist()
            for number in self._damaged_among(done[done // block == first].tolist(), rows)
        ]

    def _damaged_among(self, numbers: list[int], records: Rows) -> list[int]:
        """Return which of these tiles are damaged; all are read at once, and one by one where that fails."""
        low, high = self.tiling[numbers[0]][0].start, self.tiling[numbers[-1]][0].stop
        with suppress(Exception):
            cells = (high - low) * math.prod(self.tiling.shape[1:])
            size = cells * sum(array.dtype.itemsize for array in self._arrays.values())
            check_fits("store", "has tiles that take", size, "read them one by one")
            block = {name: array[low:high] for name, array in self._arrays.items()}

            def is_whole(number: int) -> bool:
                first, *others = self.tiling[number]
                here = (slice(first.start - low, first.stop - low), *others)
                tile = {name: values[here] for name, values in block.items()}
                return self._has(number) and is_as_written(records[number, DONE], tile)

            return [number for number in numbers if not is_whole(number)]

        def is_damaged(number: int) -> bool:
            try:
                return not is_as_written(records[number, DONE], self.read(number))
            except Exception:
                return True

        return list(filter(is_damaged, numbers))

    def damaged_axes(self) -> list[str]:
        """Return the axes whose values are not those that were written."""

        def is_damaged(number: int, name: str) -> bool:
            try:
                return bool(mark(name, self._axis(name)) != self.identity[f"axis {number}"])
            except Exception:
                return True

        damaged = [name for number, name in enumerate(self.axes, 1) if is_damaged(number, name)]
        with suppress(Exception):
            if START not in self._root["status"].metadata.dimension_names:
                return damaged
            if np.array_equal(self._axis(START), np.arange(self.shape[-1])):
                return damaged
        return [*damaged, START]

    def _axis(self, name: str) -> Any:
        array = self._root[name]
        check_fits("store", f"has an axis {name} whose values take", array.nbytes, "it is damaged")
        return np.asarray(array[:])

    def faults(self) -> list[str]:
        """Return the damages, one line each; running the same sweep again repairs all of them."""
        found = [f"the description {name!r} is damaged; it is" for name in self._damaged_descriptions()]
        found += [f"the values along {name} are damaged; they are" for name in self.damaged_axes()]
        found = [f"{line} written anew when you continue" for line in found]
        if tiles := len(self.damaged()):
            found.append(f"{tiles} damaged {'tile' if tiles == 1 else 'tiles'}; computed again when you continue")
        if self.refined and self.is_complete() and not self._is_drawn():
            found.append("the picture is damaged; drawn again when you continue")
        return found

    def _damaged_descriptions(self) -> list[str]:
        """Return the descriptions, beside those that opening a store reads, which cannot be read."""

        def is_damaged(name: str) -> bool:
            try:
                return self._files.content(f"{name}/{DESCRIPTION}") is None
            except (OSError, ValueError):
                return True

        return [name for name in (PROGRESS, *([LIST] if self.refined else [])) if is_damaged(name)]

    def is_complete(self) -> bool:
        """Whether all has been computed, and the picture of a refined map drawn."""
        done = self.records()[:, DONE] > 0
        if not self.refined:
            return bool(done.all())
        last = np.flatnonzero(done)[-1:]  # batches are numbered as they are made: one that has no record has lost it
        return self._root.attrs.get("complete") == 1 and bool(last.size and done[: last[0]].all())

    def is_whole(self) -> bool:
        """Whether all has been computed and nothing is damaged."""
        if not self.is_complete() or self.damaged_axes() or self._damaged_descriptions():
            return False
        return not self.damaged() and (not self.refined or self._is_drawn())

    def _is_drawn(self) -> bool:
        """Whether a refined map's picture can be read, and is the one that was drawn."""
        try:
            arrays = dict(self._root.arrays())
            if any(array.nchunks_initialized < array.nchunks for array in arrays.values()):
                return False
            digest = digest_of(
                {name: array for name, array in arrays.items() if name == "level" or name in self.arrays}
            )
            return bool(self._rows.attrs.get(DRAWN, digest) == digest)
        except Exception:
            return False

    def summary(self) -> dict[str, Any]:
        """Return the progress of the sweep: tiles and cells done, seconds gone by, impacts, and cells of each status.

        Of a refined map, `cells` are those of the picture, and `needed` those known so far to be computed for it.
        """
        records = self.records()
        done = records[records[:, DONE] > 0]
        counts = done[:, FIRST_STATUS:].sum(axis=0)
        return {
            "tiles_done": len(done),
            "tiles": len(self.tiling),
            "cells_done": int(counts.sum()),
            "cells": math.prod(self.shape),
            "needed": self._needed if self.refined else math.prod(self.shape),
            "seconds": float(done[:, MICROSECONDS].sum() * 1e-6),
            "impacts": int(done[:, IMPACTS].sum()),
            "steps": int(done[:, STEPS].sum()),
            "statuses": {status.word: int(count) for status, count in zip(Status, counts, strict=True) if count},
        }

    def dataset(self) -> xr.Dataset:
        """Return the sweep as far as it is done, read from disk where it is looked at.

        Raises
        ------
        OSError
            An axis is damaged. A chunk that was altered raises where it is looked at; one whose file is gone reads as
            missing cells. Both are what `damaged` finds, and what running the same sweep again repairs.
        """
        if axes := self.damaged_axes():
            raise OSError(
                f"`store` is {str(self.path)!r}, in which the values along {' and '.join(axes)} are damaged; run the "
                "same sweep again, which writes them anew"
            )
        dataset = load_lazily(self.path)
        if self.refined:
            return dataset
        found = self.summary()
        return dataset.assign_attrs(
            impacts_computed=found["impacts"],
            steps_computed=found["steps"],
            cells_missing=found["cells"] - found["cells_done"],
        )

    @contextmanager
    def writing(self, request: Request | None = None) -> Iterator[TileWriter]:
        """Yield what writes tiles; no second process is let in meanwhile.

        With the `request`, the store is cleared first of what was left half written, lost or altered.
        """
        with locked(self.path / RECORDS / LOCK, self.path):
            writer = TileWriter(self.path, self.tiling, self.arrays, self.records())
            try:
                if request is not None:
                    writer.sweep_up()
                    writer.forget(self.damaged(writer.records))
                yield writer
            finally:
                writer.close()


def open_or_create(path: str | os.PathLike[str], request: Request, cells: int) -> SweepStore:
    """Return the store of a request: the one that exists there, or a new one with tiles of so many cells."""
    try:
        folder = Path(path)
    except TypeError:
        raise invalid("store", path, "the path of a folder ending in .zarr") from None
    if folder.suffix.lower() != ".zarr":
        raise invalid("store", str(path), "a folder ending in .zarr", "give it that ending")
    folder = Path(os.path.realpath(folder))  # a link to a folder that is not there yet is followed too
    if not folder.exists() or scratch_of(folder).exists():
        create(folder, request, cells)
    measurement = request.identity()
    with suppress(OSError):  # what could not be mended, opening it explains
        mend(folder, request, measurement)
    store = SweepStore(folder)
    if store.key != key_of(measurement):
        raise ValueError(
            f"`store` is {str(path)!r}, which holds another study ({differences(store.identity, measurement)}); "
            "choose another name, or ask for what it holds"
        )
    return store


def _reason(error: Exception) -> str:
    text = (str(error).splitlines() or [""])[0]
    return text if isinstance(error, (OSError, ValueError)) and text else f"{type(error).__name__}: {text}"


def run_into_store(
    request: Request,
    path: str | os.PathLike[str],
    cells: int,
    computing: Callable[[], AbstractContextManager[Place]],
    report: Report,
) -> xr.Dataset:
    """Compute the tiles that a store lacks and write them; return the sweep, read from disk where it is looked at.

    A store made now has tiles of so many `cells`; `computing` is called only if any are left to compute.
    """
    store = open_or_create(path, request, cells)
    try:
        with store.writing(request) as writer:
            _fill(store, writer, request, computing, report)
    except (StoreBusy, PermissionError):
        if not store.is_whole():
            raise
        _Tally(store, store.records()).tell(report)  # nothing is left to write
    return store.dataset()


def _fill(
    store: SweepStore,
    writer: TileWriter,
    request: Request,
    computing: Callable[[], AbstractContextManager[Place]],
    report: Report,
) -> None:
    tally, stop = _Tally(store, writer.records), Stop(report)
    waiting = np.flatnonzero(writer.records[:, DONE] == 0).tolist()
    if not tally.tell(report) or not waiting:
        return
    gathered, began = Gathered(), perf_counter()
    tiles = [store.tiling[number] for number in waiting]
    with computing() as place, closing(place.compute(request, tiles, stop, store.path)) as pieces:
        for part, which, results in pieces:
            number = waiting[part]
            if not isinstance(which, slice):
                results = gathered.add(number, store.tiling.cells(number), which, results)
            if results is None:
                continue
            record = writer.write(number, results, perf_counter() - began)
            began = perf_counter()
            tally.add(record)
            if not tally.tell(report):
                stop.set()


class _Tally:
    """How far a stored sweep is, in the shape in which sweeps in memory report it."""

    def __init__(self, store: SweepStore, records: Rows) -> None:
        done = records[records[:, DONE] > 0]
        self.total, self.cells = math.prod(store.shape), int(done[:, FIRST_STATUS:].sum())
        skipped = {"cells_skipped": self.cells, "tiles_skipped": len(done)}
        self.dataset = dataset_of(attrs={"impacts_computed": 0, "steps_computed": 0, **skipped})

    def add(self, record: Rows) -> None:
        """Count a tile."""
        self.cells += int(record[FIRST_STATUS:].sum())
        self.dataset.attrs["impacts_computed"] += int(record[IMPACTS])
        self.dataset.attrs["steps_computed"] += int(record[STEPS])

    def tell(self, report: Report) -> bool:
        """Report; return whether to go on."""
        return report(self.cells, self.total, self.dataset) is not False
