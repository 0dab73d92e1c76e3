"""One swept parameter: the bifurcation diagram, an index as a curve, and both; checks of the results drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from vibroimpact.dataset import first_start
from vibroimpact.indices import ROUNDING, spread_scale
from vibroimpact.parameters import choice, counted, real_number
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.categories import COUNTS, missing_layers
from vibroimpact.plotting.style import BLUE, DOTS, INK, Floats, on_axes
from vibroimpact.status import Status

DRAW_ALL = 200_000  # largest number of samples that are all drawn
PAPERS_SCALE = 5.0  # scale of Std over the velocities in Lee's figure 10
HATCHED = "hatched"  # attribute and variable in a map of several initial conditions
ELSEWHERE = "#e69f00"  # colour where only other initial conditions lead to impacts
UNRANKED = ("motion", "n_periods", "n_impacts")
LEVELS = 2000  # if there are more, samples of a column within the same 1/LEVELS of the axis are drawn once


def check_diagram(value: Any) -> tuple[str, str]:
    """Return the names of the axis and the sample dimension of a bifurcation diagram, or raise `ValueError`."""
    if isinstance(value, xr.Dataset) and "velocity" in value and len(value["velocity"].dims) == 2:
        samples = [str(dim) for dim in value["velocity"].dims if dim in style.SAMPLE_DIMS]
        axes = [str(dim) for dim in value["velocity"].dims if dim not in style.SAMPLE_DIMS]
        if len(axes) == 1 and len(samples) == 1 and axes[0] in value.coords:
            return axes[0], samples[0]
    allowed = "a result of bifurcation_diagram (velocity over its axis and impact or period)"
    raise labels.refused("diagram", value, allowed, "pass what vibroimpact.bifurcation_diagram returns")


def check_sweep(value: Any, index: str, n_axes: int) -> tuple[xr.Dataset, xr.DataArray]:
    """Return a parameter map over `n_axes` axes and its `index`; raise a `ValueError` that says what to select.

    For several initial conditions it is the worst value, and the map's `note` says so.
    """
    allowed = f"a parameter_map over {('one axis', 'two axes')[n_axes - 1]}"
    if not isinstance(value, xr.Dataset) or "status" not in value or set(value.dims) & set(style.SAMPLE_DIMS):
        raise labels.refused("sweep", value, allowed, "pass what vibroimpact.parameter_map returns")
    value, field = with_index(value, index)
    axes = [str(dim) for dim in field.dims if dim != "start"]
    if len(axes) == n_axes and "point" not in axes:
        check_lengths("sweep", field)
        return value, field
    firsts = {axis: field[axis][0].item() for axis in axes[n_axes:]}
    words = [f"{axis}={first!r}" if isinstance(first, str) else f"{axis}={first:g}" for axis, first in firsts.items()]
    nearest = [] if "stop" in firsts else ["method='nearest'"]
    hint = f"select one value of the others, for instance sweep.sel({', '.join([*words, *nearest])})"
    if "point" in axes:
        hint = "draw scattered designs with index_scatter"
    elif len(axes) < n_axes:
        hint = "draw it with index_curve" if len(axes) == 1 else "sweep more axes"
    count = f"{len(axes)} {'axis' if len(axes) == 1 else 'axes'} ({', '.join(axes)})"
    raise ValueError(f"`sweep` must be {allowed}, got {count}; {hint}")


def check_lengths(argument: str, field: xr.DataArray) -> None:
    """Raise `ValueError` if an axis has a single value."""
    for dim, size in field.sizes.items():
        if size < 2 and dim != "start":
            raise ValueError(f"`{argument}` needs two or more values along each axis, got 1 along {dim}")


def with_index(sweep: xr.Dataset, index: str) -> tuple[xr.Dataset, xr.DataArray]:
    """Return a map and its index; for several initial conditions the worst value, or NaN with the first one's status.

    The worst value is the largest (for a grazing margin the smallest). Motions and numbers of periods and impacts have
    no worst value; the first is taken. `HATCHED` marks the cells in which other initial conditions differ from the
    colour shown: they lead to impacts where the first does not, or to another motion; the attribute of the same name
    says which.
    """
    names = [str(name) for name in sweep.data_vars if name != "status"]
    choice("index", index, names, "or run the map again with it among `indices`")
    if "start" in sweep[index].dims:
        sweep = _of_starts(sweep, index)
    return sweep, sweep[index]


def _of_starts(sweep: xr.Dataset, index: str) -> xr.Dataset:
    """Reduce a map over several initial conditions to one value per cell, as described in `with_index`."""
    several, first = counted(sweep.sizes["start"], "initial condition"), sweep.isel(start=0, drop=True)
    origin = f"from {first_start(sweep)}"
    if index in UNRANKED:
        names = [name for name in {index, *UNRANKED} if index == "motion" or name == index]
        differs = sum((sweep[name] != first[name]).any("start") for name in names) > 0
        meaning = f"another {'motion' if index == 'motion' else 'number'} from other initial conditions"
        attributes = {"note": f"{origin}, the first of {several}", HATCHED: meaning, "origin": f" {origin}"}
        return first.assign({HATCHED: differs}).assign_attrs(attributes)
    extreme = np.fmin if index == "grazing_margin" else np.fmax  # for an index that is a category
    worst = sweep[[index]].reduce(extreme.reduce, "start", keep_attrs=True)
    silent = first["status"].isin([Status.NO_IMPACT, Status.STOPPED_IMPACTING, Status.STUCK_FOREVER, Status.DECAYING])
    hits = (sweep["status"] <= Status.SHORT_WINDOW).any("start")
    others = sweep.sizes["start"] - 1
    meaning = f"no impact {origin}, impacts from other initial conditions"
    attributes = {
        "note": f"worst of {several}",
        HATCHED: meaning,
        "origin": f" {origin}, none that last from the other {others}",
    }
    return worst.assign({"status": first["status"], HATCHED: silent & hits}).assign_attrs(sweep.attrs | attributes)


def resolved(sweep: xr.Dataset, field: xr.DataArray) -> Floats:
    """Return the values of an index that set limits and units: spreads from rounding are 0, counts > 0 only."""
    values, model = field.values.astype(float), labels.selected_model(sweep)
    rounding = ROUNDING * spread_scale(str(field.name), model.velocity_scale if model else 1.0)
    if field.name in COUNTS:
        return np.where(values > 0.0, values, np.nan)
    return np.where(np.abs(values) <= rounding, 0.0, values)


def _points(axis: Floats, columns: Floats) -> tuple[Floats, Floats]:
    """Return the points to draw from `columns`, shape (len(axis), samples), NaN-padded.

    Many samples are thinned by height, not by rank: every k-th sample of a period-k motion would show only one of its k
    branches. The points drawn are unrounded samples.
    """
    kept = np.isfinite(columns)
    if kept.sum() > DRAW_ALL:
        low, high = columns[kept].min(), columns[kept].max()
        row, _ = np.nonzero(kept)
        level = ((columns[kept] - low) * (LEVELS / max(high - low, np.finfo(float).tiny))).astype(int)
        thinned = np.full((len(axis), LEVELS + 1), np.nan)
        thinned[row, level] = columns[kept]
        columns, kept = thinned, np.isfinite(thinned)
    return axis[np.nonzero(kept)[0]], columns[kept]


def draw_samples(ax: Axes, diagram: xr.Dataset, axis: str, samples: str, quantity: str, color: str = BLUE) -> Floats:
    """Draw the samples; return the heights drawn."""
    columns = diagram[quantity].transpose(axis, samples).values
    x, y = _points(diagram[axis].values, columns)
    dots = min(3.0, max(0.9, 550.0 / max(1, len(columns))))
    text = f"{labels.described(diagram[quantity])[0]} (one dot per {samples})"
    ax.plot(x, y, **DOTS, color=color, markersize=dots, label=text, rasterized=True)
    low, high = float(diagram[axis].min()), float(diagram[axis].max())
    ax.set_xlim(low, high if high > low else low + 1.0)
    return y


def mark_empty(ax: Axes, diagram: xr.Dataset, axis: str) -> None:
    """Mark the columns without samples along the bottom, by status."""
    if "status" in diagram:
        empty = diagram["velocity"].isnull().all([dim for dim in style.SAMPLE_DIMS if dim in diagram.dims])
        layers = style.by_status(empty.values, diagram["status"].values, "column", style.origin(diagram))
        style.mark_missing(ax, diagram[axis].values, layers)


def set_height(ax: Axes, diagram: xr.Dataset, quantity: str, heights: Floats) -> None:
    """Set the limits of the y axis: speeds from zero, phases from 0 to 1, other quantities around the data."""
    model = labels.selected_model(diagram)
    speed = model.velocity_scale if model else 1.0
    if quantity == "phase":
        ax.set_ylim(-0.03, 1.0)
    elif quantity == "velocity" and "impact" in diagram[quantity].dims:
        top = float(np.nanmax(heights, initial=0.0)) or speed
        low = float(np.nanmin(heights, initial=0.0))  # an exponent drawn on the velocity axis may be negative
        ax.set_ylim(low - 0.03 * (top - low), top + 0.05 * (top - low))
    else:
        per_speed = model.slowest_frequency if model and quantity == "displacement" else 1.0
        ax.set_ylim(*style.view(heights, style.magnitude(heights, speed / per_speed)))


@on_axes
def bifurcation_diagram(diagram: xr.Dataset, quantity: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw samples of the settled motions against the swept parameter.

    Parameters
    ----------
    diagram : xarray.Dataset
        A result of `vibroimpact.bifurcation_diagram`, of either section.
    quantity : {"velocity", "phase", "displacement"}, optional
        The quantity on the y axis: for an impact section "velocity" (the default) or "phase", for a stroboscopic
        section "displacement" (the default) or "velocity".

    Notes
    -----
    Columns without samples are marked along the bottom, and the legend explains why they are empty. Up to 200,000
    samples are all drawn; if there are more, samples of one column within the same 1/2000 of the height are drawn once,
    so a thousand columns of 5000 samples take about a second.

    References
    ----------
    Lee, figures 2, 3, 12, 14, 16, 18, 20.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> diagram = vi.bifurcation_diagram(vi.ImpactOscillator(), omega=np.linspace(1.5, 2.5, 5), sample_impacts=20)
    >>> vi.plotting.bifurcation_diagram(diagram).get_ylabel()
    'impact velocity $I$ [m/s]'
    """
    axis, samples = check_diagram(diagram)
    names = [name for name in ("displacement", "velocity", "phase") if name in diagram]
    offered = [name for name in names if "no_value" not in diagram[name].attrs]
    chosen = offered[0] if quantity is None else choice("quantity", quantity, offered)
    ax = style.new_axes(ax, (8.0, 4.4), labels.title(diagram))
    heights = draw_samples(ax, diagram, axis, samples, chosen)
    mark_empty(ax, diagram, axis)
    set_height(ax, diagram, chosen, heights)
    labels.label_axes(ax, diagram[axis], diagram[chosen])
    handles = ax.get_legend_handles_labels()[0]
    if len(handles) > 1:
        style.legend_below(ax, handles)
    return ax


