"""Figures of every result: Dataset in, matplotlib Axes out, one function a figure type.

Legends stand below the axes, so that they hide no data: give figures of your own layout="constrained".
"""

from vibroimpact.plotting.basins import basin_portrait
from vibroimpact.plotting.boundaries import boundaries
from vibroimpact.plotting.branches import branch_diagram
from vibroimpact.plotting.classes import motion_map
from vibroimpact.plotting.comparison import comparison_figure
from vibroimpact.plotting.diagrams import bifurcation_diagram, diagram_with_index, index_curve
from vibroimpact.plotting.exponents import exponent_map
from vibroimpact.plotting.files import save_figure
from vibroimpact.plotting.kinds import KINDS, default_kind
from vibroimpact.plotting.maps import boundary_lines, index_contour, index_surface
from vibroimpact.plotting.orbit import phase_portrait, time_history
from vibroimpact.plotting.sections import impact_map, stroboscopic_map
from vibroimpact.plotting.sketch import oscillator_sketch

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
    "index_surface",
    "motion_map",
    "oscillator_sketch",
    "phase_portrait",
    "save_figure",
    "stroboscopic_map",
    "time_history",
]
