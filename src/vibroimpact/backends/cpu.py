"""The `cpu` back end: exact flights in vectorised lanes, by the engine suited to each cell."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from vibroimpact.backends import one_mass, scalar
from vibroimpact.backends.base import Backend, Counts, Measurement, Outcome, Samples
from vibroimpact.cells import Cells
from vibroimpact.indices import FORCES, INDICES, RESPONSES
from vibroimpact.kernels.shared.vectors import LANES
from vibroimpact.model.system_cells import SystemCells

# Cells that are followed over their cycles together, so that lanes are full, and for how many seconds they wait.
FULL, PATIENCE = 64 * LANES, 1.0


class CpuBackend(Backend):
    """Exact flights, certified contacts, closed-form chatter; threads share the cells of a sweep.

    Systems that are equivalent to one mass at one fixed rigid stop are computed by the engine of one mass.
    """

    name = sampler = "cpu"
    smallest_tile = 64  # two rounds of lanes
    largest_tile = 4096
    alone = LANES  # cells: for as many, one thread is as fast as several
    known_indices = frozenset(INDICES | RESPONSES)

    def indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        """Return the indices, the status, the impacts computed and the certified steps of each cell."""
        columns: Outcome = {}
        for done, outcome in self.share(cells, measurement)(lambda: False):
            for name, values in outcome.items():
                columns.setdefault(name, np.empty((len(cells), *values.shape[1:]), values.dtype))[done] = values
        return columns

    def share(
        self, cells: Cells, measurement: Measurement
    ) -> Callable[[Callable[[], bool]], Iterator[tuple[Counts, Outcome]]]:
        """Return the work of a thread, which loads cells into its own lanes until none is left."""
        sweeps = list(_sweeps(cells, measurement))
        forces = tuple(name for name in measurement.indices if name in FORCES)

        def work(stopped: Callable[[], bool]) -> Iterator[tuple[Counts, Outcome]]:
            for rows, sweep in sweeps:
                of_forces = replace(measurement, indices=forces) if isinstance(sweep, scalar.Sweep) and forces else None
                again = measurement.swings or of_forces is not None
                for done in _together(sweep.finished(stopped)) if again else sweep.finished(stopped):
                    outcome = sweep.outcome(done)
                    if measurement.swings:
                        outcome |= _swings(cells[rows[done]], sweep, done, outcome["status"], measurement, stopped)
                    if of_forces is not None:
                        outcome |= _forces(cells[rows[done]], outcome["steps"], of_forces, stopped)
                    if again and stopped():
                        return  # they may not have been followed to their end
                    yield rows[done], outcome

        return work

    def samples(self, cells: Cells, measurement: Measurement) -> list[Any]:
        """Return the samples of each cell in the window."""
        if not isinstance(cells, SystemCells):
            return scalar.samples(cells, measurement)
        from vibroimpact.backends.modal import samples  # compiled on first use

        motions, served = np.empty(len(cells), object), one_mass.is_one_mass(cells)
        if served.any():
            motions[served] = one_mass.samples(cells[served], measurement, scalar.samples)
        if not served.all():
            motions[~served] = samples.samples(cells[~served], measurement)
        return motions.tolist()

    def follow(self, cell: Cells, measurement: Measurement, sampling: Measurement) -> tuple[Outcome, Samples]:
        """Return the outcome of `indices` for one cell, and its samples in the window of `sampling`."""
        if isinstance(cell, SystemCells):
            return super().follow(cell, measurement, sampling)
        return scalar.follow(cell, measurement, sampling)


def _sweeps(cells: Cells, measurement: Measurement) -> Iterator[tuple[Counts, Any]]:
    """Yield, for each engine, its cells and their sweep, which threads share."""
    if not isinstance(cells, SystemCells):
        yield np.arange(len(cells)), scalar.Sweep(cells, measurement)
        return
    from vibroimpact.backends.modal.sweep import SystemSweep  # compiled on first use

    served = one_mass.is_one_mass(cells)
    if served.any():
        oscillators, ahead = one_mass.as_one_mass(cells[served])
        yield np.flatnonzero(served), scalar.Sweep(oscillators, measurement, ahead)
    if not served.all():
        yield np.flatnonzero(~served), SystemSweep(cells[~served], measurement)


def _together(batches: Iterator[Counts]) -> Iterator[Counts]:
    """Yield finished cells so many at a time that they fill lanes."""
    held: list[Counts] = []
    since = perf_counter()
    for batch in batches:
        held.append(batch)
        if sum(map(len, held)) >= FULL or perf_counter() > since + PATIENCE:
            yield np.concatenate(held)
            held, since = [], perf_counter()
    if held:
        yield np.concatenate(held)


def _swings(
    cells: Cells, sweep: Any, done: Counts, status: Counts, measurement: Measurement, stopped: Callable[[], bool]
) -> Outcome:
    """Return the indices of displacements of cells that have ended."""
    from vibroimpact.backends.modal.swings import of_one_mass, swings  # compiled on first use

    if isinstance(sweep, scalar.Sweep):
        return of_one_mass(cells, sweep, done, status, measurement, stopped)
    return swings(sweep.settled(done), status, measurement, stopped)


def _forces(cells: Cells, steps: Counts, measurement: Measurement, stopped: Callable[[], bool]) -> Outcome:
    """Return the indices of forces of one mass, by the engine of systems, and the certified steps in all."""
    from vibroimpact.backends.modal.sweep import SystemSweep  # compiled on first use

    if not isinstance(cells, SystemCells):
        turns = cells["periods"] + cells["phase"]
        cells = one_mass.resumed(one_mass.as_systems(cells), cells["clearance"], cells["velocity"], turns)
    sweep = SystemSweep(cells, measurement)
    for _ in sweep.finished(stopped):
        pass
    outcome = sweep.outcome(slice(None))
    return {name: outcome[name] for name in measurement.indices} | {"steps": steps + outcome["steps"]}


def create() -> CpuBackend:
    """Return the back end."""
    return CpuBackend()
