"""The engine of systems for indices: many cells in lanes."""

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
)
from vibroimpact.backends.modal.leaps import slow_modes
from vibroimpact.backends.modal.rows import budgets_of, in_steps, steps_of
from vibroimpact.backends.scalar import aligned, statuses
from vibroimpact.indices import EVERY
from vibroimpact.kernels.cell import FILLED
from vibroimpact.kernels.shared.complementarity import Room
from vibroimpact.kernels.shared.held import InMemory
from vibroimpact.kernels.shared.vectors import LANES
from vibroimpact.kernels.systems import closing, form, lanes, march
from vibroimpact.kernels.systems.layout import Layout, layout_of
from vibroimpact.model.system_cells import SystemCells

_LOOKS = 200  # steps of lanes between checks for an interrupt


def layout_for(cells: SystemCells, **observed: bool) -> Layout:
    """Return the layout of the rows of cells of which so much is observed (`layout_of`)."""
    shape, step, n = cells.shape, steps_of(cells)[:, None], cells.shape.modes
    damping = (step * cells.block("damping")).reshape(-1, n, n)
    slow = slow_modes(step**2 * cells.block("square"), damping, step * cells.block("omega"))
    free = bool(cells.block("neutral").any())
    return layout_of(shape, bool(slow.any()), free, **observed)


def noted(layout: Layout) -> int:
    """Return the length of a cell's note."""
    length: int = march.SUMS + march.EACH * (layout.stops + 1)
    return length


def _turns(sine: Floats, cosine: Floats, periods: Floats) -> Floats:
    """Return times in periods."""
    return periods + np.arctan2(sine, cosine) / (2.0 * math.pi) % 1.0


def room_for(layout: Layout) -> Room:
    """Return the workspace of one cell."""
    n, s, parts = layout.modes, max(layout.stops, 1), 1 + 2 * layout.harmonics
    by_axis: list[Any] = [*[(n, n)] * 4, *[n] * 5, *[(parts, n)] * 3, *[(s, n)] * 2, (s, parts), *[n] * 3]
    of_phase = form.Form(*map(np.zeros, [*by_axis, (2 * n, 2 * n + 1)]))
    of_stops: list[Any] = [(s, s), (s, s + 1), *[s] * 7, *[n] * 3, *[s] * 2]
    return Room(*[*map(np.zeros, of_stops), of_phase])


def alone_for(layout: Layout) -> closing.Alone:
    """Return the workspace in which a cycle is followed."""
    k, size = layout._replace(thorough=True, wary=False, forceful=False, draining=False), 2 * layout.modes
    lanes, notes, note = aligned(k.rows * LANES), aligned(noted(k) * LANES), np.zeros(noted(k))
    (start, end), matrices, (d, moved) = np.zeros((2, k.rows)), np.zeros((3, size, size)), np.zeros((2, size))
    return closing.Alone(k, lanes, notes, start, end, note, matrices[0], matrices[1], matrices[2], d, moved)


