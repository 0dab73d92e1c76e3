"""The one-parameter diagram along a line through the point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.plane import TOLERANCES, TRANSIENT
from vibroimpact.explorer.state import View

Floats = NDArray[np.float64]

VALUES = 200  # along the line
IMPACTS = 48  # of each
GRAIN = 10_000  # velocities told apart, of the largest


@dataclass(frozen=True)
class Line:
    """Impact velocities over one parameter, each told once."""

    parameter: str
    values: Floats
    velocities: Floats


def compute_line(view: View, going: Callable[[], bool]) -> Line | None:
    """Return the impact velocities along the view's line, or None if they were no longer wanted."""
    parameter, (low, high) = view.along
    values = low + (np.arange(VALUES) + 0.5) * ((high - low) / VALUES)
    axis: dict[str, Any] = {parameter: values}
    diagram = vi.bifurcation_diagram(
        view.osc,
        transient_impacts=TRANSIENT,
        sample_impacts=IMPACTS,
        tolerances=TOLERANCES,
        workers=1,
        progress=lambda done, total, partial: going(),
        **axis,
    )
    if not going():
        return None
    velocity = diagram["velocity"].values
    finite = np.isfinite(velocity)
    most = float(velocity[finite].max(initial=0.0)) or 1.0
    grains = np.round(velocity[finite] * (GRAIN / most)).astype(np.int64)
    rows = np.broadcast_to(np.arange(len(values))[:, None], velocity.shape)[finite]
    _, first = np.unique(rows * (GRAIN + 1) + grains, return_index=True)
    return Line(parameter, values[rows[first]], velocity[finite][first])
