"""Two swept parameters: an index as a mountain range, and as a map with its boundaries."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import contourpy
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import Colormap, Normalize, PowerNorm, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import AbstractPathEffect, withStroke

from vibroimpact.plotting.checks import check_number, check_sweep
from vibroimpact.plotting.style import (
    INK,
    RED,
    STATUS_COLORS,
    WALL,
    Floats,
    label,
    legend_below,
    math,
    new_axes,
    status_label,
    title,
    unit_suffix,
    value_text,
    words,
)
from vibroimpact.plotting.style import reference as reference_oscillator
from vibroimpact.status import Status

COLORS = "viridis"
LEVEL_OF_V = 0.05  # the default boundary of Std, as a part of the velocity scale V


def grid_of(field: xr.DataArray) -> tuple[Floats, Floats, Floats]:
    """Return x, y and values of shape (len(y), len(x)): the map's first axis lies along x."""
    x, y = (field[dim].values.astype(float) for dim in field.dims)
    return x, y, field.values.astype(float).T


def _value_range(values: Floats) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    return (low, high) if high > low else (low, low + (abs(low) or 1.0))


def _shades(values: Floats) -> PowerNorm:
    """Return colours that go with the square root, so that small values are told apart beside a resonance."""
    low, high = _value_range(values)
    return PowerNorm(0.5, vmin=min(0.0, low), vmax=high)


def boundary_lines(sweep: xr.Dataset, index: str, level: float) -> list[Floats]:
    """Return the lines on which an index equals a level, interpolated linearly between cells.

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes.
    index : str
        An index that `sweep` holds.
    level : float
        The value on the lines, in the unit of the index.

    Returns
    -------
    list of numpy.ndarray, each of shape (n, 2)
        Points in the units of the first and the second axis. A closed line ends on its first point.

    Raises
    ------
    ValueError
        `sweep` has not two axes, does not hold the `index`, or `level` is no number.

    Notes
    -----
    Lines stop at cells without a value. Where an index jumps, a line is exact to one cell. Cells that equal
    the level to 1e-6 count as above it.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=200)
    >>> [line.shape[1] for line in boundary_lines(sweep, "std", 0.05)][:1]
    [2]
    """
    x, y, values = grid_of(check_sweep("sweep", sweep, index, 2))
    height = check_number("level", level)
    # A plateau at the very level, such as p/n = 1, would else be crossed wherever its last digits waver.
    values = np.where(np.isclose(values, height, rtol=1e-6, atol=0.0), height + 1e-5 * abs(height), values)
    generator = contourpy.contour_generator(x, y, np.ma.masked_invalid(values), line_type="Separate")
    return [np.asarray(line) for line in generator.lines(height)]


def boundary_level(sweep: xr.Dataset, field: xr.DataArray, level: float | None) -> tuple[float, str] | None:
    """Return the level of the boundary and how the legend explains it; None where no level means anything."""
    units = unit_suffix(words(field)[1], " {}")
    if level is not None:
        return (number := check_number("level", level)), f"{number:.3g}{units}"
    osc = reference_oscillator(sweep)
    if field.name != "std" or osc is None:
        return None
    number = LEVEL_OF_V * osc.velocity_scale
    return number, f"{number:.3g}{units} ({100 * LEVEL_OF_V:.0f} % of the velocity scale)"


def _reference_values(
    sweep: xr.Dataset, field: xr.DataArray, reference: Mapping[str, float] | None
) -> dict[str, float]:
    """Return the axis values to mark: those given, else the oscillator's own on the second axis."""
    limits = {str(dim): (float(field[dim].min()), float(field[dim].max())) for dim in field.dims}
    if reference is None:
        osc, axis = reference_oscillator(sweep), str(field.dims[1])
        own = getattr(osc, axis, None) if osc else None
        return {} if own is None or not limits[axis][0] <= own <= limits[axis][1] else {axis: float(own)}
    chosen = {}
    for name, value in reference.items():
        if name not in limits:
            raise ValueError(f"`reference` names {name!r}; allowed are {', '.join(limits)}; name an axis of the map")
        chosen[name] = check_number("reference", value)
        low, high = limits[name]
        if not low <= chosen[name] <= high:
            raise ValueError(
                f"`reference` is {name} = {value!r}; allowed is {low:g} to {high:g}, the range of the map; "
                "choose a value on it"
            )
    return chosen


