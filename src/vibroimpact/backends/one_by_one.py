"""Back ends that compute one cell after another and keep every impact."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.backends.base import ImpactWindow, Measurement, Outcome, Samples
from vibroimpact.backends.one_mass import OfOneMass
from vibroimpact.cells import Cells
from vibroimpact.indices import INDICES, VELOCITY_INDICES
from vibroimpact.options import Tolerances

SAMPLE_INDICES = VELOCITY_INDICES | {"dissipation", "impact_phase_spread"}


def impact_indices(samples: Samples, loss: float) -> dict[str, float]:
    """Return the indices that need only kept impacts; an impact at speed v loses the energy `loss` v^2.

    Here `loss` is m (1 - r^2)/2. The energy is the loss of all impacts after the first: these and the flights before
    them make up the span. The spread of the phases is 1 - |mean of exp(2 pi i phase)|.
    """
    velocity, last = samples.impact_velocity, len(samples.impact_velocity) - 1
    # Shifted by the first sample, so that nearly equal velocities keep the digits of their differences.
    shifted = velocity - velocity[0]
    angle = 2.0 * math.pi * samples.impact_phase
    indices = {
        "std": float(np.std(shifted)),
        "mean_velocity": float(velocity[0] + shifted.mean()),
        "max_velocity": float(velocity.max()),
        "impact_phase_spread": max(1.0 - math.hypot(float(np.cos(angle).mean()), float(np.sin(angle).mean())), 0.0),
    }
    if last == 0:
        return indices
    span = float(
        (samples.impact_periods[-1] - samples.impact_periods[0]) + (samples.impact_phase[-1] - samples.impact_phase[0])
    )
    return indices | {
        "impacts_per_period": last / span,
        "dissipation": loss * float((velocity[1:] ** 2).sum()) / span,
    }


class OneByOne(OfOneMass):
    """A back end that computes one cell after another and every impact, whether or not `early_closing` is set.

    It returns all its known indices, requested or not.
    """

    smallest_tile = 1
    largest_tile = 1
    slow = True

    def run(self, cell: dict[str, float], tolerances: Tolerances) -> Any:
        """Return the run of a cell from its initial condition.

        Its `looks(window)` returns samples, `impacts(window)` samples and the number of impacts recorded, and
        `indices(window)` these two and a dict of indices.
        """
        ...

    def _indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        rows = [self.run(cell, measurement.tolerances).indices(measurement.impacts) for cell in cells]
        table: Outcome = {
            index.name: np.array([indices.get(index.name, index.fill) for _, _, indices in rows], dtype=index.dtype)
            for index in INDICES.values()
        }
        return table | {
            "status": np.array([samples.status for samples, _, _ in rows], dtype=np.int8),
            "impacts": np.array([impacts for _, impacts, _ in rows], dtype=np.int64),
            "steps": np.array([samples.steps for samples, _, _ in rows], dtype=np.int64),
        }

    def _samples(self, cells: Cells, measurement: Measurement) -> list[Samples]:
        window = measurement.window
        runs = (self.run(cell, measurement.tolerances) for cell in cells)
        if isinstance(window, ImpactWindow):
            return [run.impacts(window)[0] for run in runs]
        return [run.looks(window) for run in runs]
