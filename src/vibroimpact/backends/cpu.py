"""The `cpu` back end: certified steps in vectorised lanes for indices and for samples of many cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import Counts, Floats, ImpactWindow, Measurement, Outcome, Samples
from vibroimpact.backends.sampling import ended_as, sample
from vibroimpact.cells import Cells
from vibroimpact.indices import INDICES, VELOCITY_INDICES
from vibroimpact.kernels.cell import FILLED
from vibroimpact.kernels.closing import LONGEST
from vibroimpact.kernels.cycle import FACTS
from vibroimpact.kernels.lanes import LANES, ROWS
from vibroimpact.kernels.runner import (
    COLUMNS,
    COUNTED,
    CYCLE_IMPACTS,
    CYCLE_PERIODS,
    EXPONENT,
    KNOWN_WITHOUT,
    LARGEST,
    LOSS,
    MEAN,
    MISSED,
    NOTES,
    PER_IMPACT,
    RATE,
    RESTING,
    SPAN,
    SPREAD,
    STD,
    STEPS,
    STICKS,
    THOROUGH_COLUMNS,
    run_cells,
)
from vibroimpact.options import Tolerances
from vibroimpact.status import Status, window_status

_LOOKS = 2000  # at the lanes, some 20 ms, before a thread asks whether to stop
_BATCH = 4096  # cells that end before they are handed on
_COLUMNS = {
    "std": STD,
    "mean_velocity": MEAN,
    "max_velocity": LARGEST,
    "impacts_per_period": RATE,
    "lyapunov": EXPONENT,
    "lyapunov_per_impact": PER_IMPACT,
    "n_periods": CYCLE_PERIODS,
    "n_impacts": CYCLE_IMPACTS,
    "dissipation": LOSS,
    "stick_fraction": RESTING,
    "impact_phase_spread": SPREAD,
    "grazing_margin": MISSED,
}


def limits(tolerances: Tolerances) -> tuple[float, float, float]:
    """Return the tolerances in the order in which the kernels take them."""
    return tolerances.chatter, tolerances.flight_periods, float(tolerances.steps_per_impact)


def outcomes(results: Floats, ends: NDArray[np.int8], window: ImpactWindow) -> Outcome:
    """Return what a back end promises of cells, from the columns that lanes hand out and why each cell ended."""
    full = ends == FILLED
    columns = _COLUMNS if results.shape[1] > COLUMNS else {name: _COLUMNS[name] for name in VELOCITY_INDICES}
    table = {name: np.where(full, results[:, column], INDICES[name].fill) for name, column in columns.items()}
    return {name: values.astype(INDICES[name].dtype) for name, values in table.items()} | {
        "status": _statuses(results, ends, window),
        "impacts": results[:, COUNTED].astype(np.int64),
        "steps": results[:, STEPS].astype(np.int64),
    }


def _statuses(results: Floats, ends: NDArray[np.int8], window: ImpactWindow) -> NDArray[np.int8]:
    """Return the status of every cell: each of the few kinds of cells there are is judged once."""
    flags = np.stack(
        [results[:, COUNTED] > 0.0, results[:, STICKS] > 0.0, results[:, SPAN] < 10.0, results[:, KNOWN_WITHOUT] > 0.0],
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
        self.results = np.zeros((len(cells), THOROUGH_COLUMNS if self.thorough else COLUMNS))
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
    """Return the arrays of a thread: lanes, the cell in each (-1: none), notes, room for one cycle."""
    return np.zeros(ROWS * LANES), np.full(LANES, -1), np.zeros((LANES, NOTES)), np.zeros((LONGEST, 4))
