"""A sweep on disk: tiles are written as they finish, and a second run goes on where the first one stopped."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import zarr

from vibroimpact.execution.store.creation import create, scratch_of
from vibroimpact.execution.store.layout import PROGRESS, RECORDS, unpacked
from vibroimpact.execution.store.locks import LOCK, StoreBusy, locked
from vibroimpact.execution.store.records import (
    CHECKSUM,
    COLUMNS,
    DONE,
    IMPACTS,
    STEPS,
    Arrays,
    Record,
    Rows,
    believed,
    checksum,
    place_of,
    summary,
)
from vibroimpact.execution.store.tiling import CELLS, Tiling
from vibroimpact.execution.store.writer import TileWriter
from vibroimpact.files import load_lazily
from vibroimpact.request import Request, differences, key_of, mark

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Record", "StoreBusy", "SweepStore", "TileWriter", "open_or_create", "summary"]


class SweepStore:
    """A stored sweep, opened for reading.

    Parameters
    ----------
    path : path
        A `.zarr` folder that `parameter_map(store=...)` made.

    Raises
    ------
    OSError
        What stands there is no stored sweep, or what describes it is damaged.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path).absolute()  # the same store wherever the process goes
        try:
            self._root: Any = zarr.open_group(self.path, mode="r", zarr_format=3)
            self._describe(self._root)
        except Exception as error:
            raise OSError(
                f"`store` is {str(path)!r}, which is no stored sweep, or a damaged one ({type(error).__name__}); "
                "give a folder that a sweep with `store` made, or a new name"
            ) from error

    def _describe(self, root: Any) -> None:
        """Take from the store what it holds; raise where that does not fit together."""
        attrs = dict(root.attrs)
        self.identity: dict[str, Any] = json.loads(str(attrs["study"]))
        self.key, self.command = key_of(self.identity), str(attrs["command"])
        if self.key != attrs["key"]:
            raise ValueError("its study was altered")
        self.axes = tuple(str(text).split()[0] for key, text in self.identity.items() if key.startswith("axis "))
        self.names = (*str(self.identity["indices"]).split(", "), "status")
        self.tiling = Tiling(root["status"].shape, tuple(attrs["tile"]))
        if any(root[name].chunks != self.tiling.tile for name in self.names):
            raise ValueError("its tiles differ")
        if root[f"{PROGRESS}/{RECORDS}"].shape != (len(self.tiling), COLUMNS):
            raise ValueError("its records differ")
        self._tiles = {name: np.empty(self.tiling.tile, root[name].dtype) for name in self.names}

    def records(self) -> Rows:
        """Return the record of every tile, one a row; a record that is damaged is one of a tile not done."""
        rows = np.zeros((len(self.tiling), COLUMNS), np.int64)
        for number in range(len(self.tiling)):
            with suppress(Exception):  # it is not there, or it is damaged
                rows[number] = unpacked(self.path / PROGRESS / RECORDS, (number, 0), rows[number])
        return believed(rows, self.key)

    def read(self, number: int) -> Arrays:
        """Return a tile as it lies on disk; raise where a file of it is lost or damaged."""
        place = self.tiling.place(number)
        inside = tuple(slice(part.stop - part.start) for part in self.tiling[number])
        return {name: unpacked(self.path / name, place, like)[inside] for name, like in self._tiles.items()}

    def damaged(self, records: Rows | None = None) -> list[int]:
        """Return the tiles whose numbers are not those that were written: truncated, lost or altered since."""
        rows = self.records() if records is None else records

        def is_damaged(number: int) -> bool:
            try:
                return checksum(self.read(number), place_of(self.key, number)) != int(rows[number, CHECKSUM])
            except Exception:
                return True

        done = np.flatnonzero(rows[:, DONE]).tolist()
        with ThreadPoolExecutor(4) as pool:
            return [number for number, bad in zip(done, pool.map(is_damaged, done), strict=True) if bad]

    def damaged_axes(self) -> list[str]:
        """Return the axes whose values are not those that were written."""

        def is_damaged(number: int, name: str) -> bool:
            try:
                return bool(mark(name, np.asarray(self._root[name][:])) != self.identity[f"axis {number}"])
            except Exception:
                return True

        return [name for number, name in enumerate(self.axes, 1) if is_damaged(number, name)]

    def is_whole(self) -> bool:
        """Whether every tile is done and nothing is damaged."""
        records = self.records()
        return bool(records[:, DONE].all()) and not self.damaged_axes() and not self.damaged(records)

    def dataset(self) -> xr.Dataset:
        """Return the sweep as far as it is done, read from disk where it is looked at.

        Raises
        ------
        OSError
            An axis is damaged. A tile that was altered since raises where it is looked at; one whose file is gone
            reads as missing cells. Both are what `damaged` finds, and what running the same sweep again mends.
        """
        if axes := self.damaged_axes():
            raise OSError(
                f"`store` is {str(self.path)!r}, in which the values along {' and '.join(axes)} are damaged; run the "
                "same sweep again, which writes them anew"
            )
        records = self.records()
        done = records[:, DONE] > 0
        cells = sum(self.tiling.cells(number) for number in np.flatnonzero(~done).tolist())
        totals = {
            "impacts_computed": int(records[done, IMPACTS].sum()),
            "steps_computed": int(records[done, STEPS].sum()),
            "cells_missing": cells,
        }
        return load_lazily(self.path).assign_attrs(totals)

    @contextmanager
    def writing(self) -> Iterator[TileWriter]:
        """Yield what writes tiles; no second process is let in meanwhile.

        Raises
        ------
        StoreBusy
            Another process writes.
        PermissionError
            Nothing can be written there.
        """
        with locked(self.path / PROGRESS / RECORDS / LOCK, self.path):
            writer = TileWriter(self.path)
            try:
                yield writer
            finally:
                writer.close()


def open_or_create(path: str | os.PathLike[str], request: Request, cells: int = CELLS) -> SweepStore:
    """Return the store of a request: the one that stands there, or a new one.

    Raises
    ------
    ValueError
        Another study's numbers stand there, or the name does not end in .zarr.
    OSError
        What stands there is no stored sweep, or nothing can be written there.
    """
    try:
        folder = Path(path)
    except TypeError:
        raise ValueError(f"`store` is {path!r}; allowed is the path of a folder ending in .zarr; give one") from None
    if folder.suffix.lower() != ".zarr":
        raise ValueError(f"`store` is {str(path)!r}; allowed is a folder ending in .zarr; give it that ending")
    folder = Path(os.path.realpath(folder))  # a link to a folder that is not there yet is followed too
    if not folder.exists() or scratch_of(folder).exists():
        create(folder, request, cells)
    store = SweepStore(folder)
    asked = request.identity()
    if store.key != key_of(asked):
        raise ValueError(
            f"`store` is {str(path)!r}, which holds another study ({differences(store.identity, asked)}); "
            "allowed is the same study; choose another name, or ask for what it holds"
        )
    return store
