"""Figures of every result: Dataset in, matplotlib Axes out, one function per figure.

Legends lie below the axes, where they hide no data: give figures of your own layout="constrained".
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.bundles import unbundle
from vibroimpact.plotting.checks import SAMPLE_DIMS
from vibroimpact.plotting.continuation import boundaries, branch_diagram
from vibroimpact.plotting.designs import comparison_figure, oscillator_sketch
from vibroimpact.plotting.diagrams import bifurcation_diagram, diagram_with_index, index_curve
from vibroimpact.plotting.files import save_figure
from vibroimpact.plotting.maps import boundary_lines, index_contour, index_scatter, index_surface
from vibroimpact.plotting.motions import EXPONENTS, basin_portrait, exponent_map, motion_map
from vibroimpact.plotting.orbits import impact_map, phase_portrait, stroboscopic_map, time_history

__all__ = [
    "KINDS",
    "basin_portrait",
    "bifurcation_diagram",
    "boundaries",
    "boundary_lines",
    "branch_diagram",
    "comparison_figure",
    "default_kind",
    "diagram_with_index",
    "exponent_map",
    "impact_map",
    "index_contour",
    "index_curve",
    "index_scatter",
    "index_surface",
    "motion_map",
    "oscillator_sketch",
    "phase_portrait",
    "save_figure",
    "stroboscopic_map",
    "time_history",
]


def _parts(draw: Callable[..., Axes]) -> Callable[..., Axes]:
    """Return a figure of all parts that one dataset bundles."""
    return lambda dataset, **how: draw(unbundle(dataset), **how)


class _Kind(NamedTuple):
    """A figure, and the functions whose results it shows unless another one is named."""

    draw: Callable[..., Axes | Figure]
    makers: tuple[str, ...] = ()


# What --figure names. To add a figure: its function in this folder, its import above, its entry here.
_TABLE = {
    "time-history": _Kind(time_history, ("simulate",)),
    "phase-portrait": _Kind(phase_portrait),
    "stroboscopic-map": _Kind(stroboscopic_map),
    "impact-map": _Kind(impact_map),
    "bifurcation-diagram": _Kind(bifurcation_diagram),
    "index-curve": _Kind(index_curve),
    "index-surface": _Kind(index_surface),
    "index-contour": _Kind(index_contour),
    "index-scatter": _Kind(index_scatter),
    "motion-map": _Kind(motion_map, ("classify",)),
    "exponent-map": _Kind(exponent_map),
    "branch-diagram": _Kind(_parts(branch_diagram), ("continue_orbit",)),
    "boundaries": _Kind(_parts(boundaries), ("continue_boundary", "boundary_curves")),
    "basin-portrait": _Kind(basin_portrait, ("basins",)),
    "comparison": _Kind(comparison_figure, ("compare",)),
}
KINDS: dict[str, Callable[..., Axes | Figure]] = {name: kind.draw for name, kind in _TABLE.items()}
_BY_MAKER = {maker: name for name, kind in _TABLE.items() for maker in kind.makers}


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
        No figure shows such a result; the message says which results have one.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> default_kind(vi.simulate(vi.ImpactOscillator(), periods=2))
    'time-history'
    """
    maker: Any = dataset.attrs.get("function")
    if maker in _BY_MAKER:
        return _BY_MAKER[maker]
    if "impact_time" in dataset:
        return "time-history"
    axes = [str(dim) for dim in dataset["status"].dims if dim != "start"] if "status" in dataset else []
    if "status" in dataset and set(dataset.dims) & set(SAMPLE_DIMS):
        return "bifurcation-diagram" if axes else "impact-map" if "phase" in dataset else "stroboscopic-map"
    if axes == ["point"]:
        return "index-scatter"
    if len(axes) == 1:
        return "index-curve"
    if len(axes) == 2:
        indices = {str(name) for name in dataset.data_vars} - {"status"}
        return "exponent-map" if indices and indices <= set(EXPONENTS) else "index-contour"
    raise ValueError(
        "`dataset` must be a result of simulate, a section, bifurcation_diagram, parameter_map over one or two axes, "
        f"continue_orbit, boundary_curves, basins or compare, got {len(axes)} axes; "
        "select values of further axes with .sel"
    )
