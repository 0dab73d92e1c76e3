"""The state of the explorer as one immutable value; a model enters only by its table of parameters."""

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
from vibroimpact.indices import INDICES, Index
from vibroimpact.model import Model, State
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.units import without_unit
from vibroimpact.parameters import Parameter, hertz, invalid, labelled, radians, real_number, with_unit

SHOWN = (MOTION, *INDICES)
SAMPLES = (200, 500, 1000, 2000, 5000)  # impacts of a cell to choose from
CASES = (
    "", "paper-mass", "paper-stiffness", "paper-damping", "paper-amplitude", "paper-restitution", "gap", "tube", "pipe",
    "ship", "valve",
)  # fmt: skip
LETTERS = ("A", "B")  # of the pins
MOST_PINS = len(LETTERS)
MOST_SHOWN = 128  # most coordinates and stops to choose from


@dataclass(frozen=True)
class Choice:
    """A field of a view with a fixed set of values: its key and texts in an address, and its label on the page."""

    key: str
    texts: dict[str, Any]
    label: str = ""


def _same(values: Iterable[Any]) -> dict[str, Any]:
    return {str(value): value for value in values}


FLAG = {"0": False, "1": True}
CHOICES = {
    "index": Choice("index", _same(SHOWN), "colour by"),
    "hertz": Choice("hz", FLAG, "driving frequency in Hz"),
    "log": Choice("log", FLAG, "logarithmic colours"),
    "worst": Choice("worst", FLAG, "worst of 17 initial conditions"),
    "boundaries": Choice("b", FLAG, "boundaries of n = 1, 2 (slow)"),
    "line": Choice("line", _same("xy"), "diagram along"),
    "samples": Choice("n", _same(SAMPLES), "impacts per cell"),
    "settled": Choice("from", {"start": False, "settled": True}, "show the settled motion"),
    "case": Choice("case", _same(CASES)),
    "coordinate": Choice("q", _same(range(MOST_SHOWN + 1)), "displacement"),
    "stop": Choice("stop", _same(range(MOST_SHOWN + 1)), "impacts"),
}

MINUS = re.compile(r"(?<!\w)-(?=\.?\d)|(?<=\de)-(?=\d)")  # a minus sign of a number; others are hyphens
POWERS = re.compile(r"(?<=[ms])\^?([2-4])\b")  # of lengths and times in a unit
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
SHORTER = {
    "driving force amplitude": "force amplitude", "angular driving frequency": "driving frequency",
    "coefficient of restitution": "restitution",
    "natural frequency of the absorber over that of the structure": "frequency ratio of the absorber",
    "mass of the absorber over that of the structure": "mass ratio of the absorber",
    "thickness in the direction of motion": "thickness along the motion",
    "amplitude of the static transmission error": "transmission error amplitude",
    "amplitude of the angular acceleration": "angular acceleration",
    "amplitude of the base acceleration": "base acceleration", "amplitude of the driving motion": "driving amplitude",
    "moment of inertia of the driven gear": "inertia of the driven gear",
    "backlash along the line of action": "backlash", "amplitude of the force per length": "force per length",
    "diametral clearance in the supports": "diametral clearance",
    "stroke of the absorber to either side": "stroke of the absorber",
    "natural frequency of the structure": "structure's frequency",
}  # fmt: skip
SHORT = {
    "largest Lyapunov exponent": "Lyapunov exponent λ",
    "largest Lyapunov exponent per impact": "λ per impact",
    "energy lost at the stop per driving period": "loss per period",
    "impacts per driving period": "impacts per period",
    "share of time at rest at the stop": "stick fraction",
    "gap left by the closest near-miss": "closest near-miss",
    "standard deviation of impact velocities": "Std of impact velocities",
    "spread of the impact phases": "spread of phases",
    "driving periods in a cycle": "periods in a cycle",
}
SHORTEST = {
    "standard deviation of impact velocities": "Std of velocities",
    "mean impact velocity": "mean velocity",
    "largest impact velocity": "largest velocity",
    "gap left by the closest near-miss": "near-miss",
}
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
GREEK = {"w": "ω", "w/2pi": "ω/2π", "zeta": "ζ", "psi/T": "ψ/T", "<I>": "⟨I⟩"}


