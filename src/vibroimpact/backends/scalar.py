"""The engine of one mass: certified steps in vectorised lanes for indices and for samples of many cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import (
    Counts,
    Floats,
    ImpactWindow,
    Measurement,
    Outcome,
    Samples,
    TimesWindow,
    Window,
    impacts_status,
    looks_status,
    with_stop_axis,
)
from vibroimpact.cells import Cells
from vibroimpact.indices import INDICES
from vibroimpact.kernels.advance import LOOK, TRACE
from vibroimpact.kernels.cell import DYING, FILLED, LAWLESS, MOST, PINNED, QUIET, RUNNING, SPENT, Cell
from vibroimpact.kernels.closing import LONGEST
from vibroimpact.kernels.cycle import FACTS
from vibroimpact.kernels.flight import REACH
from vibroimpact.kernels.lanes import CELL, LANES, ROWS
from vibroimpact.kernels.recorder import (
    END,
    IDLE,
    MEMORY,
    Plan,
    Progress,
    Recorder,
    begin,
    record,
    record_lanes,
    state_of,
)
from vibroimpact.kernels.results import NOTES, PLAIN, THOROUGH
from vibroimpact.kernels.runner import SWINGING, follow_cell, run_cells, run_swings
from vibroimpact.kernels.shared.vectors import LANES as BLOCK
from vibroimpact.kernels.state import Constants, Motion
from vibroimpact.options import Tolerances
from vibroimpact.status import Status, window_status

_LOOKS = 500  # steps of a cell or of lanes, 3 to 300 ms, between checks for an interrupt
_BATCH = 4096  # finished cells per batch
FEW = 4  # cells: fewer are recorded one after another, since most lanes would be idle
LOOKED = MEMORY - len(Progress._fields) + Progress._fields.index("looked")  # places in the memory of a recorder
FIRST = MEMORY - len(Progress._fields) - len(Plan._fields) + Plan._fields.index("first_n")
ROOM = 4096  # rows of a buffer, which is emptied when full

Limits = tuple[float, float, float]


def limits(tolerances: Tolerances) -> Limits:
    """Return the tolerances in the order expected by the kernels."""
    return tolerances.chatter, tolerances.flight_periods, float(tolerances.steps_per_impact)


def expected_steps(cells: Cells, window: ImpactWindow) -> Floats:
    """Return the expected steps of all impacts, if each flight lasts the slower of the two periods."""
    impacts = window.transient + window.keep
    steps: Floats = impacts * 2.0 * math.pi / REACH * cells.fastest_rate / cells.slowest_rate
    return steps


def outlast(cells: Cells, measurement: Measurement) -> bool:
    """Return whether all cells are expected to need more steps than the limit for stiff cells."""
    window = measurement.impacts
    granted = measurement.tolerances.steps_per_impact * (window.transient + window.keep)
    return bool(expected_steps(cells, window).min() >= max(MOST, granted))


def rows_of(cells: Cells) -> Floats:
    """Return the table of cells for the kernels; its columns must be those of a `Cell`, in that order."""
    if cells.columns != Cell._fields:
        raise ValueError(f"cells must have the columns {', '.join(Cell._fields)}, got {', '.join(cells.columns)}")
    return np.ascontiguousarray(cells.table)


def outcomes(results: Floats, ends: NDArray[np.int8], window: ImpactWindow) -> Outcome:
    """Return the outcome of cells, from the result columns of the lanes and why each cell ended."""
    full = ends == FILLED
    columns = dict(zip(THOROUGH, results.T, strict=False))
    indices = {
        name: np.where(full, columns[name], index.fill).astype(index.dtype)
        for name, index in INDICES.items()
        if name in columns
    }
    return indices | {
        "status": statuses(columns, ends, window),
        "impacts": columns["counted"].astype(np.int64),
        "steps": columns["steps"].astype(np.int64),
    }


def statuses(columns: dict[str, Floats], ends: NDArray[np.int8], window: ImpactWindow) -> NDArray[np.int8]:
    """Return the status of every cell, determined once per combination of ending and flags."""
    flags = np.stack(
        [columns["counted"] > 0.0, columns["sticks"] > 0.0, columns["span"] < 10.0, columns["added"] > 0.0],
        axis=1,
    )
    kinds, which = np.unique(ends.astype(np.int64) * 16 + flags @ (8, 4, 2, 1), return_inverse=True)
    decided = [_status(kind // 16, [bool(kind & bit) for bit in (8, 4, 2, 1)], window) for kind in kinds.tolist()]
    return np.array(decided, np.int8)[which]


def samples(cells: Cells, measurement: Measurement) -> list[Samples]:
    """Return the samples of each cell in the window."""
    runs = [_Run(row, measurement.window, limits(measurement.tolerances)) for row in rows_of(cells)]
    if len(runs) < FEW or isinstance(measurement.window, TimesWindow):
        for run in runs:
            run.record()
    else:
        _record_in_lanes(runs)
    return [run.samples() for run in runs]


def follow(cell: Cells, measurement: Measurement, sampling: Measurement) -> tuple[Outcome, Samples]:
    """Return the outcome of a sweep for one cell, and its samples in the window of `sampling`, from one run.

    Both agree bit for bit with those of two separate runs. The budgets may differ, but not `chatter`, on which the
    motion depends.
    """
    if sampling.tolerances.chatter != measurement.tolerances.chatter:
        raise ValueError(
            "`chatter` must be the same for measuring and recording one run, got "
            f"{measurement.tolerances.chatter:g} and {sampling.tolerances.chatter:g}"
        )
    sweep = Sweep(cell, measurement)
    run = _Run(sweep.cells[0], sampling.window, limits(sampling.tolerances))
    sweep.follow(run)
    run.record()
    return sweep.outcome(slice(None)), run.samples()


def _status(end: int, flags: list[bool], window: ImpactWindow) -> Status:
    hit, stuck, short, closed = flags
    return window_status(
        sampled=window.keep if end == FILLED else 0,
        wanted=window.keep,
        stuck=stuck,
        periods=0.0 if short else math.inf,
        ended=Status.CLOSED if closed else ended_as(end, hit),
    )


class Sweep:
    """Cells shared by threads, and their results."""

    def __init__(self, cells: Cells, measurement: Measurement, ahead: Floats | None = None) -> None:
        self.measurement, self.thorough = measurement, measurement.thorough
        self.ahead = np.zeros(len(cells)) if ahead is None else ahead  # of the requested phase
        self.cells = rows_of(cells)
        self.results = np.zeros((len(cells), len(THOROUGH if self.thorough else PLAIN)))
        self.ends = np.zeros(len(cells), dtype=np.int8)
        self.finals = np.zeros((len(cells), CELL if measurement.swings else 0))
        self._tickets = np.zeros(1, dtype=np.int64)
        self.window = window = measurement.impacts
        total = float(window.transient + window.keep)
        self._how = float(window.transient), total, *limits(measurement.tolerances), measurement.early_closing, _LOOKS

    def finished(self, stopped: Callable[[], bool]) -> Iterator[Counts]:
        """Step the calling thread's own lanes; yield finished cells in batches."""
        seat, facts = _seat(len(self.cells)), self._facts()
        ended = np.empty(_BATCH, dtype=np.int64)
        busy = 1
        while busy and not stopped():
            number, busy = run_cells(
                self.cells, self.results, self.finals, self.ends, self._tickets, seat, ended, *self._how, facts
            )
            if number:
                yield ended[:number].copy()

    def outcome(self, done: Counts | slice) -> Outcome:
        """Return the outcome of cells that have ended."""
        outcome = outcomes(self.results[done], self.ends[done], self.window)
        if self.thorough:
            columns, full = dict(zip(THOROUGH, self.results[done].T, strict=True)), self.ends[done] == FILLED
            outcome["first_stop"] = np.where(full, 0, -1)
            outcome["first_phase"] = (columns["first_phase"] - self.ahead[done]) % 1.0
            outcome["first_velocity"] = columns["first_velocity"]
            outcome["struck"] = full.astype(np.int64)
        return with_stop_axis(outcome, self.measurement)

    def states(self, done: Counts) -> tuple[Floats, Floats, Floats]:
        """Return clearances, velocities and times in periods of the load at which cells have ended."""
        u, p, sine, cosine, periods = self.finals[done, : len(Motion._fields)].T
        rates = Cell(*self.cells[done].T).omega / self.finals[done, len(Motion._fields) + Constants._fields.index("th")]
        return u, -p * rates, periods + np.arctan2(sine, cosine) / (2.0 * math.pi) % 1.0 - self.ahead[done]

    def swings(self, done: Counts, status: Counts, stopped: Callable[[], bool]) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the sums of how far cells swing, and which of them have some: those without are not followed."""
        # The longest motions first, so that lanes end together, and beside each other those with flights as long.
        cell: Any = Cell(*self.cells[done].T)
        which = np.lexsort((cell.omega**2 * cell.mass / cell.stiffness, status))
        which = which[: np.count_nonzero(status <= Status.SHORT_WINDOW)]
        sums, ends, tickets = np.zeros((len(which), 7)), np.zeros(len(which), np.int8), np.zeros(1, np.int64)
        memory, owner, busy = aligned((SWINGING + 1) * LANES), np.full(BLOCK, -1), 1
        while busy and not stopped():
            busy = run_swings(self.finals, done[which], sums, ends, tickets, memory, owner, _LOOKS)
        complete, full = np.zeros(len(done), bool), ends == FILLED
        complete[which] = full
        return sums[full][np.argsort(which[full])].T, complete

    def follow(self, run: _Run) -> None:
        """Measure the only cell, and record its run up to the same point or to its end."""
        seat, facts, recorder = _seat(len(self.cells)), self._facts(), Recorder(run.memory, *_room_for(run.window))
        while self.ends[0] == RUNNING:
            follow_cell(self.cells, self.results, self.ends, seat, *self._how, facts, recorder)
            run.keep(recorder)

    def _facts(self) -> Floats | None:
        return np.zeros((LANES, FACTS)) if self.thorough else None


def _seat(cells: int) -> tuple[NDArray[Any], ...]:
    """Return the arrays of a thread: lanes, the cell in each (-1: none), notes, workspaces for cycles.

    If there are few cells, a thread takes only one block and leaves the others to other threads.
    """
    owner, notes = np.full(LANES if cells >= 2 * LANES else BLOCK, -1), np.zeros((LANES, NOTES))
    return aligned(ROWS * LANES), owner, notes, np.zeros((LONGEST, 4)), np.zeros((LOOK, TRACE))


class _Run:
    """A cell, its recorder's buffers, and its record so far."""

    def __init__(self, row: Floats, window: Window, limits: Limits) -> None:
        self.cell, self.window = Cell(*row.tolist()), window
        self.look_periods = self.look_phase = np.zeros(1)
        if isinstance(window, ImpactWindow):
            numbers = float(window.transient), float(window.transient + window.keep), 0.0, 1.0
        else:
            numbers = (0.0, 0.0, 1.0, 1.0)
            if not isinstance(window, TimesWindow):
                numbers = 0.0, 0.0, float(window.keep), float(window.per_period)
            self.look_periods, self.look_phase = window.schedule(self.cell.periods, self.cell.phase)
        first = -1 if isinstance(window, TimesWindow) else 0  # the step limit follows from the only look of a plan
        self.memory = np.zeros(MEMORY)
        begin(row, self.memory, numbers, (self.look_periods[first], self.look_phase[first]), limits)
        self.parts: list[list[Floats]] = []

    def keep(self, recorder: Recorder) -> None:
        """Empty the buffers."""
        buffers = recorder.impacts, recorder.looks, recorder.sticks
        if recorder.filled.any() or not self.parts:
            self.parts.append([rows[:number].copy() for rows, number in zip(buffers, recorder.filled, strict=True)])
        recorder.filled[:] = 0

    def record(self) -> None:
        """Record the rest of the run."""
        recorder, trace = Recorder(self.memory, *_room_for(self.window)), np.empty((LOOK, TRACE))
        plans = range(self.window.keep) if isinstance(self.window, TimesWindow) else (None,)
        for at in plans:
            if at is not None:
                self._aim(at)
            while self.memory[END] == RUNNING:
                record(recorder, trace, _LOOKS)
                if self.memory[END] == RUNNING:
                    self.keep(recorder)
            if self.memory[END] != FILLED:
                break
        self.keep(recorder)

    def _aim(self, at: int) -> None:
        """Go on to a look: a filled plan ends before the step on which its last look lies."""
        self.memory[FIRST : FIRST + 2] = self.look_periods[at], self.look_phase[at]
        self.memory[LOOKED], self.memory[END] = 0.0, RUNNING

    def samples(self) -> Samples:
        """Return the samples and release their memory."""
        parts, self.parts = self.parts, []
        impacts, looks, sticks = (np.concatenate(part) for part in zip(*parts, strict=True))
        begins = np.diff(sticks[:, :2], axis=0).any(axis=1)  # a look within a rest ends a plan, and lists it again
        sticks = sticks[np.append(begins, True)[: len(sticks)]]
        last, progress = state_of(self.memory)
        status = ended_as(progress.end, progress.hits)
        if isinstance(self.window, ImpactWindow):
            status = impacts_status(impacts, sticks, self.window, status)
        else:
            if len(looks) == self.window.keep:
                pressed = self.cell.stiffness * self.cell.gap <= -self.cell.amplitude
                status = looks_status(sticks, self.look_periods[0] + self.look_phase[0], pressed)
            last = (math.nan,) * 4
            if len(looks):
                at = len(looks) - 1
                last = (looks[at, 0], looks[at, 1], self.look_periods[at], self.look_phase[at])
        times = self.look_periods[: len(looks)], self.look_phase[: len(looks)]
        looked = np.column_stack([*times, self.cell.gap - looks[:, 0], looks[:, 1]])
        design, steps = self.cell._asdict(), int(progress.steps)
        return Samples.of_one_mass(
            design, impacts=impacts, looks=looked, sticks=sticks, status=status, last=last, steps=steps
        )


