"""The `cpu` back end: certified steps in vectorised lanes for indices and for samples of many cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import Counts, Floats, ImpactWindow, Measurement, Outcome, Samples
from vibroimpact.backends.sampling import aligned, ended_as, sample
from vibroimpact.cells import Cells
from vibroimpact.indices import INDICES
from vibroimpact.kernels.cell import FILLED
from vibroimpact.kernels.closing import LONGEST
from vibroimpact.kernels.cycle import FACTS
from vibroimpact.kernels.lanes import LANES, ROWS
from vibroimpact.kernels.results import NOTES, PLAIN, THOROUGH
from vibroimpact.kernels.runner import LOOK, run_cells
from vibroimpact.kernels.walk import TRACE
from vibroimpact.options import Tolerances
from vibroimpact.status import Status, window_status

_LOOKS = 2000  # at the lanes, some 20 ms, before a thread asks whether to stop
_BATCH = 4096  # cells that end before they are handed on


def limits(tolerances: Tolerances) -> tuple[float, float, float]:
    """Return the tolerances in the order in which the kernels take them."""
    return tolerances.chatter, tolerances.flight_periods, float(tolerances.steps_per_impact)


def outcomes(results: Floats, ends: NDArray[np.int8], window: ImpactWindow) -> Outcome:
    """Return what a back end promises of cells, from the columns that lanes hand out and why each cell ended."""
    full = ends == FILLED
    columns = dict(zip(THOROUGH, results.T, strict=False))
    found = {
        name: np.where(full, columns[name], index.fill).astype(index.dtype)
        for name, index in INDICES.items()
        if name in columns
    }
    return found | {
        "status": _statuses(columns, ends, window),
        "impacts": columns["counted"].astype(np.int64),
        "steps": columns["steps"].astype(np.int64),
    }


def _statuses(columns: dict[str, Floats], ends: NDArray[np.int8], window: ImpactWindow) -> NDArray[np.int8]:
    """Return the status of every cell: each of the few kinds of cells there are is judged once."""
    flags = np.stack(
        [columns["counted"] > 0.0, columns["sticks"] > 0.0, columns["span"] < 10.0, columns["known"] > 0.0],
        axis=1,
    )
    kinds, which = np.unique(ends.astype(np.int64) * 16 + flags @ (8, 4, 2, 1), return_inverse=True)
    judged = [_status(kind // 16, [bool(kind & bit) for bit in (8, 4, 2, 1)], window) for kind in kinds.tolist()]
    return np.array(judged, np.int8)[which]


class CpuBackend:
    """Exact flights, certified contacts, closed-form chatter; threads share the cells of a sweep."""

    name = sampler = "cpu"
    smallest_tile = 64  # two rounds of lanes
    largest_tile = 4096
    tells = frozenset(INDICES)

    def indices(self, cells: Cells, asked: Measurement) -> Outcome:
        """Return the indices, the status, the impacts computed and the certified steps of each cell."""
        sweep = _Sweep(cells, asked)
        for _ in sweep.finished(lambda: False):
            pass
        return outcomes(sweep.results, sweep.ends, asked.impacts)

    def share(
        self, cells: Cells, asked: Measurement
    ) -> Callable[[Callable[[], bool]], Iterator[tuple[Counts, Outcome]]]:
        """Return the work of a thread: cell after cell into its own lanes, until none is left."""
        sweep = _Sweep(cells, asked)

        def work(stopped: Callable[[], bool]) -> Iterator[tuple[Counts, Outcome]]:
            for done in sweep.finished(stopped):
                yield done, outcomes(sweep.results[done], sweep.ends[done], asked.impacts)

        return work

    def samples(self, cells: Cells, asked: Measurement) -> list[Samples]:
        """Return what the window sees of each cell."""
        return sample(cells.table, asked.window, limits(asked.tolerances))


def create() -> CpuBackend:
    """Return the back end."""
    return CpuBackend()


def _status(end: int, flags: list[bool], window: ImpactWindow) -> Status:
    hit, stuck, short, known = flags
    return window_status(
        sampled=window.keep if end == FILLED else 0,
        wanted=window.keep,
        stuck=stuck,
        periods=0.0 if short else math.inf,
        ended=Status.CLOSED if known else ended_as(end, hit),
    )


class _Sweep:
    """Cells that threads share, and what has become of them."""

    def __init__(self, cells: Cells, asked: Measurement) -> None:
        self.thorough = asked.thorough
        self.cells = np.ascontiguousarray(cells.table)
        self.results = np.zeros((len(cells), len(THOROUGH if self.thorough else PLAIN)))
        self.ends = np.zeros(len(cells), dtype=np.int8)
        self._tickets = np.zeros(1, dtype=np.int64)
        window = asked.impacts
        total = float(window.transient + window.keep)
        self._how = float(window.transient), total, *limits(asked.tolerances), asked.early_closing, _LOOKS

    def finished(self, stopped: Callable[[], bool]) -> Iterator[Counts]:
        """Step lanes of their own for the calling thread; yield the cells that ended, a batch at a time."""
        seat = _seat()
        ended = np.empty(_BATCH, dtype=np.int64)
        facts = np.zeros((LANES, FACTS)) if self.thorough else None
        busy = 1
        while busy and not stopped():
            number, busy = run_cells(self.cells, self.results, self.ends, self._tickets, seat, ended, *self._how, facts)
            if number:
                yield ended[:number].copy()


def _seat() -> tuple[NDArray[Any], ...]:
    """Return the arrays of a thread: lanes, the cell in each (-1: none), notes, room for one cycle and for a walk."""
    owner, notes = np.full(LANES, -1), np.zeros((LANES, NOTES))
    return aligned(ROWS * LANES), owner, notes, np.zeros((LONGEST, 4)), np.zeros((LOOK, TRACE))
