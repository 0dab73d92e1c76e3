"""How far a stored refined map is."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from vibroimpact.execution.store import SweepStore
from vibroimpact.execution.store.layout import PROGRESS, RECORDS, unpacked
from vibroimpact.execution.store.records import COLUMNS, DONE, FIRST_STATUS, IMPACTS, MICROSECONDS, SEAL, Rows, believed
from vibroimpact.refinement.stored import BATCHES, LEVEL_MARK, POINTS
from vibroimpact.status import Status


@dataclass(frozen=True)
class LevelProgress:
    """Of the cells of a level that are known to be needed, how many are computed."""

    level: int
    computed: int
    needed: int


@dataclass(frozen=True)
class RefinedProgress:
    """How far the computed cells of a refined map are, and what they cost.

    `seconds` are those that went by while cells were computed, by all threads together; `statuses` count cells by the
    word for how their motion ended; `damaged` are chunks of cells that will be computed again.
    """

    levels: tuple[LevelProgress, ...]
    seconds: float
    impacts: int
    statuses: dict[str, int]
    damaged: int
    drawn: bool

    @property
    def computed(self) -> int:
        """Cells computed."""
        return sum(level.computed for level in self.levels)

    @property
    def needed(self) -> int:
        """Cells known so far to be needed."""
        return sum(level.needed for level in self.levels)


def progress_of(store: SweepStore) -> RefinedProgress:
    """Return how far a stored refined map is; another process may be at it meanwhile."""
    folder = store.path / PROGRESS / POINTS
    try:
        group: Any = zarr.open_group(folder, mode="r", zarr_format=3)
        batches, chunk = [tuple(map(int, batch)) for batch in group.attrs[BATCHES]], int(group["status"].shape[1])
    except Exception:  # not begun, or what describes it is damaged
        return RefinedProgress((), 0.0, 0, {}, 0, False)
    sizes, levels = _chunks(batches, chunk)
    rows = _records(folder, len(sizes), store.key)
    damaged = [number for number in np.flatnonzero(rows[:, DONE]).tolist() if _is_damaged(group, folder, number)]
    rows[damaged] = 0
    done = rows[:, DONE] > 0
    counts = rows[:, FIRST_STATUS:SEAL].sum(axis=0)
    return RefinedProgress(
        tuple(
            LevelProgress(level, int(sizes[done & (levels == level)].sum()), int(sizes[levels == level].sum()))
            for level in np.unique(levels).tolist()
        ),
        float(rows[:, MICROSECONDS].sum() * 1e-6),
        int(rows[:, IMPACTS].sum()),
        {status.word: int(count) for status, count in zip(Status, counts, strict=True) if count},
        len(damaged),
        LEVEL_MARK in zarr.open_group(store.path / PROGRESS, mode="r").attrs,
    )


def _chunks(batches: list[tuple[int, ...]], chunk: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return how many cells each chunk holds, and their level."""
    sizes = [[min(chunk, cells - low) for low in range(0, cells, chunk)] for _, cells in batches]
    levels = [[level] * len(parts) for (level, _), parts in zip(batches, sizes, strict=True)]
    return np.array([*chain(*sizes)], np.int64), np.array([*chain(*levels)], np.int64)


def _records(folder: Path, number: int, key: str) -> Rows:
    rows = np.zeros((number, COLUMNS), np.int64)
    for chunk in range(number):
        try:
            rows[chunk] = unpacked(folder / RECORDS, (chunk, 0), rows[chunk])
        except Exception:  # it is not there yet, or it is damaged
            continue
    return believed(rows, key)


def _is_damaged(group: Any, folder: Path, number: int) -> bool:
    """Whether a file of a chunk is lost or altered; one of another chunk in its place is found when it is used."""
    try:
        for name, array in group.arrays():
            if name != RECORDS:
                unpacked(folder / name, (number, 0), np.empty(array.shape[1], array.dtype))
    except Exception:
        return True
    return False
