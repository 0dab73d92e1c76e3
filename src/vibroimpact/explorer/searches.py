"""What takes seconds: exact boundaries in the plane, and motions that coexist at the point."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.limits import granted, stiffness
from vibroimpact.explorer.state import View
from vibroimpact.oscillator import State

Floats = NDArray[np.float64]
Going = Callable[[], bool]

MOST_SECONDS = 20.0
IMPACTS = 2000  # of a start, for which a budget is granted


@dataclass(frozen=True)
class Curves:
    """Boundaries in the plane: points, kinds and words, and whether the search came to its end."""

    x: list[Floats]
    y: list[Floats]
    kinds: list[str]
    words: list[str]
    complete: bool = True


@dataclass(frozen=True)
class Other:
    """A motion that starts lead to: its name, the share of the starts, its hardest hit, and a state on it."""

    name: str
    share: float
    max_velocity: float
    start: State


class Clock:
    """What a search asks after each of its steps: whether it is still wanted, and whether it has time left."""

    def __init__(self, going: Going) -> None:
        self._going, self._deadline, self.complete = going, time.monotonic() + MOST_SECONDS, True

    def __call__(self, done: int, total: int, partial: Any) -> bool:
        """Return whether to go on."""
        self.complete = self.complete and self._going() and time.monotonic() < self._deadline
        return self.complete


def find_curves(view: View, going: Going) -> Curves | None:
    """Return the boundaries in the view's plane, or None if they were no longer wanted."""
    clock = Clock(going)
    found = vi.boundary_curves(view.osc, (view.x, view.y), (view.x_range, view.y_range), progress=clock)
    if not going():
        return None
    values = [np.asarray(curve.values, dtype=np.float64) for curve in found]
    return Curves(
        x=[points[:, 0] for points in values],
        y=[points[:, 1] for points in values],
        kinds=[curve.kind for curve in found],
        words=[f"{curve.kind.replace('_', ' ')}, {_whose(curve)}" for curve in found],
        complete=clock.complete,
    )


def _whose(curve: Any) -> str:
    return str(curve.orbits[0].name) if curve.orbits else "an orbit"


def find_others(view: View, going: Going) -> tuple[list[Other], bool] | None:
    """Return the motions that starts at the view's point lead to and whether that is all, or None if not wanted.

    The one with the largest share of the starts comes first.
    """
    clock, budget = Clock(going), granted(stiffness(view.osc), IMPACTS)
    found = vi.attractors(view.osc, tolerances=budget, workers=1, progress=clock)
    if not going():
        return None
    return [Other(motion.name, motion.share, motion.max_velocity, motion.start) for motion in found], clock.complete
