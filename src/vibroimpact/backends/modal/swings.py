"""How far cells swing once their impacts are counted: indices of displacements, over one cycle of the motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import Counts, Floats, Measurement, Outcome, phase_of
from vibroimpact.backends.modal.rows import budgets_of, in_steps, steps_of
from vibroimpact.backends.modal.sweep import layout_for, noted, room_for
from vibroimpact.backends.one_mass import as_systems, resumed
from vibroimpact.backends.scalar import Sweep, aligned
from vibroimpact.cells import Cells
from vibroimpact.kernels.cell import FILLED, Cell
from vibroimpact.kernels.cycle import UNREPEATED
from vibroimpact.kernels.shared.held import InMemory
from vibroimpact.kernels.shared.vectors import LANES
from vibroimpact.kernels.systems import march, repeat, swing
from vibroimpact.kernels.systems.layout import SWING
from vibroimpact.model.system_cells import SystemCells
from vibroimpact.status import Status

_LOOKS = 200  # looks at lanes between checks for an interrupt
FREE = Status.NO_IMPACT, Status.STOPPED_IMPACTING, Status.DECAYING  # without contact for ever


def swings(
    cells: SystemCells, status: Counts, measurement: Measurement, stopped: Callable[[], bool] = lambda: False
) -> Outcome:
    """Return the indices of displacements of cells from where they have ended."""
    shape, direction, calm = cells.shape, _direction(cells, measurement.of), _forgets(cells, status)
    sums, complete = np.zeros((SWING + shape.stops, len(cells))), calm & (shape.harmonics <= 1)
    sums[: swing.LEFT, complete] = _steady(*_along(cells, direction))[:, complete]
    left = ~complete & (status != Status.BUDGET) & (status != Status.INVALID_RESTITUTION)
    rows = np.argsort(status, kind="stable")  # the longest motions first, so that lanes end together
    rows = rows[left[rows]]
    if len(rows):
        begun = _settled(cells[rows], calm[rows])
        sums[:, rows], complete[rows] = _followed(begun, direction[rows], measurement, stopped)
    outcome = _indices(sums, steps_of(cells), measurement.by_stop)
    return {
        name: np.where(complete, values, np.nan).T for name, values in outcome.items() if name in measurement.indices
    }


def _followed(
    cells: SystemCells, direction: Floats, measurement: Measurement, stopped: Callable[[], bool]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the sums of cells along directions, and which have some."""
    k = layout_for(cells, swinging=True)
    table = in_steps(cells, measurement.tolerances.chatter, k)
    table[:, k.along : k.along + k.modes + 1 + 2 * k.harmonics] = direction
    budgets = budgets_of(cells, measurement.tolerances, UNREPEATED)
    results, ends = np.zeros((len(cells), SWING + k.stops)), np.zeros(len(cells), np.int8)
    memory, notes, owner = aligned(k.rows * LANES), aligned(noted(k) * LANES), np.full(LANES, -1)
    rows, note, tickets, busy = np.zeros((LANES, k.rows)), np.zeros(noted(k)), np.zeros(1, np.int64), 1
    layout, room, window = InMemory(k), InMemory(room_for(k)), march.Window(0.0, np.inf)
    while busy and not stopped():
        busy = repeat.run_swings(
            table, budgets, results, ends, tickets, memory, owner, notes, rows, note, layout, room, window, _LOOKS
        )
    return results.T, ends == FILLED


def of_one_mass(
    cells: Cells, sweep: Sweep, done: Counts, status: Counts, measurement: Measurement, stopped: Callable[[], bool]
) -> Outcome:
    """Return the same of cells that the engine of one mass has followed to their end."""
    cell: Any = Cell(*sweep.cells[done].T)
    sums = np.zeros((SWING + 1, len(done)))
    followed, complete = sweep.swings(done, status, stopped)
    sums[: swing.LEFT, complete] = followed
    calm, held = np.isin(status, FREE) & (cell.damping > 0.0), status == Status.STUCK_FOREVER
    m, c, k, force, omega = (values[calm] for values in cell[:5])
    sums[: swing.LEFT, calm] = _steady(0.0 * m, force / (k - m * omega**2 + 1j * omega * c))
    sums[: swing.LEFT, held] = _steady(cell.gap[held], 0.0j * cell.gap[held])
    sums = _of_displacement(sums, cells, measurement.of, cell.gap, sweep.ahead[done])
    outcome = _indices(sums, np.ones(len(done)), measurement.by_stop)
    outcome = {name: values.T for name, values in outcome.items() if name in measurement.indices}
    others = np.flatnonzero(~(complete | calm | held))
    if len(others):  # near resonance, or without an impact to come
        systems = cells if isinstance(cells, SystemCells) else as_systems(cells)
        begun = resumed(systems[others], *sweep.states(done[others]))
        for name, values in swings(begun, status[others], measurement, stopped).items():
            outcome[name][others] = values
    return outcome


def _steady(mean: Floats, wave: Any) -> Floats:
    """Return the sums per unit of time of y = mean + Im(wave e^{iwt})."""
    size = abs(wave)
    square = mean**2 + 0.5 * size**2
    return np.stack([1.0 + 0.0 * mean, mean, square, 0.5 * wave.real, 0.5 * wave.imag, mean - size, mean + size])


