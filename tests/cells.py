"""Cells of an oscillator over a grid, for tests that ask back ends directly."""

import numpy as np

from vibroimpact.cells import Cells


def make_cells(osc, start=None, axes=None) -> Cells:
    """Return one cell per point of the grid, the last axis fastest."""
    axes = axes or {}
    grids = np.meshgrid(*axes.values(), indexing="ij")
    return osc.cells({name: grid.ravel() for name, grid in zip(axes, grids, strict=True)}, start)