class SystemSweep:
    """Cells shared by threads, and their results."""

    def __init__(self, cells: SystemCells, measurement: Measurement) -> None:
        window = measurement.impacts
        indices = frozenset(measurement.indices)
        of_forces = {"mean_force", "max_force", *(("dissipation", "work_rate") if cells.shape.compliant else ())}
        self.layout = layout_for(
            cells,
            thorough=measurement.thorough,
            wary="grazing_margin" in indices,
            forceful=bool(indices & of_forces),
            draining="damper_rate" in indices,
        )
        self.window, self.by_stop = window, measurement.by_stop
        bounds = float(window.transient), float(window.transient + window.keep)
        self.total = march.Window(*bounds, measurement.early_closing)
        self.table = in_steps(cells, measurement.tolerances.chatter, self.layout)
        self.omega = cells["omega"]
        self.compliant: Any = (~cells.bars).any(axis=0)
        self.budgets = budgets_of(cells, measurement.tolerances, self.total.total)
        self.results, self.ends = np.zeros((len(cells), noted(self.layout))), np.zeros(len(cells), np.int8)
        self.cells = cells
        self._finals = np.zeros((len(cells), 2 * self.layout.modes + 3 if measurement.swings else 0))
        self._tickets = np.zeros(1, np.int64)

    def finished(self, stopped: Callable[[], bool]) -> Iterator[Counts]:
        """Step the calling thread's own lanes; yield finished cells in batches."""
        k = self.layout
        memory, notes, owner = aligned(k.rows * LANES), aligned(noted(k) * LANES), np.full(LANES, -1)
        rows, note, ended, busy = np.zeros((LANES, k.rows)), np.zeros(noted(k)), np.empty(4096, np.int64), 1
        layout, room, alone = InMemory(k), InMemory(room_for(k)), InMemory(alone_for(k))
        while busy and not stopped():
            number, busy = lanes.run_lanes(
                self.table, self.budgets, self.results, self._finals, self.ends, self._tickets, memory, owner, notes,
                ended, rows, note, layout, room, self.total, alone, _LOOKS,
            )  # fmt: skip
            if number:
                yield ended[:number].copy()

    def _forces(self, notes: Floats, sums: Floats, dissipation: Any, seconds: Any, period: Any) -> dict[str, Any]:
        """Return the indices of forces and dampers, from durations in s and in periods."""
        h = notes[march.H]
        pushed = sums[march.THRUST] / h / seconds
        largest = np.where(self.compliant[:, None], sums[march.PEAK] / h**2, np.nan)
        if not self.by_stop:
            pushed, largest = pushed.sum(axis=0), np.fmax.reduce(largest, axis=0, initial=np.nan)
        drained = notes[march.DRAINED] / h**2 / seconds
        return {"mean_force": pushed, "max_force": largest, "work_rate": dissipation / period, "damper_rate": drained}

    def settled(self, done: Counts) -> SystemCells:
        """Return cells that have ended, in the state in which they did."""
        cells, n = self.cells[done], self.layout.modes
        eta, rate, turn = np.split(self._finals[done], [n, 2 * n], axis=1)
        state = np.einsum("kij,pkj->pki", cells.shapes, np.stack([eta, rate / steps_of(cells)[:, None]]))
        ended: SystemCells = cells.at(state[0], state[1], _turns(*turn.T))
        return ended

    def outcome(self, done: Counts | slice) -> Outcome:
        """Return the outcome of cells that have ended."""
        notes, ends = self.results[done].T, self.ends[done]
        full, h = ends == FILLED, notes[march.H]
        began, ended = (_turns(*notes[at : at + 3]) for at in (march.BEGAN, march.ENDED))
        span = ended - began
        sums = notes[march.SUMS :].reshape(self.layout.stops + 1, march.EACH, -1).swapaxes(0, 1)
        of_stops = sums[:, :-1]  # the last sums are those of all stops together
        with np.errstate(divide="ignore", invalid="ignore"):
            indices = _of_impacts(of_stops, notes[march.STOP], span, h, self.by_stop)
            period = 2.0 * math.pi / self.omega[done]
            indices |= self._forces(notes, of_stops, indices["dissipation"], span * period, period)
            if self.layout.thorough:
                growth, per_impact = _growth(notes, began, ended, self.window)
                indices["lyapunov"], indices["lyapunov_per_impact"] = growth / period, per_impact
                # A cycle is rejected if perturbations grow faster than in proportion to the impacts.
                stable = ~(per_impact * self.window.keep > math.log(self.window.keep))
                indices["n_periods"] = np.where(stable, notes[march.PERIODS], 0.0)
                indices["n_impacts"] = np.where(stable, notes[march.IMPACTS], 0.0)
                unresolved = np.isneginf(notes[march.GREW]) & (notes[march.UNSURE] > notes[march.REFERENCE])
                indices["n_periods"] = np.where(unresolved, 0.0, indices["n_periods"])
                indices["n_impacts"] = np.where(unresolved, -1.0, indices["n_impacts"])
                turned = of_stops[march.TURNED]
                repeats = (notes[march.IMPACTS] > 0.0) & (turned.sum(axis=0) == notes[march.IMPACTS]) & stable
                rate = (turned if self.by_stop else notes[march.IMPACTS]) / notes[march.PERIODS]
                indices["impacts_per_period"] = np.where(repeats, rate, indices["impacts_per_period"])
                misses = of_stops[march.MISS]
                indices["grazing_margin"] = misses if self.by_stop else misses.min(axis=0, initial=math.inf)
                since = ended - _turns(*notes[march.REFERENCE_TIME : march.REFERENCE_TIME + 3])
                cycle, rests = notes[march.PERIODS], of_stops if self.by_stop else sums[:, -1]
                rested = np.where(cycle > 0.0, rests[march.RESTING], rests[march.LATEST] - rests[march.BEFORE])
                indices["stick_fraction"] = rested / np.where(cycle > 0.0, cycle, since)
        columns = {
            name: np.where(full, values, EVERY[name].fill).T.astype(EVERY[name].dtype)
            for name, values in indices.items()
        }
        counted = {
            "counted": notes[march.HITS] - notes[march.ADDED],
            "sticks": notes[march.STICKS],
            "span": span,
            "added": notes[march.ADDED],
        }
        if self.layout.thorough and self.layout.stops:
            # The reference impact is the first one kept if 2^k - 1 are skipped.
            first_kept = full & (notes[march.REFERENCE] == self.window.transient + 1.0)
            stop = notes[march.STOP].astype(np.int64)
            columns["first_stop"] = np.where(first_kept, stop, -1)
            columns["first_phase"] = began % 1.0
            columns["first_velocity"] = of_stops[march.FIRST, stop, np.arange(len(ends))] / h
            bits = 1 << np.arange(self.layout.stops)  # one per stop
            columns["struck"] = (of_stops[march.COUNT] > 0.0).T @ bits
        return columns | {
            "status": statuses(counted, ends, self.window),
            "impacts": counted["counted"].astype(np.int64),
            "steps": (notes[march.STEPS] + notes[march.BESIDE]).astype(np.int64),
        }


def _growth(notes: Floats, began: Floats, ended: Floats, window: ImpactWindow) -> tuple[Floats, Floats]:
    """Return ln of the growth of perturbations, per period and per impact.

    It is measured over the window; over a repeating cycle, from the impact that recurred; for a certain cycle, over
    that cycle.
    """
    first, repeats = window.transient + 1.0, notes[march.PERIODS] > 0.0
    since = _turns(*notes[march.REFERENCE_TIME : march.REFERENCE_TIME + 3])
    number = np.maximum(notes[march.REFERENCE], first)
    later, grown = repeats & (number > first), notes[march.GREW] - notes[march.GROWN]
    grown = np.where(later & ~np.isneginf(notes[march.GREW]), grown, notes[march.GREW])
    periods = ended - np.where(later, since, began)
    impacts = window.transient + window.keep - np.where(later, number, first)
    certain, rate = notes[march.RATE] > 0.0, notes[march.RATE]
    per_period = np.where(certain, notes[march.DECAY], grown / periods)
    return per_period, np.where(certain, notes[march.DECAY] / rate, grown / impacts)


def _of_impacts(sums: Floats, first: Floats, span: Floats, h: Floats, by_stop: bool) -> dict[str, Any]:
    """Return the indices from sums over the impacts on each stop, per stop or for all; the first axis is the stop."""

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
