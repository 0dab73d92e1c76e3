"""What the explorer shows, in one frozen value, and the limits beyond which no view can be made.

The limits keep the server responsive, and cells apart in double precision. The page's model is named here alone.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

from vibroimpact.indices import INDICES
from vibroimpact.options import Tolerances
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.parameters import invalid, real_number

Range = tuple[float, float]

MODEL = ImpactOscillator
TABLE = {name: parameter for name, parameter in MODEL.parameters.items() if not parameter.replaces}
NAMES = tuple(TABLE)
MOTION = "motion"  # the index that is a name
SHOWN = (MOTION, *INDICES)
SAMPLES = (200, 500, 1000, 2000, 5000)
CASES = (
    "", "paper-mass", "paper-stiffness", "paper-damping", "paper-amplitude", "paper-restitution", "gap", "tube", "pipe",
    "ship", "valve",
)  # fmt: skip
MOST_PINS = 2


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
    "boundaries": Choice("b", FLAG, "boundaries of n = 1, 2 (some seconds)"),
    "line": Choice("line", _same("xy"), "diagram along"),
    "samples": Choice("n", _same(SAMPLES), "impacts per cell"),
    "settled": Choice("from", {"start": False, "settled": True}, "show the settled motion"),
    "case": Choice("case", _same(CASES)),
}

FINEST = 256  # cells along an axis of the plane
SPACING = 16  # doubles between neighbouring cells, at least
LARGEST, SMALLEST = 1e15, 1e-15  # of a parameter, in its unit
SCALE = 1e30  # of energies, and of one over them: what is sent to be drawn has single precision
FASTEST, SLOWEST, MOST_DAMPED = 100.0, 1e-3, 100.0  # driving over natural frequency; damping over critical damping
STIFFEST = 1000.0  # fastest rate over slowest: steps per impact grow with it
MOST_STEPS = 1e6  # granted a motion, about half a second
LEAST_STEPS = 400.0  # granted an impact even so: driven a hundred times as fast as it swings, it needs some 300
LONGEST_AGO = 1e9  # driving periods between time 0 and an initial condition: beyond, its phase is lost
EDGE, PIN = " at the edge of the plane", " in a pin"

HALVINGS = 24  # of the way to an end that is refused
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
LABELS = {"amplitude": "force amplitude", "omega": "driving frequency", "restitution": "restitution"}
GREEK = {"w": "ω", "psi/T": "ψ/T", "<I>": "⟨I⟩"}


@dataclass(frozen=True)
class View:
    """Everything that is shown: a point, a plane through it, the colours of its cells, and what is compared.

    Parameters
    ----------
    osc : ImpactOscillator
        The point. The plane varies two of its parameters and takes the others from here.
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
    boundaries : bool
        Whether exact boundaries are drawn over the plane.
    settled : bool
        Whether the history begins on the settled motion, or at its initial condition.
    start : State, optional
        Initial condition of the point's motion; None is at rest at min(0, gap).
    pins : tuple of ImpactOscillator
        Up to two points whose motions are drawn beside the present one.
    case : str
        The case that the view began with: it is described, and its sliders have its ranges; "" is none.
    """

    osc: ImpactOscillator = field(default_factory=MODEL)
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
        choices = {"x": NAMES, "y": NAMES} | {name: (*choice.texts.values(),) for name, choice in CHOICES.items()}
        for name, values in choices.items():
            object.__setattr__(self, name, _one_of(name, getattr(self, name), values))
        if self.x == self.y:
            raise invalid("y", self.y, "a parameter different from `x`")
        if len(self.pins) > MOST_PINS:
            raise ValueError(f"`pin` must be given at most {MOST_PINS} times, got {len(self.pins)}")
        for axis in ("x", "y"):
            name = f"{axis}_range"
            object.__setattr__(self, name, _checked_range(axis, getattr(self, axis), getattr(self, name)))
        for where, points in (("", [self.osc]), (PIN, self.pins), (EDGE, self.corners())):
            for osc in points:
                _check_limits(osc, where)
        if self.start is not None:
            _check_start(self.start, self.osc)

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
        return self.x, self.y, self.x_range, self.y_range, self.samples, self._others(self.x, self.y)

    @property
    def point_key(self) -> tuple[Any, ...]:
        """What the point's motion depends on."""
        return self.osc, self.start, self.settled, self.samples

    @property
    def line_key(self) -> tuple[Any, ...]:
        """What the diagram depends on."""
        along, ends = self.along
        return along, ends, self._others(along)

    @property
    def boundary_key(self) -> tuple[Any, ...]:
        """What the boundaries depend on."""
        *plane, _, fixed = self.plane_key
        return (True, *plane, fixed) if self.boundaries else (False,)

    def _others(self, *varied: str) -> tuple[float, ...]:
        """Return the parameters that are not varied."""
        return tuple(getattr(self.osc, name) for name in NAMES if name not in varied)

    def osc_value(self, axis: str) -> float:
        """Return the point's coordinate along an axis, "x" or "y"."""
        return float(getattr(self.osc, getattr(self, axis)))

    @property
    def along(self) -> tuple[str, Range]:
        """The parameter along which the diagram runs, and its range."""
        return (self.x, self.x_range) if self.line == "x" else (self.y, self.y_range)


