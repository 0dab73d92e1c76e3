"""What indices are measured in: on a curve of equal omega/omega_n motions are alike but for their scale."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vibroimpact.backends.base import Cells
from vibroimpact.indices import INDICES
from vibroimpact.refinement.lattice import Floats, Places


@dataclass(frozen=True)
class Curves:
    """What each axis adds to ln(omega/omega_n), and the cells at some places, which tell the scales there."""

    parts: tuple[Floats, Floats]
    cells: Callable[[Places], Cells]

    def scale(self, name: str, at: Places) -> Floats | float:
        """Return what an index is measured in at some places: of speeds V, of rates omega, of energies m V^2."""
        units = INDICES[name].units if name in INDICES else "1"
        if units == "1":
            return 1.0
        cells = self.cells(at)
        force = np.maximum(cells.amplitude, cells.stiffness * np.abs(cells.gap))
        force = np.where(force > 0.0, force, 1.0)
        scales = {
            "m/s": force / np.sqrt(cells.stiffness * cells.mass),
            "1/s": cells.omega,
            "J": force * force / cells.stiffness,
            "m": force / cells.stiffness,
        }
        found: Floats = scales[units]
        return found
