"""Times and durations of a request, in s or in another unit of time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroimpact.cli.endings import WrongRequest
from vibroimpact.cli.options import number
from vibroimpact.model.units import without_unit
from vibroimpact.parameters import Parameter, invalid, real_number, several, whole_number

ALLOWED = "a list of times in s, or { from, to, points }"
MOST = 10_000_000  # times; a typing error asks for more
ENDS = "from", "to", "points"


def read_times(text: str) -> dict[str, Any]:
    """Return the entry of times that are typed as `T,T,...` or as `FROM:TO:POINTS`."""
    parts = text.split(":")
    if len(parts) == 1:
        return {"times": [number(part.strip()) for part in text.split(",")]}
    if len(parts) != len(ENDS):
        raise WrongRequest(f"`--times` must be T,T,... or FROM:TO:POINTS such as 0:2s:101, got {text!r}")
    return {"times": dict(zip(ENDS, (number(part.strip()) for part in parts), strict=True))}


def check_times(name: str, value: Any) -> Any:
    """Return times in s, one by one or evenly spaced with both ends."""
    import numpy as np

    value = without_unit(Parameter(name, "time", "s"), value)
    if not isinstance(value, Mapping):
        return [real_number(f"{name}[{at}]", each) for at, each in enumerate(several(name, value, ALLOWED))]
    if {*value} != {*ENDS}:
        raise invalid(name, dict(value), ALLOWED)
    low, high = (real_number(f"{name}.{end}", value[end]) for end in ENDS[:2])
    return np.linspace(low, high, whole_number(f"{name}.points", value["points"], 2, MOST))


def check_duration(name: str, value: Any) -> float:
    """Return a duration in s."""
    duration = Parameter(name, "duration", "s", low=0.0, closed=False)
    return duration.check(without_unit(duration, value))
