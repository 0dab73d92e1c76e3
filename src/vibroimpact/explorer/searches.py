"""What takes seconds: exact boundaries in the plane, and motions that coexist at the point."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.plane import TOLERANCES
from vibroimpact.explorer.state import View
from vibroimpact.oscillator import State

Floats = NDArray[np.float64]

MOST_SECONDS = 20.0


@dataclass(frozen=True)
class Curves:
    """Boundaries in the plane: points, kinds and words, and whether the search was cut short."""

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


def find_curves(view: View, going: Callable[[], bool]) -> Curves | None:
    """Return the boundaries in the view's plane, or None if they were no longer wanted."""
    deadline = time.monotonic() + MOST_SECONDS
    found = vi.boundary_curves(
        view.osc,
        (view.x, view.y),
        (view.x_range, view.y_range),
        progress=lambda done, total, partial: going() and time.monotonic() < deadline,
    )
    if not going():
        return None
    kinds = [curve.kind for curve in found]
    words = [f"{curve.kind.replace('_', ' ')}, {_whose(curve)}" for curve in found]
    values = [np.asarray(curve.values, dtype=np.float64) for curve in found]
    return Curves(
        [points[:, 0] for points in values],
        [points[:, 1] for points in values],
        kinds,
        words,
        time.monotonic() < deadline,
    )


def _whose(curve: Any) -> str:
    return str(curve.orbits[0].name) if curve.orbits else "an orbit"


def find_others(view: View) -> list[Other]:
    """Return the motions that starts at the view's point lead to, the one with the largest share first."""
    found = vi.attractors(view.osc, tolerances=TOLERANCES, workers=1)
    return [Other(motion.name, motion.share, motion.max_velocity, motion.start) for motion in found]