@dataclass(frozen=True)
class View:
    """All that is shown: a point, a plane through it, the colours of its cells, and the pinned points.

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The model at the point. The plane varies two of its parameters and takes the others from here.
    x, y : str
        The parameters along the plane's axes.
    x_range, y_range : pairs of float
        The visible part of the plane, in the parameters' units.
    index : str
        "motion" for the motion's name, or an index of `parameter_map`.
    hertz : bool
        Whether the driving frequency is in Hz, not in rad/s, for models that have `omega`.
    log : bool
        Whether the colour scale is logarithmic.
    line : {"x", "y"}
        The axis along which the diagram below the plane runs, through the point.
    samples : int
        Impacts sampled per cell, after a transient of 100: 200, 500, 1000, 2000 or 5000.
    worst : bool
        Whether a cell shows the worst of several initial conditions instead of the motion from rest.
    boundaries : bool
        Whether exact boundaries are drawn over the plane.
    settled : bool
        Whether the history begins on the settled motion instead of at the initial condition.
    start : State, optional
        Initial condition of the point's motion; None means rest at min(0, gap).
    pins : tuple of models
        Up to two points whose motions are drawn together with the present one.
    case : str
        The case from which the view began, for its description and the ranges of its sliders; "" for none.
    model : str
        The name of the model in links; "" for one mass with one stop.
    coordinate, stop : int
        For systems, the coordinate and the stop shown in plots, counted from 1. `coordinate` 0 means the displacement
        towards the chosen (or the first) stop; `stop` 0 means the impacts at all stops.
    """

    osc: Model = field(default_factory=ImpactOscillator)
    x: str = "omega"
    y: str = "mass"
    x_range: Range = (0.025, 5.0)
    y_range: Range = (0.1, 5.0)
    index: str = "std"
    hertz: bool = False
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
        self._convert_axes()
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
                raise invalid(kind, getattr(self, kind), f"at most {number}, the number available")
        if self.start is not None:
            object.__setattr__(self, "start", checked_start(self.start, self.system))

    @cached_property
    def table(self) -> dict[str, Parameter]:
        """The model's parameters by name."""
        return table(self.osc, self.hertz)

    @cached_property
    def values(self) -> dict[str, float]:
        """Their values at the point."""
        return values_of(self.osc, self.hertz)

    def _convert_axes(self) -> None:
        """Convert the driving frequency along an axis to the unit of the view."""
        units = {"omega": ("frequency", hertz), "frequency": ("omega", radians)}
        for axis in ("x", "y"):
            other, convert = units.get(getattr(self, axis), ("", hertz))
            if other in self.table:
                ends = tuple(float(f"{convert(end):.12g}") for end in getattr(self, f"{axis}_range"))
                object.__setattr__(self, axis, other)
                object.__setattr__(self, f"{axis}_range", ends)

    @cached_property
    def system(self) -> Any:
        """The oscillator or system at the point."""
        return system_of(self.osc)

    def corners(self) -> list[Model]:
        """Return the models at the plane's four corners."""
        return [self.osc.replace(**{self.x: x, self.y: y}) for x, y in product(self.x_range, self.y_range)]

    @property
    def stiffness(self) -> float:
        """The largest stiffness in the plane; it is at a corner, because it is monotone in each parameter."""
        return max(stiffness(osc) for osc in (self.osc, *self.corners()))

    @property
    def plane_key(self) -> tuple[Any, ...]:
        """Key of the plane's cells: everything on which they depend."""
        return *self._plane, self.samples, self.worst

    @property
    def point_key(self) -> tuple[Any, ...]:
        """Key of the point's motion."""
        return self.osc, self.start, self.settled, self.samples, self.coordinate, self.stop

    @property
    def line_key(self) -> tuple[Any, ...]:
        """Key of the diagram."""
        along, ends = self.along
        return along, ends, self.stop, self._fixed(along)

    @property
    def boundary_key(self) -> tuple[Any, ...]:
        """Key of the boundaries."""
        return (True, *self._plane) if self.boundaries else (False,)

    @property
    def _plane(self) -> tuple[Any, ...]:
        return self.x, self.y, self.x_range, self.y_range, self._fixed(self.x, self.y)

    def _fixed(self, *varied: str) -> tuple[Any, ...]:
        """Return the model and its parameters that are not varied."""
        return self.model, *(value for name, value in self.values.items() if name not in varied)

    def osc_value(self, axis: str) -> float:
        """Return the point's coordinate along an axis, "x" or "y"."""
        return self.values[getattr(self, axis)]

    @property
    def along(self) -> tuple[str, Range]:
        """The parameter along which the diagram runs, and its range."""
        return (self.x, self.x_range) if self.line == "x" else (self.y, self.y_range)


def _one_of(name: str, value: Any, choices: tuple[Any, ...]) -> Any:
    """Return the choice equal to `value`; raise `ValueError` if there is none."""
    for choice in choices:
        if isinstance(value, (str, int, float)) and value == choice:
            return choice
    raise invalid(name, value, f"one of {', '.join(map(str, choices))}")


