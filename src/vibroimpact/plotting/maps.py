"""An index over two parameters, as coloured map, surface or boundary lines, and over scattered designs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import contourpy
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from vibroimpact.dataset import varied_parameters
from vibroimpact.model.units import display
from vibroimpact.parameters import counted, invalid, real_number, unknown
from vibroimpact.plotting import diagrams, labels, style
from vibroimpact.plotting.categories import COUNTS, missing_layers, number_layers
from vibroimpact.plotting.cells import COLORS, ROOT, add_bar, colour_scale, draw_cells, grid_of, root_shades, swatch
from vibroimpact.plotting.style import BLUE, DOTS, INK, RED, WALL, Floats, on_axes
from vibroimpact.plotting.ticks import Round, Scaled, power_of, quantity, unit_label

LEVEL_OF_V = 0.05  # default boundary of Std, relative to the velocity scale V


def boundary_lines(sweep: xr.Dataset, index: str, level: float) -> list[Floats]:
    """Return the contour lines of an index at a level, interpolated linearly between cells.

    Parameters
    ----------
    sweep : xarray.Dataset
        A `vibroimpact.parameter_map` over two axes.
    index : str
        An index that `sweep` holds.
    level : float
        The value on the lines, in the unit of the index.

    Returns
    -------
    list of numpy.ndarray, each of shape (n, 2)
        Points in the units of the first and the second axis. A closed line ends at its first point.

    Raises
    ------
    ValueError
        `sweep` does not have two axes or does not hold the `index`; `level` is not a number.

    Notes
    -----
    Lines end at cells without a value. Where an index jumps, lines are accurate to one cell. Cells within 1e-6 of the
    level count as above it.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=200)
    >>> [line.shape[1] for line in boundary_lines(sweep, "std", 0.05)][:1]
    [2]
    """
    x, y, values = grid_of(diagrams.check_sweep(sweep, index, 2)[1])
    height = real_number("level", level)
    # Otherwise a plateau exactly at the level, such as p/n = 1, would be crossed wherever rounding varies.
    values = np.where(np.isclose(values, height, rtol=1e-6, atol=0.0), height + 1e-5 * abs(height), values)
    generator = contourpy.contour_generator(x, y, np.ma.masked_invalid(values), line_type="Separate")
    return [np.asarray(line) for line in generator.lines(height)]


def _boundary_level(sweep: xr.Dataset, field: xr.DataArray, level: float | None) -> tuple[float, str] | None:
    """Return the level of the boundary and its text in the legend; None if the index has no default level."""
    units = labels.described(field)[1]
    if level is not None:
        return (number := real_number("level", level)), quantity(number, units, 3)
    model = labels.selected_model(sweep)
    if field.name != "std" or model is None:
        return None
    number = LEVEL_OF_V * model.velocity_scale
    return number, f"{quantity(number, units, 3)} ({100 * LEVEL_OF_V:.0f} % of the velocity scale)"


def _reference_values(
    sweep: xr.Dataset, field: xr.DataArray, reference: Mapping[str, float] | None
) -> dict[str, float]:
    """Return the axis values to mark: those in `reference`, else the oscillator's own value on the second axis."""
    limits = {str(dim): (float(field[dim].min()), float(field[dim].max())) for dim in field.dims}
    if reference is None:
        axis = str(field.dims[1])
        usual = labels.model_value(sweep, axis)
        return {} if usual is None or not limits[axis][0] <= usual <= limits[axis][1] else {axis: float(usual)}
    chosen = {}
    if not isinstance(reference, Mapping):
        raise invalid("reference", reference, "values by axis", 'write for example {"mass": 1.5}')
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
        _, units, symbol = labels.described(field[name])
        text = labels.value_text(symbol or name, value * display(field[name].attrs)[0], units)
        if along_x:
            low, high = ax.get_ylim()
            below = value > low + 0.93 * (high - low)  # above the line it would overlap the title
            offset, side = ((-4, -4), "top") if below else ((-4, 3), "bottom")
            ax.annotate(text, (1.0, value), offset, ax.get_yaxis_transform(), ha="right", va=side, **look)
        else:
            ax.annotate(text, (value, 1.0), (4, -4), ax.get_xaxis_transform(), ha="left", va="top", **look)


