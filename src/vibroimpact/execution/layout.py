"""The layout of a store, and how it is made and written: it appears complete, and one process at a time writes to it.

The root holds the results, one array per variable, each chunk a tile of the grid. A group `progress` holds the tiles'
records. The cells of a refined map do not form a grid: they are kept in lists, `progress/cells`, each chunk of which is
a tile, and the picture made from them is written to the root at the end.

Every chunk has Zarr's checksum: all readers refuse a chunk that was altered, and here it is computed again.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from shlex import join
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import ZstdCodec

from vibroimpact.cells import Tiling
from vibroimpact.dataset import level_variable, missing, plain_variable, status_variable, variable
from vibroimpact.execution.base import cut
from vibroimpact.files import scratch_beside
from vibroimpact.files.formats import ORDER, order_of, with_texts
from vibroimpact.files.guard import RECORDS, GuardedStore
from vibroimpact.parameters import check_fits
from vibroimpact.request import Request, key_of
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

PROGRESS, LIST = "progress", "progress/cells"
CELL = "cell"  # in the lists: the flat index of each cell on the fine grid; -1 beyond the end of a batch
LOCK = "lock"
MARK = "cluster"  # the file in `progress` by which workers of a cluster recognise the store
PACKING = ZstdCodec(checksum=True)
PICTURE = 1 << 18  # cells in a chunk of a refined map's picture
SPARE = 4096  # the most batches of a refined map: each leaves a tile of the lists half empty
# The record of a tile: whether it is done (above 0), what it cost, and how many of its cells have each status.
DONE, MICROSECONDS, IMPACTS, STEPS, FIRST_STATUS = range(5)
COLUMNS = FIRST_STATUS + len(Status)
ROWS = 64  # records in a chunk
FINISHING = 5.0  # seconds that a process about to end waits for the tile being written
NEEDED = "cells_needed"  # an attribute of the records of a refined map: the number of cells it is known to need

Arrays = Mapping[str, NDArray[Any]]
Rows = NDArray[np.int64]
Result = TypeVar("Result")
_writing = Lock()  # held while files that belong together are written


class StoreBusy(OSError):
    """Another process writes to the store."""


@contextmanager
def locked(lock: Path, store: Path) -> Iterator[None]:
    """Hold the lock of a store; the system releases it when the process ends, however it ends."""
    from filelock import FileLock, Timeout

    holding = FileLock(lock, thread_local=False)
    try:
        if lock.is_symlink():  # its target would be emptied
            lock.unlink()
        holding.acquire(timeout=0.0)
    except Timeout:
        raise StoreBusy(
            f"`store` {str(store)!r} is being written by another process; wait until that has ended, or choose another "
            "name"
        ) from None
    except OSError as error:
        raise PermissionError(
            error.errno,
            f"`store` {str(store)!r} cannot be written to ({error.strerror or error}); choose another folder",
        ) from error
    try:
        yield
    finally:
        holding.release()


def create(folder: Path, request: Request, identity: dict[str, Any], cells: int) -> None:
    """Create the store of a request, unless another process creates it at the same moment."""
    if not folder.parent.is_dir():
        raise FileNotFoundError(f"`store` {str(folder)!r}: its folder does not exist; create it first")
    tiling = tiling_of(request, cells)
    _check_room(request, tiling)
    try:
        with scratch_beside(folder) as scratch:
            lay_out(GuardedStore(scratch / folder.name, read_only=False), request, identity, tiling)
            os.rename(scratch / folder.name, folder)  # fails if a folder with content has this name
    except OSError as error:
        if folder.is_dir():
            return
        message = (
            f"`store` {str(folder)!r} could not be created ({error.strerror or error}); nothing was changed; "
            "make room there or choose another folder"
        )
        kind = PermissionError if isinstance(error, PermissionError) else OSError
        raise kind(error.errno, message) from error


def tiling_of(request: Request, cells: int) -> Tiling:
    """Return the tiles of a grid, or of the lists of a refined map."""
    if not is_refined(request.further):
        return cut(request.shape, cells)
    return Tiling(((len(request) // cells + SPARE) * cells,), (cells,))


def is_refined(arguments: Mapping[str, Any]) -> bool:
    """Return whether a request, given its further arguments or its identity, is that of a refined map."""
    return "refine" in arguments


def _check_room(request: Request, tiling: Tiling) -> None:
    """Raise if memory cannot hold one tile, or the records of all tiles."""
    many = f"span {math.prod(tiling.shape):,} cells in {len(tiling):,} tiles, whose records take"
    check_fits("axes", many, len(tiling) * COLUMNS * 8, "use fewer points, or larger tiles")
    cells = math.prod(tiling.tile)
    check_fits("tile", f"is {cells:,} cells, which take", cells * request.cell_size, "4096 is usual")


def lay_out(place: GuardedStore, request: Request, identity: dict[str, Any], tiling: Tiling) -> None:
    """Write a store in which no tile is done."""
    names = (*request.indices, "status")
    command = join([Path(sys.argv[0]).name, *sys.argv[1:]])
    root = zarr.open_group(place, mode="w-", zarr_format=3)
    root.update_attributes(
        request.provenance("parameter_map")
        | {"study": json.dumps(identity), "key": key_of(identity), "command": command, "tile": list(tiling.tile)}
        | {ORDER: order_of((*names, *request.coordinates()))}
    )
    for name, axis in request.coordinates().items():
        fill = {"f": np.nan, "U": ""}.get(axis.dtype.kind, 0)
        with with_texts():
            _array(root, name, axis, axis.shape, axis.shape, fill)[:] = axis.values
    root.create_group(PROGRESS)
    chunks = tiling.tile
    if is_refined(request.further):
        chunks = cut(request.shape, PICTURE).tile
        _array(root, "level", _label("level", request.dims), request.shape, chunks)
        root.create_group(LIST)
        for name in (*names, CELL):
            _array(root, f"{LIST}/{name}", _label(name, (CELL,)), tiling.shape, tiling.tile)
    for name in names:
        sizes = request.sizes_of(name)
        shape = tuple(sizes.values())
        like = _label(name, tuple(sizes), **request.attrs_of(name))
        _array(root, name, like, shape, (*chunks, *shape[len(chunks) :]))
    records = plain_variable(("tile", "column"), np.zeros((1, 1), np.int64), {})
    _array(root, RECORDS, records, (len(tiling), COLUMNS), (ROWS, COLUMNS))


def _array(
    root: Any, name: str, like: xr.Variable, shape: tuple[int, ...], chunks: tuple[int, ...], fill: Any = None
) -> Any:
    """Make an array with the type and labels of a variable, filled with `fill` or else the variable's first value."""
    attrs = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in like.attrs.items()}
    return root.create_array(
        name,
        shape=shape,
        dtype=like.dtype,
        chunks=chunks,
        compressors=PACKING,
        fill_value=like.values.flat[0].item() if fill is None else fill,
        dimension_names=[str(dim) for dim in like.dims],
        attributes=attrs,
    )