# ---- numbers and names of the model's parameters


def table(model: Model, in_hertz: bool = False) -> dict[str, Parameter]:
    """Return the parameters of a model by name, without those that replace others.

    With `in_hertz`, `omega` is replaced by the `frequency` in Hz.
    """
    return {name: model.parameters[name] for name in values_of(model, in_hertz)}


def values_of(model: Model, in_hertz: bool = False) -> dict[str, float]:
    """Return the values of the parameters in `table`; the frequency is the shortest number that gives omega."""
    values = model.values
    if not in_hertz or "omega" not in values or "frequency" not in model.parameters:
        return values
    omega = values["omega"]
    written = (float(f"{hertz(omega):.{digits}g}") for digits in (15, 16, 17))
    frequency = next((value for value in written if radians(value) == omega), hertz(omega))
    shown = {"frequency" if name == "omega" else name: value for name, value in values.items()}
    return shown | {"frequency": frequency}


def typed_number(parameter: Parameter, value: Any) -> float:
    """Return the value of a typed parameter, in its own unit unless another one is given, as in 0.5mm."""
    if isinstance(value, str):
        value = without_unit(parameter, value.strip().replace("−", "-"))
    if isinstance(value, str):
        if not NUMBER.fullmatch(value):
            raise no_number(parameter.name, value, "such as 2.8, or one with a unit, such as 0.5mm")
        value = float(value)
    return parameter.check(value)


def with_minus(text: str) -> str:
    """Return a text with typographic minus signs in negative numbers, as in plots.

    Examples
    --------
    >>> with_minus("period-1 impact-1: the gap is -0.2 mm, at -1e-05")
    'period-1 impact-1: the gap is −0.2 mm, at −1e−05'
    """
    return MINUS.sub("−", text)


def written(value: float, digits: int = 5) -> str:
    """Return a number as text; very small and very large ones have a power of ten.

    Examples
    --------
    >>> written(-0.0002), written(200e9)
    ('−0.0002', '2·10¹¹')
    """
    number, _, power = f"{float(f'{value:.{digits}g}'):g}".partition("e")
    if not power:
        return with_minus(number)
    ten = f"10{str(int(power)).translate(RAISED)}"
    return ten if number == "1" else f"{with_minus(number)}·{ten}"


def no_number(name: str, text: str, hint: str = "write it with a dot, as in 2.8") -> ValueError:
    """Return the error for text that is not a number."""
    return invalid(name, text, "a number", hint)


def rounded(value: Any, ends: Range) -> float:
    """Return a clicked value, rounded to the digits that a pixel distinguishes."""
    value = real_number("point", value)
    return round(float(value), math.ceil(-math.log10((ends[1] - ends[0]) / 2000.0)))


def symbol(parameter: Parameter) -> str:
    """Return a parameter's symbol, such as ω; its name if it has no symbol."""
    has_symbol = parameter.symbol and parameter.symbol != parameter.name
    return GREEK.get(parameter.symbol, parameter.symbol) if has_symbol else _words(parameter)


def _words(parameter: Parameter) -> str:
    """Return the name in words, without a unit at its end, which is shown separately."""
    name = SHORTER.get(parameter.long_name, parameter.long_name)
    return name.removesuffix(f" {parameter.unit}")


def shown_unit(unit: str) -> str:
    """Return a unit as shown, such as m/s² for m/s^2; empty for a pure number."""
    return "" if unit == "1" else POWERS.sub(lambda power: power[1].translate(RAISED), unit)


def quantity_of(parameter: Parameter, value: float) -> str:
    """Return a parameter with its value and unit, such as 'ω = 157 rad/s'."""
    return with_unit(f"{symbol(parameter)} = {written(value)}", shown_unit(parameter.unit))


def parameter_label(parameter: Parameter, units: bool = True) -> str:
    """Return the label of a parameter, such as 'driving frequency ω [rad/s]'."""
    name = _words(parameter)
    label = name if symbol(parameter) == name else f"{name} {symbol(parameter)}"
    return labelled(label, shown_unit(parameter.unit)) if units else label


def index_label(index: Index, units: bool = True, shorter: bool = False) -> str:
    """Return the label of an index, such as 'Std of impact velocities [m/s]', with a short form for tables."""
    name = SHORT.get(index.long_name, index.long_name)
    label = SHORTEST.get(index.long_name, name) if shorter else name
    return labelled(label, shown_unit(index.units)) if units else label
