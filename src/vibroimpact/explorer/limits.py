"""The limits of views: they keep the server responsive, and cells distinct in double precision."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.model import Model, State
from vibroimpact.options import Tolerances
from vibroimpact.parameters import Parameter, invalid

if TYPE_CHECKING:
    from vibroimpact.explorer.state import View

Range = tuple[float, float]

FINEST = 256  # cells along an axis of the plane
SPACING = 16  # least number of doubles between neighbouring cells
LARGEST, SMALLEST = 1e15, 1e-15  # magnitudes of a parameter, in its unit
SCALE = 1e30  # of energies, and of their reciprocals: data are sent to the page in single precision
STIFFEST = 1000.0  # fastest rate over slowest: steps per impact grow with this ratio
MOST_STEPS = 1e6  # steps per motion, about half a second
LEAST_STEPS = 400.0  # per impact in any case: about 300 are needed at 100 times the natural frequency
LONGEST_AGO = 1e9  # driving periods between time 0 and an initial condition: beyond this its phase is lost
HALVINGS = 24  # halvings of the way to a refused end


def stiffness(osc: Any) -> float:
    """Return the ratio of the fastest of driving, natural and decay rate to the slower of driving and natural rate.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> stiffness(ImpactOscillator(omega=0.25)), stiffness(ImpactOscillator(omega=1.0, damping=4.0)) > 3.7
    (4.0, True)
    """
    return _system_and_stiffness(osc)[1]


def system_of(model: Any) -> Any:
    """Return the oscillator or system of a model at its own values."""
    return _system_and_stiffness(model)[0]


@lru_cache(1024)  # a view needs five points, most of them shared with the last view
def _system_and_stiffness(model: Any) -> tuple[Any, float]:
    system = model.at()
    cell = system.cells({})
    return system, float(cell.fastest_rate[0] / cell.slowest_rate[0])


def budget(stiff: float, count: int) -> Tolerances:
    """Return a budget of about `MOST_STEPS` certified steps for these impacts or periods; at most a tenth of usual.

    Examples
    --------
    >>> budget(1.0, 600).steps_per_impact, budget(100.0, 5100).steps_per_impact
    (100, 4)
    """
    per_impact = max(LEAST_STEPS, MOST_STEPS / count)
    return Tolerances(steps_per_impact=max(1, min(100, int(per_impact / stiff))), flight_periods=100.0)


def check_limits(model: Model, where: str) -> None:
    """Raise `ValueError` unless all parameters, the ratio of rates and the scale of energies are within limits."""
    for name, value in model.values.items():
        if value and not SMALLEST <= abs(value) <= LARGEST:
            raise ValueError(
                f"`{name}` must have a magnitude from {SMALLEST:g} to {LARGEST:g} here, got {abs(value):g}{where}; "
                "choose other units"
            )
    system, stiff = system_of(model), stiffness(model)
    if stiff > STIFFEST * (1.0 + 1e-9):
        raise ValueError(
            f"the fastest of driving, free oscillation and decay must be at most {STIFFEST:g} times as fast as the "
            f"slower of driving and free oscillation here, got {stiff:.3g} times{where}; use parameter_map, which has "
            "no such limit"
        )
    energies = system.velocity_scale**2 / np.diag(system.modal().mobility)
    for energy in energies[(energies > 0.0) & ~((energies >= 1.0 / SCALE) & (energies <= SCALE))]:
        raise ValueError(
            f"forces and gaps must make energies from {1.0 / SCALE:g} to {SCALE:g} J here, got {energy:.3g} J{where}; "
            "choose other units"
        )


def checked_start(start: State, system: Any) -> State:
    """Return a checked initial condition (for a single coordinate as numbers), or raise `ValueError`."""
    if system.coordinates == 1 and isinstance(start.displacement, tuple) and len(start.displacement) == 1:
        start = State(start.displacement[0], start.velocity[0], start.time)
    system.cells({}, start)  # raises for a state beyond a stop
    size = max(map(abs, parts_of(start)[:-1]))
    if size > LARGEST:
        raise ValueError(f"`start` must have magnitudes up to {LARGEST:g}, got {size:g}")
    if abs(start.time) > LONGEST_AGO * system.period:
        raise ValueError(
            f"`start` must be within {LONGEST_AGO:g} driving periods of time 0, got {start.time:g} s; give a time "
            "in the first period"
        )
    if not system.velocity_scale:
        raise ValueError("`start` must come with a force or a gap: without a force and a gap every motion dies out")
    return start


def allowed_range(parameter: Parameter, ends: Range) -> Range:
    """Return a slider's range, without zero if the parameter must not be zero."""
    low, high = ends
    return (high / 500.0 if low <= parameter.low and not parameter.closed else low), high


