"""The figure a result is drawn as, by name and by default."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import xarray as xr
from matplotlib.axes import Axes

from vibroimpact.plotting.checks import SAMPLE_DIMS
from vibroimpact.plotting.diagrams import bifurcation_diagram, index_curve
from vibroimpact.plotting.maps import index_contour, index_surface
from vibroimpact.plotting.orbit import phase_portrait, time_history
from vibroimpact.plotting.sections import impact_map, stroboscopic_map

KINDS: dict[str, Callable[..., Axes]] = {
    "time-history": time_history,
    "phase-portrait": phase_portrait,
    "stroboscopic-map": stroboscopic_map,
    "impact-map": impact_map,
    "bifurcation-diagram": bifurcation_diagram,
    "index-curve": index_curve,
    "index-surface": index_surface,
    "index-contour": index_contour,
}


def default_kind(dataset: xr.Dataset) -> str:
    """Return the name in `KINDS` of the figure that shows a result best.

    Parameters
    ----------
    dataset : xarray.Dataset
        A result of any public function.

    Returns
    -------
    str

    Raises
    ------
    ValueError
        No figure shows such a result; the message tells what would be needed.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> default_kind(vi.simulate(vi.ImpactOscillator(), periods=2))
    'time-history'
    """
    made_by: Any = dataset.attrs.get("function")
    axes = [dim for dim in dataset["status"].dims if dim not in SAMPLE_DIMS] if "status" in dataset else []
    if made_by == "simulate" or "impact_time" in dataset:
        return "time-history"
    if "impact" in dataset.dims or "period" in dataset.dims:
        if axes:
            return "bifurcation-diagram"
        return "impact-map" if "phase" in dataset else "stroboscopic-map"
    if len(axes) in (1, 2):
        return "index-curve" if len(axes) == 1 else "index-contour"
    raise ValueError(
        f"`dataset` has {len(axes)} axes and no samples; allowed is a result of simulate, a section, "
        "bifurcation_diagram, or a parameter_map over one or two axes; select values of further axes with .sel"
    )