def _draw_boundary(ax: Axes, lines: list[Floats], text: str) -> Line2D:
    """Draw contour lines in white with a dark outline; return the legend entry."""
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
    """Draw an index over two parameters as a coloured map, with boundary lines and a marked reference value.

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes; the first lies along x.
    index : str
        The index drawn, one that `sweep` holds.
    level : float, optional
        Value on the boundary lines, in the unit of the index. The default for `std` is 5 % of the velocity scale V =
        max(f, k |g|)/sqrt(k m) of the reference oscillator, as given in the legend; other indices have no lines by
        default.
    reference : dict of str to float, optional
        Axis values to mark by a line, such as ``{"mass": 1.0}``. The default is the reference oscillator's own value on
        the second axis; ``{}`` marks none.

    Notes
    -----
    Every cell is drawn as computed, without smoothing. Colours are on a square-root scale; exponents are coloured as in
    `exponent_map`. For `n_periods` and `n_impacts`, each number has its own colour, and so have chaos, complete chatter
    and no impact. Cells without a value are grey or red by status, as explained in the legend.

    For several initial conditions the worst value is drawn: the largest, for `grazing_margin` the smallest. Cells in
    which the first initial condition leads to no impacts but others do are hatched. Numbers of periods and impacts are
    those of the first initial condition, and cells in which others lead to another number are hatched.

    The paper calls motions below a level of Std "stable"; but a stable period-1 impact-2 motion has a large Std, too.

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
    sweep, field = diagrams.check_sweep(sweep, index, 2)
    boundary = _boundary_level(sweep, field, level)
    marked = _reference_values(sweep, field, reference)
    ax = style.new_axes(ax, (8.4, 5.2) if index in COUNTS else (7.2, 5.4), labels.title(sweep))
    entries: list[Any] = draw_cells(ax, sweep, field)
    if boundary is not None:
        lines = boundary_lines(sweep, index, boundary[0])
        entries.insert(0, _draw_boundary(ax, lines, f"boundary: {labels.symbol_of(field)} = {boundary[1]}"))
    _draw_references(ax, field, marked)
    style.legend_added(ax, entries)
    return ax


@on_axes
def index_surface(sweep: xr.Dataset, index: str = "std", ax: Axes | None = None) -> Axes:
    """Draw an index over two parameters as a surface: high where impacts vary, low where they repeat.

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes; the first lies along x.
    index : str
        The index drawn, one that `sweep` holds.

    Notes
    -----
    `ax` must be three-dimensional. Every cell is drawn. Cells without a value are drawn flat at the bottom, in the
    colours of `index_contour`, as explained in the legend. For several initial conditions the worst value is drawn, as
    in `index_contour`.

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
    sweep, field = diagrams.check_sweep(sweep, index, 2)
    if getattr(ax, "name", "3d") != "3d":
        raise invalid("ax", ax, "three-dimensional axes", "make them with add_subplot(projection='3d')")
    solid: Any = style.new_axes(ax, (7.2, 5.6), labels.title(sweep), projection="3d")
    x, y, _ = grid_of(field)
    shades = root_shades(diagrams.resolved(sweep, field))
    solid.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), zlim=(shades.vmin, shades.vmax))
    surface = ScalarMappable(shades, COLORS)
    entries = _draw_surface(solid, sweep, field, surface)
    shown = *(sweep[dim] for dim in field.dims), field
    for axis, data in zip((solid.xaxis, solid.yaxis, solid.zaxis), shown, strict=True):
        factor = display(data.attrs)[0]
        power = power_of(axis.get_view_interval() * factor)
        axis.set_major_formatter(Scaled(power, factor))
        axis.set_major_locator(Round(5, factor=factor))
        short = labels.symbol_of(data) + unit_label(labels.described(data)[1], power)
        text = labels.wrapped(short, 22) if data is field else labels.wrapped(labels.label(data, power), 40)
        axis.set_label_text(text)
        longest = max(map(len, axis.major.formatter.format_ticks(axis.get_majorticklocs())))
        axis.labelpad = 10 + 4 * max(0, longest - 5) * (axis is not solid.xaxis)  # z labels are below the ticks
    bar = add_bar(solid, surface, field, ROOT, shrink=0.6, pad=0.1)
    solid.set_box_aspect((1.2, 1.2, 0.7), zoom=0.95)  # room for the labels outside the box
    solid.view_init(elev=38, azim=-70)
    style.legend_below(solid, entries)
    if (figure := solid.get_figure(root=True)) in style.PACKAGE_FIGURES:
        figure.set_layout_engine("none")  # the outer box of the labels changes with each drawing
        low = 0.08 + style.LEGEND_LINE * style.legend_lines(solid) / figure.get_figheight()
        solid.set_position((0.0, low, 0.76, 0.92 - low))
        bar.ax.set_position((0.8, low + 0.15, 0.03, 0.6 - low))
    return solid  # type: ignore[no-any-return]


