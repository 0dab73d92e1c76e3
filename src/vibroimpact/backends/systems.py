"""The engine of systems: one cell with all that is seen of it, and many cells in lanes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from vibroimpact.backends.base import (
    Counts,
    Floats,
    ImpactWindow,
    Measurement,
    Outcome,
    SystemSamples,
)
from vibroimpact.backends.cpu import aligned, ended_as, statuses
from vibroimpact.indices import EVERY
from vibroimpact.kernels.cell import FILLED, MOST, RUNNING
from vibroimpact.kernels.systems import lanes, march, walk
from vibroimpact.kernels.systems.complementarity import Room
from vibroimpact.kernels.systems.layout import Layout, layout_of
from vibroimpact.kernels.systems.leap import HALF, WHOLE
from vibroimpact.kernels.systems.series import REACH
from vibroimpact.kernels.vectors import LANES
from vibroimpact.options import Tolerances
from vibroimpact.status import Status, window_status
from vibroimpact.system_cells import SystemCells

_LOOKS = 200  # at lanes, before Python asks whether to stop
_STEPS = 1 << 14  # of one cell, as well
_TERMS = 30  # of a series over a leap: 2^31/31! is below rounding
_ROOM = 4096  # rows of a buffer, which is emptied when it is full

# By which power of a step's length a number is multiplied where time is counted in steps.
_POWERS = {
    "rate": 1,
    "square": 2,
    "damping": 1,
    "load": 2,
    "force": 2,
    "omega": 1,
    "scale": 1,
    "give": -2,
    "spring": 2,
    "dashpot": 1,
}
_RENAMED = {"omega": "theta", "scale": "cut"}


def _steps(cells: SystemCells) -> Floats:
    """Return the length of a step of every cell in s."""
    return REACH / cells.fastest_rate


def _layout(cells: SystemCells, thorough: bool = False, wary: bool = False, forceful: bool = False) -> Layout:
    shape = cells.shape
    given = shape.modes, shape.stops, shape.harmonics, shape.coupled, shape.moving
    return layout_of(*given, thorough, wary, shape.giving, forceful)


def _in_steps(cells: SystemCells, chatter: float, layout: Layout) -> Floats:
    """Return the engine's rows of every cell, time counted in steps, with the cut at that part of V."""
    step = _steps(cells)[:, None]
    table = np.zeros((len(cells), layout.constants))
    for name, size in cells.shape.sizes.items():
        first = getattr(layout, _RENAMED.get(name, name), None)
        if first is not None:
            table[:, first : first + size] = cells.block(name) * step ** _POWERS.get(name, 0)
    _prepare_leaps(cells, layout, table)
    s, grip = layout.stops, np.einsum("ijk,ijk->ij", *(_by_stop(cells, name) for name in ("alpha", "jump")))
    table[:, layout.hard : layout.hard + s] = table[:, layout.spring : layout.spring + s] * grip / REACH**2
    table[:, layout.thick : layout.thick + s] = table[:, layout.dashpot : layout.dashpot + s] * grip / REACH
    table[:, layout.speed] = table[:, layout.cut]
    table[:, layout.cut] *= chatter
    return table


def _by_stop(cells: SystemCells, name: str) -> Floats:
    return cells.block(name).reshape(len(cells), cells.shape.stops, cells.shape.modes)


