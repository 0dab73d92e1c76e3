"""How far cells swing once their impacts are counted: indices of displacements, over one cycle of the motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from vibroimpact.backends.base import Counts, Floats, Measurement, Outcome
from vibroimpact.backends.modal.rows import budgets_of, in_steps, steps_of
from vibroimpact.backends.modal.sweep import layout_for, noted, room_for
from vibroimpact.backends.scalar import aligned
from vibroimpact.kernels.cell import FILLED
from vibroimpact.kernels.held import InMemory
from vibroimpact.kernels.systems import march, repeat, swing
from vibroimpact.kernels.systems.layout import SWING, Layout
from vibroimpact.kernels.vectors import LANES
from vibroimpact.model.system_cells import SystemCells
from vibroimpact.status import Status

_LOOKS = 200  # looks at lanes between checks for an interrupt
FREE = Status.NO_IMPACT, Status.STOPPED_IMPACTING, Status.DECAYING  # without contact for ever


def swings(
    cells: SystemCells, status: Counts, measurement: Measurement, stopped: Callable[[], bool] = lambda: False
) -> Outcome:
    """Return the indices of displacements of cells that start from their settled motion."""
    cells, k = _settled(cells, status), layout_for(cells, False, False, False, False, True)
    table = in_steps(cells, measurement.tolerances.chatter, k)
    table[:, k.along : k.along + k.modes + 1 + 2 * k.harmonics] = _direction(cells, measurement.of, k)
    budgets = budgets_of(cells, measurement.tolerances, repeat.MOST)
    results, ends = np.zeros((len(cells), SWING + k.stops)), np.zeros(len(cells), np.int8)
    memory, notes, owner = aligned(k.rows * LANES), aligned(noted(k) * LANES), np.full(LANES, -1)
    rows, note, tickets, busy = np.zeros((LANES, k.rows)), np.zeros(noted(k)), np.zeros(1, np.int64), 1
    layout, room, window = InMemory(k), InMemory(room_for(k)), march.Window(0.0, np.inf)
    while busy and not stopped():
        busy = repeat.run_swings(
            table, budgets, results, ends, tickets, memory, owner, notes, rows, note, layout, room, window, _LOOKS
        )
    known = (ends == FILLED) & (status != Status.BUDGET) & (status != Status.INVALID_RESTITUTION)
    outcome = _indices(results.T, steps_of(cells), measurement.by_stop)
    return {name: np.where(known, values, np.nan).T for name, values in outcome.items() if name in measurement.indices}


def _settled(cells: SystemCells, status: Counts) -> SystemCells:
    """Return the cells; those that never touch a stop again and forget how they began start on the steady motion."""
    (n, m), calm = (cells.shape.modes, cells.shape.harmonics), np.isin(status, FREE)
    calm &= (cells.block("damping")[:, :: n + 1] > 0.0).all(axis=1) & (cells.block("square") > 0.0).all(axis=1)
    waves = cells.block("steady")[:, n:].reshape(len(cells), n, m, 2)
    rates = cells["omega"][:, None, None] * np.arange(1, m + 1)
    modes = cells.block("steady")[:, :n] + waves[..., 1].sum(axis=-1), (rates * waves[..., 0]).sum(axis=-1)
    place, speed = (np.einsum("kij,kj->ki", cells.shapes, part) for part in modes)
    begun = cells.carried(place, speed, np.zeros(len(cells)))
    begun.table[~calm] = cells.table[~calm]
    return begun


def _direction(cells: SystemCells, of: tuple[float, ...] | int | None, k: Layout) -> Floats:
    """Return the factors of the modes, and the constant and harmonics of what moves by itself."""
    own = np.zeros((len(cells), 1 + 2 * k.harmonics))
    if isinstance(of, int):
        along = -cells.block("alpha").reshape(len(cells), k.stops, k.modes)[:, of]
        own[:, 0] = cells.block("gap")[:, of]
        own[:, 1:] = cells.block("motion").reshape(len(cells), k.stops, -1)[:, of]
    else:
        along = np.einsum("i,kij->kj", np.zeros(k.modes) if of is None else np.array(of), cells.shapes)
    return np.concatenate([along, own], axis=1)


def _indices(sums: Floats, step: Floats, by_stop: bool) -> dict[str, Any]:
    """Return the indices from sums; y = Im(Y e^{i wt}) has the means Im(Y)/2 and Re(Y)/2 of y cos wt and y sin wt."""
    with np.errstate(divide="ignore", invalid="ignore"):
        mean, square, sine, cosine = sums[[swing.MEAN, swing.SQUARE, swing.SINE, swing.COSINE]] / sums[swing.LENGTH]
        strength = sums[SWING:] / sums[swing.LENGTH]
    return {
        "amplitude": 0.5 * (sums[swing.LARGEST] - sums[swing.LEAST]),
        "rms": np.sqrt(square),
        "mean": mean,
        "harmonic_amplitude": 2.0 * np.hypot(sine, cosine),
        "harmonic_phase": np.arctan2(cosine, sine),
        "rms_force": np.sqrt(strength if by_stop else strength.sum(axis=0)) / step**2,
    }
