"""What the explorer shows, in one frozen value; nothing outside its limits can be made."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

from vibroimpact.dataset import VARIABLES
from vibroimpact.indices import INDICES
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, State, parameter_value, real_number

Range = tuple[float, float]

MOTION = "motion"  # the index that is a name
SHOWN = (MOTION, *INDICES)
SAMPLES = (200, 500, 1000, 2000, 5000)
MOST_PINS = 2
FINEST = 256  # cells along an axis of the plane

# No request may hang the server: steps an impact grow as w/w_n and c/(2 sqrt(k m)) do, and periods as w_n/w does.
LARGEST, SMALLEST = 1e15, 1e-15
FASTEST, SLOWEST, MOST_DAMPED = 100.0, 1e-3, 100.0
APART = 16  # doubles between neighbouring cells, at least


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

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            _one_of(name, getattr(self, name), PARAMETERS)
        if self.x == self.y:
            raise ValueError(f"`y` is {_short(self.y)}, as `x` is; allowed are two different parameters; replace one")
        _one_of("index", self.index, SHOWN)
        _one_of("line", self.line, ("x", "y"))
        _one_of("samples", self.samples, SAMPLES)
        if len(self.pins) > MOST_PINS:
            raise ValueError(f"`pin` is given {len(self.pins)} times; allowed are {MOST_PINS}; drop one")
        object.__setattr__(self, "x_range", _range("x", self.x, self.x_range))
        object.__setattr__(self, "y_range", _range("y", self.y, self.y_range))
        for osc in (self.osc, *self.pins, *self.corners()):
            _within_reach(osc)
        if self.start is not None:
            _check_start(self.start, self.osc)

    def corners(self) -> list[ImpactOscillator]:
        """Return the oscillators at the plane's four corners."""
        return [self.osc.replace(**{self.x: x, self.y: y}) for x, y in product(self.x_range, self.y_range)]

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
        return self.boundaries, *plane, fixed

    def osc_value(self, axis: str) -> float:
        """Return the point's coordinate along an axis, "x" or "y"."""
        return float(getattr(self.osc, getattr(self, axis)))

    @property
    def along(self) -> tuple[str, Range]:
        """The parameter along which the diagram runs, and its range."""
        return (self.x, self.x_range) if self.line == "x" else (self.y, self.y_range)


def with_ranges(view: View, x_range: Range, y_range: Range) -> tuple[View, str]:
    """Return the view moved to these ranges as far as its limits allow, and a message where they did not."""
    try:
        return replace(view, x_range=x_range, y_range=y_range), ""
    except ValueError as error:
        message = str(error)
    wanted = {"x_range": x_range, "y_range": y_range}
    view = _together(view, wanted)
    for name, ends in wanted.items():
        for end in (0, 1):
            view = _moved(view, name, end, ends[end])
    return view, message


def _together(view: View, wanted: dict[str, Range]) -> View:
    """Return the view with all four ends moved by the largest common share of their ways that is allowed."""
    begins, best = {name: getattr(view, name) for name in wanted}, view
    done, refused = 0.0, 1.0
    for _ in range(24):
        tried = 0.5 * (done + refused)
        moved: dict[str, Any] = {
            name: tuple(a + tried * (b - a) for a, b in zip(begins[name], goal, strict=True))
            for name, goal in wanted.items()
        }
        try:
            best, done = replace(view, **moved), tried
        except ValueError:
            refused = tried
    return best


def _moved(view: View, name: str, end: int, goal: float) -> View:
    """Return the view with one end of a range moved as near to `goal` as is allowed."""
    begin = getattr(view, name)[end]
    if not math.isfinite(goal):
        return view
    done, refused, best = 0.0, 1.0, view
    for share in (1.0, *[0.0] * 24):
        tried = share or 0.5 * (done + refused)
        ends = list(getattr(view, name))
        ends[end] = begin + tried * (goal - begin)
        change: dict[str, Any] = {name: tuple(ends)}
        try:
            best, done = replace(view, **change), tried
        except ValueError:
            refused = tried
        if done == 1.0:
            break
    return best


