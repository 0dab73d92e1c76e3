"""What the witness takes of a cell: its linear system, its initial condition and its scales.

A cell of a system holds its modes: eta'' + D eta' + W eta = f, with masses M; in them the matrices are M, M D, M W.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.reference.events import Moment
from vibroimpact.backends.reference.phases import Equations, LinearSystem
from vibroimpact.backends.reference.stops import Floats, Stop, stop_of
from vibroimpact.cells import Cells
from vibroimpact.contact import LAWS
from vibroimpact.model.elements import BLOCKS
from vibroimpact.model.system_cells import SystemCells


@dataclass(frozen=True)
class Design:
    """One cell.

    Parameters
    ----------
    eq : Equations
        Its equations, in the coordinates eta.
    start : Moment
        The initial condition.
    shapes : array, shape (n, n)
        Displacements are `shapes` eta.
    felt : boolean array, shape (2n,)
        Which eta and eta' the motion at the stops depends on: those of a free centre are left out.
    speed : float
        V in m/s, to which the cutoff is relative.
    slowest : float
        The slower one of the driving rate and the slowest natural rate, in 1/s.
    """

    eq: Equations
    start: Moment
    shapes: Floats
    felt: NDArray[np.bool_]
    speed: float
    slowest: float

    def bound(self, q: Floats, v: Floats) -> Floats:
        """Return what no stop can be struck faster than without a load: sqrt(2 E G), E the energy and G of a stop."""
        energy = v @ self.eq.mass @ v + q @ self.eq.stiffness @ q
        speeds: Floats = np.sqrt(energy * np.diag(self.eq.coupling))
        return speeds


def designs(cells: Cells) -> Iterator[Design]:
    """Yield the design of each cell."""
    for at in range(len(cells)):
        yield _of_modes(cells[at : at + 1]) if isinstance(cells, SystemCells) else _of_one_mass(cells[at : at + 1])


def _of_one_mass(cell: Cells) -> Design:
    """Return an oscillator, m y'' + c y' + k y = f sin wt; its distance u to the stop is not rounded in g - y."""
    row = {name: float(cell[name][0]) for name in cell.columns}
    one, gap = np.ones((1, 1)), row["gap"]
    wave = {1: np.array([row["amplitude"] + 0j])} if row["amplitude"] else {}
    stop = stop_of(one[0], gap, {}, {"restitution": row["restitution"], "stiffness": 0.0})
    mass, damping, stiffness = (row[name] * one for name in ("mass", "damping", "stiffness"))
    eq = Equations(LinearSystem(mass, damping, stiffness, row["omega"], np.zeros(1), wave, (stop,)))
    u, v = np.array([row["clearance"]]), np.array([row["velocity"]])
    start = Moment(row["periods"], row["phase"], gap - u, v, u, -v)
    speed = float(cell.velocity_scale[0])
    design = Design(eq, start, one, np.ones(2, bool), speed, float(cell.slowest_rate[0]))
    own = float(design.bound(start.displacement, v).max())
    return design if speed > 0.0 else Design(eq, start, one, design.felt, own, design.slowest)


def _of_modes(cell: SystemCells) -> Design:
    n, s, h = cell.shape.modes, cell.shape.stops, cell.shape.harmonics

    def block(name: str, *shape: int) -> Floats:
        values: Floats = cell.block(name)[0].reshape(shape)
        return values

    def waves(name: str, rows: int) -> NDArray[np.complex128]:
        parts = block(name, rows, h, 2)
        return parts[..., 0] + 1j * parts[..., 1]

    mass, forces, moves = block("weight", n), waves("force", n), waves("motion", s)
    stops = tuple(
        _stop(cell, j, block("alpha", s, n)[j], {k + 1: moves[j, k] for k in np.flatnonzero(moves[j]).tolist()})
        for j in range(s)
    )
    eq = Equations(
        LinearSystem(
            np.diag(mass),
            mass[:, None] * block("damping", n, n),
            np.diag(mass * block("square", n)),
            float(cell["omega"][0]),
            mass * block("load", n),
            {k + 1: mass * forces[:, k] for k in np.flatnonzero(forces.any(axis=0)).tolist()},
            stops,
        )
    )
    periods, phase = block("time", 2).tolist()
    start = Moment.of(eq, periods, phase, block("eta", n), block("rate", n))
    start.clearance[eq.impenetrable] = np.maximum(start.clearance[eq.impenetrable], 0.0)
    felt = block("neutral", 2 * n) == 0.0
    return Design(eq, start, cell.shapes[0], felt, float(cell["scale"][0]), float(cell.slowest_rate[0]))


def _stop(cell: SystemCells, j: int, direction: Floats, motion: dict[int, complex]) -> Stop:
    numbers: dict[str, Any] = {name: float(cell.block(block.name)[0, j]) for name, block in BLOCKS.items()}
    if numbers["law"]:
        numbers["restitution"] = Rule(numbers["law"], numbers["restitution"])
    return stop_of(direction, numbers["gap"], motion, numbers)


class LawlessError(Exception):
    """A law of restitution returned a number that is not within 0 and 1."""


class Rule:
    """The law of restitution of a cell, from its mark and its number."""

    def __init__(self, mark: float, number: float) -> None:
        formula, self.number = LAWS[mark].formula, number
        self._rule: Callable[..., Any] = formula.rule(lambda function: function, lambda _, at: float(formula.table[at]))

    def __call__(self, speed: float) -> float:
        """Return r at a speed in m/s."""
        ratio = float(self._rule(speed, self.number, 0))
        if not 0.0 <= ratio <= 1.0:
            raise LawlessError
        return ratio

    def slope(self, speed: float) -> float:
        """Return dr/dv in s/m."""
        return float(self._rule(speed, self.number, 1))
