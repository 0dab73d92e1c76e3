"""One axis of a study: linear with both ends, or a list of values."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.oscillator import parameter_value
from vibroimpact.parameters import whole_number

Floats = NDArray[np.float64]

MOST_POINTS = 10_000_000


def axis_values(name: str, value: Any) -> Floats:
    """Return the values of an axis, strictly increasing, or raise with a line a fault."""
    if isinstance(value, Mapping) and set(value) == {"values"}:
        value = value["values"]
    if isinstance(value, (list, tuple)):
        return _listed(name, value)
    keys = ("from", "to", "points")
    if not isinstance(value, Mapping):
        raise ValueError(
            f"`{name}` is {value!r}; allowed is {{ from, to, points }} or a list of values; "
            "write { from = 1.0, to = 2.0, points = 11 }"
        )
    missing, unknown = [key for key in keys if key not in value], [key for key in value if key not in keys]
    faults = [f"`{name}.{key}` is missing; allowed are from, to and points together; add it" for key in missing]
    faults += [f"`{name}.{key}` is no key of an axis; allowed are from, to, points; drop it" for key in unknown]
    ends: list[float] = []
    for key in [key for key in keys if key in value]:
        try:
            if key == "points":
                points = _few(key, whole_number(key, value[key], 1))
            else:
                ends.append(parameter_value(name, value[key]))
        except ValueError as error:
            faults.append(re.sub(r"^`\w+`", f"`{name}.{key}`", str(error)))
    if not faults and points > 1 and not ends[0] < ends[1]:
        faults.append(
            f"`{name}` is from {ends[0]:g} to {ends[1]:g}; allowed is an increasing axis; give the smaller end first"
        )
    if not faults and points == 1 and ends[0] != ends[1]:
        faults.append(
            f"`{name}.points` is 1 from {ends[0]:g} to {ends[1]:g}; allowed are 2 points or more, both ends being "
            f"among them; give more points, or {ends[0]:g} at both ends for that value alone"
        )
    if faults:
        raise ValueError("\n".join(faults))
    return np.linspace(ends[0], ends[1], points)


def _few(key: str, points: int) -> int:
    if points > MOST_POINTS:
        raise ValueError(f"`{key}` is {points}; allowed are at most {MOST_POINTS:,}; take fewer points")
    return points


def _listed(name: str, value: list[Any] | tuple[Any, ...]) -> Floats:
    if not value:
        raise ValueError(f"`{name}` is empty; allowed is at least one value; list the values to sweep")
    numbers = np.array([parameter_value(name, number) for number in value])
    if not (np.diff(numbers) > 0.0).all():
        raise ValueError(f"`{name}` is {list(value)!r}; allowed are strictly increasing values; sort them")
    return numbers
