"""A refined map as a request that can be stored, taken up again, and cut into batches of scattered cells."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from vibroimpact.backends.base import Cells
from vibroimpact.backends.starts import make_cells
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.refinement.lattice import Floats, Places
from vibroimpact.request import SLOW, Request

# What of a cell a parameter decides, beside itself: the start lies that far from the stop, at that phase.
DECIDES = {
    "gap": ("gap", "clearance"),
    "omega": ("omega", "periods", "phase"),
    "frequency": ("omega", "periods", "phase"),
}
CHUNK = 1 << 14  # cells kept together: a second or more of work
FEW = 64  # the same, where a cell takes up to seconds


@dataclass(frozen=True)
class RefinedRequest(Request):
    """All that decides a refined map; `axes` are those of the fine grid."""

    levels: int = 1
    jump: float | None = None

    def identity(self) -> dict[str, Any]:
        """Return what two requests must share for one to go on where the other stopped."""
        return super().identity() | self._how()

    def arguments(self) -> dict[str, Any]:
        """Return the call in the words of the API."""
        return super().arguments() | self._how()

    def _how(self) -> dict[str, Any]:
        return {"refine": self.levels, "jump": self.jump}

    @property
    def chunk(self) -> int:
        """Cells kept together."""
        return FEW if self.backend in SLOW else CHUNK

    def cells(self, at: Places) -> Cells:
        """Return cells of the fine grid by their flat indices, the same bits as on the whole grid."""
        return scattered_cells(self.oscillator, self.start, tuple(self.axes), *self._values(at))

    def batch(self, at: Places) -> Batch:
        """Return a request of these cells alone, small enough to travel."""
        shared = {field.name: getattr(self, field.name) for field in fields(Request)}
        pairs = {CELL: np.stack(self._values(at), axis=1)}
        return Batch(**shared | {"axes": pairs}, names=tuple(self.axes))

    def _values(self, at: Places) -> tuple[Floats, Floats]:
        first, second = self.axes.values()
        return first[at // len(second)], second[at % len(second)]


CELL = "cell"


@dataclass(frozen=True)
class Batch(Request):
    """Scattered cells of a plane, in a line: its one axis holds pairs of the values of the parameters `names`."""

    names: tuple[str, ...] = ()

    def cells_of(self, axes: dict[str, Floats]) -> Cells:
        """Return the cells of a stretch of the line."""
        first, second = axes[CELL].T
        return scattered_cells(self.oscillator, self.start, self.names, first, second)


def scattered_cells(
    osc: ImpactOscillator, start: State | None, names: tuple[str, ...], first: Floats, second: Floats
) -> Cells:
    """Return one cell a pair of values of two parameters, the same bits as on a grid."""
    one, other = names
    # A start may be refused at the oscillator's own gap, which an axis replaces.
    safe = osc.replace(gap=float(second.min())) if other == "gap" and len(second) else osc
    across = make_cells(safe, start, {one: first})
    decided = {name: getattr(across, name) for name in DECIDES.get(one, (one,))}
    safe = osc.replace(gap=float(first.min())) if one == "gap" and len(first) else osc
    return replace(make_cells(safe, start, {other: second}), **decided)
