"""An index over two parameters: coloured map, surface, boundary lines; over scattered designs; the cells of any map."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import contourpy
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import PowerNorm, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from vibroimpact.parameters import invalid, real_number, unknown
from vibroimpact.plotting import diagrams, style
from vibroimpact.plotting.style import BLUE, DOTS, INK, RED, WALL, Floats, Layer, on_axes

COLORS = "viridis"
OPEN = "#ffffff"  # cells without a colour of their own; their patch in a legend has an edge
LEVEL_OF_V = 0.05  # the default boundary of Std, as a part of the velocity scale V


def grid_of(field: xr.DataArray) -> tuple[Floats, Floats, Floats]:
    """Return x, y and values of shape (len(y), len(x)): the map's first axis lies along x."""
    x, y = (field[dim].values.astype(float) for dim in field.dims)
    return x, y, field.values.astype(float).T


def frame_plane(ax: Axes, field: xr.DataArray) -> None:
    """Limit and label the axes by the two axes of a map."""
    x, y = (field[dim] for dim in field.dims)
    ax.set_xlim(float(x[0]), float(x[-1]))
    ax.set_ylim(float(y[0]), float(y[-1]))
    style.label_axes(ax, x, y)


def colour_mesh(ax: Axes, field: xr.DataArray, values: Any, **how: Any) -> QuadMesh:
    """Draw a rectangle per cell in place of the grid's lines: colours, or numbers with their `cmap` and `norm`."""
    ax.grid(visible=False)
    x, y, _ = grid_of(field)
    return ax.pcolormesh(x, y, values, shading="nearest", zorder=1, rasterized=True, **how)


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
    return fill_cells(ax, field, style.by_status(~np.isfinite(grid_of(field)[2]), codes, "cell"))


def add_bar(ax: Axes, mesh: Any, field: xr.DataArray, note: str = "", text: str = "", **how: Any) -> None:
    """Put the scale of colours beside a map, labelled with quantity and unit."""
    bar = ax.get_figure().colorbar(mesh, ax=ax, **how)  # type: ignore[union-attr]
    bar.set_label(text or style.label(field), labelpad=6)
    if note:
        bar.ax.set_xlabel(note, loc="left", labelpad=6, fontsize=8.5)


def _shades(values: Floats) -> PowerNorm:
    """Return colours on a square-root scale from zero, so that small values differ visibly beside a resonance."""
    finite = values[np.isfinite(values)]
    low, high = float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf))
    if low >= high:  # one value, or none
        low, high = (low, low + (abs(low) or 1.0)) if finite.size else (0.0, 1.0)
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
        `sweep` does not have two axes or does not hold the `index`; `level` is not a number.

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
    x, y, values = grid_of(diagrams.check_sweep("sweep", sweep, index, 2)[1])
    height = real_number("level", level)
    # A plateau at the very level, such as p/n = 1, would else be crossed wherever its last digits waver.
    values = np.where(np.isclose(values, height, rtol=1e-6, atol=0.0), height + 1e-5 * abs(height), values)
    generator = contourpy.contour_generator(x, y, np.ma.masked_invalid(values), line_type="Separate")
    return [np.asarray(line) for line in generator.lines(height)]


def _boundary_level(sweep: xr.Dataset, field: xr.DataArray, level: float | None) -> tuple[float, str] | None:
    """Return the level of the boundary and how the legend explains it; None where no level has a meaning."""
    units = style.unit_suffix(style.described(field)[1], " {}")
    if level is not None:
        return (number := real_number("level", level)), f"{number:.3g}{units}"
    osc = style.reference(sweep)
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
        axis = str(field.dims[1])
        own = style.own_value(sweep, axis)
        return {} if own is None or not limits[axis][0] <= own <= limits[axis][1] else {axis: float(own)}
    chosen = {}
    for name, value in reference.items():
        if name not in limits:
            raise unknown("axis in `reference`", name, limits)
        chosen[name] = real_number("reference", value)
        low, high = limits[name]
        if not low <= chosen[name] <= high:
            raise invalid(f"reference[{name!r}]", value, f"between {low:g} and {high:g}, the range of the map")
    return chosen


