"""What maps of a plane share: cells in colours, cells without a value, axes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, Normalize, to_rgb
from matplotlib.patches import Patch

from vibroimpact.plotting.style import WALL, Floats, Mask, label, label_axes, status_color, status_label
from vibroimpact.status import Status

OPEN = "#ffffff"  # cells without a colour of their own; their patch in a legend has an edge
Layer = tuple[Mask, str, str]  # cells, colour, legend entry


def grid_of(field: xr.DataArray) -> tuple[Floats, Floats, Floats]:
    """Return x, y and values of shape (len(y), len(x)): the map's first axis lies along x."""
    x, y = (field[dim].values.astype(float) for dim in field.dims)
    return x, y, field.values.astype(float).T


def frame_plane(ax: Axes, field: xr.DataArray) -> None:
    """Limit and label the axes by the two axes of a map."""
    x, y = (field[dim] for dim in field.dims)
    ax.set_xlim(float(x[0]), float(x[-1]))
    ax.set_ylim(float(y[0]), float(y[-1]))
    label_axes(ax, x, y)


def colour_mesh(ax: Axes, field: xr.DataArray, values: Any, **how: Any) -> QuadMesh:
    """Draw a rectangle per cell in place of the grid's lines: colours, or numbers with their `cmap` and `norm`."""
    ax.grid(visible=False)
    x, y, _ = grid_of(field)
    return ax.pcolormesh(x, y, values, shading="nearest", zorder=1, rasterized=True, **how)


def draw_numbers(ax: Axes, field: xr.DataArray, colors: str | Colormap, norm: Normalize) -> QuadMesh:
    """Draw the cells of a map in the colours of their finite values."""
    return colour_mesh(ax, field, np.ma.masked_invalid(grid_of(field)[2]), cmap=colors, norm=norm)


def fill_cells(ax: Axes, field: xr.DataArray, layers: Iterable[Layer], others: str | None = None) -> list[Patch]:
    """Fill the cells of each layer with its colour, the `others` with theirs or none; return legend entries."""
    entries = []
    rgba = np.zeros((*grid_of(field)[2].shape, 4)) if others is None else None
    shade = np.full((*grid_of(field)[2].shape, 3), to_rgb(others or OPEN)) if rgba is None else rgba
    for here, color, text in layers:
        shade[here] = to_rgb(color) if rgba is None else (*to_rgb(color), 1.0)
        edge = WALL if color == OPEN else color
        entries.append(Patch(facecolor=color, edgecolor=edge, label=text))
    if entries or others:
        colour_mesh(ax, field, shade)
    return entries


def draw_missing(ax: Axes, sweep: xr.Dataset, field: xr.DataArray) -> list[Patch]:
    """Colour cells without a value by their status; return legend entries that say why."""
    codes = sweep["status"].transpose(*field.dims).values.T
    missing = ~np.isfinite(grid_of(field)[2])
    found = [(missing & (codes == status), status) for status in Status]
    layers = [
        (here, status_color(status), status_label(status, int(here.sum()), "cell"))
        for here, status in found
        if here.any()
    ]
    return fill_cells(ax, field, layers)


def add_bar(ax: Axes, mesh: Any, field: xr.DataArray, note: str = "", text: str = "", **how: Any) -> None:
    """Put the scale of colours beside a map, labelled with quantity and unit."""
    bar = ax.get_figure().colorbar(mesh, ax=ax, **how)  # type: ignore[union-attr]
    bar.set_label(text or label(field), labelpad=6)
    if note:
        bar.ax.set_xlabel(note, loc="left", labelpad=6, fontsize=8.5)
