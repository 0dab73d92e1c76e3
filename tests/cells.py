"""Cells of an oscillator over a grid, and columns of samples, for tests that ask back ends directly."""

from dataclasses import fields

import numpy as np

from vibroimpact.cells import Cells


def make_cells(osc, start=None, axes=None) -> Cells:
    """Return one cell per point of the grid, the last axis fastest."""
    axes = axes or {}
    grids = np.meshgrid(*axes.values(), indexing="ij")
    return osc.cells({name: grid.ravel() for name, grid in zip(axes, grids, strict=True)}, start)


def columns_of(samples):
    """Return all columns of samples by name, those of contacts among them."""
    columns = {field.name: getattr(samples, field.name) for field in fields(samples)}
    return columns | columns.pop("contacts")._asdict()