def _prepare_leaps(cells: SystemCells, k: Layout, table: Floats) -> None:
    """Leave the flows of leaps, and bounds of loads and of the stops' accelerations."""
    n, s, m, number = k.modes, k.stops, k.harmonics, len(cells)
    square, damping = table[:, k.square : k.square + n], table[:, k.damping : k.damping + n * n : n + 1]
    load, theta = table[:, k.load : k.load + n], table[:, k.theta, None]
    force = table[:, k.force : k.force + 2 * m * n].reshape(number, n, m, 2)
    motion = table[:, k.motion : k.motion + 2 * m * s].reshape(number, s, m, 2)
    turned = np.arange(1, m + 1) * theta
    size, swing = np.hypot(force[..., 0], force[..., 1]), np.hypot(motion[..., 0], motion[..., 1])
    bounds = (np.abs(load) + size.sum(axis=-1), *((part * turned[:, None] ** 2).sum(axis=-1) for part in (size, swing)))
    table[:, k.driven : k.driven + 2 * n + s] = np.hstack(bounds)
    coupled = np.count_nonzero(table[:, k.damping : k.damping + n * n], axis=1) > np.count_nonzero(damping, axis=1)
    zero, one = np.zeros((number, n)), np.ones((number, n))
    for first, length in ((k.halves, HALF), (k.wholes, WHOLE)):
        room = np.where(coupled[:, None], 0.0, 1.0 - square * length**2 / 8.0 - damping * length / 2.0)
        own = [*_over(one, zero, square, damping, length), *_over(zero, one, square, damping, length)]
        loaded = _over(zero, zero, square, damping, length, load, zero, 0.0)
        bound = np.where(room > 0.0, 1.0 / np.where(room > 0.0, room, 1.0), np.inf)
        columns = [own[0], own[2], loaded[0], own[1], own[3], loaded[1], bound]
        for order in range(m):
            rate, (re, im) = turned[:, order, None], np.moveaxis(force[:, :, order], -1, 0)
            sine = _over(zero, zero, square, damping, length, re, -im * rate, rate)
            cosine = _over(zero, zero, square, damping, length, im, re * rate, rate)
            columns += [sine[0], cosine[0], sine[1], cosine[1]]
        flat = np.stack(columns, axis=-1).reshape(number, -1)
        table[:, first : first + flat.shape[1]] = flat
        angle = length * theta[:, 0]
        table[:, first + flat.shape[1]], table[:, first + flat.shape[1] + 1] = np.sin(angle), np.cos(angle)


def _over(
    y: Floats, p: Floats, square: Floats, damping: Floats, x: float, force: Any = 0.0, slope: Any = 0.0, rate: Any = 0.0
) -> tuple[Floats, Floats]:
    """Return amplitude and rate after x steps, by the power series, under a force that turns at a rate."""
    b = [y, p]
    for _ in range(_TERMS - 1):
        b.append(force - square * b[-2] - damping * b[-1])
        force, slope = slope, -(rate**2) * force
    powers = [x**order / math.factorial(order) for order in range(_TERMS + 1)]
    amplitude, moved = 0.0 * y, 0.0 * y
    for order in range(_TERMS, 0, -1):
        amplitude, moved = amplitude + powers[order] * b[order], moved + powers[order - 1] * b[order]
    return amplitude + b[0], moved


def _budgets(cells: SystemCells, tolerances: Tolerances, total: float) -> Floats:
    """Return the step, the longest flight in steps and the steps granted of every cell."""
    step, slowest = _steps(cells), cells.slowest_rate
    longest = tolerances.flight_periods * 2.0 * math.pi / (slowest * step)
    granted = tolerances.steps_per_impact * total
    most = np.maximum(granted, np.minimum(granted * cells.fastest_rate / slowest, MOST))
    return np.column_stack([step, longest, most])


def _noted(layout: Layout) -> int:
    """Return the length of a cell's note."""
    return march.SUMS + march.EACH * (layout.stops + 1)


def _turns(sine: Floats, cosine: Floats, periods: Floats) -> Floats:
    """Return times in periods."""
    return periods + np.arctan2(sine, cosine) / march.TURN % 1.0


def _room(layout: Layout) -> Room:
    s = max(layout.stops, 1)
    return Room(
        np.zeros((s, s)),
        np.zeros((s, s + 1)),
        *(np.zeros(s) for _ in range(6)),
        *(np.zeros(layout.modes) for _ in range(3)),
    )


def samples(cells: SystemCells, measurement: Measurement) -> list[SystemSamples]:
    """Return what the window sees of each cell."""
    return [_sampled(cells[i : i + 1], measurement) for i in range(len(cells))]