def _draw_index(ax: Axes, field: xr.DataArray, scale: float) -> Floats:
    """Draw `scale` times an index over its axis, with a dot for values whose two neighbours are missing."""
    values = scale * field.values.astype(float)
    if field.name in COUNTS:
        values[values <= 0.0] = np.nan
    finite = np.pad(np.isfinite(values), 1)
    alone = finite[1:-1] & ~finite[:-2] & ~finite[2:]
    x = field[field.dims[0]].values
    symbol = labels.symbol_of(field)
    name = symbol if scale == 1.0 else rf"{scale:g} $\times$ {symbol}"
    if field.name in COUNTS:
        ax.plot(x, values, **DOTS, color=INK, markersize=3, label=name, zorder=4)
    else:
        ax.plot(x, values, color=INK, linewidth=1.1, label=name, zorder=4)
        ax.plot(x[alone], values[alone], **DOTS, color=INK, markersize=2, zorder=4)
    return values


@on_axes
def diagram_with_index(
    diagram: xr.Dataset, sweep: xr.Dataset, index: str = "std", scale: float | None = None, ax: Axes | None = None
) -> Axes:
    r"""Draw a bifurcation diagram of impact velocities (blue dots) with an index on top (black line).

    Std is drawn on the axis of the velocities, multiplied by 5 as in the paper; other indices have their own axis on
    the right.

    Parameters
    ----------
    diagram : xarray.Dataset
        A `vibroimpact.bifurcation_diagram` with section="impact".
    sweep : xarray.Dataset
        A `vibroimpact.parameter_map` over the same axis; the grids may differ.
    index : str
        The index drawn, one that `sweep` holds.
    scale : float, optional
        Factor by which the index is multiplied to draw it on the axis of the velocities. None means 5 for `std`, and a
        separate axis for other indices.

    References
    ----------
    Lee, equation 2 and figure 10.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> osc, omega = vi.ImpactOscillator(), np.linspace(1.5, 2.5, 5)
    >>> diagram = vi.bifurcation_diagram(osc, omega=omega, sample_impacts=20)
    >>> ax = vi.plotting.diagram_with_index(diagram, vi.parameter_map(osc, omega=omega, sample_impacts=100))
    >>> ax.get_legend().get_texts()[-1].get_text()
    '5 $\\times$ $\\mathrm{Std}$'
    """
    axis, samples = check_diagram(diagram)
    if samples != "impact":
        raise ValueError(
            "`diagram` must hold impacts, got one sample per period; call bifurcation_diagram with section='impact'"
        )
    sweep, field = check_sweep(sweep, index, 1)
    if field.dims != (axis,):
        raise ValueError(f"`sweep` must run over {axis}, as `diagram` does, got {field.dims[0]}")
    factor = PAPERS_SCALE if scale is None else real_number("scale", scale)
    ax = style.new_axes(ax, (8.0, 4.4), labels.title(diagram))
    heights = draw_samples(ax, diagram, axis, samples, "velocity")
    if scale is None and index != "std":
        lines = _draw_beside(ax, sweep, field)
    else:
        drawn = _draw_index(ax, field, factor)
        heights, lines = np.concatenate([heights, drawn[np.isfinite(drawn)]]), []
    mark_empty(ax, diagram, axis)
    set_height(ax, diagram, "velocity", heights)
    labels.label_axes(ax, diagram[axis], diagram["velocity"])
    style.legend_below(ax, [*ax.get_legend_handles_labels()[0], *lines])
    return ax


