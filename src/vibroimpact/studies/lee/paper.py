"""What the paper sets: its oscillator, its figures and the parameters they were drawn at."""

from __future__ import annotations

from dataclasses import dataclass

import vibroimpact as vi

CITATION = (
    "J.-Y. Lee, Numerical Analysis of Impact Vibration Based on a Bifurcation Diagram With Two Varying Control "
    "Parameters, National Kaohsiung University of Science and Technology"
)
OSCILLATOR = vi.ImpactOscillator(mass=1.0, damping=0.01, stiffness=1.0, amplitude=1.0, restitution=0.8, gap=0.0)
WINDOW = (100.0, 150.0)  # s; what the paper's simulations keep
TIME_STEP = 0.0005  # s; of its Runge-Kutta scheme
TOP = 5.0  # rad/s; end of every frequency axis
LEVEL = 0.05  # m/s; height of a boundary unless told otherwise, 5 % of f / sqrt(k m)

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
