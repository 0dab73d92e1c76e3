"""The flow of one system over driving periods from any state, with its derivative."""

from __future__ import annotations

import numpy as np

from vibroimpact.backends.base import Floats
from vibroimpact.backends.modal.rows import in_steps, steps_of
from vibroimpact.backends.modal.sweep import layout_for, room_for
from vibroimpact.backends.scalar import aligned
from vibroimpact.kernels.shared.held import InMemory
from vibroimpact.kernels.shared.vectors import LANES
from vibroimpact.kernels.systems.walk import carry_over
from vibroimpact.model.system_cells import SystemCells
from vibroimpact.options import Tolerances

STEPS = 100_000  # steps per driving period, at most: a few tenths of a second


class Carrier:
    """The motion of one cell over given times, through impacts, whole chatter and rests.

    A state holds the modal amplitudes and then their rates times a step of the engine, so that all have one unit.
    """

    def __init__(self, cells: SystemCells, tolerances: Tolerances) -> None:
        self.layout = layout_for(cells, thorough=True)
        self._row = in_steps(cells, tolerances.chatter, self.layout)[0]
        self._shapes, self._step = cells.shapes[0], float(steps_of(cells)[0])
        self.neutral = cells.block("neutral")[0] > 0.0  # components of the state: position and drift of a free centre

    def state(self, displacement: Floats, velocity: Floats) -> Floats:
        """Return the state for given coordinates and rates."""
        eta, rate = np.linalg.solve(self._shapes, np.column_stack([displacement, velocity])).T
        return np.append(eta, rate * self._step)

    def coordinates(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the coordinates and rates of a state."""
        eta, rate = x.reshape(2, -1)
        return self._shapes @ eta, self._shapes @ rate / self._step

    def over(self, x: Floats, phase: float, periods: float) -> tuple[Floats, Floats]:
        """Return the state a number of driving periods after a given one, and its derivative with respect to that one.

        If a stop is closed at the beginning, the derivative is restricted to the directions that it leaves free.

        Raises
        ------
        ValueError
            The motion takes too many steps, or a law of restitution does not return a number.
        """
        k, size = self.layout, len(x)
        row, angle, derivative = self._row.copy(), 2.0 * np.pi * phase, np.empty((size, size))
        row[k.eta : k.eta + size], row[k.turn : k.turn + 3] = x, (np.sin(angle), np.cos(angle), 0.0)
        rows, lanes, before = np.zeros(k.rows), aligned(k.rows * LANES), np.zeros(k.rows * LANES)
        layout, room, most = InMemory(k), InMemory(room_for(k)), int(STEPS * (periods + 1.0))
        for first in range(0, size, LANES):
            if not carry_over(row, rows, layout, room, lanes, before, first, periods, most):
                raise ValueError(f"the motion could not be followed for {periods:g} driving periods")
            columns = lanes.reshape(-1, LANES)[:, : size - first]
            derivative[:, first : first + LANES] = columns[k.deta : k.deta + size]
        return columns[k.eta : k.eta + size, 0].copy(), derivative