def _label(name: str, dims: tuple[str, ...], **attrs: str) -> xr.Variable:
    """Return a variable of missing values."""
    one = (1,) * len(dims)
    if name == "status":
        return status_variable(dims, np.full(one, Status.INTERRUPTED, np.int8))
    if name == "level":
        return level_variable(dims, np.full(one, -1, np.int8))
    if name == CELL:
        return plain_variable(dims, np.full(one, -1, np.int64), {})
    return variable(name, dims, missing(name, one), **attrs)


# ---- writing tiles


def finish_writing() -> None:
    """Wait until the tile being written is complete, and write no more; for a process that is about to end."""
    _writing.acquire(timeout=FINISHING)


class TileWriter:
    """Writes tiles into a store, one at a time, in a separate thread, which Ctrl-C does not interrupt.

    A tile's numbers are written first and its record last, each file completely or not at all: wherever the process
    ends, a tile without a record is computed again. Nothing is forced to disk: chunks lost in a power failure fail
    their checksum and are computed again. `arrays` gives the path in the store of each array that holds tiles, by
    variable name; `records`, one row per tile, are kept up to date.
    """

    def __init__(self, path: Path, tiling: Tiling, arrays: Mapping[str, str], records: Rows) -> None:
        self.path, self.tiling, self.records = path, tiling, records
        self._root: Any = zarr.open_group(GuardedStore(path, read_only=False), mode="r+", zarr_format=3)
        self._arrays: dict[str, Any] = {name: self._root[place] for name, place in arrays.items()}
        self._rows: Any = self._root[RECORDS]
        self._thread = ThreadPoolExecutor(1, "store")

    def write(self, number: int, result: Arrays | Rows, seconds: float) -> Rows:
        """Write a tile's results, or take the record from the worker that has written them; return the record."""

        def job() -> Rows:
            if isinstance(result, Mapping):
                write_tile(self._arrays, self.tiling[number], result)
                record = record_of(result)
            else:
                record = result.copy()
            record[MICROSECONDS] = round(1e6 * seconds)
            return self._note(number, record)

        return self.whole(job)

    def is_done(self, number: int) -> bool:
        """Return whether a tile is in the store; numbers beyond its end never are."""
        return number < len(self.records) and bool(self.records[number, DONE])

    def cost(self, number: int) -> tuple[int, int]:
        """Return the numbers of impacts and steps that a tile took."""
        return int(self.records[number, IMPACTS]), int(self.records[number, STEPS])

    def forget(self, numbers: Iterable[int]) -> None:
        """Mark tiles as not done and their values as missing; Zarr removes the chunks."""

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
        """Write whole arrays at the root and, once they are written, all attributes in one step."""

        def job() -> None:
            for name, values in arrays.items():
                _keeping(self._root[name])[...] = values
            self._root.update_attributes(dict(attrs))

        self.whole(job)

    def need(self, cells: int) -> None:
        """Record how many cells a refined map is known to need."""
        if cells > self._rows.attrs.get(NEEDED, 0):
            self.whole(lambda: self._rows.update_attributes({NEEDED: cells}))

    def sweep_up(self) -> None:
        """Remove the leftovers of runs that were interrupted."""

        def job() -> None:
            for leftover in (self.path / PROGRESS / MARK, *self.path.rglob("*.partial")):
                leftover.unlink(missing_ok=True)

        self.whole(job)

    def whole(self, job: Callable[[], Result]) -> Result:
        """Run a job that writes files which belong together, and return its result."""

        def run() -> Result:
            with _writing, _explained(self.path):
                if not (self.path / "zarr.json").exists():
                    raise OSError(f"`store` {str(self.path)!r} has been removed; run the same again")
                return job()

        return self._thread.submit(run).result()

    def close(self) -> None:
        """Wait for files being written."""
        self._thread.shutdown()


