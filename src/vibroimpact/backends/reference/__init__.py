"""The `reference` back end: an independent cross-check in plain NumPy and SciPy, one cell at a time.

It shares neither code nor methods with the kernels. Flights are matrix exponentials (`phases`); the first event is
bracketed on a fine grid (`walk`); sets of stops that act together are found by trying all (`contacts`). Impact times
and velocities agree with 50-digit values to 1e-13 of their scales times the growth of errors along the orbit. An impact
of one mass takes about 2 ms. To audit a cell, read `walk.Walk`, which contains all the physics.
"""

from __future__ import annotations

import numpy as np

from vibroimpact.backends.base import Backend, ImpactWindow, Measurement, Outcome, Samples
from vibroimpact.backends.reference.designs import designs
from vibroimpact.backends.reference.indices import Account
from vibroimpact.backends.reference.ledger import Ledger
from vibroimpact.backends.reference.run import Run
from vibroimpact.cells import Cells
from vibroimpact.indices import FORCES, INDICES
from vibroimpact.model.system_cells import SystemCells
from vibroimpact.status import Status


class ReferenceBackend(Backend):
    """The independent cross-check as a back end, for any model.

    It computes every impact, whether or not `early_closing` is set. Indices of forces are returned if requested, all
    others always.
    """

    name = sampler = "reference"
    smallest_tile = 1
    largest_tile = 1
    slow = True
    known_indices = frozenset(INDICES)

    def indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        """Return the indices, the status, the impacts computed and the steps of each cell."""
        table = INDICES | {name: index for name, index in FORCES.items() if name in measurement.indices}
        s = cells.shape.stops if isinstance(cells, SystemCells) else 1
        columns: Outcome = {
            name: np.full(
                (len(cells), *([s] if measurement.by_stop and index.by_stop else [])), index.fill, index.dtype
            )
            for name, index in table.items()
        }
        columns |= {name: np.zeros(len(cells), np.int64) for name in ("impacts", "steps", "struck")}
        columns |= {"first_stop": np.full(len(cells), -1), "first_phase": np.full(len(cells), np.nan)}
        columns["first_velocity"] = columns["first_phase"].copy()
        columns["status"] = np.zeros(len(cells), np.int8)
        for at, design in enumerate(designs(cells)):
            run, window = Run(design, measurement.tolerances), measurement.impacts
            ledger = Ledger(design, run.walk, run.endings)
            samples = run.impacts(window, ledger)
            columns["status"][at], columns["steps"][at] = samples.status, samples.steps
            columns["impacts"][at] = min(run.walk.recorded, window.transient + window.keep)
            if Status(samples.status).has_indices:
                columns["first_stop"][at] = samples.impact_stop[0]
                columns["first_phase"][at], columns["first_velocity"][at] = (
                    values[0] for values in (samples.impact_phase, samples.impact_velocity)
                )
                columns["struck"][at] = sum(1 << j for j in {*samples.impact_stop.tolist()})
                for name, value in Account(ledger, design, window).indices(measurement.by_stop).items():
                    if name in columns:
                        columns[name][at] = value
        return columns

    def samples(self, cells: Cells, measurement: Measurement) -> list[Samples]:
        """Return the samples of each cell in the window."""
        window, found = measurement.window, list[Samples]()
        for design in designs(cells):
            run = Run(design, measurement.tolerances)
            found.append(run.impacts(window) if isinstance(window, ImpactWindow) else run.looks(window))
            if not isinstance(cells, SystemCells):  # one mass, at the stop or away from it
                at_impact = isinstance(window, ImpactWindow)
                y = found[-1].last_displacement[0]
                found[-1].last_clearance = float(run.walk.at.clearance[0] if at_impact else design.eq.places[0, 0] - y)
        return found


def create() -> ReferenceBackend:
    """Return the back end."""
    return ReferenceBackend()
