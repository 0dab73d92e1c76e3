"""The largest Lyapunov exponent over two swept parameters."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.patches import Patch

from vibroimpact.plotting.checks import check_choice, check_sweep
from vibroimpact.plotting.classes import share
from vibroimpact.plotting.maps import colour_mesh, draw_missing, frame_plane, grid_of
from vibroimpact.plotting.style import STICKING, Floats, label, legend_below, math, new_axes, title, words

COLORS = "RdBu_r"
SHOWN = 99.0  # per cent of the cells that the colours tell apart; beyond, they saturate


def symmetric_limit(values: Floats) -> float:
    """Return the largest exponent that the colours show, of either sign: some 1 % of the cells lie beyond."""
    sizes = np.abs(values[np.isfinite(values)])
    return float(np.percentile(sizes, SHOWN)) or 1.0 if sizes.size else 1.0


def exponent_map(sweep: xr.Dataset, index: str = "lyapunov", ax: Axes | None = None) -> Axes:
    r"""Draw the largest Lyapunov exponent over two parameters: red where neighbours part, blue where they meet.

    .. math:: \lambda = \lim_{t \to \infty} \frac1t \ln \frac{|\delta(t)|}{|\delta(0)|}

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes; the first lies along x.
    index : {"lyapunov", "lyapunov_per_impact"}
        Per unit time, in 1/s, or per impact.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `sweep` has not two axes or does not hold the `index`, or that is no exponent.

    Notes
    -----
    White is zero: bifurcations are white lines within blue. Both signs share one scale, whose ends the outermost 1 % of
    the cells exceed. A motion that sticks forgets its start at once: its exponent is minus infinity and has a colour
    of its own. Cells without a value are grey or red by their status, which the legend names.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=200, indices=["lyapunov"])
    >>> exponent_map(sweep).get_ylabel()
    'mass $m$ [kg]'
    """
    check_choice("index", index, ("lyapunov", "lyapunov_per_impact"))
    field = check_sweep("sweep", sweep, index, 2)
    x, y, values = grid_of(field)
    sticks = np.isneginf(values)
    limit = symmetric_limit(values)
    ax = new_axes(ax, (7.2, 5.4), title(sweep))
    mesh = colour_mesh(ax, x, y, values, COLORS, Normalize(-limit, limit))
    entries = _draw_sticking(ax, x, y, sticks, field) + draw_missing(ax, sweep, field.where(~np.isneginf(field), 0.0))
    frame_plane(ax, field)
    bar = ax.get_figure().colorbar(mesh, ax=ax, pad=0.02, extend=_beyond(values, limit))  # type: ignore[union-attr]
    bar.set_label(label(field))
    legend_below(ax, entries)
    return ax


def _draw_sticking(ax: Axes, x: Floats, y: Floats, sticks: np.ndarray, field: xr.DataArray) -> list[Patch]:
    """Colour the cells whose exponent is minus infinity; return the legend's entry."""
    if not sticks.any():
        return []
    over = np.ma.masked_where(~sticks, np.zeros(sticks.shape))
    ax.pcolormesh(x, y, over, shading="nearest", zorder=1, rasterized=True, cmap=ListedColormap([STICKING]))
    symbol = math(words(field)[2]).strip("$")
    return [Patch(color=STICKING, label=rf"sticking: ${symbol} = -\infty$ ({share(sticks).strip()} of the cells)")]


def _beyond(values: Floats, limit: float) -> str:
    """Return at which ends of the scale values lie beyond it, in Matplotlib's words."""
    finite = values[np.isfinite(values)]
    low, high = bool((finite < -limit).any()), bool((finite > limit).any())
    return "both" if low and high else "min" if low else "max" if high else "neither"
