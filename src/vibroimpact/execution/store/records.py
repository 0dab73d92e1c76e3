"""What is noted of a finished tile, and how its numbers are known to be those that were written."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.execution.store.tiling import Tiling
from vibroimpact.status import Status

Arrays = dict[str, NDArray[Any]]
Rows = NDArray[np.int64]

# A tile's record: whether it is done, the checksum of its numbers, what it cost, how many cells have each status, and
# a checksum of all this.
DONE, CHECKSUM, MICROSECONDS, IMPACTS, STEPS, FIRST_STATUS = range(6)
SEAL = FIRST_STATUS + len(Status)
COLUMNS = SEAL + 1


@dataclass(frozen=True)
class Record:
    """What is noted of a finished tile."""

    checksum: int
    microseconds: int
    impacts: int
    steps: int
    statuses: tuple[int, ...]

    @classmethod
    def of(cls, arrays: Arrays, impacts: int, steps: int, seconds: float, place: int) -> Record:
        """Return the record of a tile's numbers; `place` is what `place_of` says."""
        counts = np.bincount(arrays["status"].ravel(), minlength=len(Status))
        return cls(checksum(arrays, place), round(1e6 * seconds), impacts, steps, tuple(counts.tolist()))

    def row(self, place: int) -> Rows:
        """Return the record as it is stored."""
        row = np.array([1, self.checksum, self.microseconds, self.impacts, self.steps, *self.statuses, 0], np.int64)
        row[SEAL] = _seal(row, place)
        return row


def place_of(key: str, number: int) -> int:
    """Return what checksums of a tile begin with: numbers of another tile, or another study, then never pass for it."""
    return zlib.crc32(f"{key} {number}".encode())


def checksum(arrays: Arrays, place: int) -> int:
    """Return a checksum of a tile's numbers, in the order of their names."""
    total = place
    for name in sorted(arrays):
        total = zlib.crc32(np.ascontiguousarray(arrays[name]).tobytes(), total)
    return total


def believed(rows: Rows, key: str) -> Rows:
    """Return the records with those that are not as they were written taken for records of tiles not done."""
    kept = np.zeros_like(rows)
    for number in np.flatnonzero(rows[:, DONE]).tolist():
        if rows[number, SEAL] == _seal(rows[number], place_of(key, number)):
            kept[number] = rows[number]
    return kept


def _seal(row: Rows, place: int) -> int:
    return zlib.crc32(row[:SEAL].tobytes(), place)


def summary(records: Rows, tiling: Tiling) -> dict[str, Any]:
    """Return how far a sweep is: tiles and cells done, seconds spent computing, impacts, and cells of each status."""
    done = np.flatnonzero(records[:, DONE])
    counts = records[done, FIRST_STATUS:SEAL].sum(axis=0)
    return {
        "tiles_done": len(done),
        "tiles": len(tiling),
        "cells_done": sum(tiling.cells(number) for number in done.tolist()),
        "cells": int(np.prod(tiling.shape)),
        "seconds": float(records[done, MICROSECONDS].sum() * 1e-6),
        "impacts": int(records[done, IMPACTS].sum()),
        "statuses": {status.word: int(count) for status, count in zip(Status, counts, strict=True) if count},
    }