def _draw_references(ax: Axes, field: xr.DataArray, values: Mapping[str, float]) -> None:
    """Draw each reference value as a labelled line across the map."""
    halo = [withStroke(linewidth=2.6, foreground="white")]
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "boxstyle": "round,pad=0.15"}
    look: dict[str, Any] = {"color": RED, "fontsize": 9, "bbox": box, "zorder": 6, "textcoords": "offset points"}
    for name, value in values.items():
        along_x = name == field.dims[1]
        (ax.axhline if along_x else ax.axvline)(
            value, color=RED, linewidth=1.4, linestyle=(0, (6, 3)), path_effects=halo, zorder=5
        )
        _, units, symbol = style.described(field[name])
        text = style.value_text(symbol or name, value, units)
        if along_x:
            low, high = ax.get_ylim()
            below = value > low + 0.93 * (high - low)  # above the line it would cover the title
            offset, side = ((-4, -4), "top") if below else ((-4, 3), "bottom")
            ax.annotate(text, (1.0, value), offset, ax.get_yaxis_transform(), ha="right", va=side, **look)
        else:
            ax.annotate(text, (value, 1.0), (4, -4), ax.get_xaxis_transform(), ha="left", va="top", **look)


def draw_cells(ax: Axes, sweep: xr.Dataset, field: xr.DataArray) -> list[Patch]:
    """Draw every cell of an index in colour, with a scale beside; return legend entries for those without a value."""
    values = grid_of(field)[2]
    mesh = colour_mesh(ax, field, np.ma.masked_invalid(values), cmap=COLORS, norm=_shades(values))
    missing = draw_missing(ax, sweep, field)
    frame_plane(ax, field)
    add_bar(ax, mesh, field, "root scale", pad=0.02)
    return missing


def _draw_boundary(ax: Axes, lines: list[Floats], text: str) -> Line2D:
    """Draw the lines of a level, white with a dark halo; return the legend's entry."""
    halo = [withStroke(linewidth=1.9, foreground=INK)]
    drawn = LineCollection(lines, colors="white", linewidths=0.8, path_effects=halo, zorder=4)
    ax.add_collection(drawn, autolim=False)
    return Line2D([], [], color="white", linewidth=0.8, path_effects=halo, label=text)


@on_axes
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
        Value on the boundary lines, in the unit of the index. By default, for `std`, 5 % of the velocity scale
        V = max(f, k |g|)/sqrt(k m) of the reference oscillator, as the legend shows; no lines for other indices.
    reference : dict of str to float, optional
        Axis values to mark by a line, such as ``{"mass": 1.0}``. By default the reference oscillator's own
        value on the second axis; ``{}`` marks none.

    Notes
    -----
    Every cell is drawn as computed, without smoothing; colours follow the square root of the index. Cells
    without a value are grey or red by their status, which the legend names. Of several initial conditions the
    largest value is drawn. "Stable" below a level of Std is the paper's reading: a stable period-1 impact-2
    motion has a large Std too.

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
    sweep, field = diagrams.check_sweep("sweep", sweep, index, 2)
    boundary = _boundary_level(sweep, field, level)
    marked = _reference_values(sweep, field, reference)
    ax = style.new_axes(ax, (7.2, 5.4), style.title(sweep))
    entries: list[Any] = list(draw_cells(ax, sweep, field))
    if boundary is not None:
        lines = boundary_lines(sweep, index, boundary[0])
        entries.insert(0, _draw_boundary(ax, lines, f"boundary: {style.symbol_of(field)} = {boundary[1]}"))
    _draw_references(ax, field, marked)
    style.legend_below(ax, entries)
    return ax


