"""What a page may ask for: nothing that hangs the server, and nothing that double precision cannot tell apart."""

from __future__ import annotations

import math
from typing import Any

from vibroimpact.options import Tolerances
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, State, parameter_value

Range = tuple[float, float]

FINEST = 256  # cells along an axis of the plane
APART = 16  # doubles between neighbouring cells, at least

LARGEST, SMALLEST = 1e15, 1e-15  # of a parameter, in its unit
SCALE = 1e30  # of energies, and of one over them: what is sent to be drawn has single precision
FASTEST, SLOWEST, MOST_DAMPED = 100.0, 1e-3, 100.0
STIFFEST = 1000.0  # fastest rate over slowest: steps an impact grow with it
MOST_STEPS = 1e6  # granted a motion, about half a second
LEAST_STEPS = 400.0  # granted an impact even so: driven a hundred times as fast as it swings, it needs some 300
LONGEST_AGO = 1e9  # driving periods between time 0 and a start: beyond, its phase is lost


def stiffness(osc: ImpactOscillator) -> float:
    """Return the fastest of driving, natural and decay rate over the slower of driving and natural rate.

    Examples
    --------
    >>> stiffness(ImpactOscillator(omega=0.25)), stiffness(ImpactOscillator(omega=1.0, damping=4.0)) > 3.7
    (4.0, True)
    """
    natural, half = osc.natural_frequency, 0.5 * osc.damping / osc.mass
    over = half * half - natural * natural
    decay = half + math.sqrt(over) if over > 0.0 else 0.0
    return max(osc.omega, natural, decay) / min(osc.omega, natural)


def granted(stiff: float, count: int) -> Tolerances:
    """Return a budget of some `MOST_STEPS` certified steps for so many impacts or periods; at most a tenth of usual.

    Examples
    --------
    >>> granted(1.0, 600).steps_per_impact, granted(100.0, 5100).steps_per_impact
    (100, 4)
    """
    an_impact = max(LEAST_STEPS, MOST_STEPS / count)
    return Tolerances(steps_per_impact=max(1, min(100, int(an_impact / stiff))), flight_periods=100.0)


def within_reach(osc: ImpactOscillator, where: str) -> None:
    """Raise `ValueError` unless each of the seven numbers, their ratios and the scale of energies are allowed."""
    for name in PARAMETERS:
        value = abs(getattr(osc, name))
        if value and not SMALLEST <= value <= LARGEST:
            raise ValueError(
                f"`{name}` is {value:g}{where}; allowed here are magnitudes from {SMALLEST:g} to {LARGEST:g}; "
                "choose other units"
            )
    _check_rates(osc, where)
    energy = osc.mass * osc.velocity_scale**2
    if energy and not 1.0 / SCALE <= energy <= SCALE:
        raise ValueError(
            f"`amplitude` and `gap` make energies of {energy:.3g} J{where}; allowed here are magnitudes from "
            f"{1.0 / SCALE:g} to {SCALE:g}; choose other units"
        )


def _check_rates(osc: ImpactOscillator, where: str) -> None:
    ratio, stiff = osc.omega / osc.natural_frequency, stiffness(osc)
    if not SLOWEST <= ratio <= FASTEST:
        raise ValueError(
            f"`omega` is {ratio:.3g} times the natural frequency{where}; allowed here is {SLOWEST:g} to {FASTEST:g}; "
            "beyond, use parameter_map, which takes its time"
        )
    if osc.damping_ratio > MOST_DAMPED:
        raise ValueError(
            f"`damping` is {osc.damping_ratio:.3g} times critical{where}; allowed here is up to {MOST_DAMPED:g}; "
            "lower it"
        )
    if stiff > STIFFEST * (1.0 + 1e-9):
        raise ValueError(
            f"`damping` decays {stiff:.3g} times as fast as the slower of driving and free oscillation{where}; allowed "
            f"here is up to {STIFFEST:g}; lower it"
        )


def check_start(start: State, osc: ImpactOscillator) -> None:
    """Raise `ValueError` unless a motion may start there."""
    if start.displacement > osc.gap:
        raise ValueError(
            f"`start` is at {start.displacement:g} m, beyond the stop at {osc.gap:g} m; allowed is up to the stop; "
            "start before it"
        )
    size = max(abs(start.displacement), abs(start.velocity))
    if size > LARGEST:
        raise ValueError(f"`start` holds {size:g}; allowed are magnitudes up to {LARGEST:g}; choose a smaller one")
    if abs(start.time) > LONGEST_AGO * osc.period:
        raise ValueError(
            f"`start` is at {start.time:g} s; allowed is up to {LONGEST_AGO:g} driving periods before or after 0; "
            "start within the first period"
        )
    if not osc.velocity_scale:
        raise ValueError(
            "`start` is given without a force and a gap, where every motion dies out; allowed is one with a force or "
            "a gap; leave it out"
        )


def checked_range(axis: str, parameter: str, ends: Any) -> Range:
    """Return the range of an axis as two floats, or raise `ValueError` saying what is allowed."""
    try:
        first, last = ends
    except (TypeError, ValueError):
        first = last = math.nan
    low, high = (parameter_value(parameter, end) for end in (first, last))
    if not high > low:
        raise ValueError(f"`{axis}` is {short(ends)}; allowed are a lowest and a highest value; put the lower first")
    least = least_width(low, high)
    if high - low < least:
        raise ValueError(
            f"`{axis}` spans {high - low:.2g}; allowed is {least:.2g} or more, where double precision still tells "
            f"{FINEST} cells apart; zoom out"
        )
    return low, high


def least_width(low: float, high: float) -> float:
    """Return the narrowest range whose cells double precision tells apart."""
    return FINEST * APART * math.ulp(max(abs(low), abs(high)))


def one_of(name: str, value: Any, allowed: tuple[Any, ...]) -> Any:
    """Return the allowed value that `value` equals, or raise `ValueError` naming all of them."""
    for choice in allowed:
        if isinstance(value, (str, int, float)) and value == choice:
            return choice
    raise ValueError(f"`{name}` is {short(value)}; allowed are {', '.join(map(str, allowed))}; choose one of them")


def no_number(name: str, text: str) -> ValueError:
    """Return the complaint of a text that is no number."""
    return ValueError(f"`{name}` is {cut(text)!r}; allowed is a number; write it with a dot, as in 2.8")


def short(value: Any) -> str:
    """Return a value as a message may quote it."""
    return cut(repr(value))


def cut(text: str) -> str:
    """Return a text no longer than a message may quote it."""
    return text if len(text) <= 40 else text[:37] + "..."