def _draw_references(ax: Axes, field: xr.DataArray, values: Mapping[str, float]) -> None:
    """Draw each reference value as a labelled line across the map."""
    halo = [withStroke(linewidth=2.6, foreground="white")]
    for name, value in values.items():
        along_x = name == field.dims[1]
        (ax.axhline if along_x else ax.axvline)(
            value, color=RED, linewidth=1.4, linestyle=(0, (6, 3)), path_effects=halo, zorder=5
        )
        where: dict[str, Any] = {"xy": (1.0, value), "xycoords": ax.get_yaxis_transform(), "xytext": (-4, 3)}
        where |= {"ha": "right", "va": "bottom"}
        if not along_x:
            where = {"xy": (value, 1.0), "xycoords": ax.get_xaxis_transform(), "xytext": (4, -4)}
            where |= {"ha": "left", "va": "top"}
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "boxstyle": "round,pad=0.15"}
        ax.annotate(value_text(name, value), textcoords="offset points", color=RED, fontsize=9, bbox=box, zorder=6,
                    **where)  # fmt: skip


def draw_missing(ax: Axes, sweep: xr.Dataset, field: xr.DataArray) -> list[Patch]:
    """Colour cells without a value by their status; return legend entries that say why."""
    x, y, values = grid_of(field)
    codes = sweep["status"].transpose(*field.dims).values.T
    missing = ~np.isfinite(values)
    entries, shade = [], np.zeros((*values.shape, 4))
    for status in Status:
        here = missing & (codes == status)
        if here.any():
            color = STATUS_COLORS.get(status, WALL)
            shade[here] = (*to_rgb(color), 1.0)
            entries.append(Patch(color=color, label=status_label(status, int(here.sum()), "cell")))
    if entries:
        ax.pcolormesh(x, y, shade, shading="nearest", rasterized=True, zorder=1)
    return entries


def colour_mesh(ax: Axes, x: Floats, y: Floats, values: Floats, colors: str | Colormap, norm: Normalize) -> QuadMesh:
    """Draw a rectangle a cell, nothing where it has no finite value, in the place of the grid's lines."""
    ax.grid(visible=False)
    return ax.pcolormesh(
        x, y, np.ma.masked_invalid(values), shading="nearest", zorder=1, rasterized=True, cmap=colors, norm=norm
    )


def draw_cells(ax: Axes, sweep: xr.Dataset, field: xr.DataArray) -> list[Patch]:
    """Draw every cell of an index in colour, with a scale beside; return legend entries for those without a value."""
    x, y, values = grid_of(field)
    mesh = colour_mesh(ax, x, y, values, COLORS, _shades(values))
    missing = draw_missing(ax, sweep, field)
    frame_plane(ax, field)
    _label_bar(ax.get_figure().colorbar(mesh, ax=ax, pad=0.02), field)  # type: ignore[union-attr]
    return missing


def _label_bar(bar: Any, field: xr.DataArray) -> None:
    """Name what the colours tell, and that they do not go in proportion."""
    bar.set_label(label(field))
    bar.ax.set_xlabel("root scale", loc="left", labelpad=6, fontsize=8.5)


def _draw_boundary(ax: Axes, lines: list[Floats]) -> list[AbstractPathEffect]:
    """Draw the lines of a level, white with a dark halo, which is returned for the legend."""
    halo: list[AbstractPathEffect] = [withStroke(linewidth=1.9, foreground=INK)]
    drawn = LineCollection(lines, colors="white", linewidths=0.8, zorder=4)
    drawn.set_path_effects(halo)
    ax.add_collection(drawn, autolim=False)
    return halo


def frame_plane(ax: Axes, field: xr.DataArray) -> None:
    """Limit and label the axes by the two axes of a map."""
    x, y = (field[dim] for dim in field.dims)
    ax.set_xlim(float(x[0]), float(x[-1]))
    ax.set_ylim(float(y[0]), float(y[-1]))
    ax.set_xlabel(label(x))
    ax.set_ylabel(label(y))


