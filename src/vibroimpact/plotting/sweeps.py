"""What figures of sweeps share: is this the sweep that is drawn; its plane, its cells in colours, its scale."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, Normalize, to_rgb
from matplotlib.patches import Patch

from vibroimpact.parameters import unknown
from vibroimpact.plotting.style import SAMPLE_DIMS, WALL, Floats, Layer, by_status, label, label_axes, refused

OPEN = "#ffffff"  # cells without a colour of their own; their patch in a legend has an edge


def check_sweep(argument: str, value: Any, index: str, n_axes: int) -> tuple[xr.Dataset, xr.DataArray]:
    """Return a parameter map over `n_axes` axes and its `index`, or raise `ValueError` saying what to select.

    Of several initial conditions it is the largest value, which the map's `note` says.
    """
    allowed = f"a parameter_map over {('one axis', 'two axes')[n_axes - 1]}"
    if not isinstance(value, xr.Dataset) or "status" not in value or set(value.dims) & set(SAMPLE_DIMS):
        raise refused(argument, value, allowed, "pass what vibroimpact.parameter_map returns")
    value, field = _with_index(value, index)
    axes = [str(dim) for dim in field.dims if dim != "start"]
    if len(axes) == n_axes and "point" not in axes:
        check_lengths(argument, field)
        return value, field
    chosen = ", ".join(f"{axis}={float(field[axis][0]):g}" for axis in axes[n_axes:])
    hint = f"select one value of the others, for instance sweep.sel({chosen}, method='nearest')"
    if "point" in axes:
        hint = "draw scattered designs with index_scatter"
    elif len(axes) < n_axes:
        hint = "draw it with index_curve" if len(axes) == 1 else "sweep more axes"
    count = f"{len(axes)} {'axis' if len(axes) == 1 else 'axes'} ({', '.join(axes)})"
    raise ValueError(f"`{argument}` must be {allowed}, got {count}; {hint}")


def check_lengths(argument: str, field: xr.DataArray) -> None:
    """Raise `ValueError` where an axis has a single value."""
    for dim, size in field.sizes.items():
        if size < 2 and dim != "start":
            raise ValueError(f"`{argument}` needs two or more values along each axis, got 1 along {dim}")


def check_points(argument: str, value: Any, index: str) -> tuple[xr.Dataset, xr.DataArray, list[xr.DataArray]]:
    """Return a map of scattered designs, its `index` and the parameters that vary, or raise `ValueError`."""
    if not isinstance(value, xr.Dataset) or "status" not in value or "point" not in value["status"].dims:
        hint = "pass what vibroimpact.parameter_map(points=...) returns"
        raise refused(argument, value, "a parameter_map of scattered designs", hint)
    value, field = _with_index(value, index)
    varied = [coord for name, coord in value.coords.items() if coord.dims == ("point",) and name != "point"]
    if not varied:
        raise refused(argument, value, "a parameter_map with the parameters that vary", "keep its coordinates")
    return value, field, varied


def _with_index(sweep: xr.Dataset, index: str) -> tuple[xr.Dataset, xr.DataArray]:
    """Return a map and its index: the largest over several initial conditions, NaN with the status of the first."""
    held = [str(name) for name in sweep.data_vars if name != "status"]
    if index not in held:
        raise unknown("`index`", index, held, "or run the map again with it among `indices`")
    if "start" in sweep[index].dims and index != "motion":
        note = f"largest of {sweep.sizes['start']} initial conditions"
        largest, status = sweep[[index]].max("start", keep_attrs=True), sweep["status"].isel(start=0, drop=True)
        sweep = largest.assign(status=status).assign_attrs(sweep.attrs, note=note)
    return sweep, sweep[index]


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
    shape = grid_of(field)[2].shape
    shade, entries = np.zeros((*shape, 4)) if others is None else np.full((*shape, 3), to_rgb(others)), []
    for here, color, text in (layer for layer in layers if layer[0].any()):
        shade[here] = (*to_rgb(color), 1.0)[: shade.shape[2]]
        entries.append(Patch(facecolor=color, edgecolor=WALL if color == OPEN else color, label=text))
    if entries or others:
        colour_mesh(ax, field, shade)
    return entries


def draw_missing(ax: Axes, sweep: xr.Dataset, field: xr.DataArray) -> list[Patch]:
    """Colour cells without a value by their status; return legend entries that say why."""
    codes = sweep["status"].transpose(*field.dims).values.T
    return fill_cells(ax, field, by_status(~np.isfinite(grid_of(field)[2]), codes, "cell"))


def add_bar(ax: Axes, mesh: Any, field: xr.DataArray, note: str = "", text: str = "", **how: Any) -> None:
    """Put the scale of colours beside a map, labelled with quantity and unit."""
    bar = ax.get_figure().colorbar(mesh, ax=ax, **how)  # type: ignore[union-attr]
    bar.set_label(text or label(field), labelpad=6)
    if note:
        bar.ax.set_xlabel(note, loc="left", labelpad=6, fontsize=8.5)