def parts_of(start: State) -> list[float]:
    """Return displacements, velocities and time of an initial condition."""
    parts: list[float] = []
    for part in (start.displacement, start.velocity, start.time):
        parts += part if isinstance(part, tuple) else (part,)
    return parts


def checked_range(axis: str, parameter: Parameter, ends: Any) -> Range:
    """Return the range of an axis as two floats."""
    try:
        first, last = ends
    except (TypeError, ValueError):
        first = last = math.nan
    low, high = (parameter.check(end) for end in (first, last))
    if not high > low:
        raise invalid(axis, ends, "a lower and a higher end", "put the lower end first")
    least = least_width(low, high)
    if high - low < least:
        raise ValueError(
            f"`{axis}` must span at least {least:.2g}, the resolution of {FINEST} cells in double precision, got "
            f"{high - low:.2g}; zoom out"
        )
    return low, high


def least_width(low: float, high: float) -> float:
    """Return the narrowest range whose cells are distinct in double precision."""
    return FINEST * SPACING * math.ulp(max(abs(low), abs(high)))


# ---- other parts of the plane, within the limits


def with_ranges(view: View, x_range: Range, y_range: Range) -> tuple[View, str]:
    """Return the view with these ranges as far as the limits allow, and a message if they were reduced."""
    try:
        return replace(view, x_range=x_range, y_range=y_range), ""
    except ValueError as error:
        message = str(error)
    wanted = {"x_range": x_range, "y_range": y_range}
    if not all(_is_range(ends) for ends in wanted.values()):
        return view, message
    # First all four ends are moved by the largest common share of their ways, then each end alone as far as allowed.
    view = _farthest(view, wanted, (0, 1))
    for name, end in product(wanted, (0, 1)):
        view = _farthest(view, {name: wanted[name]}, (end,))
    return view, message


def with_axes(view: View, ranges: dict[str, Range]) -> tuple[View, str]:
    """Return the view with two parameters along its axes, in these ranges as far as allowed, and a message.

    Raises
    ------
    ValueError
        No range around the point can be shown.
    """
    (x, x_range), (y, y_range) = ranges.items()
    try:
        return replace(view, x=x, y=y, x_range=x_range, y_range=y_range), ""
    except ValueError:
        close = {name: near(view.table[name], view.values[name], ends) for name, ends in ranges.items()}
        return with_ranges(replace(view, x=x, y=y, x_range=close[x], y_range=close[y]), x_range, y_range)


def near(parameter: Parameter, value: float, ends: Range) -> Range:
    """Return a thousandth of a range about a value, within the parameter's range."""
    width = 5e-4 * (ends[1] - ends[0])
    low, high = max(value - width, parameter.low), min(value + width, parameter.high)
    return allowed_range(parameter, (low, high))


def _farthest(view: View, wanted: dict[str, Range], ends: tuple[int, ...]) -> View:
    """Return the view with these ends of ranges moved by the largest share of their ways that is allowed.

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


def _is_range(ends: Any) -> bool:
    try:
        low, high = ends
        return math.isfinite(low) and math.isfinite(high) and bool(low < high)
    except (TypeError, ValueError):
        return False