def _of_displacement(
    sums: Floats, cells: Cells, of: tuple[float, ...] | int | None, gap: Floats, ahead: Floats
) -> Floats:
    """Return the sums of a displacement, or a clearance, from those of the oscillator's y."""
    if isinstance(cells, SystemCells):
        along, offset = _direction(cells, of)[:, :2].T
        factor, offset = along / cells["alpha"], offset + along * cells["load"] / cells["square"]
    else:
        factor, offset = (-1.0, gap) if isinstance(of, int) else (0.0 if of is None else of[0], 0.0)
    length, mean, square, sine, cosine, least, largest = sums[: swing.LEFT]
    wave = factor * (sine + 1j * cosine) * np.exp(2j * np.pi * ahead)
    moved = sums.copy()
    moved[swing.MEAN] = offset * length + factor * mean
    moved[swing.SQUARE] = offset**2 * length + 2.0 * offset * factor * mean + factor**2 * square
    moved[swing.SINE], moved[swing.COSINE] = wave.real, wave.imag
    ends = offset + factor * np.stack([least, largest])
    moved[swing.LEAST], moved[swing.LARGEST] = ends.min(axis=0), ends.max(axis=0)
    return moved


def _forgets(cells: SystemCells, status: Counts) -> NDArray[np.bool_]:
    """Return which cells never touch a stop again and forget how they began: their steady motion is left."""
    calm = np.isin(status, FREE) & (cells.block("damping")[:, :: cells.shape.modes + 1] > 0.0).all(axis=1)
    return calm & (cells.block("square") > 0.0).all(axis=1)


def _waves(cells: SystemCells) -> Any:
    """Return the steady motion of each mode, Im(wave e^{imwt}) of each harmonic beside a constant."""
    n, m = cells.shape.modes, cells.shape.harmonics
    waves = cells.block("steady")[:, n:].reshape(len(cells), n, m, 2)
    return waves[..., 0] + 1j * waves[..., 1]


def _along(cells: SystemCells, direction: Floats) -> tuple[Floats, Any]:
    """Return the constant and the first harmonic of the steady motion along directions."""
    n, first = cells.shape.modes, min(cells.shape.harmonics, 1)
    motion = direction[:, n + 1 : n + 1 + 2 * first].reshape(len(cells), first, 2)
    wave = (direction[:, :n, None] * _waves(cells)[..., :first]).sum(axis=1) + motion[..., 0] + 1j * motion[..., 1]
    return direction[:, n] + (direction[:, :n] * cells.block("steady")[:, :n]).sum(axis=1), wave.sum(axis=1)


def _settled(cells: SystemCells, calm: NDArray[np.bool_]) -> SystemCells:
    """Return the cells; those that are calm start on the steady motion."""
    waves, n = _waves(cells), cells.shape.modes
    rates = cells["omega"][:, None, None] * np.arange(1, cells.shape.harmonics + 1)
    modes = cells.block("steady")[:, :n] + waves.imag.sum(axis=-1), (rates * waves.real).sum(axis=-1)
    place, speed = (np.einsum("kij,kj->ki", cells.shapes, part) for part in modes)
    begun = cells.at(place, speed, np.zeros(len(cells)))
    begun.table[~calm] = cells.table[~calm]
    return begun


def _direction(cells: SystemCells, of: tuple[float, ...] | int | None) -> Floats:
    """Return the factors of the modes, and the constant and harmonics of what moves by itself."""
    k = cells.shape
    motion = np.zeros((len(cells), 1 + 2 * k.harmonics))
    if isinstance(of, int):
        along = -cells.block("alpha").reshape(len(cells), k.stops, k.modes)[:, of]
        motion[:, 0] = cells.block("gap")[:, of]
        motion[:, 1:] = cells.block("motion").reshape(len(cells), k.stops, -1)[:, of]
    else:
        along = np.einsum("i,kij->kj", np.zeros(k.modes) if of is None else np.array(of), cells.shapes)
    return np.concatenate([along, motion], axis=1)


def _indices(sums: Floats, step: Floats, by_stop: bool) -> dict[str, Any]:
    """Return the indices from sums; y = Im(Y e^{i wt}) has the means Im(Y)/2 and Re(Y)/2 of y cos wt and y sin wt."""
    with np.errstate(divide="ignore", invalid="ignore"):
        mean, square, sine, cosine = sums[[swing.MEAN, swing.SQUARE, swing.SINE, swing.COSINE]] / sums[swing.LENGTH]
        strength = sums[SWING:] / sums[swing.LENGTH]
    rms = np.sqrt(square)
    return {
        "amplitude": 0.5 * (sums[swing.LARGEST] - sums[swing.LEAST]),
        "rms": rms,
        "mean": mean,
        "harmonic_amplitude": 2.0 * np.hypot(sine, cosine),
        "harmonic_phase": phase_of(sine + 1j * cosine, rms),
        "rms_force": np.sqrt(strength if by_stop else strength.sum(axis=0)) / step**2,
    }
