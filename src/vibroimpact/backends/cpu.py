"""The `cpu` back end: certified steps in vectorised lanes for indices and for samples of many cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import (
    Backend,
    Counts,
    Floats,
    ImpactWindow,
    Measurement,
    Outcome,
    Samples,
    StroboscopicWindow,
)
from vibroimpact.backends.sampled import samples_of
from vibroimpact.cells import Cells
from vibroimpact.indices import INDICES
from vibroimpact.kernels import recorder
from vibroimpact.kernels.cell import DYING, FILLED, PINNED, QUIET, RUNNING, SPENT, Cell
from vibroimpact.kernels.closing import LONGEST
from vibroimpact.kernels.cycle import FACTS
from vibroimpact.kernels.lanes import LANES, ROWS, TRACED_ROWS
from vibroimpact.kernels.recorder import IDLE, Recorder, record_lanes
from vibroimpact.kernels.results import NOTES, PLAIN, THOROUGH
from vibroimpact.kernels.runner import follow_cell, run_cells
from vibroimpact.kernels.walk import LOOK, TRACE
from vibroimpact.options import Tolerances
from vibroimpact.status import Status, window_status

_LOOKS = 2000  # at the lanes, some 20 ms, before a thread asks whether to stop
_BATCH = 4096  # cells that end before they are handed on
FEW = 4  # cells, recorded sooner one after the other than in lanes most of which stand idle
ROOM = 4096  # rows of a buffer, which is emptied when it is full

Window = ImpactWindow | StroboscopicWindow
Limits = tuple[float, float, float]
Seen = tuple[Floats, Floats, Floats]  # rows of impacts, looks and sticks


def limits(tolerances: Tolerances) -> tuple[float, float, float]:
    """Return the tolerances in the order in which the kernels take them."""
    return tolerances.chatter, tolerances.flight_periods, float(tolerances.steps_per_impact)


def rows_of(cells: Cells) -> Floats:
    """Return the table of cells as kernels read it; its columns must be those of a `Cell`, in that order."""
    if cells.columns != Cell._fields:
        raise ValueError(f"cells must have the columns {', '.join(Cell._fields)}, got {', '.join(cells.columns)}")
    return np.ascontiguousarray(cells.table)


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
    """Return the status of every cell; it is decided once for each combination of ending and flags."""
    flags = np.stack(
        [columns["counted"] > 0.0, columns["sticks"] > 0.0, columns["span"] < 10.0, columns["known"] > 0.0],
        axis=1,
    )
    kinds, which = np.unique(ends.astype(np.int64) * 16 + flags @ (8, 4, 2, 1), return_inverse=True)
    found = [_status(kind // 16, [bool(kind & bit) for bit in (8, 4, 2, 1)], window) for kind in kinds.tolist()]
    return np.array(found, np.int8)[which]


class CpuBackend(Backend):
    """Exact flights, certified contacts, closed-form chatter; threads share the cells of a sweep."""

    name = sampler = "cpu"
    smallest_tile = 64  # two rounds of lanes
    largest_tile = 4096
    known_indices = frozenset(INDICES)

    def indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        """Return the indices, the status, the impacts computed and the certified steps of each cell."""
        sweep = _Sweep(cells, measurement)
        for _ in sweep.finished(lambda: False):
            pass
        return outcomes(sweep.results, sweep.ends, measurement.impacts)

    def share(
        self, cells: Cells, measurement: Measurement
    ) -> Callable[[Callable[[], bool]], Iterator[tuple[Counts, Outcome]]]:
        """Return the work of a thread: cell after cell into its own lanes, until none is left."""
        sweep = _Sweep(cells, measurement)

        def work(stopped: Callable[[], bool]) -> Iterator[tuple[Counts, Outcome]]:
            for done in sweep.finished(stopped):
                yield done, outcomes(sweep.results[done], sweep.ends[done], measurement.impacts)

        return work

    def samples(self, cells: Cells, measurement: Measurement) -> list[Samples]:
        """Return what the window sees of each cell."""
        return sample(rows_of(cells), measurement.window, limits(measurement.tolerances))

    def follow(self, cell: Cells, measurement: Measurement, seen: Measurement) -> tuple[Outcome, Samples]:
        """Return what `indices` gives for a single cell, and what the window of `seen` sees of it, from one run.

        Both agree bit for bit with those of two runs. The budgets may differ; `chatter`, on which the motion depends,
        must not.
        """
        if seen.tolerances.chatter != measurement.tolerances.chatter:
            raise ValueError(
                "`chatter` must be the same for measuring and recording one run, got "
                f"{measurement.tolerances.chatter:g} and {seen.tolerances.chatter:g}"
            )
        sweep = _Sweep(cell, measurement)
        run = _Run.begun(sweep.cells[0], seen.window, limits(seen.tolerances))
        sweep.follow(run)
        _one_by_one([run], _numbers(seen.window))
        return outcomes(sweep.results, sweep.ends, measurement.impacts), run.samples()


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

    def __init__(self, cells: Cells, measurement: Measurement) -> None:
        self.thorough = measurement.thorough
        self.cells = rows_of(cells)
        self.results = np.zeros((len(cells), len(THOROUGH if self.thorough else PLAIN)))
        self.ends = np.zeros(len(cells), dtype=np.int8)
        self._tickets = np.zeros(1, dtype=np.int64)
        window = measurement.impacts
        total = float(window.transient + window.keep)
        self._how = float(window.transient), total, *limits(measurement.tolerances), measurement.early_closing, _LOOKS

    def finished(self, stopped: Callable[[], bool]) -> Iterator[Counts]:
        """Step lanes of their own for the calling thread; yield the cells that ended, a batch at a time."""
        seat, facts = _seat(), self._facts()
        ended = np.empty(_BATCH, dtype=np.int64)
        busy = 1
        while busy and not stopped():
            number, busy = run_cells(self.cells, self.results, self.ends, self._tickets, seat, ended, *self._how, facts)
            if number:
                yield ended[:number].copy()

    def follow(self, run: _Run) -> None:
        """Measure the only cell, and record its run up to there, or to its own end."""
        seat, facts, recorded = _seat(), self._facts(), np.array([RUNNING])
        window = _numbers(run.window)
        buffers = _buffers(window)
        while self.ends[0] == RUNNING:
            filled = np.zeros(3, np.int64)
            recorder = Recorder(run.memory, window, *buffers, filled, recorded)
            follow_cell(self.cells, self.results, self.ends, seat, *self._how, facts, recorder)
            run.keep(buffers, filled)
        run.end = int(recorded[0])

    def _facts(self) -> Floats | None:
        return np.zeros((LANES, FACTS)) if self.thorough else None


def _seat() -> tuple[NDArray[Any], ...]:
    """Return the arrays of a thread: lanes, the cell in each (-1: none), notes, room for one cycle and for a walk."""
    owner, notes = np.full(LANES, -1), np.zeros((LANES, NOTES))
    return aligned(ROWS * LANES), owner, notes, np.zeros((LONGEST, 4)), np.zeros((LOOK, TRACE))


def sample(table: Floats, window: Window, limits: Limits) -> list[Samples]:
    """Return what the window sees of each cell, one a row of the table."""
    runs = [_Run.begun(row, window, limits) for row in table]
    record = _one_by_one if len(runs) < FEW else _in_lanes
    record(runs, _numbers(window))
    return [run.samples() for run in runs]


@dataclass
class _Run:
    """A cell, its recorder's memory, and what was seen of it so far."""

    cell: Cell
    window: Window
    look_periods: Floats
    look_phase: Floats
    memory: Floats
    end: int = RUNNING
    parts: list[Seen] = field(default_factory=list)

    @classmethod
    def begun(cls, row: Floats, window: Window, limits: Limits) -> _Run:
        """Return a run at its start."""
        cell = Cell(*row.tolist())
        periods = phase = np.zeros(1)
        if isinstance(window, StroboscopicWindow):
            periods, phase = window.schedule(cell.periods, cell.phase)
        memory = np.zeros(recorder.MEMORY)
        recorder.begin(row, memory, _numbers(window), (periods[0], phase[0]), limits)
        return cls(cell, window, periods, phase, memory)

    def keep(self, buffers: Sequence[Floats], filled: NDArray[np.int64]) -> None:
        """Empty the buffers."""
        impacts, looks, sticks = (rows[:number].copy() for rows, number in zip(buffers, filled, strict=True))
        self.parts.append((impacts, looks, sticks))

    def samples(self) -> Samples:
        """Return what was seen, and keep it no longer."""
        parts, self.parts = self.parts, []
        impacts, looks, sticks = (np.concatenate(part) for part in zip(*parts, strict=True))
        ended = ended_as(self.end, self.memory[recorder.COUNT])
        if isinstance(self.window, ImpactWindow):
            turns = impacts[:, 0] + impacts[:, 1]
            span = turns[-1] - turns[0] if len(turns) else 0.0
            status = window_status(
                sampled=len(impacts), wanted=self.window.keep, stuck=len(sticks) > 0, periods=span, ended=ended
            )
            velocity, phase = recorder.place(self.memory)
            last = (self.memory[recorder.U], velocity, self.memory[recorder.N], phase)
        else:
            status = self._looks_status(looks, sticks, ended)
            last = (math.nan,) * 4
            if len(looks):
                at = len(looks) - 1
                last = (looks[at, 0], looks[at, 1], self.look_periods[at], self.look_phase[at])
        times = self.look_periods[: len(looks)], self.look_phase[: len(looks)]
        looked = np.column_stack([*times, self.cell.gap - looks[:, 0], looks[:, 1]])
        steps = int(self.memory[recorder.STEPS])
        return samples_of(impacts=impacts, looks=looked, sticks=sticks, status=status, last=last, steps=steps)

    def _looks_status(self, looks: Floats, sticks: Floats, ended: Status) -> Status:
        if len(looks) < len(self.look_periods):
            return ended
        always_pressed = self.cell.stiffness * self.cell.gap <= -self.cell.amplitude
        released = sticks[:, 2] + sticks[:, 3]
        if len(sticks) and np.isnan(released[-1]) and always_pressed:
            return Status.STUCK_FOREVER
        within = np.isnan(released) | (released > self.look_periods[0] + self.look_phase[0])
        return Status.STICKING if within.any() else Status.OK


