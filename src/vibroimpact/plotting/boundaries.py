"""Exact boundaries of motions in a plane of two parameters, alone or over a map."""

from __future__ import annotations

from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from vibroimpact.axes import NAMES
from vibroimpact.dataset import variable
from vibroimpact.motion import cycle_name
from vibroimpact.plotting.checks import check_sweep, datasets_of, holding
from vibroimpact.plotting.classes import BESIDE
from vibroimpact.plotting.maps import draw_cells
from vibroimpact.plotting.style import INK, label, legend_below, legend_lines, new_axes, title

# Colour of a kind, and its words: light with a dark halo, or dark with a light one, so that it shows on any map.
KINDS = {
    "fold": ("#000000", "fold"),
    "period_doubling": ("#ff5d8f", "period doubling"),
    "grazing": ("#ffb000", "grazing"),
    "end_of_sticking": ("#7fe3ff", "end"),
}
HALOS = {"fold": "#ffffff"}  # the others' is dark
LINE = 0.16  # inches of a line of the legend
DASHES: dict[int, Any] = {1: "solid", 2: (0, (5, 2)), 3: (0, (2, 1.5))}  # by n_periods
MORE_PERIODS = (0, (1, 1))


def boundaries(curves: Any, sweep: xr.Dataset | None = None, index: str = "std", ax: Axes | None = None) -> Axes:
    """Draw the curves on which motions fold, double their period, graze, or cease to stick.

    Parameters
    ----------
    curves : Boundary, xarray.Dataset, or sequence of them
        What `continue_boundary` or `boundary_curves` returns, or the `dataset` of each, all in one plane.
    sweep : xarray.Dataset, optional
        A `vibroimpact.parameter_map` over the same two parameters, drawn beneath as by `index_contour`, without its
        boundary lines; its first axis lies along x.
    index : str
        Which index of `sweep` is drawn.
    ax : matplotlib.axes.Axes, optional
        Where to draw; axes that show the plane already keep their limits and their legend. A new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `curves` is empty, no boundary, or of several planes; `sweep` or `ax` shows another plane.

    Notes
    -----
    The colour tells the kind, the dashes the driving periods in a cycle. Without `sweep` the first parameter of the
    curves lies along x, unless `ax` is labelled the other way round. Between its points a curve is drawn straight.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> from vibroimpact.continuation import boundary_curves
    >>> curves = boundary_curves(vi.ImpactOscillator(), ("omega", "restitution"), ((2, 3), (0.5, 0.9)), lines=3)
    >>> boundaries(curves).get_legend().get_texts()[0].get_text()
    'period doubling of period-1 impact-1'
    """
    drawn = _datasets(curves)
    plane = _plane(drawn)
    own, below = ax is None, []
    if sweep is not None:
        _check_sweep(sweep, plane)
        field = check_sweep("sweep", sweep, index, 2)
        ax = new_axes(ax, (7.2, 5.4), title(sweep))
        below = draw_cells(ax, sweep, field)
    ax = new_axes(ax, (7.2, 5.4), title(drawn[0]))
    x, y = _order(ax, plane)
    labelled = bool(ax.get_xlabel())
    limits = ax.get_xlim(), ax.get_ylim()
    entries = {str(line.get_label()): line for line in (_draw(ax, curve, x, y) for curve in drawn)}
    if labelled:
        ax.set(xlim=limits[0], ylim=limits[1])
    ax.set_xlabel(parameter_label(x))
    ax.set_ylabel(parameter_label(y))
    _add_legend(ax, [*below, *(entries[text] for text in sorted(entries, key=_by_orbit))])
    if own:
        _make_room(ax)
    return ax


def _by_orbit(text: str) -> tuple[str, str]:
    """Return what entries of the legend are ordered by: the orbit, then the kind."""
    kind, _, orbit = text.partition(" of period-")
    return orbit, kind


