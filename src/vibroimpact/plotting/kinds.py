"""The figure a result is drawn as, by name and by default."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.bundles import unbundle
from vibroimpact.plotting.basins import basin_portrait
from vibroimpact.plotting.boundaries import boundaries
from vibroimpact.plotting.branches import branch_diagram
from vibroimpact.plotting.checks import SAMPLE_DIMS
from vibroimpact.plotting.classes import motion_map
from vibroimpact.plotting.comparison import comparison_figure
from vibroimpact.plotting.diagrams import bifurcation_diagram, index_curve
from vibroimpact.plotting.exponents import exponent_map
from vibroimpact.plotting.maps import index_contour, index_surface
from vibroimpact.plotting.orbit import phase_portrait, time_history
from vibroimpact.plotting.sections import impact_map, stroboscopic_map


def _all_boundaries(dataset: xr.Dataset, **more: Any) -> Axes:
    return boundaries(unbundle(dataset), **more)


def _all_branches(dataset: xr.Dataset, **more: Any) -> Axes:
    return branch_diagram(unbundle(dataset), **more)


KINDS: dict[str, Callable[..., Axes | Figure]] = {
    "time-history": time_history,
    "phase-portrait": phase_portrait,
    "stroboscopic-map": stroboscopic_map,
    "impact-map": impact_map,
    "bifurcation-diagram": bifurcation_diagram,
    "index-curve": index_curve,
    "index-surface": index_surface,
    "index-contour": index_contour,
    "motion-map": motion_map,
    "exponent-map": exponent_map,
    "branch-diagram": _all_branches,
    "boundaries": _all_boundaries,
    "basin-portrait": basin_portrait,
    "comparison": comparison_figure,
}

_BY_MAKER = {
    "simulate": "time-history",
    "classify": "motion-map",
    "continue_orbit": "branch-diagram",
    "continue_boundary": "boundaries",
    "boundary_curves": "boundaries",
    "basins": "basin-portrait",
    "compare": "comparison",
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
    if made_by in _BY_MAKER:
        return _BY_MAKER[made_by]
    axes = [dim for dim in dataset["status"].dims if dim not in SAMPLE_DIMS] if "status" in dataset else []
    if "impact_time" in dataset:
        return "time-history"
    if "status" in dataset and ("impact" in dataset.dims or "period" in dataset.dims):
        if axes:
            return "bifurcation-diagram"
        return "impact-map" if "phase" in dataset else "stroboscopic-map"
    if len(axes) in (1, 2):
        return _of_a_sweep(dataset, len(axes))
    raise ValueError(
        f"`dataset` has {len(axes)} axes and no samples; allowed is a result of simulate, a section, "
        "bifurcation_diagram, parameter_map over one or two axes, continue_orbit, boundary_curves, basins or compare; "
        "select values of further axes with .sel"
    )


def _of_a_sweep(dataset: xr.Dataset, n_axes: int) -> str:
    """Return the figure of a map: exponents have their own where nothing else is told."""
    if n_axes == 1:
        return "index-curve"
    told = {str(name) for name in dataset.data_vars} - {"status"}
    return "exponent-map" if told and told <= {"lyapunov", "lyapunov_per_impact"} else "index-contour"