# ---- limits


def stiffness(osc: ImpactOscillator) -> float:
    """Return the fastest of driving, natural and decay rate over the slower of driving and natural rate.

    Examples
    --------
    >>> stiffness(ImpactOscillator(omega=0.25)), stiffness(ImpactOscillator(omega=1.0, damping=4.0)) > 3.7
    (4.0, True)
    """
    return float(osc.cells({}).fastest_rate[0]) / min(osc.omega, osc.natural_frequency)


def granted(stiff: float, count: int) -> Tolerances:
    """Return a budget of some `MOST_STEPS` certified steps for so many impacts or periods; at most a tenth of usual.

    Examples
    --------
    >>> granted(1.0, 600).steps_per_impact, granted(100.0, 5100).steps_per_impact
    (100, 4)
    """
    per_impact = max(LEAST_STEPS, MOST_STEPS / count)
    return Tolerances(steps_per_impact=max(1, min(100, int(per_impact / stiff))), flight_periods=100.0)


def _check_limits(osc: ImpactOscillator, where: str) -> None:
    """Raise `ValueError` unless all parameters, the ratios of rates and the scale of energies are within limits."""
    for name in NAMES:
        value = abs(getattr(osc, name))
        if value and not SMALLEST <= value <= LARGEST:
            raise ValueError(
                f"`{name}` must have a magnitude from {SMALLEST:g} to {LARGEST:g} here, got {value:g}{where}; choose "
                "other units"
            )
    ratio, stiff = osc.omega / osc.natural_frequency, stiffness(osc)
    if not SLOWEST <= ratio <= FASTEST:
        raise ValueError(
            f"`omega` must be between {SLOWEST:g} and {FASTEST:g} times the natural frequency here, got {ratio:.3g} "
            f"times{where}; use parameter_map, which has no such limit"
        )
    if osc.damping_ratio > MOST_DAMPED:
        raise ValueError(
            f"`damping` must be at most {MOST_DAMPED:g} times critical here, got {osc.damping_ratio:.3g} times{where}; "
            "lower it"
        )
    if stiff > STIFFEST * (1.0 + 1e-9):
        raise ValueError(
            f"`damping` must make decay at most {STIFFEST:g} times as fast as the slower of driving and free "
            f"oscillation here, got {stiff:.3g} times{where}; lower it"
        )
    energy = osc.mass * osc.velocity_scale**2
    if energy and not 1.0 / SCALE <= energy <= SCALE:
        raise ValueError(
            f"`amplitude` and `gap` must make energies from {1.0 / SCALE:g} to {SCALE:g} J here, got {energy:.3g} J"
            f"{where}; choose other units"
        )


def _check_start(start: State, osc: ImpactOscillator) -> None:
    """Raise `ValueError` unless a motion may start there."""
    if start.displacement > osc.gap:
        raise ValueError(f"`start` must be at or before the stop at {osc.gap:g} m, got {start.displacement:g} m")
    size = max(abs(start.displacement), abs(start.velocity))
    if size > LARGEST:
        raise ValueError(f"`start` must have magnitudes up to {LARGEST:g}, got {size:g}")
    if abs(start.time) > LONGEST_AGO * osc.period:
        raise ValueError(
            f"`start` must be within {LONGEST_AGO:g} driving periods of time 0, got {start.time:g} s; give a time "
            "in the first period"
        )
    if not osc.velocity_scale:
        raise ValueError("`start` must come with a force or a gap: without a force and a gap every motion dies out")


