"""What a window sees of cells: a few of them one after the other, many side by side in lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import Floats, ImpactWindow, Samples, StroboscopicWindow, look_schedule
from vibroimpact.backends.sampled import samples_of
from vibroimpact.kernels import recorder
from vibroimpact.kernels.cell import DYING, PINNED, QUIET, RUNNING, SPENT
from vibroimpact.kernels.lanes import LANES, TRACED_ROWS
from vibroimpact.kernels.recorder import IDLE, record_lanes
from vibroimpact.kernels.runner import LOOK
from vibroimpact.kernels.walk import TRACE
from vibroimpact.status import Status, window_status

Window = ImpactWindow | StroboscopicWindow
Limits = tuple[float, float, float]
Seen = tuple[Floats, Floats, Floats]  # rows of impacts, looks and sticks

FEW = 4  # cells, recorded sooner one after the other than in lanes most of which stand idle
ROOM = 4096  # rows of a buffer, which is emptied when it is full


def sample(table: Floats, window: Window, limits: Limits) -> list[Samples]:
    """Return what the window sees of each cell, one a row of the table."""
    runs = [_Run.begun(row, window, limits) for row in table]
    record = _one_by_one if len(runs) < FEW else _in_lanes
    record(runs, _numbers(window))
    return [run.samples() for run in runs]


@dataclass
class _Run:
    """A cell, its recorder's memory, and what was seen of it so far."""

    cell: Floats
    window: Window
    look_periods: Floats
    look_phase: Floats
    memory: Floats
    end: int = RUNNING
    parts: list[Seen] = field(default_factory=list)

    @classmethod
    def begun(cls, cell: Floats, window: Window, limits: Limits) -> _Run:
        """Return a run at its start."""
        periods = phase = np.zeros(1)
        if isinstance(window, StroboscopicWindow):
            periods, phase = look_schedule(cell[9], cell[10], window)
        memory = np.zeros(recorder.MEMORY)
        recorder.begin(cell, memory, _numbers(window), (periods[0], phase[0]), limits)
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
        looked = np.column_stack([*times, self.cell[6] - looks[:, 0], looks[:, 1]])
        steps = int(self.memory[recorder.STEPS])
        return samples_of(impacts=impacts, looks=looked, sticks=sticks, status=status, last=last, steps=steps)

    def _looks_status(self, looks: Floats, sticks: Floats, ended: Status) -> Status:
        if len(looks) < len(self.look_periods):
            return ended
        pressed_for_ever = self.cell[2] * self.cell[6] <= -self.cell[3]
        released = sticks[:, 2] + sticks[:, 3]
        if len(sticks) and np.isnan(released[-1]) and pressed_for_ever:
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
    transient, total, looks, _ = window
    impacts = ROOM if looks else min(ROOM, int(total - transient) + 1)
    return np.empty((*lanes, impacts, 3)), np.empty((*lanes, max(int(looks), 1), 2)), np.empty((*lanes, ROOM, 4))


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
    """Return the status of a cell that ended so; `impacts` tells whether it had any."""
    if end in (QUIET, DYING) and not impacts:
        return Status.NO_IMPACT
    return {
        QUIET: Status.STOPPED_IMPACTING,
        PINNED: Status.STUCK_FOREVER,
        DYING: Status.DECAYING,
        SPENT: Status.BUDGET,
    }.get(end, Status.OK)