def index_contour(
    sweep: xr.Dataset,
    index: str = "std",
    level: float | None = None,
    reference: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw an index over two parameters in colour, with boundary lines and a marked reference value.

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes; the first lies along x.
    index : str
        The index drawn, one that `sweep` holds.
    level : float, optional
        Value on the boundary lines, in the unit of the index. Without it, 5 % of the velocity scale
        V = max(f, k |g|)/sqrt(k m) of the reference oscillator for `std`, as the legend tells; other indices
        have no lines then.
    reference : dict of str to float, optional
        Axis values to mark by a line, such as ``{"mass": 1.0}``. Without it, the reference oscillator's own
        value on the second axis; ``{}`` marks none.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `sweep` has not two axes or does not hold the `index`; `level` is no number; `reference` is off the map.

    Notes
    -----
    Every cell is drawn as computed, without smoothing; colours go with the square root of the index. Cells
    without a value are grey or red by their status, which the legend names. "Stable" below a level of Std is
    the paper's reading: a stable period-1 impact-2 motion has a large Std too.

    References
    ----------
    Lee, figures 11b, 13b, 15b, 17b, 19b.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=200)
    >>> vi.plotting.index_contour(sweep, reference={"mass": 1.0}).get_ylabel()
    'mass $m$ [kg]'
    """
    field = check_sweep("sweep", sweep, index, 2)
    boundary = boundary_level(sweep, field, level)
    marked = _reference_values(sweep, field, reference)
    ax = new_axes(ax, (7.2, 5.4), title(sweep))
    entries: list[Any] = list(draw_cells(ax, sweep, field))
    if boundary is not None:
        halo = _draw_boundary(ax, boundary_lines(sweep, index, boundary[0]))
        told = f"boundary: {math(words(field)[2] or str(field.name))} = {boundary[1]}"
        entries.insert(0, Line2D([], [], color="white", linewidth=0.8, path_effects=halo, label=told))
    _draw_references(ax, field, marked)
    legend_below(ax, entries)
    return ax


def index_surface(sweep: xr.Dataset, index: str = "std", ax: Axes | None = None) -> Axes:
    """Draw an index over two parameters as a surface: mountains where motions vary, plains where they settle.

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes; the first lies along x.
    index : str
        The index drawn, one that `sweep` holds.
    ax : matplotlib.axes.Axes, optional
        Three-dimensional axes to draw on; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes
        The three-dimensional axes.

    Raises
    ------
    ValueError
        `sweep` has not two axes or does not hold the `index`, or `ax` is flat.

    Notes
    -----
    Every cell is drawn: none is thinned out. Cells without a value are holes; `index_contour` says why.

    References
    ----------
    Lee, figures 11a, 13a, 15a, 17a, 19a.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=200)
    >>> vi.plotting.index_surface(sweep).name
    '3d'
    """
    field = check_sweep("sweep", sweep, index, 2)
    if ax is not None and ax.name != "3d":
        raise ValueError(
            f"`ax` is flat ({ax.name}); allowed are three-dimensional axes; make them with subplot projection='3d'"
        )
    solid: Any = new_axes(ax, (7.2, 5.6), title(sweep), projection="3d")
    x, y, values = grid_of(field)
    low, high = _value_range(values)
    surface = solid.plot_surface(
        *np.meshgrid(x, y), values, rcount=len(y), ccount=len(x), cmap=COLORS, norm=_shades(values),
        linewidth=0.0, antialiased=False, rasterized=True,
    )  # fmt: skip
    solid.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), zlim=(min(0.0, low), high))
    solid.set_xlabel(label(field[field.dims[0]]), labelpad=6)
    solid.set_ylabel(label(field[field.dims[1]]), labelpad=6)
    long_name, units, symbol = words(field)
    solid.set_zlabel(f"{math(symbol) if symbol else long_name}{unit_suffix(units)}", labelpad=4)
    bar = solid.get_figure().colorbar(surface, ax=solid, shrink=0.6, pad=0.08)
    _label_bar(bar, field)
    solid.set_box_aspect((1.2, 1.2, 0.7), zoom=0.95)  # leaves room for the labels outside the box
    solid.view_init(elev=38, azim=-70)
    return solid  # type: ignore[no-any-return]
