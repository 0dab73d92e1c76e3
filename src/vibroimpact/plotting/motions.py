"""Motions in maps: names and exponents over two parameters, attractors over initial conditions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vibroimpact.dataset import VARIABLES, arguments_of, flag_meanings
from vibroimpact.figures import EXPONENTS
from vibroimpact.motion.classes import classify
from vibroimpact.parameters import choice, counted
from vibroimpact.plotting import cells, diagrams, labels, style
from vibroimpact.plotting.categories import OPEN, motion_layers
from vibroimpact.plotting.style import DOTS, INK, RINGS, Layer, on_axes
from vibroimpact.plotting.ticks import quantity
from vibroimpact.status import Status

# Colours of attractors: Okabe and Ito's palette, lightest and most distinct hues first; grey without impacts.
ATTRACTORS = "#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#f0e442", "#0072b2", "#d55e00"
FURTHER = "#7a5230"
QUIET = {
    "no_impact": style.STATUS_COLORS[Status.NO_IMPACT],
    "permanently_in_contact": style.STATUS_COLORS[Status.STUCK_FOREVER],
    "at_rest": style.STATUS_COLORS[Status.DECAYING],
}
RING = RINGS | {"markersize": 5.0, "markeredgecolor": INK, "markeredgewidth": 1.2}
DOT = DOTS | {"markersize": 1.8, "color": INK}
FEW = 24  # most points of an attractor marked as rings; beyond, dots


@on_axes
def motion_map(sweep: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the name of the motion in every cell of a map over two parameters.

    The most frequent periodic motions have one colour each, and rarer ones share a colour; sticking, chaos, no impact
    and undecided cells have their own colours. The legend gives the share of the cells of each.

    Parameters
    ----------
    sweep : xarray.Dataset
        A result of `vibroimpact.classify` over two axes, or a `parameter_map` accepted by it; the first axis is the x
        axis.

    Notes
    -----
    Every cell is drawn as computed. The usual names have the same colour in every map. All colours can be distinguished
    by colour-blind readers (dichromats). For several initial conditions the colour shows the motion from the first;
    cells in which others lead to another motion are hatched.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=500, indices=("lyapunov_per_impact", "n_periods", "n_impacts"))
    >>> ax = motion_map(sweep)
    >>> ax.get_legend().get_texts()[0].get_text()
    '66.7 %   period-1 impact-1'
    """
    classes = sweep if isinstance(sweep, xr.Dataset) and "motion" in sweep else classify(sweep)
    classes, field = diagrams.check_sweep(classes, "motion", 2)
    codes, n, p = (
        cells.grid_of(classes[name].transpose(*field.dims))[2].astype(int)
        for name in ("motion", "n_periods", "n_impacts")
    )
    layers = [(mask, color, f"{cells.share_of(mask)}   {text}") for mask, color, text in motion_layers(codes, n, p)]
    ax = style.new_axes(ax, (7.8, 5.0), labels.title(classes))
    entries = cells.fill_cells(ax, field, layers, OPEN)
    cells.frame_plane(ax, field)
    style.legend_beside(ax, entries, "share of the cells, and motion")
    style.legend_added(ax, cells.hatch_cells(ax, classes, field))
    return ax


@on_axes
def exponent_map(sweep: xr.Dataset, index: str = "lyapunov", ax: Axes | None = None) -> Axes:
    r"""Draw the largest Lyapunov exponent over two parameters: red where perturbations grow, blue where they decay.

    .. math:: \lambda = \lim_{t \to \infty} \frac1t \ln \frac{|\delta(t)|}{|\delta(0)|}

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes; the first lies along x.
    index : {"lyapunov", "lyapunov_per_impact"}
        Per unit time, in 1/s, or per impact.

    Notes
    -----
    White is zero: bifurcations appear as white lines within blue. Positive and negative values share one scale, which
    about 1 % of the cells exceed. Sticking erases all perturbations, so its exponent is minus infinity, shown in a
    separate colour. Cells without a value are grey or red by status, as explained in the legend.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=200, indices=["lyapunov"])
    >>> exponent_map(sweep).get_ylabel()
    'mass $m$ [kg]'
    """
    choice("index", index, EXPONENTS)
    sweep, field = diagrams.check_sweep(sweep, index, 2)
    ax = style.new_axes(ax, (7.2, 5.4), labels.title(sweep))
    style.legend_below(ax, cells.draw_cells(ax, sweep, field))
    return ax


