"""The fine grid behind a coarse one, and the lattices in between."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.int64]


def finer(values: Floats, levels: int) -> Floats:
    """Return an axis whose every interval is cut into 2^levels equal ones; its own values stay as they are.

    Examples
    --------
    >>> finer(np.array([0.0, 1.0, 3.0]), 1).tolist()
    [0.0, 0.5, 1.0, 2.0, 3.0]
    """
    cuts = 1 << levels
    parts = np.arange(cuts) / cuts
    between = values[:-1, None] + np.diff(values)[:, None] * parts
    return np.append(between.ravel(), values[-1])


def quads(field: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return the four corners of every square of neighbours of a lattice."""
    return field[:-1, :-1], field[1:, :-1], field[:-1, 1:], field[1:, 1:]


def points_of(squares: Flags) -> Flags:
    """Return the points of the lattice of half the step that lie in or on the marked squares."""
    rows, columns = squares.shape
    points = np.zeros((2 * rows + 1, 2 * columns + 1), bool)
    for i in range(3):
        for j in range(3):
            points[i : i + 2 * rows - 1 : 2, j : j + 2 * columns - 1 : 2] |= squares
    return points


def places(points: Flags, step: int, shape: tuple[int, ...]) -> Places:
    """Return where marked points of a lattice lie on the fine grid, as flat indices in ascending order."""
    i, j = np.nonzero(points)
    at = i * shape[1]
    at += j
    at *= step
    return at
