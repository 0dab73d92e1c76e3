"""Division of the cells of a request into parts (tiles of a grid, or lists of cells), and the interface of places."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from threading import Event
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import get_backend
from vibroimpact.backends.base import Outcome
from vibroimpact.cells import Tiling
from vibroimpact.request import Places, Request

if TYPE_CHECKING:
    from pathlib import Path


CELLS = 4096  # per tile: 0.25 s of work, of which writing takes 1 % and lanes idle at the end 2 %
FEW = 4  # cells per tile with slow back ends: an interrupted sweep loses no more
LISTED, FEW_LISTED = 1 << 14, 64  # the same for refined maps

# Cells of a request: their flat indices, or a box of the grid.
Part = slice | Places | tuple[slice, ...]
# Results as they arrive: the number of a part, which of its cells have ended, and their results.
Pieces = Generator[tuple[int, slice | Places, Any], None, None]


def usual_tile(request: Request, *, listed: bool = False) -> int:
    """Return the usual number of cells per tile; with `listed`, that of a refined map."""
    slow = get_backend(request.backend, time_step=request.time_step, elsewhere=True).slow
    many, few = (LISTED, FEW_LISTED) if listed else (CELLS, FEW)
    return few if slow else many


def cut(shape: tuple[int, ...], cells: int = CELLS) -> Tiling:
    """Cut a grid into tiles of about `cells` cells, as close to cubes as possible.

    Examples
    --------
    >>> cut((200, 300)).tile, len(cut((200, 300)))
    ((64, 64), 20)
    >>> cut((5, 100_000)).tile
    (5, 820)
    """
    sides = [1] * len(shape)
    remaining = float(cells)
    for waiting, axis in zip(range(len(shape), 0, -1), sorted(range(len(shape)), key=shape.__getitem__), strict=True):
        sides[axis] = min(shape[axis], math.ceil(round(remaining ** (1.0 / waiting), 9)))
        remaining = max(remaining / sides[axis], 1.0)
    return Tiling(shape, tuple(sides))


def flat(part: Part, request: Request) -> Places:
    """Return the flat indices of the cells of a part of a request."""
    if isinstance(part, tuple):
        return request.box(part)
    return np.arange(*part.indices(len(request))) if isinstance(part, slice) else part


class Gathered:
    """Pieces of parts, collected until a part is complete."""

    def __init__(self) -> None:
        self._incomplete: dict[int, tuple[Outcome, NDArray[np.bool_]]] = {}

    def add(self, part: int, size: int, which: Places, outcome: Outcome) -> Outcome | None:
        """Add a piece of a part of `size` cells; return the part's results once it is complete."""
        if part not in self._incomplete:
            results = {name: np.empty((size, *values.shape[1:]), values.dtype) for name, values in outcome.items()}
            self._incomplete[part] = results, np.zeros(size, bool)
        results, ended = self._incomplete[part]
        for name, values in outcome.items():
            results[name][which] = values
        ended[which] = True
        return self._incomplete.pop(part)[0] if ended.all() else None


class Place(Protocol):
    """The interface of a place that computes cells."""

    def part_size(self, request: Request, cells: int) -> int:
        """Return the number of cells that a part should hold when `cells` are to be computed."""
        ...

    def compute(self, request: Request, parts: Sequence[Part], stop: Event, store: Path | None = None) -> Pieces:
        """Yield (number of a part, which of its cells have ended, their results) until all have or `stop` is set.

        A worker that can reach the `store` may write a tile there, and return its record instead of its results.
        """
        ...
