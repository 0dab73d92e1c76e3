"""What the explorer shows, in one frozen value; nothing outside its limits can be made."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import product
from typing import Any

from vibroimpact.dataset import VARIABLES
from vibroimpact.explorer.limits import FINEST as FINEST  # others take it from here
from vibroimpact.explorer.limits import Range as Range
from vibroimpact.explorer.limits import check_start, checked_range, one_of, short, stiffness, within_reach
from vibroimpact.indices import INDICES
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, State
from vibroimpact.parameters import real_number

MOTION = "motion"  # the index that is a name
SHOWN = (MOTION, *INDICES)
SAMPLES = (200, 500, 1000, 2000, 5000)
CASES = (
    "", "paper-mass", "paper-stiffness", "paper-damping", "paper-amplitude", "paper-restitution", "gap", "tube", "pipe",
    "ship", "valve",
)  # fmt: skip
MOST_PINS = 2
EDGE, PIN = " at the edge of the plane", " in a pin"


@dataclass(frozen=True)
class View:
    """Everything that is seen: a point, a plane through it, what is told of each cell, and what is compared.

    Parameters
    ----------
    osc : ImpactOscillator
        The point: seven numbers. The plane varies two of them and takes the other five from here.
    x, y : str
        The parameters along the plane's axes.
    x_range, y_range : pairs of float
        What part of the plane is seen, in the parameters' units.
    index : str
        "motion" for the motion's name, or an index of `parameter_map`.
    log : bool
        Whether colours are spread over the logarithm of the index.
    line : {"x", "y"}
        Along which axis the diagram below the plane runs, through the point.
    samples : int
        Impacts sampled a cell, after 100 left out: 200, 500, 1000, 2000 or 5000.
    boundaries : bool
        Whether exact boundaries are drawn over the plane.
    settled : bool
        Whether the history begins on the settled motion, or at its start.
    start : State, optional
        Where the point's motion starts; None is at rest at min(0, gap).
    pins : tuple of ImpactOscillator
        Up to two points whose motions are drawn beside the present one.
    case : str
        Which of the cases the view began with: it is told of, and the sliders reach as far as suits it; "" is none.
    """

    osc: ImpactOscillator = field(default_factory=ImpactOscillator)
    x: str = "omega"
    y: str = "mass"
    x_range: Range = (0.025, 5.0)
    y_range: Range = (0.1, 5.0)
    index: str = "std"
    log: bool = False
    line: str = "x"
    samples: int = 500
    boundaries: bool = False
    settled: bool = True
    start: State | None = None
    pins: tuple[ImpactOscillator, ...] = ()
    case: str = ""

    def __post_init__(self) -> None:
        for name, allowed in _CHOICES.items():
            object.__setattr__(self, name, one_of(name, getattr(self, name), allowed))
        if self.x == self.y:
            raise ValueError(f"`y` is {short(self.y)}, as `x` is; allowed are two different parameters; replace one")
        if len(self.pins) > MOST_PINS:
            raise ValueError(f"`pin` is given {len(self.pins)} times; allowed are {MOST_PINS}; drop one")
        for axis in ("x", "y"):
            name = f"{axis}_range"
            object.__setattr__(self, name, checked_range(axis, getattr(self, axis), getattr(self, name)))
        for where, points in (("", [self.osc]), (PIN, self.pins), (EDGE, self.corners())):
            for osc in points:
                within_reach(osc, where)
        if self.start is not None:
            check_start(self.start, self.osc)

    def corners(self) -> list[ImpactOscillator]:
        """Return the oscillators at the plane's four corners."""
        return [self.osc.replace(**{self.x: x, self.y: y}) for x, y in product(self.x_range, self.y_range)]

    @property
    def stiffness(self) -> float:
        """The largest stiffness in the plane, which is that of a corner: it rises or falls with each parameter."""
        return max(stiffness(osc) for osc in (self.osc, *self.corners()))

    @property
    def plane_key(self) -> tuple[Any, ...]:
        """What the plane's cells depend on."""
        fixed = tuple(getattr(self.osc, name) for name in PARAMETERS if name not in (self.x, self.y))
        return self.x, self.y, self.x_range, self.y_range, self.samples, fixed

    @property
    def point_key(self) -> tuple[Any, ...]:
        """What the point's motion depends on."""
        return self.osc, self.start, self.settled, self.samples

    @property
    def line_key(self) -> tuple[Any, ...]:
        """What the diagram depends on."""
        along, low_high = self.along
        others = tuple(getattr(self.osc, name) for name in PARAMETERS if name != along)
        return along, low_high, others

    @property
    def boundary_key(self) -> tuple[Any, ...]:
        """What the boundaries depend on."""
        *plane, _, fixed = self.plane_key
        return (True, *plane, fixed) if self.boundaries else (False,)

    def osc_value(self, axis: str) -> float:
        """Return the point's coordinate along an axis, "x" or "y"."""
        return float(getattr(self.osc, getattr(self, axis)))

    @property
    def along(self) -> tuple[str, Range]:
        """The parameter along which the diagram runs, and its range."""
        return (self.x, self.x_range) if self.line == "x" else (self.y, self.y_range)


_CHOICES: dict[str, tuple[Any, ...]] = {
    "x": PARAMETERS,
    "y": PARAMETERS,
    "index": SHOWN,
    "line": ("x", "y"),
    "samples": SAMPLES,
    "log": (False, True),
    "boundaries": (False, True),
    "settled": (False, True),
    "case": CASES,
}


def rounded(value: Any, ends: Range) -> float:
    """Return a clicked value with no more digits than a pixel tells."""
    value = real_number("point", value)
    return round(float(value), math.ceil(-math.log10((ends[1] - ends[0]) / 2000.0)))


LABELS = {"amplitude": "force amplitude", "omega": "driving frequency", "restitution": "restitution"}
GREEK = {"w": "ω", "psi/T": "ψ/T", "<I>": "⟨I⟩"}


def parameter_label(name: str) -> str:
    """Return 'driving frequency ω [rad/s]'."""
    long_name, units, symbol = VARIABLES[name]
    return f"{LABELS.get(name, long_name)} {GREEK.get(symbol, symbol)}" + ("" if units == "1" else f" [{units}]")