@on_axes
def index_surface(sweep: xr.Dataset, index: str = "std", ax: Axes | None = None) -> Axes:
    """Draw an index over two parameters as a surface: mountains where impacts vary, plains where they repeat.

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes; the first lies along x.
    index : str
        The index drawn, one that `sweep` holds.

    Notes
    -----
    `ax` must be three-dimensional. Every cell is drawn, none is thinned out. Cells without a value are holes;
    `index_contour` says why.

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
    sweep, field = diagrams.check_sweep("sweep", sweep, index, 2)
    if ax is not None and ax.name != "3d":
        raise invalid("ax", ax.name, "three-dimensional axes", "make them with add_subplot(projection='3d')")
    solid: Any = style.new_axes(ax, (7.2, 5.6), style.title(sweep), projection="3d")
    x, y, values = grid_of(field)
    shades = _shades(values)
    surface = solid.plot_surface(
        *np.meshgrid(x, y), values, rcount=len(y), ccount=len(x), cmap=COLORS, norm=shades,
        linewidth=0.0, antialiased=False, rasterized=True,
    )  # fmt: skip
    solid.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), zlim=(shades.vmin, shades.vmax))
    solid.set_xlabel(style.label(field[field.dims[0]]), labelpad=6)
    solid.set_ylabel(style.label(field[field.dims[1]]), labelpad=6)
    short = f"{style.symbol_of(field)}{style.unit_suffix(style.described(field)[1])}"
    solid.set_zlabel(short, labelpad=4)
    add_bar(solid, surface, field, "root scale", f"{style.described(field)[0]}\n{short}", shrink=0.6, pad=0.08)
    solid.set_box_aspect((1.2, 1.2, 0.7), zoom=0.95)  # leaves room for the labels outside the box
    solid.view_init(elev=38, azim=-70)
    return solid  # type: ignore[no-any-return]


def check_points(argument: str, value: Any, index: str) -> tuple[xr.Dataset, xr.DataArray, list[xr.DataArray]]:
    """Return a map of scattered designs, its `index` and the parameters that vary, or raise `ValueError`."""
    if not isinstance(value, xr.Dataset) or "status" not in value or "point" not in value["status"].dims:
        hint = "pass what vibroimpact.parameter_map(points=...) returns"
        raise style.refused(argument, value, "a parameter_map of scattered designs", hint)
    value, field = diagrams.with_index(value, index)
    varied = [coord for name, coord in value.coords.items() if coord.dims == ("point",) and name != "point"]
    if not varied:
        raise style.refused(argument, value, "a parameter_map with the parameters that vary", "keep its coordinates")
    return value, field, varied


@on_axes
def index_scatter(designs: xr.Dataset, index: str = "std", ax: Axes | None = None) -> Axes:
    """Draw an index of scattered designs: each a dot over its first two varied parameters, coloured by the index.

    With one varied parameter the index lies along y. Designs without a value are crosses in the colour of their
    status, which the legend names. Of several initial conditions the largest value is drawn.

    Parameters
    ----------
    designs : xarray.Dataset
        What `vibroimpact.parameter_map` returns for ``points=``, a table of designs.
    index : str
        The index drawn, one that `designs` holds.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> table = {"omega": [1.5, 2.0, 2.8], "restitution": [0.7, 0.8, 0.75]}
    >>> designs = vi.parameter_map(vi.ImpactOscillator(), points=table, sample_impacts=200)
    >>> index_scatter(designs).get_ylabel()
    'coefficient of restitution $r$'
    """
    designs, field, varied = check_points("designs", designs, index)
    x, values = varied[0], field.values.astype(float)
    y = varied[1] if len(varied) > 1 else field
    known, codes = np.isfinite(values), designs["status"].values
    ax = style.new_axes(ax, (7.2, 5.4), style.title(designs))
    if y is field:
        ax.plot(x.values[known], values[known], **DOTS, color=BLUE, markersize=4, zorder=3)
        style.mark_missing(ax, x.values, codes, ~known, "design")
    else:
        shades = _shades(values)
        dots = ax.scatter(x.values[known], y.values[known], c=values[known], cmap=COLORS, norm=shades, s=22, zorder=3)
        add_bar(ax, dots, field, "root scale", pad=0.02)
        for here, color, text in style.by_status(~known, codes, "design"):
            ax.scatter(x.values[here], y.values[here], marker="x", color=color, label=text, zorder=2)
    style.label_axes(ax, x, y)
    style.legend_below(ax)
    return ax