def _checked_range(axis: str, parameter: str, ends: Any) -> Range:
    """Return the range of an axis as two floats."""
    try:
        first, last = ends
    except (TypeError, ValueError):
        first = last = math.nan
    low, high = (TABLE[parameter].check(end) for end in (first, last))
    if not high > low:
        raise invalid(axis, ends, "a lower and a higher end", "put the lower end first")
    least = least_width(low, high)
    if high - low < least:
        raise ValueError(
            f"`{axis}` must span at least {least:.2g}, where double precision still separates {FINEST} cells, got "
            f"{high - low:.2g}; zoom out"
        )
    return low, high


def least_width(low: float, high: float) -> float:
    """Return the narrowest range whose cells double precision separates."""
    return FINEST * SPACING * math.ulp(max(abs(low), abs(high)))


def _one_of(name: str, value: Any, choices: tuple[Any, ...]) -> Any:
    """Return the choice that `value` equals."""
    for choice in choices:
        if isinstance(value, (str, int, float)) and value == choice:
            return choice
    raise invalid(name, value, f"one of {', '.join(map(str, choices))}")


# ---- another part of the plane, as far as the limits allow


def with_ranges(view: View, x_range: Range, y_range: Range) -> tuple[View, str]:
    """Return the view moved to these ranges as far as its limits allow, and a message where they did not."""
    try:
        return replace(view, x_range=x_range, y_range=y_range), ""
    except ValueError as error:
        message = str(error)
    wanted = {"x_range": x_range, "y_range": y_range}
    if not all(_some_range(ends) for ends in wanted.values()):
        return view, message
    # First all four ends by the largest common share of their ways, then each alone as near as it may.
    view = _farthest(view, wanted, (0, 1))
    for name, end in product(wanted, (0, 1)):
        view = _farthest(view, {name: wanted[name]}, (end,))
    return view, message


def _farthest(view: View, wanted: dict[str, Range], ends: tuple[int, ...]) -> View:
    """Return the view with these ends of ranges moved by the largest share of their ways that is not refused.

    The share lies between 0 and 1 and is found by `HALVINGS` halvings.
    """
    done, refused, best = 0.0, 1.0, view
    for share in (1.0, *[0.0] * HALVINGS):
        tried = share or 0.5 * (done + refused)
        ranges: dict[str, Any] = {
            name: tuple(a + tried * (to[end] - a) * (end in ends) for end, a in enumerate(getattr(view, name)))
            for name, to in wanted.items()
        }
        try:
            best, done = replace(view, **ranges), tried
        except ValueError:
            refused = tried
        if done == 1.0:
            break
    return best


def _some_range(ends: Any) -> bool:
    try:
        low, high = ends
        return math.isfinite(low) and math.isfinite(high) and bool(low < high)
    except (TypeError, ValueError):
        return False


# ---- numbers and names of the model's parameters


def typed_number(name: str, value: Any) -> float:
    """Return a parameter as it was typed."""
    if isinstance(value, str):
        if not NUMBER.fullmatch(value):
            raise no_number(name, value)
        value = float(value)
    return TABLE[name].check(value)


def no_number(name: str, text: str) -> ValueError:
    """Return the error for a text that is not a number."""
    return invalid(name, text, "a number", "write it with a dot, as in 2.8")


def rounded(value: Any, ends: Range) -> float:
    """Return a clicked value with no more digits than a pixel distinguishes."""
    value = real_number("point", value)
    return round(float(value), math.ceil(-math.log10((ends[1] - ends[0]) / 2000.0)))


def allowed_range(name: str, ends: Range) -> Range:
    """Return a slider's range without a zero that the parameter may not have."""
    low, high = ends
    parameter = TABLE[name]
    return (high / 500.0 if low <= parameter.low and not parameter.closed else low), high


def symbol(name: str) -> str:
    """Return a parameter's symbol, as ω."""
    return GREEK.get(TABLE[name].symbol, TABLE[name].symbol)


def unit(name: str) -> str:
    """Return a parameter's unit; "" where it has none."""
    return "" if TABLE[name].unit == "1" else TABLE[name].unit


def parameter_label(name: str, units: bool = True) -> str:
    """Return 'driving frequency ω [rad/s]'."""
    label = f"{LABELS.get(name, TABLE[name].long_name)} {symbol(name)}"
    return f"{label} [{unit(name)}]" if units and unit(name) else label