def _sampled(cell: SystemCells, measurement: Measurement) -> SystemSamples:
    k, window = _layout(cell, forceful=cell.shape.giving), measurement.window
    start_periods, start_phase = cell.block("time")[0].tolist()
    if isinstance(window, ImpactWindow):
        total, wanted = march.Window(float(window.transient), float(window.transient + window.keep)), 0
        times = np.zeros((2, 0))
        schedule = walk.Schedule(0.0, 0.0, 0.0, 1.0)
    else:
        total, wanted = march.Window(0.0, math.inf), window.keep
        times = np.array(window.schedule(start_periods, start_phase))
        schedule = walk.Schedule(float(wanted), times[0, 0], times[1, 0], float(window.per_period))
    rows, spare, note, room = np.zeros(k.rows), np.zeros(k.rows), np.zeros(_noted(k)), _room(k)
    limit = total.total if isinstance(window, ImpactWindow) else window.skip_periods + wanted / window.per_period + 1.0
    note[: march.MADE] = _budgets(cell, measurement.tolerances, limit)
    seen = walk.Seen(
        np.zeros((_ROOM, 10)), np.zeros((wanted, 2 * k.modes)), np.zeros((_ROOM, 5)), np.zeros(3, np.int64)
    )
    walk.seat(rows, k, _in_steps(cell, measurement.tolerances.chatter, k)[0], room, seen)
    impacts: list[Floats] = []
    rests, end = [], RUNNING
    while end == RUNNING:
        end = walk.follow(rows, spare, k, room, note, seen, total, schedule, _STEPS)
        _take_impacts(impacts, seen, rows[k.entry : k.entry + k.stops], end != RUNNING)
        if seen.filled[2] + k.stops > _ROOM:  # those still closed stay
            done = seen.rests[: seen.filled[2]]
            open_ones = done[np.isnan(done[:, 3])]
            rests.append(done[~np.isnan(done[:, 3])].copy())
            seen.rests[: len(open_ones)] = open_ones
            seen.filled[2] = len(open_ones)
    rests.append(seen.rests[: seen.filled[2]])
    state = rows[k.eta : k.eta + k.modes], rows[k.rate : k.rate + k.modes], march.moment(*rows[k.turn : k.turn + 3])[1]
    found = np.concatenate(impacts), np.concatenate(rests)
    return _labelled(cell, window, *found, times, seen, end, note, state)


def _take_impacts(impacts: list[Floats], seen: walk.Seen, entries: Floats, ended: bool) -> None:
    """Move rows of impacts out of their buffer, but for those from the first contact on that still goes on."""
    number = int(seen.filled[0])
    goes_on = np.flatnonzero(np.isnan(seen.impacts[:number, 4]))
    taken = int(goes_on[0]) if len(goes_on) and not ended else number
    impacts.append(seen.impacts[:taken].copy())
    seen.impacts[: number - taken] = seen.impacts[taken:number].copy()
    seen.filled[0] -= taken
    entries[:] = np.maximum(entries - taken, 0.0)


def _labelled(
    cell: SystemCells,
    window: Any,
    impacts: Floats,
    rests: Floats,
    times: Floats,
    seen: walk.Seen,
    end: int,
    note: Floats,
    state: tuple[Floats, Floats, float],
) -> SystemSamples:
    n, h, shapes = cell.shape.modes, float(_steps(cell)[0]), cell.shapes[0]
    looks = seen.looks[: seen.filled[1]]
    if isinstance(window, ImpactWindow):
        turns, filled = impacts[:, 0] + impacts[:, 1], len(impacts) == window.keep
        first, last = (turns[0], turns[-1] if filled else math.inf) if len(turns) else (math.inf, -math.inf)
        later = np.isnan(rests[:, 3]) | (rests[:, 3] + rests[:, 4] > first)
        rests = rests[later & (rests[:, 1] + rests[:, 2] < last)]
        span = float(turns[-1] - turns[0]) if len(turns) else 0.0
        ended = ended_as(end, bool(note[march.HITS]))
        status = window_status(
            sampled=len(impacts), wanted=window.keep, stuck=len(rests) > 0, periods=span, ended=ended
        )
    else:
        last = times[0, -1] + times[1, -1]  # the step that passes the last look may end at an impact
        impacts = impacts[impacts[:, 0] + impacts[:, 1] <= last]
        rests = rests[rests[:, 1] + rests[:, 2] <= last]
        rests[rests[:, 3] + rests[:, 4] > last, 3:] = math.nan
        released = rests[:, 3] + rests[:, 4]
        first = times[0, 0] + times[1, 0]
        stuck = bool((np.isnan(released) | (released > first)).any())
        status = (
            ended_as(end, bool(note[march.HITS]))
            if len(looks) < window.keep
            else Status.STICKING
            if stuck
            else Status.OK
        )
    return SystemSamples(
        impact_periods=impacts[:, 0],
        impact_phase=impacts[:, 1],
        impact_stop=impacts[:, 2].astype(np.int64),
        impact_velocity=impacts[:, 3] / h,
        impact_impulse=impacts[:, 4] / h,
        impact_energy=impacts[:, 9] / h**2,
        impact_simultaneous=impacts[:, 5] > 0.0,
        impact_force=impacts[:, 6] / h**2,
        impact_duration=impacts[:, 7] * h,
        impact_depth=impacts[:, 8],
        look_periods=times[0, : len(looks)],
        look_phase=times[1, : len(looks)],
        look_displacement=looks[:, :n] @ shapes.T,
        look_velocity=looks[:, n:] @ shapes.T / h,
        rest_stop=rests[:, 0].astype(np.int64),
        rest_begin=rests[:, 1:3],
        rest_end=rests[:, 3:5],
        status=int(status),
        steps=int(note[march.MADE]),
        last_displacement=shapes @ state[0],
        last_velocity=shapes @ state[1] / h,
        last_phase=state[2],
    )


