"""Where a motion ends in one direction of one parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.verdict.reach import Reach
from vibroimpact.verdict.readings import Start

NOISE = 1e-12  # relative: what is smaller is rounding
KIND_WORDS = {
    "period_doubling": "period doubling",
    "fold": "fold",
    "grazing": "grazing",
    "end_of_sticking": "end of sticking",
    "first_contact": "the motion first touches the stop",
    "lift_off": "the force first lifts the mass off the stop",
    "pressed_for_ever": "the force no longer lifts the mass off the stop",
    "change": "another motion",
    "none": "none",
}


@dataclass(frozen=True)
class Edge:
    """The nearest boundary of a motion along one parameter, downwards or upwards.

    Parameters
    ----------
    parameter : str
        Which one is varied.
    direction : int
        -1 for smaller values, +1 for larger ones.
    kind : str
        "period_doubling", "fold", "grazing", "end_of_sticking", "first_contact" and "lift_off" (of a motion without
        impacts), "pressed_for_ever", "change" (another class of motion, found by bisection), or "none" as far as was
        looked.
    value : float
        The parameter there; NaN for "none".
    change : float
        From the present value to there, signed, as a part of the present value, or of `of`.
    of : str
        What the change is a part of, where that is not the present value: "f/k" for a gap smaller than that.
    half_width : float
        0 where `value` solves the boundary's own equation (to some 1e-12); else it lies within this of `value`.
    beyond : str
        The motion just beyond, followed across; empty where none was found.
    beyond_at : float
        The value at which that was looked at; NaN where it was not.
    searched_to : float
        How far was looked.
    """

    parameter: str
    direction: int
    kind: str
    value: float
    change: float
    of: str
    half_width: float = 0.0
    beyond: str = ""
    beyond_at: float = math.nan
    searched_to: float = math.nan

    @property
    def found(self) -> bool:
        """Whether there is one."""
        return self.kind != "none"

    @property
    def exact(self) -> bool:
        """Whether the value solves the boundary's own equation."""
        return self.found and self.half_width == 0.0

    @property
    def at_once(self) -> bool:
        """Whether the present value lies on the boundary, as far as rounding can tell."""
        return self.exact and abs(self.change) < NOISE

    @property
    def accuracy(self) -> str:
        """`exact`, `to within ...`, or nothing where no boundary was found."""
        return "" if not self.found else "exact" if self.exact else f"to within {self.half_width:.1g}"


@dataclass(frozen=True)
class Found:
    """A boundary before one has looked beyond it: `osc` and `start` are what to carry across."""

    reach: Reach
    direction: int
    kind: str = "none"
    value: float = math.nan
    half_width: float = 0.0
    start: Start | None = None

    def beyond_at(self) -> float:
        """Return a value a little beyond the boundary, NaN where the range ends first."""
        if self.kind == "none":
            return math.nan
        scale = self.reach.scale
        ahead = min(0.02 * abs(self.value - self.reach.value) + 1e-6 * scale, 4e-3 * scale) + 2.0 * self.half_width
        value = self.value + self.direction * ahead
        end = self.reach.end(self.direction)
        value = min(value, end) if self.direction > 0 else max(value, end)
        return value if (value - self.value) * self.direction > 0.0 else math.nan

    def edge(self, beyond: str, at: float) -> Edge:
        """Return what callers see."""
        reach, end = self.reach, self.reach.end(self.direction)
        change = reach.change(self.value)
        return Edge(
            reach.name, self.direction, self.kind, self.value, change, reach.of, self.half_width, beyond, at, end
        )


def steady_start(osc: ImpactOscillator) -> Start | None:
    """Return the motion without a stop at phase 0: f Im(H), w f Re(H) with H = 1/(k - m w^2 + i c w)."""
    impedance = complex(osc.stiffness - osc.mass * osc.omega**2, osc.damping * osc.omega)
    if impedance == 0.0:
        return None
    answer = osc.amplitude / impedance
    return Start(max(osc.gap - answer.imag, 0.0), osc.omega * answer.real, 0.0)
