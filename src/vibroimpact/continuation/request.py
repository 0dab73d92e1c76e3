"""Check what a caller of continuation asks for."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

from vibroimpact.axes import NAMES
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.oscillator import parameter_value
from vibroimpact.parameters import real_number


def check_parameter(name: Any) -> str:
    """Return the name of a parameter, or say which there are."""
    if name not in NAMES:
        close = get_close_matches(str(name), NAMES, 1)
        remedy = f"did you mean {close[0]!r}?" if close else "check the spelling"
        raise ValueError(f"`parameter` is {name!r}; allowed are {', '.join(NAMES)}; {remedy}")
    return str(name)


def check_range(name: str, given: Any, value: float) -> tuple[float, float]:
    """Return the ends of a range of a parameter that holds a value."""
    try:
        low, high = given
    except (TypeError, ValueError):
        raise ValueError(f"`range` is {given!r}; allowed are two numbers; give (lowest, highest) {name}") from None
    low, high = parameter_value(name, low), parameter_value(name, high)
    if not low < high:
        raise ValueError(f"`range` is ({low!r}, {high!r}); allowed is a lower number before a higher one; swap them")
    if not low <= value <= high:
        raise ValueError(
            f"`range` is ({low:g}, {high:g}); allowed is one that holds the orbit's {name}, {value:.12g}; widen it"
        )
    return low, high


def check_step(step: Any) -> float:
    """Return the longest step, a part of the range."""
    value = real_number("step", step, "a number above 0 and up to 0.5")
    if not 0.0 < value <= 0.5:
        raise ValueError(f"`step` is {step!r}; allowed is a number above 0 and up to 0.5; 0.01 is usual")
    return value


def check_orbit(name: str, orbit: Any) -> Orbit:
    """Return an orbit that flies from impact to impact."""
    if not isinstance(orbit, Orbit):
        raise ValueError(f"`{name}` is {orbit!r}; allowed is an Orbit; give one that find_orbit returned")
    if orbit.n_impacts < 1 or orbit.sticks:
        raise ValueError(
            f"`{name}` is a {orbit.name} orbit; allowed is one that never rests at the stop; "
            "follow its end of sticking with continue_boundary instead"
        )
    return orbit
