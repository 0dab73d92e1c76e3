"""Samples and indices from what a window kept, in plain NumPy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from vibroimpact.backends.base import Floats, Outcome, Samples
from vibroimpact.indices import INDICES, VELOCITY_INDICES
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


SAMPLE_INDICES = VELOCITY_INDICES | {"dissipation", "impact_phase_spread"}


def impact_indices(seen: Samples, loss: float) -> dict[str, float]:
    """Return the indices that follow from kept impacts alone; an impact of speed v costs `loss` v^2, m (1 - r^2) v^2/2.

    The energy is what the impacts after the first one cost: they and the flights before them make up the span. The
    phases' spread is 1 - |mean of exp(2 pi i phase)|.
    """
    velocity, last = seen.impact_velocity, len(seen.impact_velocity) - 1
    # Shifted by the first sample: nearly equal velocities keep the digits of their differences.
    shifted = velocity - velocity[0]
    angle = 2.0 * math.pi * seen.impact_phase
    found = {
        "std": float(np.std(shifted)),
        "mean_velocity": float(velocity[0] + shifted.mean()),
        "max_velocity": float(velocity.max()),
        "impact_phase_spread": max(1.0 - math.hypot(float(np.cos(angle).mean()), float(np.sin(angle).mean())), 0.0),
    }
    if last == 0:
        return found
    span = float((seen.impact_periods[-1] - seen.impact_periods[0]) + (seen.impact_phase[-1] - seen.impact_phase[0]))
    return found | {
        "impacts_per_period": last / span,
        "dissipation": loss * float((velocity[1:] ** 2).sum()) / span,
    }


def energy_loss(mass: float, restitution: float) -> float:
    """Return m (1 - r^2)/2: what an impact of unit speed costs."""
    return 0.5 * mass * (1.0 - restitution) * (1.0 + restitution)


def table_of_indices(runs: Sequence[tuple[Samples, int, Mapping[str, float]]]) -> Outcome:
    """Return the arrays that `Backend.indices` promises from (samples, impacts computed, indices) of each cell."""
    table: Outcome = {
        index.name: np.array([found.get(index.name, index.fill) for _, _, found in runs], dtype=index.dtype)
        for index in INDICES.values()
    }
    return table | {
        "status": np.array([seen.status for seen, _, _ in runs], dtype=np.int8),
        "impacts": np.array([impacts for _, impacts, _ in runs], dtype=np.int64),
        "steps": np.array([seen.steps for seen, _, _ in runs], dtype=np.int64),
    }