def least_width(low: float, high: float) -> float:
    """Return the narrowest range whose cells double precision tells apart."""
    return FINEST * APART * math.ulp(max(abs(low), abs(high)))


def rounded(value: float, ends: Range) -> float:
    """Return a clicked value with no more digits than a pixel tells."""
    value = float(value)
    if not math.isfinite(value):
        return value
    return round(value, min(17, math.ceil(-math.log10((ends[1] - ends[0]) / 2000.0))))


def offset(ends: Range) -> float:
    """Return what is best subtracted from an axis: 0, or a round value within where it is zoomed in deeply."""
    low, high = ends
    size = max(abs(low), abs(high))
    if high - low > 1e-4 * size:
        return 0.0
    return round(0.5 * (low + high), math.ceil(-math.log10(high - low)))


def _range(axis: str, parameter: str, ends: Any) -> Range:
    try:
        low, high = (parameter_value(parameter, end) for end in ends)
    except TypeError:
        low = high = math.nan
    if not high > low:
        raise ValueError(f"`{axis}` is {_short(ends)}; allowed are a lowest and a highest value; put the lower first")
    least = least_width(low, high)
    if high - low < least:
        raise ValueError(
            f"`{axis}` spans {high - low:.2g}; allowed is {least:.2g} or more, where double precision still tells "
            f"{FINEST} cells apart; zoom out"
        )
    return low, high


def _within_reach(osc: ImpactOscillator) -> None:
    for name in PARAMETERS:
        value = abs(getattr(osc, name))
        if value and not SMALLEST <= value <= LARGEST:
            raise ValueError(
                f"`{name}` is {value:g}; allowed here are magnitudes from {SMALLEST:g} to {LARGEST:g}; "
                "choose other units"
            )
    ratio = osc.omega / osc.natural_frequency
    if not SLOWEST <= ratio <= FASTEST:
        raise ValueError(
            f"`omega` is {ratio:.3g} times the natural frequency; allowed here is {SLOWEST:g} to {FASTEST:g}; "
            "beyond, use parameter_map, which takes its time"
        )
    if osc.damping_ratio > MOST_DAMPED:
        raise ValueError(
            f"`damping` is {osc.damping_ratio:.3g} times critical; allowed here is up to {MOST_DAMPED:g}; lower it"
        )


def _check_start(start: State, osc: ImpactOscillator) -> None:
    if start.displacement > osc.gap:
        raise ValueError(
            f"`start` is at {start.displacement:g} m, beyond the stop at {osc.gap:g} m; allowed is up to the stop; "
            "start before it"
        )
    size = max(abs(start.displacement), abs(start.velocity), abs(start.time))
    if size > LARGEST:
        raise ValueError(f"`start` holds {size:g}; allowed are magnitudes up to {LARGEST:g}; choose a smaller one")


def _one_of(name: str, value: Any, allowed: tuple[Any, ...]) -> None:
    if value not in allowed:
        raise ValueError(f"`{name}` is {_short(value)}; allowed are {', '.join(map(str, allowed))}; choose one of them")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


LABELS = {"amplitude": "force amplitude", "omega": "driving frequency", "restitution": "restitution"}
GREEK = {"w": "ω", "psi/T": "ψ/T", "<I>": "⟨I⟩"}


def parameter_label(name: str) -> str:
    """Return 'driving frequency ω [rad/s]'."""
    long_name, units, symbol = VARIABLES[name]
    return f"{LABELS.get(name, long_name)} {GREEK.get(symbol, symbol)}" + ("" if units == "1" else f" [{units}]")


def typed_number(name: str, value: Any) -> float:
    """Return what was typed as a parameter of the oscillator, or say what is allowed."""
    return parameter_value(name, real_number(name, value))