@on_axes
def basin_portrait(dataset: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the basins of attraction, one colour per attractor, and the attractors themselves.

    Parameters
    ----------
    dataset : xarray.Dataset
        A result of `vibroimpact.basins`; its first axis is the x axis.

    Notes
    -----
    Every initial condition is drawn as computed. The legend names each motion with its hardest impact and its share of
    the initial conditions; the eighth attractor with impacts and all smaller ones share a colour. Rings (dots if there
    are more than 24) mark the attractors themselves: their impacts, or their states at the portrait's phase.

    Examples
    --------
    >>> import numpy as np
    >>> from vibroimpact import ImpactOscillator
    >>> from vibroimpact.coexistence import basins
    >>> found = basins(ImpactOscillator(omega=3.0), phase=np.linspace(0, 1, 21), velocity=np.linspace(0, 3, 21))
    >>> basin_portrait(found).get_ylabel()
    'impact velocity $I$ [m/s]'
    """
    field = _attractors(dataset)
    ax = style.new_axes(ax, (7.2, 5.4), _title(dataset))
    entries: list[Any] = list(cells.fill_cells(ax, field, _basins(dataset, field), OPEN))
    cells.frame_plane(ax, field)
    marks = _mark_attractors(ax, dataset, [f"point_{dim}" for dim in field.dims])
    entries += [Line2D([], [], **mark, label="the attractors themselves") for mark in marks[:1]]
    style.legend_below(ax, entries)
    return ax


def _attractors(value: Any) -> xr.DataArray:
    """Return the attractor of each initial condition, or raise `ValueError`."""
    if not isinstance(value, xr.Dataset) or "attractor" not in value or value["attractor"].ndim != 2:
        allowed = "a result of basins (attractor over two axes)"
        raise labels.refused("dataset", value, allowed, "pass what vibroimpact.basins returns")
    diagrams.check_lengths("dataset", value["attractor"])
    return value["attractor"]


def _title(dataset: xr.Dataset) -> str:
    """Return the oscillator's parameters and, if it is common to all initial conditions, their phase."""
    fixed = labels.title(dataset)
    if "phase" in dataset.dims or not fixed:
        return fixed
    phase = arguments_of(dataset).get("phase", 0.0)
    return f"{fixed},  {labels.value_text(VARIABLES['phase'][2], phase, '')}"


def _basins(dataset: xr.Dataset, field: xr.DataArray) -> Iterator[Layer]:
    """Yield mask of initial conditions, colour and name of each attractor in the legend; then of the others."""
    numbers, codes = field.values.T, dataset["status"].transpose(*field.dims).values.T
    shares, hardest = dataset["share"].values, dataset["max_velocity"].values
    units, colors, further = labels.described(dataset["max_velocity"])[1], iter(ATTRACTORS), []
    for number, meaning in enumerate(flag_meanings(field)[1:]):
        color = QUIET.get(meaning) or next(colors, FURTHER)
        if color == FURTHER:
            further.append(number)
            continue
        hits = f", impacts up to {quantity(hardest[number], units, 3)}" if np.isfinite(hardest[number]) else ""
        yield numbers == number, color, f"{meaning.replace('_', ' ')}{hits}: {labels.percent(shares[number])}"
    if further:
        text = f"{len(further)} further attractors: {labels.percent(shares[further].sum())}"
        yield np.isin(numbers, further), FURTHER, text
    cut_off = (numbers < 0) & np.isin(codes, (Status.BUDGET, Status.INTERRUPTED))
    yield from style.by_status(cut_off, codes, "initial condition")
    undecided = (numbers < 0) & ~cut_off
    count = counted(int(undecided.sum()), "initial condition")
    yield undecided, OPEN, f"undecided: neither a cycle nor certain chaos ({count})"


def _mark_attractors(ax: Axes, dataset: xr.Dataset, names: list[str]) -> list[dict[str, Any]]:
    """Mark the points of each attractor within the portrait; return the marks."""
    marks = []
    for x, y in zip(*(dataset[name].values for name in names), strict=True):
        if not (points := int(np.isfinite(x).sum())):
            continue
        mark = RING if points <= FEW else DOT
        (line,) = ax.plot(x, y, **mark, zorder=4)
        if ax.viewLim.count_contains(line.get_xydata()) and mark not in marks:
            marks.append(mark)
    return marks
