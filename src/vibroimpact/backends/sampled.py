"""Samples and indices from what a window kept, in plain NumPy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import Floats, Samples
from vibroimpact.status import Status


def samples_of(
    *,
    impacts: Floats,
    looks: Floats,
    sticks: Floats,
    status: Status,
    last: tuple[float, float, float, float],
    steps: int,
) -> Samples:
    """Return `Samples` from rows of impacts (periods, phase, velocity), looks (periods, phase, displacement, velocity)
    and sticks (periods, phase, periods, phase of the release); `last` is (clearance, velocity, periods, phase).
    """
    return Samples(
        impact_periods=impacts[:, 0],
        impact_phase=impacts[:, 1],
        impact_velocity=impacts[:, 2],
        look_periods=looks[:, 0],
        look_phase=looks[:, 1],
        look_displacement=looks[:, 2],
        look_velocity=looks[:, 3],
        stick_periods=sticks[:, 0],
        stick_phase=sticks[:, 1],
        release_periods=sticks[:, 2],
        release_phase=sticks[:, 3],
        status=int(status),
        last_clearance=last[0],
        last_velocity=last[1],
        last_periods=last[2],
        last_phase=last[3],
        steps=steps,
    )


def impact_indices(velocity: Floats, time: Floats) -> dict[str, float]:
    """Return every index of the table from kept impact velocities and their times in driving periods."""
    # Shifted by the first sample: nearly equal velocities keep the digits of their differences.
    shifted = velocity - velocity[0]
    last = len(velocity) - 1
    return {
        "std": float(np.std(shifted)),
        "mean_velocity": float(velocity[0] + shifted.mean()),
        "max_velocity": float(velocity.max()),
        "impacts_per_period": last / float(time[-1]) if last else math.nan,
    }


def table_of_indices(names: Sequence[str], runs: Sequence[tuple[Samples, int]]) -> dict[str, NDArray[Any]]:
    """Return the arrays that `Backend.indices` promises from (samples, impacts computed) of each cell."""
    table: dict[str, NDArray[Any]] = {name: np.full(len(runs), np.nan) for name in names}
    for i, (seen, _) in enumerate(runs):
        if Status(seen.status).has_indices:
            since_first = (seen.impact_periods - seen.impact_periods[0]) + (seen.impact_phase - seen.impact_phase[0])
            for name, value in impact_indices(seen.impact_velocity, since_first).items():
                table[name][i] = value
    return table | {
        "status": np.array([seen.status for seen, _ in runs], dtype=np.int8),
        "impacts": np.array([impacts for _, impacts in runs], dtype=np.int64),
        "steps": np.array([seen.steps for seen, _ in runs], dtype=np.int64),
    }
