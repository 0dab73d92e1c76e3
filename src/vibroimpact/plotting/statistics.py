"""The speeds of impacts as a histogram, support by support."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from vibroimpact.plotting import labels, style
from vibroimpact.plotting.orbits import check_result, legend
from vibroimpact.plotting.style import on_axes
from vibroimpact.plotting.ticks import quantity
from vibroimpact.plotting.walls import STOPS


@on_axes
def impact_histogram(statistics: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw how many impacts per second fall into each class of velocities, stacked over the supports.

    The legend gives the rate, the hardest impact and the power of each support; those that are not struck are left out.

    Parameters
    ----------
    statistics : xarray.Dataset
        The result of `vibroimpact.impact_statistics`.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> ax = vi.plotting.impact_histogram(vi.impact_statistics(vi.models.impact_damper(), sample_impacts=400))
    >>> [text.get_text().split(":")[0] for text in ax.get_legend().get_texts()]
    ['left', 'right']
    """
    check_result("statistics", statistics, "impact_statistics", {"number": ("stop", "velocity_class"), "rate": "stop"})
    ax = style.new_axes(ax, (6.2, 4.2), labels.title(statistics))
    low, high = statistics["velocity_from"].values, statistics["velocity_to"].values
    rates = statistics["number"].values / float(statistics["duration"])
    below = np.zeros(len(low))
    for at, name in enumerate(statistics["stop"].values.tolist()):
        if rates[at].any():
            of = statistics.isel(stop=at)
            facts = [quantity(of[key].item(), of[key].attrs["units"], 4) for key in ("rate", "max_velocity", "power")]
            text = f"{name}: {facts[0]}, up to {facts[1]}, {facts[2]}"
            look: Any = {"color": style.color_at(STOPS, at), "edgecolor": "white", "linewidth": 0.4}
            ax.bar(low, rates[at], high - low, below, align="edge", label=text, **look)
            below += rates[at]
    if not below.any():
        ax.text(0.5, 0.5, "no impacts", transform=ax.transAxes, ha="center", va="center", color="#555555")
    ax.set_xlim(low[0], high[-1])
    velocity = statistics["velocity_class"].assign_attrs(long_name="impact velocity")
    labels.label_axes(ax, velocity, statistics["rate"])
    legend(ax, statistics)
    return ax
