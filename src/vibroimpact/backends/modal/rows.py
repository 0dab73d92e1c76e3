"""The rows of numbers read by the engine of systems, with time in steps."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.backends.base import Floats
from vibroimpact.backends.modal.leaps import prepare_leaps
from vibroimpact.contact import LAWS
from vibroimpact.kernels.cell import MOST
from vibroimpact.kernels.restitution import address_of
from vibroimpact.kernels.shared.series import REACH
from vibroimpact.kernels.systems.layout import Layout
from vibroimpact.model.elements import BLOCKS
from vibroimpact.model.system_cells import SystemCells
from vibroimpact.options import Tolerances

# The power of the step's length that converts a number to time in steps.
_POWERS = {
    "rate": 1,
    "square": 2,
    "damping": 1,
    "load": 2,
    "force": 2,
    "omega": 1,
    "scale": 1,
    "give": -2,
    "slide": 1,
    "sliding": -1,
    **{block.name: block.power for block in BLOCKS.values()},
}
_RENAMED = {"omega": "theta", "scale": "cut"}


def steps_of(cells: SystemCells) -> Floats:
    """Return the step length of every cell in s."""
    return REACH / cells.fastest_rate


def in_steps(cells: SystemCells, chatter: float, layout: Layout) -> Floats:
    """Return the engine's rows of all cells, with time in steps and the cutoff relative to V."""
    _check_known(cells, layout)
    step = steps_of(cells)[:, None]
    table = np.zeros((len(cells), layout.constants))
    for name, size in cells.shape.sizes.items():
        first = getattr(layout, _RENAMED.get(name, name), None)
        if first is not None and (layout.free or name != "neutral"):
            table[:, first : first + size] = cells.block(name) * step ** _POWERS.get(name, 0)
    _address_laws(layout, table)
    table[:, layout.tick] = step[:, 0]
    s, grip = layout.stops, np.einsum("ijk,ijk->ij", *map(cells.by_stop, ("alpha", "jump")))
    table[:, layout.hard : layout.hard + s] = table[:, layout.spring : layout.spring + s] * grip / REACH**2
    table[:, layout.thick : layout.thick + s] = table[:, layout.dashpot : layout.dashpot + s] * grip / REACH
    prepare_leaps(layout, table)
    table[:, layout.speed] = table[:, layout.cut]
    table[:, layout.cut] *= chatter
    return table


def _check_known(cells: SystemCells, layout: Layout) -> None:
    """Raise if a stop has a number that the kernels have no column for: they would compute it as one without it."""
    for name, block in BLOCKS.items():
        if not hasattr(layout, block.name) and (cells.block(block.name) != block.none).any():
            raise ValueError(
                f"a stop has a `{name}`, for which back end 'cpu' has no contact law; make it rigid or compliant"
            )


def _address_laws(k: Layout, table: Floats) -> None:
    """Replace the placeholders of restitution laws and their tables by addresses."""
    laws, numbers = (table[:, first : first + k.stops] for first in (k.law, k.restitution))
    for mark in np.unique(laws[laws != 0.0]).tolist():
        law, stops = LAWS[mark], laws == mark
        laws[stops] = address_of(law.code, law.formula.rule)
        if law.formula.table is not None:
            numbers[stops] = law.formula.table.ctypes.data


def budgets_of(cells: SystemCells, tolerances: Tolerances, total: float) -> Floats:
    """Return the step, the longest flight in steps and the step limit of every cell."""
    step, slowest = steps_of(cells), cells.slowest_rate
    longest = tolerances.flight_periods * 2.0 * math.pi / (slowest * step)
    granted = tolerances.steps_per_impact * total
    most = np.maximum(granted, np.minimum(granted * cells.fastest_rate / slowest, MOST))
    return np.column_stack([step, longest, most])