def _draw_surface(solid: Any, sweep: xr.Dataset, field: xr.DataArray, colors: ScalarMappable) -> list[Patch]:
    """Draw the surface between cell centres, flat where values are missing; return legend entries for the latter.

    All is one collection, so that parts in front hide parts behind.
    """
    x, y, values = grid_of(field)
    shade, entries = np.zeros((*values.shape, 4)), []
    for mask, color, text in missing_layers(sweep, field, "cell"):
        shade[mask.T] = (*to_rgb(color), 1.0)
        entries.append(swatch(color, text))
    gone = shade[..., 3] > 0.0
    heights = np.where(gone, np.nan, values)

    def corners(array: Any) -> Any:
        """Return the values at the four corners of each quadrangle."""
        return np.stack([array[:-1, :-1], array[:-1, 1:], array[1:, 1:], array[1:, :-1]], axis=2)

    flat = corners(gone)
    quads = np.stack([*map(corners, np.meshgrid(x, y)), corners(heights)], axis=-1)
    quads[flat.any(axis=2), :, 2] = solid.get_zlim()[0]
    colour_of_flat = np.take_along_axis(corners(shade), flat.argmax(axis=2)[..., None, None], axis=2)[:, :, 0]
    faces = np.where(flat.any(axis=2)[..., None], colour_of_flat, colors.to_rgba(quads[..., 2].mean(axis=2)))
    looks: dict[str, Any] = {"linewidths": 0.0, "antialiased": False, "rasterized": True}
    solid.add_collection3d(Poly3DCollection(quads.reshape(-1, 4, 3), facecolors=faces.reshape(-1, 4), **looks))
    return entries


def _check_points(value: Any, index: str) -> tuple[xr.Dataset, xr.DataArray, list[xr.DataArray]]:
    """Return a map of scattered designs, its `index` and the varied parameters, or raise `ValueError`."""
    if not isinstance(value, xr.Dataset) or "status" not in value or "point" not in value["status"].dims:
        hint = "pass what vibroimpact.parameter_map(points=...) returns"
        raise labels.refused("designs", value, "a parameter_map of scattered designs", hint)
    value, field = diagrams.with_index(value, index)
    varied = [value[name] for name in varied_parameters(value)]
    if not varied:
        raise labels.refused("designs", value, "a parameter_map with the parameters that vary", "keep its coordinates")
    return value, field, varied


@on_axes
def index_scatter(designs: xr.Dataset, index: str = "std", ax: Axes | None = None) -> Axes:
    """Draw scattered designs as dots over their first two varied parameters, coloured by an index.

    With one varied parameter, the index is on the y axis. Designs without a value are crosses in the colour of their
    status, as explained in the legend. For several initial conditions the worst value is drawn, as in `index_contour`,
    with rings in place of hatching.

    Parameters
    ----------
    designs : xarray.Dataset
        A `vibroimpact.parameter_map` computed with ``points=``, a table of designs.
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
    designs, field, varied = _check_points(designs, index)
    x, y = varied[0], varied[1] if len(varied) > 1 else field
    height, values = y.values, field.values.astype(float)
    finite = np.isfinite(resolved := diagrams.resolved(designs, field))
    numbers = y is not field and index in COUNTS
    ax = style.new_axes(ax, (8.4, 5.2) if numbers else (7.2, 5.4), labels.title(designs))
    if y is field:
        ax.plot(x.values[finite], values[finite], **DOTS, color=BLUE, markersize=4, zorder=3)
        style.mark_missing(ax, x.values, missing_layers(designs, field, "design"))
    elif numbers:
        for mask, color, text in number_layers(designs, field):
            ax.scatter(x.values[mask], height[mask], color=color, edgecolors=WALL, s=24, label=text, zorder=3)
    else:
        scale, bar = colour_scale(designs, field)
        drawn = ax.scatter(x.values[finite], height[finite], c=values[finite], s=22, zorder=3, **scale)
        add_bar(ax, drawn, field, pad=0.02, **bar)
        for mask, color, text in missing_layers(designs, field, "design"):
            ax.scatter(x.values[mask], height[mask], marker="x", color=color, label=text, zorder=2)
    named = ax.get_legend_handles_labels()[0] if numbers else []
    if named:
        style.legend_beside(ax, named, labels.label(field))
    if diagrams.HATCHED in designs and (mask := designs[diagrams.HATCHED].values & np.isfinite(height)).any():
        text = f"{designs.attrs[diagrams.HATCHED]} ({counted(int(mask.sum()), 'design')})"
        ax.scatter(x.values[mask], height[mask], s=70, facecolors="none", edgecolors=INK, label=text, zorder=4)
    labels.label_axis(ax.xaxis, x)
    labels.label_axis(ax.yaxis, y, resolved if y is field else None)
    style.legend_added(ax, ax.get_legend_handles_labels()[0][len(named) :])
    return ax