def _add_legend(ax: Axes, entries: list[Any]) -> None:
    """Put the entries below the axes, after those of a legend that is there already."""
    before = ax.get_legend()
    if before is not None and before.get_gid() == BESIDE:
        legend_below(ax, entries)
        ax.add_artist(before).set_clip_on(False)
    else:
        legend_below(ax, [*(before.legend_handles if before else []), *entries])


def _make_room(ax: Axes) -> None:
    """Make the figure higher by what its legend takes, so that the plane keeps its height."""
    figure: Any = ax.get_figure(root=True)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + LINE * legend_lines(ax))


def _datasets(curves: Any) -> list[xr.Dataset]:
    """Return the curves as datasets, or raise `ValueError`."""
    drawn = datasets_of(curves)
    for curve in drawn:
        if not isinstance(curve, xr.Dataset) or "kind" not in curve or len(_parameters(curve)) != 2:
            raise ValueError(
                f"`curves` {holding(curve)}; allowed are boundaries in a plane of two parameters; "
                "pass what continue_boundary or boundary_curves returns"
            )
    if not drawn:
        raise ValueError("`curves` is empty; allowed is one boundary or more; widen the ranges or take more `lines`")
    return drawn


def _parameters(curve: xr.Dataset) -> tuple[str, ...]:
    return tuple(str(name) for name, coord in curve.coords.items() if coord.dims == ("point",) and name in NAMES)


def _plane(drawn: list[xr.Dataset]) -> tuple[str, str]:
    """Return the two parameters of all curves, in the order of the first one."""
    first = _parameters(drawn[0])
    for curve in drawn[1:]:
        if set(_parameters(curve)) != set(first):
            raise ValueError(
                f"`curves` lie in the planes {' and '.join(first)}, {' and '.join(_parameters(curve))}; allowed is "
                "one plane; draw one figure a plane"
            )
    return first[0], first[1]


def _check_sweep(sweep: Any, plane: tuple[str, str]) -> None:
    if not isinstance(sweep, xr.Dataset) or set(map(str, sweep.dims)) != set(plane):
        over = " and ".join(map(str, getattr(sweep, "dims", ()))) or "no axis"
        raise ValueError(
            f"`sweep` runs over {over} and `curves` over {' and '.join(plane)}; allowed is one plane for both; "
            f"sweep {plane[0]} and {plane[1]}, or select values of further axes with .sel"
        )


def _order(ax: Axes, plane: tuple[str, str]) -> tuple[str, str]:
    """Return which parameter lies along x and which along y: as the axes are labelled, else in the plane's order."""
    shown = ax.get_xlabel(), ax.get_ylabel()
    for x, y in (plane, plane[::-1]):
        if shown in (("", ""), (parameter_label(x), parameter_label(y))):
            return x, y
    raise ValueError(
        f"`ax` shows {shown[0]} and {shown[1]}, `curves` lie over {' and '.join(plane)}; allowed are fresh axes or "
        "those of a map over the same plane; draw them apart"
    )


def _draw(ax: Axes, curve: xr.Dataset, x: str, y: str) -> Line2D:
    """Draw one curve and return it, labelled with its kind and its orbit."""
    kind = str(curve["kind"].attrs["flag_meanings"]).split()[int(curve["kind"])]
    color, words = KINDS[kind]
    n, p = int(curve.attrs["n_periods"]), int(curve.attrs["n_impacts"])
    orbit = cycle_name(n, p, sticks=kind == "end_of_sticking")
    (line,) = ax.plot(
        curve[x].values,
        curve[y].values,
        color=color,
        linewidth=1.7,
        linestyle=DASHES.get(n, MORE_PERIODS),
        path_effects=[withStroke(linewidth=3.1, foreground=HALOS.get(kind, INK))],
        label=f"{words} of {orbit}",
        zorder=5,
    )
    return line


def parameter_label(name: str) -> str:
    """Return the axis label of a parameter."""
    return label(xr.DataArray(variable(name, (), 0.0), name=name))
