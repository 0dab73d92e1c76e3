"""Figures of every result: Dataset in, matplotlib Axes out, one function a figure type.

Legends stand below the axes, so that they hide no data: give figures of your own layout="constrained".
"""

from vibroimpact.plotting.diagrams import bifurcation_diagram, diagram_with_index, index_curve
from vibroimpact.plotting.files import save_figure
from vibroimpact.plotting.kinds import KINDS, default_kind
from vibroimpact.plotting.maps import boundary_lines, index_contour, index_surface
from vibroimpact.plotting.orbit import phase_portrait, time_history
from vibroimpact.plotting.sections import impact_map, stroboscopic_map
from vibroimpact.plotting.sketch import oscillator_sketch

__all__ = [
    "KINDS",
    "bifurcation_diagram",
    "boundary_lines",
    "default_kind",
    "diagram_with_index",
    "impact_map",
    "index_contour",
    "index_curve",
    "index_surface",
    "oscillator_sketch",
    "phase_portrait",
    "save_figure",
    "stroboscopic_map",
    "time_history",
]
