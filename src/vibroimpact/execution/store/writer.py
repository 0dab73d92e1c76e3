"""Writing tiles into a store."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

import numpy as np
import zarr
from numpy.typing import NDArray

from vibroimpact.execution.store.layout import DONE, IMPACTS, MARK, MICROSECONDS, NEEDED, PROGRESS, RECORDS, ROWS, STEPS
from vibroimpact.execution.tiling import Tiling
from vibroimpact.status import Status

Arrays = Mapping[str, NDArray[Any]]
Rows = NDArray[np.int64]
Result = TypeVar("Result")

SETTLING = 5.0  # seconds for which a process about to end waits for the tile that it is writing
_writing = Lock()  # held while files are written that belong together


def settle() -> None:
    """Wait until the tile that this process is writing is whole, and write no more: the process is about to end."""
    _writing.acquire(timeout=SETTLING)


class TileWriter:
    """Writes tiles into a store, one at a time, in a thread of its own, into which Ctrl-C does not break.

    A tile's numbers are written first and its record last, each file whole or not at all: wherever the process ends, a
    tile without a record is computed again. Nothing is flushed to the disk by force: chunks that a power failure kept
    from it fail their checksum and are computed again.

    Parameters
    ----------
    path : Path
        The store.
    tiling : Tiling
        Its tiles.
    arrays : mapping
        The path in the store of each array that holds tiles, by the name of its variable.
    records : array of int64, one row per tile
        The records of the tiles, kept up to date.
    """

    def __init__(self, path: Path, tiling: Tiling, arrays: Mapping[str, str], records: Rows) -> None:
        self.path, self.tiling, self.records = path, tiling, records
        self._root: Any = zarr.open_group(path, mode="r+", zarr_format=3)
        self._arrays: dict[str, Any] = {name: self._root[place] for name, place in arrays.items()}
        self._rows: Any = self._root[RECORDS]
        self._thread = ThreadPoolExecutor(1, "store")

    def write(self, number: int, result: Arrays | Rows, seconds: float) -> Rows:
        """Write a tile's results, or take its record from a worker that has written them; return its record."""

        def job() -> Rows:
            if isinstance(result, Mapping):
                put(self._arrays, self.tiling[number], result)
                record = record_of(result)
            else:
                record = result.copy()
            record[MICROSECONDS] = round(1e6 * seconds)
            return self._note(number, record)

        return self.whole(job)

    def is_done(self, number: int) -> bool:
        """Whether a tile is in the store; those beyond its end never are."""
        return number < len(self.records) and bool(self.records[number, DONE])

    def cost(self, number: int) -> tuple[int, int]:
        """Return the impacts and steps that a tile took."""
        return int(self.records[number, IMPACTS]), int(self.records[number, STEPS])

    def forget(self, numbers: Iterable[int]) -> None:
        """Take tiles for not done and their numbers for missing: Zarr removes the chunks."""

        def job() -> None:
            for number in numbers:
                self._note(number, np.zeros_like(self.records[number]))
                for array in self._arrays.values():
                    array[self.tiling[number]] = array.fill_value

        self.whole(job)

    def _note(self, number: int, record: Rows) -> Rows:
        self.records[number] = record
        chunk = slice(number // ROWS * ROWS, (number // ROWS + 1) * ROWS)
        _keeping(self._rows)[chunk] = self.records[chunk]
        return record

    def draw(self, arrays: Arrays, attrs: Mapping[str, Any]) -> None:
        """Write whole arrays at the root, and attributes once they are written."""

        def job() -> None:
            for name, values in arrays.items():
                _keeping(self._root[name])[...] = values
            self._root.attrs.update(attrs)

        self.whole(job)

    def need(self, cells: int) -> None:
        """Note how many cells a refined map is known to need."""
        if cells > self._rows.attrs.get(NEEDED, 0):
            self.whole(lambda: self._rows.attrs.update({NEEDED: cells}))

    def sweep_up(self) -> None:
        """Remove what runs left behind that were ended in the middle."""

        def job() -> None:
            (self.path / PROGRESS / MARK).unlink(missing_ok=True)
            for leftover in self.path.rglob("*.partial"):
                leftover.unlink(missing_ok=True)

        self.whole(job)

    def whole(self, job: Callable[[], Result]) -> Result:
        """Return what a job returns that writes files which belong together."""

        def run() -> Result:
            with _writing, _explained(self.path):
                if not (self.path / "zarr.json").exists():
                    raise OSError(f"`store` is {str(self.path)!r}, which has been removed; run the same again")
                return job()

        return self._thread.submit(run).result()

    def close(self) -> None:
        """Wait for files being written."""
        self._thread.shutdown()


def put(arrays: Mapping[str, Any], part: tuple[slice, ...], result: Arrays) -> None:
    """Write the results of a tile's cells, in the order of the grid; a tile of a list may be filled in part."""
    box = tuple(along.stop - along.start for along in part)
    for name, array in arrays.items():
        values = np.full(box, array.fill_value, array.dtype)
        values.ravel()[: result[name].size] = result[name].ravel()
        _keeping(array)[part] = values


def record_of(result: Arrays) -> Rows:
    """Return the record of a tile whose results these are, but for the time that it took."""
    counts = np.bincount(result["status"].ravel(), minlength=len(Status))
    return np.array([1, 0, result["impacts"].sum(), result["steps"].sum(), *counts], np.int64)


def _keeping(array: Any) -> Any:
    """Return an array of which chunks equal to the fill value are written too: a file that is not there was lost."""
    return array.with_config({"write_empty_chunks": True})


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Say what to do where the disk refuses."""
    try:
        yield
    except OSError as error:
        if not error.errno:
            raise
        kind = PermissionError if isinstance(error, PermissionError) else OSError
        message = (
            f"`store` is {str(path)!r}, which could not be written to ({os.strerror(error.errno)}); finished tiles are "
            "kept; make room there or see to its permissions, then run the same again to go on"
        )
        raise kind(error.errno, message) from error
