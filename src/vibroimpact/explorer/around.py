"""What surrounds the point: the diagram along a line through it, exact boundaries, and coexisting motions."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.plane import TRANSIENT
from vibroimpact.explorer.state import Range, View, granted, stiffness
from vibroimpact.oscillator import State

Floats = NDArray[np.float64]
KeepGoing = Callable[[], bool]

LINE_SECONDS, SEARCH_SECONDS = 10.0, 20.0  # a diagram and a search are stopped after so long
VALUES, PART = 200, 100  # along the line; computed at a time
IMPACTS = 48  # of each value
BUDGETED = 5000  # impacts for which a budget is granted: the few of a diagram get a share of it
RESOLUTION = 10_000  # velocities that a diagram distinguishes, up to the largest
START_IMPACTS = 2000  # of an initial condition, for which a budget is granted


@dataclass(frozen=True)
class Line:
    """Impact velocities over one parameter, each given once."""

    parameter: str
    ends: Range
    values: Floats
    velocities: Floats


@dataclass(frozen=True)
class Curves:
    """Boundaries in the plane: points, kinds and descriptions."""

    x: list[Floats]
    y: list[Floats]
    kinds: list[str]
    descriptions: list[str]


@dataclass(frozen=True)
class Other:
    """A motion that initial conditions lead to: its name, the share of them, its largest velocity, a state on it."""

    name: str
    share: float
    max_velocity: float
    start: State


class Clock:
    """The progress callback of a search: whether it is still wanted, and has time left."""

    def __init__(self, keep_going: KeepGoing, seconds: float) -> None:
        self._keep_going, self._deadline, self.complete = keep_going, time.monotonic() + seconds, True

    def __call__(self, *progress: Any) -> bool:
        """Return whether to go on."""
        self.complete = self.complete and self._keep_going() and time.monotonic() < self._deadline
        return self.complete


def compute_line(view: View, keep_going: KeepGoing) -> tuple[Line, bool] | None:
    """Return the impact velocities along the view's line, and whether all of them; None if no longer wanted."""
    parameter, (low, high) = view.along
    values: Floats = low + (np.arange(VALUES, dtype=np.float64) + 0.5) * ((high - low) / VALUES)
    clock, parts = Clock(keep_going, LINE_SECONDS), [_velocities(view, parameter, values[:PART])]
    for first in range(PART, VALUES, PART):
        if clock():
            parts.append(_velocities(view, parameter, values[first : first + PART]))
    if not keep_going():
        return None
    velocity = np.concatenate(parts)
    finite = np.isfinite(velocity)
    largest = float(velocity[finite].max(initial=0.0)) or 1.0
    rounded = np.round(velocity[finite] * (RESOLUTION / largest)).astype(np.int64)
    rows = np.broadcast_to(np.arange(len(velocity))[:, None], velocity.shape)[finite]
    _, distinct = np.unique(rows * (RESOLUTION + 1) + rounded, return_index=True)
    return Line(parameter, (low, high), values[rows[distinct]], velocity[finite][distinct]), clock.complete


def _velocities(view: View, parameter: str, values: Floats) -> Floats:
    """Return the velocities of some impacts at each value, NaN where there are fewer."""
    axis: dict[str, Any] = {parameter: values}
    diagram = vi.bifurcation_diagram(
        view.osc,
        transient_impacts=TRANSIENT,
        sample_impacts=IMPACTS,
        tolerances=granted(view.stiffness, BUDGETED),
        workers=1,
        **axis,
    )
    found = diagram["velocity"].values
    return np.pad(found, ((0, 0), (0, IMPACTS - found.shape[1])), constant_values=np.nan)


def find_curves(view: View, keep_going: KeepGoing) -> tuple[Curves, bool] | None:
    """Return the boundaries in the view's plane, and whether all of them; None if no longer wanted."""
    clock = Clock(keep_going, SEARCH_SECONDS)
    found = vi.boundary_curves(view.osc, (view.x, view.y), (view.x_range, view.y_range), progress=clock)
    if not keep_going():
        return None
    points = [np.asarray(curve.values, dtype=np.float64) for curve in found]
    curves = Curves(
        x=[at[:, 0] for at in points],
        y=[at[:, 1] for at in points],
        kinds=[curve.kind for curve in found],
        descriptions=[
            f"{curve.kind.replace('_', ' ')}, {curve.orbits[0].name if curve.orbits else 'an orbit'}" for curve in found
        ],
    )
    return curves, clock.complete


def find_others(view: View, keep_going: KeepGoing) -> tuple[list[Other], bool] | None:
    """Return the motions that initial conditions at the view's point lead to, and whether all of them.

    The one with the largest share of the initial conditions comes first; None if no longer wanted.
    """
    clock, budget = Clock(keep_going, SEARCH_SECONDS), granted(stiffness(view.osc), START_IMPACTS)
    found = vi.attractors(view.osc, tolerances=budget, workers=1, progress=clock)
    if not keep_going():
        return None
    return [Other(motion.name, motion.share, motion.max_velocity, motion.start) for motion in found], clock.complete
