"""The one-parameter diagram along a line through the point."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.limits import Range, granted
from vibroimpact.explorer.plane import TRANSIENT
from vibroimpact.explorer.state import View

Floats = NDArray[np.float64]

VALUES, PART = 200, 100  # along the line; at a time
IMPACTS = 48  # of each
MANY = 5000  # impacts for which a whole budget is granted: these few have but a share of it
MOST_SECONDS = 10.0
GRAIN = 10_000  # velocities told apart, of the largest


@dataclass(frozen=True)
class Line:
    """Impact velocities over one parameter, each told once, and whether all of the line was computed."""

    parameter: str
    ends: Range
    values: Floats
    velocities: Floats
    complete: bool = True


def compute_line(view: View, going: Callable[[], bool]) -> Line | None:
    """Return the impact velocities along the view's line, or None if they were no longer wanted."""
    parameter, (low, high) = view.along
    values: Floats = low + (np.arange(VALUES, dtype=np.float64) + 0.5) * ((high - low) / VALUES)
    deadline = time.monotonic() + MOST_SECONDS
    seen: list[Floats] = []
    for first in range(0, VALUES, PART):
        if seen and time.monotonic() > deadline:
            break
        if not going():
            return None
        seen.append(_velocities(view, parameter, values[first : first + PART]))
    velocity = np.concatenate(seen)
    finite = np.isfinite(velocity)
    most = float(velocity[finite].max(initial=0.0)) or 1.0
    grains = np.round(velocity[finite] * (GRAIN / most)).astype(np.int64)
    rows = np.broadcast_to(np.arange(len(velocity))[:, None], velocity.shape)[finite]
    _, told = np.unique(rows * (GRAIN + 1) + grains, return_index=True)
    return Line(parameter, (low, high), values[rows[told]], velocity[finite][told], complete=len(velocity) == VALUES)


def _velocities(view: View, parameter: str, values: Floats) -> Floats:
    """Return the velocities of some impacts at each value, NaN where there are fewer."""
    axis: dict[str, Any] = {parameter: values}
    diagram = vi.bifurcation_diagram(
        view.osc,
        transient_impacts=TRANSIENT,
        sample_impacts=IMPACTS,
        tolerances=granted(view.stiffness, MANY),
        workers=1,
        **axis,
    )
    found = diagram["velocity"].values
    return np.pad(found, ((0, 0), (0, IMPACTS - found.shape[1])), constant_values=np.nan)
