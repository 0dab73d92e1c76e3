"""What the explorer shows, in one frozen value; a model is known by its table of parameters alone."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

from vibroimpact.explorer.limits import Range, check_limits, checked_range, checked_start, stiffness, system_of
from vibroimpact.figures import MOTION
from vibroimpact.indices import INDICES
from vibroimpact.model import Model, State
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.parameters import Parameter, invalid, real_number

SHOWN = (MOTION, *INDICES)
SAMPLES = (200, 500, 1000, 2000, 5000)
CASES = (
    "", "paper-mass", "paper-stiffness", "paper-damping", "paper-amplitude", "paper-restitution", "gap", "tube", "pipe",
    "ship", "valve",
)  # fmt: skip
MOST_PINS = 2
MOST_SHOWN = 128  # coordinates and stops to choose from


@dataclass(frozen=True)
class Choice:
    """A field of a view that has one of some values: its key and texts in an address, and its label on the page."""

    key: str
    texts: dict[str, Any]
    label: str = ""


def _same(values: Iterable[Any]) -> dict[str, Any]:
    return {str(value): value for value in values}


FLAG = {"0": False, "1": True}
CHOICES = {
    "index": Choice("index", _same(SHOWN), "colour by"),
    "log": Choice("log", FLAG, "logarithmic colours"),
    "worst": Choice("worst", FLAG, "worst of 17 initial conditions"),
    "boundaries": Choice("b", FLAG, "boundaries of n = 1, 2 (some seconds)"),
    "line": Choice("line", _same("xy"), "diagram along"),
    "samples": Choice("n", _same(SAMPLES), "impacts per cell"),
    "settled": Choice("from", {"start": False, "settled": True}, "show the settled motion"),
    "case": Choice("case", _same(CASES)),
    "coordinate": Choice("q", _same(range(MOST_SHOWN + 1)), "displacement"),
    "stop": Choice("stop", _same(range(MOST_SHOWN + 1)), "impacts"),
}

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
SHORTER = {
    "driving force amplitude": "force amplitude", "angular driving frequency": "driving frequency",
    "coefficient of restitution": "restitution",
}  # fmt: skip
GREEK = {"w": "ω", "w/2pi": "ω/2π", "zeta": "ζ", "psi/T": "ψ/T", "<I>": "⟨I⟩"}


@dataclass(frozen=True)
class View:
    """Everything that is shown: a point, a plane through it, the colours of its cells, and what is compared.

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The model at the point. The plane varies two of its parameters and takes the others from here.
    x, y : str
        The parameters along the plane's axes.
    x_range, y_range : pairs of float
        The part of the plane that is shown, in the parameters' units.
    index : str
        "motion" for the motion's name, or an index of `parameter_map`.
    log : bool
        Whether colours are spread over the logarithm of the index.
    line : {"x", "y"}
        Along which axis the diagram below the plane runs, through the point.
    samples : int
        Impacts sampled per cell, after 100 left out: 200, 500, 1000, 2000 or 5000.
    worst : bool
        Whether a cell shows the worst of several initial conditions, not what follows from rest.
    boundaries : bool
        Whether exact boundaries are drawn over the plane.
    settled : bool
        Whether the history begins on the settled motion, or at its initial condition.
    start : State, optional
        Initial condition of the point's motion; None is at rest at min(0, gap).
    pins : tuple of models
        Up to two points whose motions are drawn beside the present one.
    case : str
        The case that the view began with: it is described, and its sliders have its ranges; "" is none.
    model : str
        What the model is called in links; "" is one mass with one stop.
    coordinate, stop : int
        For systems, the coordinate that plots show, counted from 1, and the stop whose impacts they show. 0 are the
        displacement towards that stop, or the first, and the impacts at all stops.
    """

    osc: Model = field(default_factory=ImpactOscillator)
    x: str = "omega"
    y: str = "mass"
    x_range: Range = (0.025, 5.0)
    y_range: Range = (0.1, 5.0)
    index: str = "std"
    log: bool = False
    line: str = "x"
    samples: int = 500
    worst: bool = False
    boundaries: bool = False
    settled: bool = True
    start: State | None = None
    pins: tuple[Model, ...] = ()
    case: str = ""
    model: str = ""
    coordinate: int = 0
    stop: int = 0

    def __post_init__(self) -> None:
        names = tuple(self.table)
        choices = {"x": names, "y": names} | {name: (*choice.texts.values(),) for name, choice in CHOICES.items()}
        for name, values in choices.items():
            object.__setattr__(self, name, _one_of(name, getattr(self, name), values))
        if self.x == self.y:
            raise invalid("y", self.y, "a parameter different from `x`")
        if len(self.pins) > MOST_PINS:
            raise ValueError(f"`pin` must be given at most {MOST_PINS} times, got {len(self.pins)}")
        for axis in ("x", "y"):
            name = f"{axis}_range"
            parameter = self.table[getattr(self, axis)]
            object.__setattr__(self, name, checked_range(axis, parameter, getattr(self, name)))
        corners = self.corners()
        for where, points in (("", [self.osc]), (" in a pin", self.pins), (" at the edge of the plane", corners)):
            for osc in points:
                check_limits(osc, where)
        for kind, number in (("coordinate", self.system.coordinates), ("stop", len(self.system.stops))):
            if getattr(self, kind) > number:
                raise invalid(kind, getattr(self, kind), f"at most {number}, as many as there are")
        if self.start is not None:
            object.__setattr__(self, "start", checked_start(self.start, self.system))

    @cached_property
    def table(self) -> dict[str, Parameter]:
        """The model's parameters, by name."""
        return table(self.osc)

    @cached_property
    def system(self) -> Any:
        """The oscillator or system at the point."""
        return system_of(self.osc)

    def corners(self) -> list[Model]:
        """Return the models at the plane's four corners."""
        return [self.osc.replace(**{self.x: x, self.y: y}) for x, y in product(self.x_range, self.y_range)]

    @property
    def stiffness(self) -> float:
        """The largest stiffness in the plane, which is that of a corner: it rises or falls with each parameter."""
        return max(stiffness(osc) for osc in (self.osc, *self.corners()))

    @property
    def plane_key(self) -> tuple[Any, ...]:
        """What the plane's cells depend on."""
        return *self._plane, self.samples, self.worst

    @property
    def point_key(self) -> tuple[Any, ...]:
        """What the point's motion depends on."""
        return self.osc, self.start, self.settled, self.samples, self.coordinate, self.stop

    @property
    def line_key(self) -> tuple[Any, ...]:
        """What the diagram depends on."""
        along, ends = self.along
        return along, ends, self.stop, self._fixed(along)

    @property
    def boundary_key(self) -> tuple[Any, ...]:
        """What the boundaries depend on."""
        return (True, *self._plane) if self.boundaries else (False,)

    @property
    def _plane(self) -> tuple[Any, ...]:
        return self.x, self.y, self.x_range, self.y_range, self._fixed(self.x, self.y)

    def _fixed(self, *varied: str) -> tuple[Any, ...]:
        """Return the model, and its parameters that are not varied."""
        return self.model, *(value for name, value in self.osc.values.items() if name not in varied)

    def osc_value(self, axis: str) -> float:
        """Return the point's coordinate along an axis, "x" or "y"."""
        return float(self.osc.values[getattr(self, axis)])

    @property
    def along(self) -> tuple[str, Range]:
        """The parameter along which the diagram runs, and its range."""
        return (self.x, self.x_range) if self.line == "x" else (self.y, self.y_range)