def aligned(size: int) -> Floats:
    """Return zeros that begin at a cache line, as lanes should: registers that straddle two cost some 4 %."""
    room = np.zeros(size + 7)
    first = -room.ctypes.data % 64 // 8
    return room[first : first + size]


def _numbers(window: Window) -> tuple[float, float, float, float]:
    """Return a window as the recorder reads it."""
    if isinstance(window, ImpactWindow):
        return float(window.transient), float(window.transient + window.keep), 0.0, 1.0
    return 0.0, 0.0, float(window.keep), float(window.per_period)


def _buffers(window: tuple[float, float, float, float], *lanes: int) -> Seen:
    """Return room for impacts, for all looks, and for sticks."""
    looks = max(int(window[2]), 1)
    return np.empty((*lanes, ROOM, 3)), np.empty((*lanes, looks, 2)), np.empty((*lanes, ROOM, 4))


def _one_by_one(runs: list[_Run], window: tuple[float, float, float, float]) -> None:
    buffers, trace = _buffers(window), np.empty((LOOK, TRACE))
    for run in runs:
        while run.end == RUNNING:
            filled = np.zeros(3, np.int64)
            run.end = recorder.record(run.memory, window, trace, buffers, filled)
            run.keep(buffers, filled)


def _in_lanes(runs: list[_Run], window: tuple[float, float, float, float]) -> None:
    """Record the runs in lanes; one that ends makes room for the next."""
    lanes, trace = aligned(TRACED_ROWS * LANES), np.zeros((LOOK, TRACE * LANES))
    memory, ends = np.zeros((LANES, recorder.MEMORY)), np.full(LANES, IDLE)
    buffers = _buffers(window, LANES)
    rows = [buffer.shape[1] for buffer in buffers]
    filled = np.zeros((LANES, 3), np.int64)
    waiting = iter(runs)
    seated: dict[int, _Run] = {}
    while True:
        for lane in sorted(set(range(LANES)) - set(seated)):
            run = next(waiting, None)
            if run is None:
                break
            seated[lane], memory[lane], ends[lane] = run, run.memory, RUNNING
        if not seated:
            return
        record_lanes(lanes, trace, memory, ends, window, *buffers, filled)
        halted = (ends != RUNNING) | (filled == rows).any(axis=1)
        for lane, run in [(lane, run) for lane, run in seated.items() if halted[lane]]:
            run.keep([buffer[lane] for buffer in buffers], filled[lane])
            filled[lane] = 0
            if ends[lane] != RUNNING:
                run.end, run.memory = int(ends[lane]), memory[lane].copy()
                del seated[lane]


def ended_as(end: int, impacts: float | bool) -> Status:
    """Return the status of a cell that ended so; `impacts` is 0 or False if it had none."""
    if end in (QUIET, DYING) and not impacts:
        return Status.NO_IMPACT
    return {
        QUIET: Status.STOPPED_IMPACTING,
        PINNED: Status.STUCK_FOREVER,
        DYING: Status.DECAYING,
        SPENT: Status.BUDGET,
    }.get(end, Status.OK)
