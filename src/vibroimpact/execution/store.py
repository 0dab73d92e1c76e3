"""A sweep on disk: tiles are written as they finish, and a second run continues where the first one stopped."""

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
from vibroimpact.execution.base import Gathered, Place
from vibroimpact.execution.layout import (
    CELL,
    COLUMNS,
    DONE,
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
    is_refined,
    locked,
)
from vibroimpact.files import aside_hint, load_lazily, sweep_up
from vibroimpact.files.formats import ORDER
from vibroimpact.files.guard import DESCRIPTION, RECORDS, GuardedStore
from vibroimpact.parameters import check_fits, invalid
from vibroimpact.progress import Report, Stop
from vibroimpact.request import Request, differences, key_of
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr


class SweepStore:
    """A stored sweep, opened for reading; raises `OSError` if there is none or if its description is damaged."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path).absolute()  # independent of later changes of the working directory
        if not self.path.exists():
            raise FileNotFoundError(
                f"`store` {str(path)!r} does not exist; {aside_hint(self.path) or 'check the spelling'}"
            )
        try:
            self._files = GuardedStore(self.path)
            self._check_described("")
            self._root: Any = zarr.open_group(self._files, mode="r", zarr_format=3)
            self._describe()
        except Exception as error:
            raise OSError(
                f"`store` {str(path)!r} is not a stored sweep, or is damaged ({_reason(error)}); restore that "
                "file, delete the store, or choose another name"
            ) from error

    def _describe(self) -> None:
        """Read the description of the store; raise if its parts do not match."""
        attrs = dict(self._root.attrs)
        self.identity: dict[str, Any] = json.loads(str(attrs["study"]))
        if key_of(self.identity) != attrs["key"]:
            raise ValueError(f"the study in {str(self.path / DESCRIPTION)!r} was altered")
        self.key, self.command = str(attrs["key"]), str(attrs.get("command", ""))
        self.refined = is_refined(self.identity)
        names = (*str(self.identity["indices"]).split(", "), "status")
        self.arrays = {name: f"{LIST}/{name}" for name in (*names, CELL)} if self.refined else {n: n for n in names}
        self._drawn = (*names, "level") if self.refined else ()
        self._check_files([name for name in json.loads(str(attrs[ORDER])) if name not in names])
        self.shape: tuple[int, ...] = self._root["status"].shape
        self._arrays = {name: self._root[place] for name, place in self.arrays.items()}
        self._rows = self._root[RECORDS]
        self.tiling = Tiling(self._arrays["status"].shape, tuple(attrs["tile"]))
        for name, array in self._arrays.items():
            further = array.shape[len(self.tiling.tile) :]  # further dimensions are not cut
            if (array.shape, array.chunks) != ((*self.tiling.shape, *further), (*self.tiling.tile, *further)):
                raise ValueError(
                    f"{str(self.path / self.arrays[name] / DESCRIPTION)!r} differs from the store in its tiles"
                )
        self._needed = self._rows.attrs.get(NEEDED, 0)
        if not all(self.shape) or self._rows.shape != (len(self.tiling), COLUMNS) or type(self._needed) is not int:
            raise ValueError(f"{str(self.path / RECORDS / DESCRIPTION)!r} does not fit the tiles of the store")
        check_fits("store", f"has {len(self.tiling):,} tiles, whose records take", 8 * self._rows.size, "it is damaged")

    def _check_files(self, axes: list[str]) -> None:
        """Raise if a description or an axis, each of one chunk, is lost or damaged."""
        lists = (LIST,) if self.refined else ()
        self._check_described(PROGRESS, RECORDS, *lists, *self.arrays.values(), *self._drawn, *axes)
        for name in axes:
            axis = self._files.declared(name)
            if axis is None or axis.shape != axis.chunk or not self._files.is_whole(f"{name}/c/0"):
                raise ValueError(f"{str(self.path / name / 'c' / '0')!r} is missing or damaged")

    def _check_described(self, *names: str) -> None:
        for name in names:
            if self._files.content(f"{name}/{DESCRIPTION}".lstrip("/")) is None:
                raise FileNotFoundError(f"{str(self.path / name / DESCRIPTION)!r} is missing")

    def records(self) -> Rows:
        """Return the record of every tile, one per row; tiles with damaged records count as not done."""
        rows = np.zeros((len(self.tiling), COLUMNS), np.int64)
        try:
            rows[:] = self._rows[:]
        except Exception:
            for low in range(0, len(rows), ROWS):
                with suppress(Exception):
                    rows[low : low + ROWS] = self._rows[low : low + ROWS]
        return rows

    def read(self, number: int) -> Arrays:
        """Return a tile as it is stored; raise if a chunk of it is lost or was altered."""
        if not self._has_tile(number):
            raise OSError(f"`store` {str(self.path)!r} does not hold all of tile {number}")
        return {name: np.asarray(array[self.tiling[number]]) for name, array in self._arrays.items()}

    def _has_tile(self, number: int) -> bool:
        """Return whether every chunk of a tile is intact; Zarr would read a lost one as missing values."""
        at = tuple(along.start // side for along, side in zip(self.tiling[number], self.tiling.tile, strict=True))
        return all(
            self._has_chunk(self.arrays[name], array, (*at, *(0,) * (array.ndim - len(at))))
            for name, array in self._arrays.items()
        )

    def _has_chunk(self, place: str, array: Any, at: tuple[int, ...]) -> bool:
        return self._files.is_whole(f"{place}/{array.metadata.encode_chunk_key(at)}")

    def damaged(self) -> list[int]:
        """Return the finished tiles with a chunk that was lost or altered since it was written."""
        return [number for number in np.flatnonzero(self.records()[:, DONE]).tolist() if not self._has_tile(number)]

    def faults(self) -> list[str]:
        """Return the faults, one line each; running the same sweep again repairs all of them."""
        lines = []
        if tiles := len(self.damaged()):
            lines.append(f"{tiles} damaged {'tile' if tiles == 1 else 'tiles'}; computed again when you continue")
        if self.refined and self.is_complete() and not self._is_drawn():
            lines.append("the picture is damaged; drawn again when you continue")
        return lines

    def is_complete(self) -> bool:
        """Return whether all cells are computed, and the picture of a refined map is drawn."""
        done = self.records()[:, DONE] > 0
        if not self.refined:
            return bool(done.all())
        last = np.flatnonzero(done)[-1:]  # batches are numbered in order: one without a record has lost it
        return self._root.attrs.get("complete") == 1 and bool(last.size and done[: last[0]].all())

    def is_whole(self) -> bool:
        """Return whether all cells are computed and nothing is damaged."""
        return self.is_complete() and not self.faults()

    def _is_drawn(self) -> bool:
        """Return whether every chunk of a refined map's picture is intact."""
        pictures = {name: self._root[name] for name in self._drawn}
        return all(
            self._has_chunk(name, array, at) for name, array in pictures.items() for at in np.ndindex(array.cdata_shape)
        )

    def summary(self) -> dict[str, Any]:
        """Return the progress of the sweep: tiles and cells done, seconds elapsed, impacts, and cells of each status.

        For refined maps, `cells` are those of the picture, and `needed` those that must be computed for it, as far as
        known.
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
        """Return the sweep as far as it is done; values are read from disk only when they are used.

        A chunk that was altered raises `OSError` when it is read; a chunk whose file is gone reads as missing cells.
        `damaged` finds both, and running the same sweep again repairs them.
        """
        dataset = load_lazily(self.path)
        if self.refined:
            return dataset
        counts = self.summary()
        return dataset.assign_attrs(
            impacts_computed=counts["impacts"],
            steps_computed=counts["steps"],
            cells_missing=counts["cells"] - counts["cells_done"],
        )

    @contextmanager
    def writing(self) -> Iterator[TileWriter]:
        """Clear partial, lost and altered tiles, then yield a writer of tiles; no other process can write meanwhile."""
        with locked(self.path / RECORDS / LOCK, self.path):
            writer = TileWriter(self.path, self.tiling, self.arrays, self.records())
            try:
                writer.sweep_up()
                writer.forget(self.damaged())
                yield writer
            finally:
                writer.close()


def open_or_create(path: str | os.PathLike[str], request: Request, cells: int) -> SweepStore:
    """Return the store of a request: the existing one, or a new one with tiles of `cells` cells."""
    try:
        folder = Path(path)
    except TypeError:
        raise invalid("store", path, "the path of a folder ending in .zarr") from None
    if folder.suffix.lower() != ".zarr":
        raise invalid("store", str(path), "a folder ending in .zarr", "give it that ending")
    folder = Path(os.path.realpath(folder))  # follows links, also to a folder that does not exist yet
    identity = request.identity()
    if folder.exists():
        sweep_up(folder)
    else:
        create(folder, request, identity, cells)
    store = SweepStore(folder)
    if store.key != key_of(identity):
        raise ValueError(
            f"`store` {str(path)!r} holds another study ({differences(store.identity, identity)}); "
            "choose another name, or request the study that it holds"
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
    """Compute the tiles that a store lacks and write them; return the sweep, read from disk only when it is used.

    A new store has tiles of `cells` cells; `computing` is called only if tiles are left to compute.
    """
    store = open_or_create(path, request, cells)
    try:
        with store.writing() as writer:
            _fill(store, writer, request, computing, report)
    except (StoreBusy, PermissionError):
        if not store.is_whole():
            raise
        _Tally(store, store.records()).report_to(report)  # nothing is left to write
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
    if not tally.report_to(report) or not waiting:
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
            if not tally.report_to(report):
                stop.set()


class _Tally:
    """The progress of a stored sweep, in the form in which sweeps in memory report it."""

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

    def report_to(self, report: Report) -> bool:
        """Report the progress; return whether to continue."""
        return report(self.cells, self.total, self.dataset) is not False
