"""Writing tiles into a store."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Condition
from typing import Any, ClassVar
from weakref import WeakSet

import numpy as np
import zarr
from numpy.typing import NDArray

from vibroimpact.execution.store.layout import PROGRESS, RECORDS
from vibroimpact.execution.store.locks import LOCK
from vibroimpact.execution.store.records import Arrays, Record, place_of

SETTLING = 5.0  # seconds that a process about to end waits for files it is writing


class TileWriter:
    """Writes tiles into a store, from whichever process and machine sees its folder; it can be pickled.

    A tile's numbers are written first and its record last, each file whole or not at all: wherever the process ends,
    a tile without a record is computed again. Nothing is flushed to the disk by force: after a power failure, tiles
    that never reached it have the wrong checksum and are computed again.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._root: Any = zarr.open_group(path, mode="r+", zarr_format=3)
        self._key = str(self._root.attrs["key"])
        self._arrays: dict[str, Any] = {}
        self._gate = _Gate()

    def write(self, number: int, part: tuple[slice, ...], result: Arrays, seconds: float) -> Record:
        """Write a tile's numbers, then that it is done; each file appears whole or not at all."""
        kept = {name: values for name, values in result.items() if name not in ("impacts", "steps")}
        place = place_of(self._key, number)
        record = Record.of(kept, int(result["impacts"].sum()), int(result["steps"].sum()), seconds, place)
        with self.passing():
            for name, values in kept.items():
                self._array(name)[part] = values
            self._array(f"{PROGRESS}/{RECORDS}")[number] = record.row(place)
        return record

    @contextmanager
    def passing(self) -> Iterator[None]:
        """Let the caller write files that belong together; it is waited for before the store is handed to others."""
        with self._gate.passed(self.path), told(self.path):
            yield

    def forget(self, number: int, place: tuple[int, ...], names: tuple[str, ...]) -> None:
        """Take a tile for not done and its numbers for missing; `place` counts tiles along each axis."""
        with told(self.path):
            self.path.joinpath(PROGRESS, RECORDS, "c", str(number), "0").unlink(missing_ok=True)
            for name in ("status", *names):
                self.path.joinpath(name, "c", *map(str, place)).unlink(missing_ok=True)

    def write_axis(self, name: str, values: NDArray[np.float64]) -> None:
        """Write the values along an axis anew."""
        with told(self.path):
            self._array(name)[:] = values

    def sweep_up(self) -> None:
        """Remove what writers left behind that were ended in mid-file, and words left to their workers."""
        progress = self.path / PROGRESS
        with told(self.path):
            notes = [entry for folder in (progress, progress / RECORDS) for entry in folder.iterdir()]
            words = [note for note in notes if note.is_file() and note.name not in ("zarr.json", LOCK)]
            for leftover in (*self.path.rglob("*.partial"), *words):
                leftover.unlink(missing_ok=True)

    def close(self) -> None:
        """Wait for tiles being written; refuse those that threads bring later."""
        self._gate.close()

    def _array(self, name: str) -> Any:
        if name not in self._arrays:
            # Tiles equal to the fill value are written too: a file that is not there has been lost.
            self._arrays[name] = self._root[name].with_config({"write_empty_chunks": True})
        return self._arrays[name]


@contextmanager
def told(path: Path) -> Iterator[None]:
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


def settle() -> None:
    """Wait until what this process writes into stores is whole, and hold up what it would write next: it is to end."""
    for gate in list(_Gate.all):
        gate.hold()


class _Gate:
    """Lets writers pass until it is closed; whoever closes it waits for those on their way."""

    all: ClassVar[WeakSet[_Gate]] = WeakSet()

    def __init__(self) -> None:
        self._changed, self._inside, self._open, self._held = Condition(), 0, True, False
        _Gate.all.add(self)

    def __reduce__(self) -> tuple[type[_Gate], tuple[()]]:
        return _Gate, ()

    @contextmanager
    def passed(self, path: Path) -> Iterator[None]:
        with self._changed:
            self._changed.wait_for(lambda: not self._held)
            if not self._open or not (path / "zarr.json").exists():
                raise OSError(f"`store` is {str(path)!r}, which has been closed or removed; run the same again")
            self._inside += 1
        try:
            yield
        finally:
            with self._changed:
                self._inside -= 1
                self._changed.notify_all()

    def close(self) -> None:
        with self._changed:
            self._open = False
            self._changed.wait_for(lambda: not self._inside)

    def hold(self) -> None:
        with self._changed:
            self._held = True
            self._changed.wait_for(lambda: not self._inside, SETTLING)