def aligned(size: int) -> Floats:
    """Return zeros aligned to a cache line: lanes that straddle two lines are about 4 % slower."""
    room = np.zeros(size + 7)
    first = -room.ctypes.data % 64 // 8
    return room[first : first + size]


def _room_for(window: Window, *lanes: int) -> tuple[Floats, Floats, Floats, Counts]:
    """Return buffers for impacts, all looks and sticks, and the number of rows filled in each."""
    impacts, looks = (min(ROOM, window.keep + LOOK + 1), 1) if isinstance(window, ImpactWindow) else (ROOM, window.keep)
    rooms = [np.empty((*lanes, *room)) for room in ((impacts, 3), (looks, 2), (ROOM, 4))]
    return rooms[0], rooms[1], rooms[2], np.zeros((*lanes, 3), np.int64)


def _record_in_lanes(runs: list[_Run]) -> None:
    """Record the runs in lanes; a finished run is replaced by the next."""
    lanes, trace = aligned(CELL * LANES), np.zeros((LOOK, TRACE * LANES))
    recorder = Recorder(np.zeros((LANES, MEMORY)), *_room_for(runs[0].window, LANES))
    recorder.memory[:, END] = IDLE
    rooms = recorder.impacts.shape[1], recorder.looks.shape[1], recorder.sticks.shape[1]
    waiting = iter(runs)
    seated: dict[int, _Run] = {}
    while True:
        for lane in sorted(set(range(LANES)) - set(seated)):
            run = next(waiting, None)
            if run is None:
                break
            seated[lane], recorder.memory[lane] = run, run.memory
        if not seated:
            return
        record_lanes(lanes, trace, recorder, _LOOKS)
        halted = (recorder.memory[:, END] != RUNNING) | (recorder.filled == rooms).any(axis=1)
        for lane, run in [(lane, run) for lane, run in seated.items() if halted[lane]]:
            run.keep(Recorder(*(part[lane] for part in recorder)))
            if recorder.memory[lane, END] != RUNNING:
                run.memory = recorder.memory[lane].copy()
                del seated[lane]


def ended_as(end: int, impacts: float | bool) -> Status:
    """Return the status of a cell from the way it ended; `impacts` is 0 or False if it had none."""
    if end in (QUIET, DYING) and not impacts:
        return Status.NO_IMPACT
    return {
        QUIET: Status.STOPPED_IMPACTING,
        PINNED: Status.STUCK_FOREVER,
        DYING: Status.DECAYING,
        SPENT: Status.BUDGET,
        LAWLESS: Status.INVALID_RESTITUTION,
    }.get(end, Status.OK)