def write_tile(arrays: Mapping[str, Any], part: tuple[slice, ...], result: Arrays) -> None:
    """Write the results of a tile's cells, in the order of the grid; a tile of a list may be partly filled."""
    box = tuple(along.stop - along.start for along in part)
    for name, array in arrays.items():
        values = np.full((*box, *array.shape[len(box) :]), array.fill_value, array.dtype)
        values.ravel()[: result[name].size] = result[name].ravel()
        _keeping(array)[part] = values


def record_of(result: Arrays) -> Rows:
    """Return the record of a tile with these results, without the time that it took."""
    counts = np.bincount(result["status"].ravel(), minlength=len(Status))
    return np.array([1, 0, result["impacts"].sum(), result["steps"].sum(), *counts], np.int64)


def _keeping(array: Any) -> Any:
    """Return an array that also writes chunks equal to the fill value, so that a missing file means a lost chunk."""
    return array.with_config({"write_empty_chunks": True})


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Add what to do to the message when the disk refuses."""
    try:
        yield
    except OSError as error:
        if not error.errno:
            raise
        kind = PermissionError if isinstance(error, PermissionError) else OSError
        file = error.filename2 or error.filename
        reason = os.strerror(error.errno) + (f": {str(file)!r}" if file else "")
        message = (
            f"`store` {str(path)!r} could not be written to ({reason}); finished tiles are kept; make room "
            "there or check its permissions, then run the same again to continue"
        )
        raise kind(error.errno, message) from error