def indices(cells: SystemCells, measurement: Measurement) -> Outcome:
    """Return the indices, the status, the impacts computed and the certified steps of each cell."""
    sweep = SystemSweep(cells, measurement)
    for _ in sweep.finished(lambda: False):
        pass
    return sweep.outcome(slice(None))


def share(
    cells: SystemCells, measurement: Measurement
) -> Callable[[Callable[[], bool]], Iterator[tuple[Counts, Outcome]]]:
    """Return the work of a thread: cell after cell into its own lanes, until none is left."""
    sweep = SystemSweep(cells, measurement)

    def work(stopped: Callable[[], bool]) -> Iterator[tuple[Counts, Outcome]]:
        for done in sweep.finished(stopped):
            yield done, sweep.outcome(done)

    return work


class SystemSweep:
    """Cells that threads share, and what has become of them."""

    def __init__(self, cells: SystemCells, measurement: Measurement) -> None:
        window = measurement.impacts
        forceful = not {"mean_force", "max_force"}.isdisjoint(measurement.indices)
        self.layout = _layout(cells, measurement.thorough, "grazing_margin" in measurement.indices, forceful)
        self.window, self.by_stop = window, measurement.by_stop
        self.total = march.Window(float(window.transient), float(window.transient + window.keep))
        self.table = _in_steps(cells, measurement.tolerances.chatter, self.layout)
        self.omega = cells["omega"]
        self.gives: Any = (cells.block("spring") > 0.0).any(axis=0)
        self.budgets = _budgets(cells, measurement.tolerances, self.total.total)
        self.results, self.ends = np.zeros((len(cells), _noted(self.layout))), np.zeros(len(cells), np.int8)
        self._tickets = np.zeros(1, np.int64)

    def finished(self, stopped: Callable[[], bool]) -> Iterator[Counts]:
        """Step lanes of their own for the calling thread; yield the cells that ended, a batch at a time."""
        k = self.layout
        memory, notes, owner = aligned(k.rows * LANES), aligned(_noted(k) * LANES), np.full(LANES, -1)
        rows, note, room = np.zeros(k.rows), np.zeros(_noted(k)), _room(k)
        ended, busy = np.empty(4096, np.int64), 1
        while busy and not stopped():
            number, busy = lanes.run_lanes(
                self.table, self.budgets, self.results, self.ends, self._tickets, memory, owner, notes, ended, rows,
                note, k, room, self.total, _LOOKS,
            )  # fmt: skip
            if number:
                yield ended[:number].copy()

    def _forces(self, sums: Floats, dissipation: Any, seconds: Any, h: Any, period: Any) -> dict[str, Any]:
        """Return what the stops' forces come to, over seconds and per period."""
        pushed = sums[march.THRUST] / h / seconds
        largest = np.where(self.gives[:, None], sums[march.PEAK] / h**2, np.nan)
        if not self.by_stop:
            pushed, largest = pushed.sum(axis=0), np.fmax.reduce(largest, axis=0, initial=np.nan)
        return {"mean_force": pushed, "max_force": largest, "work_rate": dissipation / period}

    def outcome(self, done: Counts | slice) -> Outcome:
        """Return what a back end promises of cells that have ended."""
        notes, ends = self.results[done].T, self.ends[done]
        full, h, kept = ends == FILLED, notes[march.H], float(self.window.keep)
        began, ended = (_turns(*notes[at : at + 3]) for at in (march.BEGAN, march.ENDED))
        span = ended - began
        sums = notes[march.SUMS :].reshape(self.layout.stops + 1, march.EACH, -1).swapaxes(0, 1)
        own = sums[:, :-1]
        with np.errstate(divide="ignore", invalid="ignore"):
            found = _of_impacts(own, notes[march.STOP], span, h, self.by_stop)
            period = 2.0 * math.pi / self.omega[done]
            found |= self._forces(own, found["dissipation"], span * period, h, period)
            if self.layout.thorough:
                found["lyapunov"] = notes[march.GREW] / (span * period)
                found["n_periods"], found["n_impacts"] = notes[march.PERIODS], notes[march.IMPACTS]
                found["lyapunov_per_impact"] = notes[march.GREW] / (kept - 1.0)
                misses = own[march.MISS]
                found["grazing_margin"] = misses if self.by_stop else misses.min(axis=0, initial=math.inf)
                since = ended - notes[march.SINCE] - notes[march.PHASE]
                cycle, rests = notes[march.PERIODS], own if self.by_stop else sums[:, -1]
                rested = np.where(cycle > 0.0, rests[march.RESTING], rests[march.LATEST] - rests[march.BEFORE])
                found["stick_fraction"] = rested / np.where(cycle > 0.0, cycle, since)
        columns = {
            name: np.where(full, values, EVERY[name].fill).T.astype(EVERY[name].dtype) for name, values in found.items()
        }
        counted = {
            "counted": notes[march.HITS],
            "sticks": notes[march.STICKS],
            "span": span,
            "known": np.zeros(len(ends)),
        }
        if self.layout.thorough and self.layout.stops:
            # The impact that is known is the first one kept where 2^k - 1 are left out.
            known = full & (notes[march.FROM] == self.window.transient + 1.0)
            stop = notes[march.AT].astype(np.int64)
            columns["first_stop"] = np.where(known, stop, -1)
            columns["first_phase"] = began % 1.0
            columns["first_velocity"] = own[march.FIRST, stop, np.arange(len(ends))] / h
        return columns | {
            "status": statuses(counted, ends, self.window),
            "impacts": notes[march.HITS].astype(np.int64),
            "steps": notes[march.MADE].astype(np.int64),
        }


