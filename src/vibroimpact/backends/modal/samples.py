"""Samples of the motions of systems, followed with one cell per lane and recorded impact by impact."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vibroimpact.backends.base import Floats, ImpactWindow, Measurement, Samples, looks_status, within_impacts
from vibroimpact.backends.modal.rows import budgets_of, in_steps, steps_of
from vibroimpact.backends.modal.sweep import alone_for, layout_for, noted, room_for
from vibroimpact.backends.scalar import aligned, ended_as
from vibroimpact.kernels.cell import RUNNING
from vibroimpact.kernels.shared.held import InMemory
from vibroimpact.kernels.shared.vectors import LANES
from vibroimpact.kernels.systems import march, walk
from vibroimpact.kernels.systems.elements import CLOSED
from vibroimpact.model.elements import Contact
from vibroimpact.model.system_cells import SystemCells
from vibroimpact.status import Status

_STEPS = 1 << 14  # steps of all lanes between checks for an interrupt
_OF_CONTACTS = [4, *range(6, walk.IMPACT)]  # what is known of an impact once its contact is over
# Periods or impacts, times modes squared: a shorter motion of a cell that is alone is followed in lanes, as maps are.
# Stepping it by itself is up to twice as fast, but takes seconds to compile.
_BRIEF = 1e5
_ROOM = 4096  # rows of a buffer, which is emptied when full


def samples(cells: SystemCells, measurement: Measurement) -> list[Samples]:
    """Return the samples of each cell in the window."""
    by_cell = dict(_Recorder(cells, measurement).finished())
    return [by_cell[at] for at in range(len(cells))]


class _Recorder:
    """Cells in lanes, and their records."""

    def __init__(self, cells: SystemCells, measurement: Measurement) -> None:
        self._cells, self._window = cells, measurement.window
        k = self._layout = layout_for(cells, forceful=cells.shape.compliant)
        self._table = in_steps(cells, measurement.tolerances.chatter, k)
        if isinstance(self._window, ImpactWindow):
            looks, limit = 0, float(self._window.transient + self._window.keep)
            self._total = march.Window(float(self._window.transient), limit)
        else:
            looks, limit = self._window.keep, self._window.length + 1.0
            self._total = march.Window(0.0, math.inf)
        self._budgets = budgets_of(cells, measurement.tolerances, limit)
        wide = min(max(len(cells), 1 + (limit * k.modes**2 < _BRIEF)), LANES)
        self._times = np.zeros((wide, 2, looks))
        self._schedule = walk.Schedule(float(looks), self._times)
        impacts, rests = np.zeros((wide, _ROOM, walk.IMPACT)), np.zeros((wide, _ROOM, 5))
        filled = np.zeros((wide, 3), np.int64)
        self._buffers = walk.Record(impacts, np.zeros((wide, looks, 2 * k.modes)), rests, filled)
        owner, ends = np.full(LANES, -1), np.full(LANES, walk.GOES_ON)
        before = np.zeros(k.fixed * LANES if looks else 0)
        notes, rows, spare = np.zeros((wide, noted(k))), np.zeros((wide, k.rows)), np.zeros(k.rows)
        self._busy = walk.Busy(aligned(k.rows * LANES), owner, notes, ends, before, rows, spare)
        self._rows = self._busy.lanes.reshape(-1, LANES)
        self._recorded: list[tuple[list[Floats], list[Floats]]] = [([], []) for _ in range(wide)]

    def finished(self) -> Iterator[tuple[int, Samples]]:
        """Yield the number and the samples of each cell when it ends."""
        k, owner, ends = self._layout, self._busy.owner, self._busy.ends
        waiting = iter(range(len(self._cells)))
        busy, layout, schedule = InMemory(self._busy), InMemory(k), InMemory(self._schedule)
        room, alone, buffers = InMemory(room_for(k)), InMemory(alone_for(k)), InMemory(self._buffers)

        def seat(lane: int) -> None:
            owner[lane] = cell = next(waiting, -1)
            if cell >= 0:
                self._prepare(lane, cell)
                walk.seat(busy, lane, layout, self._table[cell], room, buffers)

        for lane in range(len(self._times)):
            seat(lane)
        while (owner >= 0).any():
            walk.follow(busy, layout, room, buffers, self._total, schedule, _STEPS, alone)
            for lane in np.flatnonzero((owner >= 0) & (ends != walk.GOES_ON)).tolist():
                if self._empty(lane):
                    buffers = InMemory(self._buffers)
                if ends[lane] != RUNNING:
                    yield int(owner[lane]), self._labelled(lane)
                    seat(lane)
                ends[lane] = walk.GOES_ON

    def _prepare(self, lane: int, cell: int) -> None:
        """Begin the record of a lane at the initial time of its cell."""
        begins = self._cells.block("time")[cell].tolist()
        if not isinstance(self._window, ImpactWindow):
            self._times[lane] = self._window.schedule(*begins)
        self._busy.notes[lane] = 0.0
        self._busy.notes[lane, : march.STEPS] = self._budgets[cell]
        self._buffers.filled[lane] = 0
        self._recorded[lane] = [], []

    def _empty(self, lane: int) -> bool:
        """Empty a lane's buffers except for unfinished contacts; return whether a buffer had to grow."""
        k, (hits, rested) = self._layout, self._recorded[lane]
        impacts, _, rests, filled = (rows[lane] for rows in self._buffers)
        entries, ended = self._rows[k.entry : k.entry + k.stops, lane], self._busy.ends[lane] != RUNNING
        number, pushes = int(filled[0]), self._rows[k.kind : k.kind + k.stops, lane] >= CLOSED
        if ended:  # a contact that goes on after its stop let go is not over
            unfinished = entries[pushes & (entries > 0.0)].astype(int) - 1
            impacts[np.ix_(unfinished, _OF_CONTACTS)] = math.nan
        gone = number if ended else int(entries[entries > 0.0].min(initial=number + 1.0)) - 1
        hits.append(impacts[:gone].copy())
        impacts[: number - gone] = impacts[gone:number].copy()
        filled[0] -= gone
        entries[:] = np.maximum(entries - gone, 0.0)
        pending = rests[: filled[2]]
        over = np.isfinite(pending[:, 3]) | ended
        rested.append(pending[over])
        rests[: (~over).sum()] = pending[~over]
        filled[2] = (~over).sum()
        if 2 * filled[0] < len(impacts):
            return False
        self._buffers = self._buffers._replace(impacts=np.concatenate([self._buffers.impacts] * 2, axis=1))
        return True

    def _labelled(self, lane: int) -> Samples:
        """Return the samples of the cell in a lane, in SI units."""
        k, rows, note, times = self._layout, self._rows[:, lane], self._busy.notes[lane], self._times[lane]
        at = self._busy.owner[lane]
        cell = self._cells[at : at + 1]
        n, h, shapes = k.modes, float(steps_of(cell)[0]), cell.shapes[0]
        impacts, rests = map(np.concatenate, self._recorded[lane])
        looks = self._buffers.looks[lane, : self._buffers.filled[lane, 1]].copy()
        ended = ended_as(int(self._busy.ends[lane]), bool(note[march.HITS]))
        if isinstance(self._window, ImpactWindow):
            rests, status = within_impacts(impacts, rests, self._window, ended)
        else:
            step = h * cell["omega"][0] / (2.0 * math.pi)
            impacts, rests, status = _within_looks(impacts, rests, times.sum(axis=0), step, ended)
            status = ended if len(looks) < self._window.keep else status
        return Samples(
            impact_periods=impacts[:, 0],
            impact_phase=impacts[:, 1],
            impact_stop=impacts[:, 2].astype(np.int64),
            impact_velocity=impacts[:, 3] / h,
            impact_simultaneous=impacts[:, 5] > 0.0,
            contacts=Contact(
                impulse=impacts[:, 4] / h,
                contact_time=impacts[:, 7] * h,
                peak_force=impacts[:, 6] / h**2,
                penetration=impacts[:, 8],
                energy_lost=impacts[:, 9] / h**2,
                exit_velocity=impacts[:, 11] / h,
                exit_time=impacts[:, 10] * h,
                peak_force_time=impacts[:, 12] * h,
                penetration_time=impacts[:, 13] * h,
            ),
            look_periods=times[0, : len(looks)].copy(),
            look_phase=times[1, : len(looks)].copy(),
            look_displacement=looks[:, :n] @ shapes.T,
            look_velocity=looks[:, n:] @ shapes.T / h,
            rest_stop=rests[:, 0].astype(np.int64),
            rest_begin=rests[:, 1:3],
            rest_end=rests[:, 3:5],
            status=int(status),
            steps=int(note[march.STEPS]),
            last_displacement=shapes @ rows[k.eta : k.eta + n],
            last_velocity=shapes @ rows[k.rate : k.rate + n] / h,
            last_phase=march.moment.py_func(*rows[k.turn : k.turn + 3])[1],
        )


def _within_looks(
    impacts: Floats, rests: Floats, looks: Floats, step: float, ended: Status
) -> tuple[Floats, Floats, Status]:
    """Return the impacts and rests up to the last sample, and the status of a full window; `step` is in periods."""
    last = looks[-1]  # the step beyond it may end at an impact
    impacts = impacts[impacts[:, 0] + impacts[:, 1] <= last]
    over = impacts[:, 0] + impacts[:, 1] + impacts[:, 10] * step
    impacts[np.ix_(over > last, _OF_CONTACTS)] = math.nan  # an unfinished contact
    rests = rests[rests[:, 1] + rests[:, 2] <= last]
    rests[rests[:, 3] + rests[:, 4] > last, 3:] = math.nan
    return impacts, rests, looks_status(rests[:, 1:], looks[0], ended == Status.STUCK_FOREVER)
