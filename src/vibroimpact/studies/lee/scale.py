"""How much is computed: the paper's study, or the same on coarse grids."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scale:
    """Grids and counts of one run of the study.

    Parameters
    ----------
    map_points : int
        Values along either axis of the five two-parameter maps.
    map_transient, map_impacts : int
        Impacts left out and kept in each cell of a map and along each line of Std.
    columns : int
        Frequencies of a bifurcation diagram and of a line of Std.
    column_transient, column_impacts : int
        Impacts left out and kept in a column of a diagram.
    looks : int
        Stroboscopic looks kept in a column of figure 2, after as many periods as `map_transient`.
    orbit_impacts : int
        Impacts, and periods, kept on the sections of figures 4 to 9.
    scan_step : float
        Distance in rad/s of the frequencies at which motions are recognised.
    variant_step : float
        The same for scans at other parameters than the paper's.
    cells_along : int
        Cells of a map, along either axis, in which the motion is recognised.
    settle_impacts, settled_impacts : int
        Impacts left out, then kept, where a motion is recognised.
    dpi : int
        Resolution of the figures.
    """

    name: str
    map_points: int
    map_transient: int
    map_impacts: int
    columns: int
    column_transient: int
    column_impacts: int
    looks: int
    orbit_impacts: int
    scan_step: float
    variant_step: float
    cells_along: int
    settle_impacts: int
    settled_impacts: int
    dpi: int


PAPER = Scale(
    name="full", map_points=200, map_transient=100, map_impacts=5000,
    columns=1000, column_transient=200, column_impacts=150, looks=100, orbit_impacts=5000,
    scan_step=0.01, variant_step=0.02, cells_along=25, settle_impacts=2000, settled_impacts=1000, dpi=150,
)  # fmt: skip
QUICK = Scale(
    name="quick", map_points=40, map_transient=50, map_impacts=300,
    columns=150, column_transient=100, column_impacts=100, looks=50, orbit_impacts=1000,
    scan_step=0.01, variant_step=0.05, cells_along=13, settle_impacts=1000, settled_impacts=500, dpi=90,
)  # fmt: skip
