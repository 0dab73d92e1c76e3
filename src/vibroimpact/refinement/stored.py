"""A refined map on disk: chunks of computed cells as they end, the filled picture when all have.

Beside the picture's tiles, laid out as those of any sweep, the store has a group of points: row `number` of each array
is a chunk of computed cells, in the order in which refinement asks for them, which depends on the request alone. A
chunk's record holds a checksum of its numbers and of where they lie on the fine grid.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import xarray as xr
import zarr

from vibroimpact.execution.store.layout import PACKING, PROGRESS, RECORDS
from vibroimpact.execution.store.records import CHECKSUM, COLUMNS, DONE, Arrays, Record, checksum, place_of
from vibroimpact.execution.store.store import SweepStore, open_or_create
from vibroimpact.execution.store.writer import TileWriter, told
from vibroimpact.files import load_lazily
from vibroimpact.refinement.computing import chunk_of
from vibroimpact.refinement.lattice import Places
from vibroimpact.refinement.picture import FILLED, Picture, level_variable
from vibroimpact.request import Request

POINTS = "points"
BATCHES = "batches"  # level and number of cells of each, in the order in which they are asked for
LEVEL_MARK = "level_checksum"
MOST = 1 << 20  # chunks; those never written take no room
TILE = 1 << 18  # cells of the picture in a file


def open_refined(path: str | os.PathLike[str], request: Request) -> SweepStore:
    """Return the store of a refined map: the one that stands there, or a new one."""
    return open_or_create(path, request, TILE)


def finished(store: SweepStore) -> xr.Dataset | None:
    """Return the map if all of it stands there, undamaged."""
    root: Any = zarr.open_group(store.path, mode="r", zarr_format=3)
    if LEVEL_MARK not in root[PROGRESS].attrs or not store.is_whole():
        return None
    try:
        whole = zlib.crc32(np.asarray(root["level"][:]).tobytes()) == root[PROGRESS].attrs[LEVEL_MARK]
    except Exception:  # a damaged file
        return None
    return load_lazily(store.path) if whole else None


@contextmanager
def keeping(store: SweepStore, request: Request) -> Iterator[StoredPoints]:
    """Yield what keeps computed cells in a store; no second process is let in meanwhile."""
    with store.writing() as writer:
        writer.sweep_up()
        for name in store.damaged_axes():
            writer.write_axis(name, request.axes[name])
        yield _kept(store, writer, request)


def _kept(store: SweepStore, writer: TileWriter, request: Request) -> StoredPoints:
    try:
        with told(store.path):
            return StoredPoints(store, writer, request)
    except OSError:
        raise
    except Exception as error:
        raise OSError(
            f"`store` is {str(store.path)!r}, in which what describes the computed cells is damaged "
            f"({type(error).__name__}); remove its folder {PROGRESS}/{POINTS}, and they are computed anew"
        ) from error


class StoredPoints:
    """Keeps computed cells, and the picture made of them."""

    def __init__(self, store: SweepStore, writer: TileWriter, request: Request) -> None:
        self.store, self.writer = store, writer
        root: Any = zarr.open_group(store.path, mode="r+", zarr_format=3)
        self.root = root
        kinds = {name: np.dtype(root[name].dtype) for name in (*request.indices, "status")}
        kinds |= {"impacts": np.dtype("int64"), "steps": np.dtype("int64")}
        group = root[PROGRESS].require_group(POINTS)
        self.group, self.chunk = group, chunk_of(request)
        rows = {"shape": (MOST, self.chunk), "chunks": (1, self.chunk), "fill_value": 0}
        self.points = {name: _array(group, name, dtype=kind, **rows) for name, kind in kinds.items()}
        self.records = _array(
            group, RECORDS, shape=(MOST, COLUMNS), chunks=(1, COLUMNS), fill_value=0, dtype=np.dtype("int64")
        )
        level = level_variable(tuple(request.axes), np.zeros((1, 1), np.int8))
        self.level = _array(
            root, "level", shape=request.shape, chunks=store.tiling.tile, fill_value=FILLED, dtype=level.dtype,
            dimension_names=list(request.axes), attributes=level.attrs,
        )  # fmt: skip

    def begin(self, turn: int, level: int, cells: int) -> None:
        """Note how large a batch is, for those who ask how far the sweep is."""
        known = list(self.group.attrs.get(BATCHES, []))
        if known[turn : turn + 1] != [[level, cells]]:
            with self.writer.passing():
                self.group.attrs[BATCHES] = [*known[:turn], [level, cells]]

    def recall(self, number: int, at: Places) -> Arrays | None:
        """Return a chunk of cells if it was kept, for these cells, and has not been altered since."""
        try:
            record = self.records[number]
            if not record[DONE]:
                return None
            kept = {name: np.asarray(array[number])[: len(at)] for name, array in self.points.items()}
            mark = checksum(kept | {"cell": at}, place_of(self.store.key, number))
        except Exception:  # a damaged file: computed anew
            return None
        return kept if mark == record[CHECKSUM] else None

    def keep(self, number: int, at: Places, result: Arrays, seconds: float) -> None:
        """Write a chunk of cells, then that it is done."""
        place = place_of(self.store.key, number)
        impacts, steps = int(result["impacts"].sum()), int(result["steps"].sum())
        record = Record.of(result | {"cell": at}, impacts, steps, seconds, place)
        with self.writer.passing():
            for name, array in self.points.items():
                row = np.zeros(self.chunk, array.dtype)
                row[: len(at)] = result[name]
                array[number] = row
            self.records[number] = record.row(place)

    def draw(self, picture: Picture, attrs: dict[str, Any], *, complete: bool) -> xr.Dataset:
        """Write the filled picture, a complete one with its records, and return it, read from disk."""
        none = {name: np.zeros(1, np.int64) for name in ("impacts", "steps")}  # counts stand beside the points
        tiling = self.store.tiling
        for number in range(len(tiling)):
            part = tiling[number]
            tile = {name: values[part] for name, values in picture.values.items()}
            with self.writer.passing():
                self.level[part] = picture.level[part]
                for name, values in () if complete else tile.items():
                    self.root[name][part] = values
            if complete:
                self.writer.write(number, part, tile | none, 0.0)
        with self.writer.passing():
            self.root.attrs.update(attrs)
            if complete:
                self.root[PROGRESS].attrs[LEVEL_MARK] = zlib.crc32(picture.level.tobytes())
        return load_lazily(self.store.path)


def _array(group: Any, name: str, **layout: Any) -> Any:
    """Return an array of a group, made where it is not there, that writes chunks of zeros too."""
    if name not in group:
        labels = {key: _plain(value) for key, value in layout.pop("attributes", {}).items()}
        group.create_array(name, compressors=PACKING, attributes=labels, **layout)
    return group[name].with_config({"write_empty_chunks": True})


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value
