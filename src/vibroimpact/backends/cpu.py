"""The `cpu` back end: certified steps in vectorised lanes for indices, in a single loop for samples."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import recorder
from vibroimpact.backends.base import Cells, Floats, ImpactWindow, Samples, StroboscopicWindow, look_schedule
from vibroimpact.backends.lane_runner import (
    COLUMNS,
    IMPACTS,
    KNOWN_WITHOUT,
    LARGEST,
    MEAN,
    RATE,
    SPAN,
    STD,
    STEPS,
    STICKS,
    run_cells,
)
from vibroimpact.kernels.cell import DYING, FILLED, PINNED, QUIET, RUNNING, SPENT
from vibroimpact.options import Tolerances
from vibroimpact.status import Status, window_status

_ROOM = 4096  # rows of a recorder's buffer that is not known to fill


def _ended(end: int, impacts: float) -> Status:
    if end in (QUIET, DYING) and not impacts:
        return Status.NO_IMPACT
    return {
        QUIET: Status.STOPPED_IMPACTING,
        PINNED: Status.STUCK_FOREVER,
        DYING: Status.DECAYING,
        SPENT: Status.BUDGET,
    }.get(end, Status.OK)


def table(cells: Cells) -> Floats:
    """Return the cells, one a row, as the kernels read them."""
    return np.ascontiguousarray(
        np.stack([getattr(cells, field.name) for field in fields(cells)], axis=1), dtype=np.float64
    )


def limits(tolerances: Tolerances) -> tuple[float, float, float]:
    """Return the tolerances in the order in which the kernels take them."""
    return tolerances.chatter, tolerances.flight_periods, float(tolerances.steps_per_impact)


def outcomes(results: Floats, ends: NDArray[np.int8], window: ImpactWindow) -> dict[str, NDArray[Any]]:
    """Return what a back end promises of cells, from the columns that lanes hand out and why each cell ended."""
    full = ends == FILLED
    columns = {"std": STD, "mean_velocity": MEAN, "max_velocity": LARGEST, "impacts_per_period": RATE}
    return {name: np.where(full, results[:, column], np.nan) for name, column in columns.items()} | {
        "status": np.array(
            [_status(end, row, window) for end, row in zip(ends.tolist(), results.tolist(), strict=True)], np.int8
        ),
        "impacts": results[:, IMPACTS].astype(np.int64),
        "steps": results[:, STEPS].astype(np.int64),
    }


class CpuBackend:
    """Exact flights, certified contacts, closed-form chatter on one core; threads may share tiles."""

    name = "cpu"
    smallest_tile = 64  # two rounds of lanes
    largest_tile = 4096

    def indices(
        self, cells: Cells, window: ImpactWindow, tolerances: Tolerances, early_closing: bool = True
    ) -> dict[str, NDArray[Any]]:
        """Return every index, the status, the impacts computed and the certified steps of each cell."""
        results = np.zeros((len(cells), COLUMNS))
        ends = np.zeros(len(cells), dtype=np.int8)
        total = float(window.transient + window.keep)
        run_cells(table(cells), results, ends, float(window.transient), total, *limits(tolerances), early_closing)
        return outcomes(results, ends, window)

    def samples(self, cells: Cells, window: ImpactWindow | StroboscopicWindow, tolerances: Tolerances) -> list[Samples]:
        """Return what the window sees of each cell, one after the other."""
        return [_record(row, window, tolerances) for row in table(cells)]


def create() -> CpuBackend:
    """Return the back end."""
    return CpuBackend()


def _record(row: Floats, window: ImpactWindow | StroboscopicWindow, tolerances: Tolerances) -> Samples:
    look_periods = look_phase = np.empty(0)
    first = (0.0, 0.0)
    if isinstance(window, ImpactWindow):
        transient, total, per_period, room = float(window.transient), window.transient + window.keep, 1, window.keep
    else:
        transient, total, per_period, room = 0.0, 0, window.per_period, _ROOM
        look_periods, look_phase = look_schedule(row[9], row[10], window)
        first = (look_periods[0], look_phase[0])
    number = len(look_periods)
    memory = np.zeros(recorder.MEMORY)
    recorder.begin(row, memory)
    parts: list[list[Floats]] = []
    end = RUNNING
    while end == RUNNING:
        buffers = np.empty((room, 3)), np.empty((max(number, 1), 2)), np.empty((_ROOM, 4))
        end, *filled = recorder.record(
            row, memory, *buffers, transient, float(total), *first, float(per_period), number, limits(tolerances)
        )
        parts.append([buffer[:rows] for buffer, rows in zip(buffers, filled, strict=True)])
    impacts, looks, sticks = (np.concatenate(part) for part in zip(*parts, strict=True))
    ended = _ended(end, memory[recorder.COUNT])
    if isinstance(window, ImpactWindow):
        turns = impacts[:, 0] + impacts[:, 1]
        span = turns[-1] - turns[0] if len(turns) else 0.0
        status = window_status(
            sampled=len(impacts), wanted=window.keep, stuck=len(sticks) > 0, periods=span, ended=ended
        )
        velocity, phase = recorder.place(row, memory)
        last = (memory[recorder.U], velocity, memory[recorder.N], phase)
    else:
        status = _looks_status(row, look_periods, look_phase, looks, sticks, ended)
        last = (looks[-1, 0], looks[-1, 1], look_periods[-1], look_phase[-1]) if len(looks) else (math.nan,) * 4
    return Samples(
        impact_periods=impacts[:, 0],
        impact_phase=impacts[:, 1],
        impact_velocity=impacts[:, 2],
        look_periods=look_periods[: len(looks)],
        look_phase=look_phase[: len(looks)],
        look_displacement=row[6] - looks[:, 0],
        look_velocity=looks[:, 1],
        stick_periods=sticks[:, 0],
        stick_phase=sticks[:, 1],
        release_periods=sticks[:, 2],
        release_phase=sticks[:, 3],
        status=int(status),
        last_clearance=last[0],
        last_velocity=last[1],
        last_periods=last[2],
        last_phase=last[3],
        steps=int(memory[recorder.STEPS]),
    )


def _looks_status(row: Floats, periods: Floats, phase: Floats, looks: Floats, sticks: Floats, ended: Status) -> Status:
    if len(looks) < len(periods):
        return ended
    pressed_for_ever = row[2] * row[6] <= -row[3]
    released = sticks[:, 2] + sticks[:, 3]
    if len(sticks) and np.isnan(released[-1]) and pressed_for_ever:
        return Status.STUCK_FOREVER
    within = np.isnan(released) | (released > periods[0] + phase[0])
    return Status.STICKING if within.any() else Status.OK


def _status(end: int, row: list[float], window: ImpactWindow) -> Status:
    return window_status(
        sampled=window.keep if end == FILLED else 0,
        wanted=window.keep,
        stuck=row[STICKS] > 0.0,
        periods=row[SPAN],
        ended=Status.CLOSED if row[KNOWN_WITHOUT] else _ended(end, row[IMPACTS]),
    )
