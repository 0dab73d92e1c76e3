"""A refined map as a request that can be stored and taken up again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from vibroimpact.backends.base import Cells
from vibroimpact.backends.starts import make_cells
from vibroimpact.refinement.lattice import Places
from vibroimpact.stores import SweepRequest

# What of a cell a parameter decides, beside itself: the start lies that far from the stop, at that phase.
DECIDES = {
    "gap": ("gap", "clearance"),
    "omega": ("omega", "periods", "phase"),
    "frequency": ("omega", "periods", "phase"),
}


@dataclass(frozen=True)
class RefinedRequest(SweepRequest):
    """All that decides a refined map; `axes` are those of the fine grid."""

    levels: int = 1
    jump: float | None = None
    along_curves: bool = False

    def identity(self) -> dict[str, Any]:
        """Return what two requests must share for one to go on where the other stopped."""
        how = {"refine": self.levels, "jump": self.jump, "along_curves": self.along_curves}
        return super().identity() | how

    def cells(self, at: Places) -> Cells:
        """Return cells of the fine grid by their flat indices, the same bits as on the whole grid."""
        (first, x), (second, y) = self.axes.items()
        osc = self.oscillator.replace(gap=float(self.axes["gap"][0])) if "gap" in self.axes else self.oscillator
        i, j = divmod(at, len(y))
        across = make_cells(osc, self.start, {first: x})[i]
        cells = make_cells(osc, self.start, {second: y})[j]
        return replace(cells, **{name: getattr(across, name) for name in DECIDES.get(first, (first,))})