def _one_of(name: str, value: Any, choices: tuple[Any, ...]) -> Any:
    """Return the choice that `value` equals."""
    for choice in choices:
        if isinstance(value, (str, int, float)) and value == choice:
            return choice
    raise invalid(name, value, f"one of {', '.join(map(str, choices))}")


# ---- numbers and names of the model's parameters


def table(model: Model) -> dict[str, Parameter]:
    """Return the parameters that a model has values of, by name: not those that stand for others."""
    return {name: model.parameters[name] for name in model.values}


def typed_number(parameter: Parameter, value: Any) -> float:
    """Return a parameter as it was typed."""
    if isinstance(value, str):
        if not NUMBER.fullmatch(value):
            raise no_number(parameter.name, value)
        value = float(value)
    return parameter.check(value)


def no_number(name: str, text: str) -> ValueError:
    """Return the error for a text that is not a number."""
    return invalid(name, text, "a number", "write it with a dot, as in 2.8")


def rounded(value: Any, ends: Range) -> float:
    """Return a clicked value with no more digits than a pixel distinguishes."""
    value = real_number("point", value)
    return round(float(value), math.ceil(-math.log10((ends[1] - ends[0]) / 2000.0)))


def symbol(parameter: Parameter) -> str:
    """Return a parameter's symbol, as ω; its name in words where it has none of its own."""
    has_symbol = parameter.symbol and parameter.symbol != parameter.name
    return GREEK.get(parameter.symbol, parameter.symbol) if has_symbol else parameter.long_name


def shown_unit(unit: str) -> str:
    """Return a unit as it is shown: nothing for a pure number."""
    return "" if unit == "1" else unit


def parameter_label(parameter: Parameter, units: bool = True) -> str:
    """Return 'driving frequency ω [rad/s]'."""
    name = SHORTER.get(parameter.long_name, parameter.long_name)
    label = name if symbol(parameter) == parameter.long_name else f"{name} {symbol(parameter)}"
    unit = shown_unit(parameter.unit)
    return f"{label} [{unit}]" if units and unit else label
