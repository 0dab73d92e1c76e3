"""How a grid is cut into tiles, and which cells a part of it holds."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibroimpact.backends import get_backend
from vibroimpact.request import Places, Request

CELLS = 4096  # of a tile: a quarter of a second's work, in which writing it is 1 % and the last lanes' idling 2 %

FEW = 4  # cells of a tile with slow back ends: no more may be lost when a sweep ends at once
LISTED, FEW_LISTED = 1 << 14, 64  # the same, of the cells of a refined map

# Cells of a request: by their flat indices, or a box.
Part = slice | Places | tuple[slice, ...]
# What comes of parts, as it comes: the number of a part, which of its cells have ended, and their results.
Pieces = Generator[tuple[int, slice | Places, Any], None, None]


@dataclass(frozen=True)
class Tiling:
    """A grid of cells cut into equal boxes, those at the far edges smaller.

    Parameters
    ----------
    shape : tuple of int
        Cells along each axis of the grid.
    tile : tuple of int
        Cells along each axis of a tile.
    """

    shape: tuple[int, ...]
    tile: tuple[int, ...]

    @property
    def counts(self) -> tuple[int, ...]:
        """Tiles along each axis."""
        return tuple(-(-cells // side) for cells, side in zip(self.shape, self.tile, strict=True))

    def __len__(self) -> int:
        return math.prod(self.counts)

    def __getitem__(self, number: int) -> tuple[slice, ...]:
        """Return where tile `number` lies, the last axis fastest."""
        places = []
        for count, side, cells in zip(self.counts[::-1], self.tile[::-1], self.shape[::-1], strict=True):
            number, at = divmod(number, count)
            places.append(slice(at * side, min((at + 1) * side, cells)))
        return tuple(places[::-1])

    def cells(self, number: int) -> int:
        """Return how many cells a tile holds."""
        return math.prod(part.stop - part.start for part in self[number])


def _slow(request: Request) -> bool:
    return get_backend(request.backend, time_step=request.time_step, elsewhere=True).slow


def usual_tile(request: Request) -> int:
    """Return the cells of a tile unless the user gives a number."""
    return FEW if _slow(request) else CELLS


def listed_tile(request: Request) -> int:
    """Return how many cells of a refined map are kept together."""
    return FEW_LISTED if _slow(request) else LISTED


def cut(shape: tuple[int, ...], cells: int = CELLS) -> Tiling:
    """Cut a grid into tiles of about as many cells, as nearly cubes as it allows.

    Examples
    --------
    >>> cut((200, 300)).tile, len(cut((200, 300)))
    ((64, 64), 20)
    >>> cut((5, 100_000)).tile
    (5, 820)
    """
    sides = [1] * len(shape)
    left = float(cells)
    for waiting, axis in zip(range(len(shape), 0, -1), sorted(range(len(shape)), key=shape.__getitem__), strict=True):
        sides[axis] = min(shape[axis], math.ceil(round(left ** (1.0 / waiting), 9)))
        left = max(left / sides[axis], 1.0)
    return Tiling(shape, tuple(sides))


def flat(part: Part, request: Request) -> Places:
    """Return the flat indices of the cells of a part of a request."""
    if isinstance(part, tuple):
        return request.box(part)
    return np.arange(*part.indices(len(request))) if isinstance(part, slice) else part
