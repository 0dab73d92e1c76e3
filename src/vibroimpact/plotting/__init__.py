"""Figures of every result: Dataset in, matplotlib Axes out, one function per figure.

Legends lie below the axes, where they hide no data: give figures of your own layout="constrained".
"""

from __future__ import annotations

from collections.abc import Callable

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact import figures
from vibroimpact.dataset import unbundle
from vibroimpact.plotting.checks import SAMPLE_DIMS
from vibroimpact.plotting.continuation import boundaries, branch_diagram
from vibroimpact.plotting.designs import comparison_figure, oscillator_sketch
from vibroimpact.plotting.diagrams import bifurcation_diagram, diagram_with_index, index_curve
from vibroimpact.plotting.files import save_figure
from vibroimpact.plotting.maps import boundary_lines, index_contour, index_scatter, index_surface
from vibroimpact.plotting.motions import basin_portrait, exponent_map, motion_map
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


def _drawer(kind: figures.Kind) -> Callable[..., Axes | Figure]:
    """Return the function of a kind of figure; a bundled one takes all parts of one dataset."""
    draw: Callable[..., Axes | Figure] = globals()[kind.function]
    return (lambda dataset, **how: draw(unbundle(dataset), **how)) if kind.bundled else draw


KINDS: dict[str, Callable[..., Axes | Figure]] = {name: _drawer(kind) for name, kind in figures.KINDS.items()}
_BY_SHAPE = ("impact_section", "stroboscopic_section", "bifurcation_diagram", "parameter_map")  # may have been sliced


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
    maker = str(dataset.attrs.get("function"))
    if maker not in _BY_SHAPE and (kinds := figures.kinds_of(maker)):
        return kinds[0]
    if "impact_time" in dataset:
        return "time-history"
    axes = [str(dim) for dim in dataset["status"].dims if dim != "start"] if "status" in dataset else []
    if "status" in dataset and set(dataset.dims) & set(SAMPLE_DIMS):
        return "bifurcation-diagram" if axes else "impact-map" if "phase" in dataset else "stroboscopic-map"
    if axes == ["point"]:
        return "index-scatter"
    indices = {str(name) for name in dataset.data_vars} - {"status"}
    if len(axes) == 2 and indices and indices <= set(figures.EXPONENTS):
        return "exponent-map"
    if kinds := figures.kinds_of("parameter_map", len(axes)) if axes else ():
        return kinds[0]
    raise ValueError(
        "`dataset` must be a result of simulate, a section, bifurcation_diagram, parameter_map over one or two axes, "
        f"continue_orbit, boundary_curves, basins or compare, got {len(axes)} axes; "
        "select values of further axes with .sel"
    )
