"""Which starts lead to which attractor: the basin portrait."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from vibroimpact.plotting.style import (
    INK,
    STATUS_COLORS,
    label,
    legend_below,
    new_axes,
    status_label,
    title,
    unit_suffix,
    value_text,
    words,
)
from vibroimpact.status import Status

# Okabe and Ito's palette, the lightest and most different hues first; what does not move or never hits is grey.
COLORS = "#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#f0e442", "#0072b2", "#d55e00"
FURTHER = "#7a5230"
QUIET = {
    "no_impact": STATUS_COLORS[Status.NO_IMPACT],
    "stuck_for_ever": STATUS_COLORS[Status.STUCK_FOREVER],
    "at_rest": STATUS_COLORS[Status.DECAYING],
}
UNDECIDED = "#ffffff"
_RING: dict[str, Any] = {
    "linestyle": "none",
    "marker": "o",
    "markersize": 5.0,
    "markerfacecolor": "white",
    "markeredgecolor": INK,
    "markeredgewidth": 1.2,
}
_DOT: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 1.8, "markeredgewidth": 0.0, "color": INK}
FEW = 24  # points of an attractor that are marked as rings; more are marked as dots


def basin_portrait(dataset: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw which starts lead to which attractor, one colour an attractor, and where the attractors lie.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `vibroimpact.basins` returns; its first axis lies along x.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `dataset` is another kind of result, or an axis has a single value.

    Notes
    -----
    Every start is drawn as computed. The legend names each motion with its hardest hit and its share of the starts;
    the eighth attractor with impacts and all smaller ones share a colour. Rings (dots where there are more than 24)
    mark the attractors themselves: their impacts, or their states at the portrait's phase.

    Examples
    --------
    >>> import numpy as np
    >>> from vibroimpact import ImpactOscillator
    >>> from vibroimpact.coexistence import basins
    >>> found = basins(ImpactOscillator(omega=3.0), phase=np.linspace(0, 1, 21), velocity=np.linspace(0, 3, 21))
    >>> basin_portrait(found).get_ylabel()
    'impact velocity $I$ [m/s]'
    """
    field = _checked(dataset)
    across, upwards = (str(dim) for dim in field.dims)
    x, y, numbers = dataset[across].values, dataset[upwards].values, field.values.T
    ax = new_axes(ax, (7.2, 5.4), _title(dataset))
    ax.grid(visible=False)
    meanings = str(field.attrs["flag_meanings"]).split()[1:]
    colors = list(_colors(meanings))
    shade = np.array([to_rgb(color) for color in (*colors, UNDECIDED)])[numbers]  # number -1 is the last colour
    entries: list[Any] = list(_attractor_entries(dataset, meanings, colors))
    codes = dataset["status"].transpose(*field.dims).values.T
    for color, here, told in _left_over(numbers, codes):
        shade[here] = to_rgb(color)
        entries.append(Patch(facecolor=color, edgecolor=INK, linewidth=0.4, label=told))
    ax.pcolormesh(x, y, shade, shading="nearest", rasterized=True, zorder=1)
    if _mark_attractors(ax, dataset, (across, upwards)):
        entries.append(Line2D([], [], **_RING, label="the attractors themselves"))
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])
    ax.set_xlabel(label(dataset[across]))
    ax.set_ylabel(label(dataset[upwards]))
    legend_below(ax, entries)
    return ax


def _checked(value: Any) -> xr.DataArray:
    """Return the attractor of each start, or raise `ValueError`."""
    if not isinstance(value, xr.Dataset) or "attractor" not in value or value["attractor"].ndim != 2:
        held = f"holds {', '.join(map(str, value.data_vars))}" if isinstance(value, xr.Dataset) else "is no Dataset"
        raise ValueError(
            f"`dataset` {held}; allowed is a result of basins (attractor over two axes); "
            "pass what vibroimpact.basins returns"
        )
    field = value["attractor"]
    for dim in field.dims:
        if field.sizes[dim] < 2:
            raise ValueError(f"`dataset` has 1 value along {dim}; allowed are two or more; give basins a longer axis")
    return field


def _title(dataset: xr.Dataset) -> str:
    """Return the oscillator's parameters, and the phase of starts that have none of their own."""
    told = title(dataset)
    if "phase" in dataset.dims or not told:
        return told
    phase = json.loads(dataset.attrs["arguments"]).get("phase", 0.0)
    return f"{told},  {value_text('phase', phase)}"


def _colors(meanings: list[str]) -> Iterator[str]:
    left = iter(COLORS)
    for meaning in meanings:
        yield QUIET[meaning] if meaning in QUIET else next(left, FURTHER)


def _attractor_entries(dataset: xr.Dataset, meanings: list[str], colors: list[str]) -> Iterator[Patch]:
    shares, hardest = dataset["share"].values, dataset["max_velocity"].values
    units = unit_suffix(words(dataset["max_velocity"])[1], " {}")
    further = 0.0
    for meaning, color, share, speed in zip(meanings, colors, shares, hardest, strict=True):
        if color == FURTHER:
            further += share
            continue
        hits = f", hits up to {speed:.3g}{units}" if np.isfinite(speed) else ""
        yield Patch(color=color, label=f"{meaning.replace('_', ' ')}{hits}: {_percent(share)}")
    if further:
        yield Patch(color=FURTHER, label=f"{colors.count(FURTHER)} further attractors: {_percent(further)}")


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %" if share >= 0.0005 else "< 0.1 %"


def _left_over(
    numbers: NDArray[np.integer[Any]], codes: NDArray[np.integer[Any]]
) -> Iterator[tuple[str, NDArray[np.bool_], str]]:
    """Yield colour, place and legend entry of the starts that lead to no attractor known."""
    nowhere = numbers < 0
    for status in (Status.BUDGET, Status.INTERRUPTED):
        here = nowhere & (codes == status)
        if here.any():
            yield STATUS_COLORS[status], here, status_label(status, int(here.sum()), "start")
        nowhere &= ~here
    if nowhere.any():
        count = int(nowhere.sum())
        yield UNDECIDED, nowhere, f"undecided: no cycle and no chaos for sure ({count} start{'s' * (count > 1)})"


def _mark_attractors(ax: Axes, dataset: xr.Dataset, axes: tuple[str, str]) -> bool:
    """Mark the points of each attractor that lie in the portrait; return whether there are any."""
    marked = False
    for x, y in zip(*(dataset[f"point_{axis}"].values for axis in axes), strict=True):
        points = int(np.isfinite(x).sum())
        if points:
            ax.plot(x, y, **(_RING if points <= FEW else _DOT), zorder=4)
            marked = True
    return marked
