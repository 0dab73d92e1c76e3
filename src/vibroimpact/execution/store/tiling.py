"""How a grid is cut into tiles."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vibroimpact.request import Request

SLOW = ("reference", "fixed-step")  # back ends that take up to seconds per cell
FEW = 4  # cells of a tile with them
CELLS = 4096  # of a tile: a quarter of a second's work, in which writing it is 1 % and the last lanes' idling 2 %


def usual_tile(request: Request) -> int:
    """Return the cells of a tile unless told otherwise: no more than may be lost when a sweep ends at once."""
    return FEW if request.backend in SLOW else CELLS


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

    def place(self, number: int) -> tuple[int, ...]:
        """Return how many tiles lie before tile `number` along each axis."""
        return tuple(part.start // side for part, side in zip(self[number], self.tile, strict=True))

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