def _draw_beside(ax: Axes, sweep: xr.Dataset, field: xr.DataArray) -> list[Any]:
    """Draw an index on its own axis on the right; return the legend's entry."""
    right = ax.twinx()
    right.spines["top"].set_visible(False)
    _draw_index(right, field, 1.0)
    _frame_index(right, resolved(sweep, field))
    labels.label_axis(right.yaxis, field)
    return right.get_legend_handles_labels()[0]


def _frame_index(ax: Axes, values: Floats) -> None:
    """Set the limits of the y axis around an index and zero, with a line at zero if it has negative values."""
    finite = values[np.isfinite(values)]
    low, high = finite.min(initial=0.0), finite.max(initial=0.0)
    span = float(high - low) or 1.0
    if low < 0.0:
        ax.axhline(0.0, color=INK, linewidth=0.6, linestyle=":", zorder=1)
    ax.set_ylim(low - 0.03 * span, high + 0.05 * span)


@on_axes
def index_curve(sweep: xr.Dataset, index: str = "std", ax: Axes | None = None) -> Axes:
    r"""Draw an index against the one parameter swept.

    The line is broken where the index has no value; marks along the bottom show the status that explains it. For
    several initial conditions the worst value is drawn, as in `index_contour`, and columns in which the first leads to
    no impacts but others do are marked.

    Parameters
    ----------
    sweep : xarray.Dataset
        A `vibroimpact.parameter_map` over one axis.
    index : str
        The index drawn, one that `sweep` holds.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(1.5, 2.5, 5), sample_impacts=100)
    >>> vi.plotting.index_curve(sweep).get_xlabel()
    'angular driving frequency $\\omega$ [rad/s]'
    """
    sweep, field = check_sweep(sweep, index, 1)
    axis = field[field.dims[0]]
    ax = style.new_axes(ax, (8.0, 4.0), labels.title(sweep))
    _draw_index(ax, field, 1.0)
    style.mark_missing(ax, axis.values, missing_layers(sweep, field, "column"))
    if HATCHED in sweep and (mask := sweep[HATCHED].values).any():
        text = f"{sweep.attrs[HATCHED]} ({counted(int(mask.sum()), 'column')})"
        style.mark_missing(ax, axis.values, [(mask, ELSEWHERE, text)])
    _frame_index(ax, resolved(sweep, field))
    ax.set_xlim(float(axis.min()), float(axis.max()))
    labels.label_axes(ax, axis, field)
    style.legend_below(ax, ax.get_legend_handles_labels()[0][1:])
    return ax