def _of_impacts(sums: Floats, first: Floats, span: Floats, h: Floats, by_stop: bool) -> dict[str, Any]:
    """Return what follows from sums over the impacts of each stop, for each or for all; stops come first."""

    def over(values: Any) -> Any:
        return values if by_stop else values.sum(axis=0)

    count, struck = sums[march.COUNT], np.maximum(sums[march.COUNT], 1.0)
    offset = sums[march.SUM] / struck
    speed, variance = sums[march.FIRST] + offset, np.maximum(sums[march.SQUARES] / struck - offset**2, 0.0)
    largest, number = sums[march.LARGEST], over(count)
    mean = over(count * speed) / number
    later = over(count - (first == np.arange(len(count))[:, None]))
    return {
        "std": np.sqrt(over(count * (variance + (speed - mean) ** 2)) / number) / h,
        "mean_velocity": mean / h,
        "max_velocity": np.where(count > 0.0, largest, np.nan) / h if by_stop else largest.max(axis=0, initial=0.0) / h,
        "impacts_per_period": later / span,
        "dissipation": over(sums[march.ENERGY]) / h**2 / span,
        "impact_phase_spread": np.maximum(
            1.0 - np.hypot(*map(over, sums[march.COSINE : march.SINE + 1])) / number, 0.0
        ),
    }
