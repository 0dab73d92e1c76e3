"""What the paper prescribes: its oscillator, its figures, their parameters; and the grids that the study uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi

CITATION = (
    "J.-Y. Lee, Numerical Analysis of Impact Vibration Based on a Bifurcation Diagram With Two Varying Control "
    "Parameters, National Kaohsiung University of Science and Technology"
)
OSCILLATOR = vi.ImpactOscillator(mass=1.0, damping=0.01, stiffness=1.0, amplitude=1.0, restitution=0.8, gap=0.0)
WINDOW = (100.0, 150.0)  # s; what the paper's simulations keep
TIME_STEP = 0.0005  # s; of its Runge-Kutta scheme
TOP = 5.0  # rad/s; end of every frequency axis
LEVEL = 0.05  # m/s; default height of a boundary, 5 % of f / sqrt(k m)
INDICES = ("std", "mean_velocity", "max_velocity", "impacts_per_period")  # of every map and line along w

# figure: driving frequency of its Poincare map (a) and impact map (b)
ORBITS = {4: 0.10, 5: 0.25, 6: 0.75, 7: 1.0, 8: 2.0, 9: 2.8}


@dataclass(frozen=True)
class Pair:
    """One varied parameter beside w: its map (figure `map_figure`) and its two diagrams (the next figure).

    The paper prints no ranges for the second axis; `low` and `high` are ours.
    """

    name: str
    symbol: str
    section: str
    map_figure: int
    low: float
    high: float
    examples: tuple[float, float]

    @property
    def key(self) -> str:
        """Key of the map among the results."""
        return f"figure-{self.map_figure}"

    @property
    def word(self) -> str:
        """The varied parameter in the paper's words."""
        return {"amplitude": "forcing amplitude", "restitution": "the restitution coefficient"}.get(
            self.name, self.name
        )

    @property
    def reference(self) -> float:
        """The value at which the marker line is drawn."""
        return float(getattr(OSCILLATOR, self.name))


PAIRS = (
    Pair("mass", "m", "4.1", 11, 0.1, 5.0, (0.1, 5.0)),
    Pair("damping", "c", "4.2", 13, 0.005, 1.0, (0.5, 1.0)),
    Pair("stiffness", "k", "4.3", 15, 0.1, 5.0, (0.1, 5.0)),
    Pair("amplitude", "f", "4.4", 17, 0.1, 5.0, (0.1, 5.0)),
    Pair("restitution", "r", "4.5", 19, 0.1, 0.99, (1.0, 0.1)),
)


def pair_of(name: str) -> Pair:
    """Return the pair whose second parameter has this name."""
    return next(pair for pair in PAIRS if pair.name == name)


def frequencies(points: int, low: float = 0.0, high: float = TOP) -> NDArray[np.float64]:
    """Return `points` evenly spaced driving frequencies in (low, high], rad/s."""
    return np.linspace(low, high, points + 1)[1:]


@dataclass(frozen=True)
class Scale:
    """Grids and counts of one run of the study."""

    name: str
    map_points: int  # along either axis of the five two-parameter maps
    map_transient: int  # impacts left out in each cell of a map and along each line of Std
    map_impacts: int  # impacts kept there
    columns: int  # frequencies of a bifurcation diagram and of a line of Std
    column_transient: int  # impacts left out in a column of a diagram
    column_impacts: int  # impacts kept there
    looks: int  # stroboscopic samples kept in a column of figure 2, after 2 `map_transient` periods
    orbit_impacts: int  # impacts, and periods, kept on the sections of figures 4 to 9
    scan_step: float  # rad/s between the frequencies at which motions are recognised
    variant_step: float  # the same at parameters other than the paper's
    cells_along: int  # cells of a map, along either axis, in which the motion is recognised
    settle_impacts: int  # left out where a motion is recognised
    settled_impacts: int  # kept there
    dpi: int  # of the figures


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
