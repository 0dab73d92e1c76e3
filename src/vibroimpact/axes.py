"""The axes of a sweep: which parameters it varies, over which values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.oscillator import PARAMETERS, nearest_parameter, parameter_value

NAMES = (*PARAMETERS, "frequency")


def check_axes(axes: Mapping[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Return the axes as arrays in the order given, or raise `ValueError` naming the first that is wrong."""
    for name in axes:
        if name not in NAMES:
            ratio = name in ("damping_ratio", "zeta")
            remedy = "vary damping, c = 2 zeta sqrt(k m)" if ratio else nearest_parameter(name, NAMES)
            raise ValueError(f"`{name}` is no parameter to vary; allowed are {', '.join(NAMES)}; {remedy}")
    if "omega" in axes and "frequency" in axes:
        raise ValueError("`omega` and `frequency` are one parameter; allowed is one of the two; drop the other")
    return {name: _values(name, values) for name, values in axes.items()}


def _values(name: str, given: Any) -> NDArray[np.float64]:
    values = _numbers(given)
    if values.ndim != 1 or values.size == 0:
        raise ValueError(
            f"`{name}` is {_short(given)}; allowed is a one-dimensional, non-empty list of numbers; "
            f"write for example {name}=np.linspace(0.1, 5, 200)"
        )
    for value in (*values[~np.isfinite(values)][:1], values.min(), values.max()):  # ranges are intervals
        parameter_value(name, value.item())
    falls = np.flatnonzero(np.diff(values) <= 0.0)
    if falls.size:
        at = int(falls[0])
        raise ValueError(
            f"`{name}` goes from {values[at]:g} to {values[at + 1]:g}; allowed are "
            "strictly increasing values; sort them"
        )
    return values


def _numbers(given: Any) -> NDArray[np.float64]:
    """Return a list of numbers as an array of one dimension; one of two dimensions where it is none, text included."""
    none = np.empty((0, 0))
    try:
        found = np.asarray(given)
        listed = found.dtype.kind == "O" and not any(isinstance(value, (str, bytes, bool)) for value in found.flat)
        return np.array(found, dtype=np.float64) if found.dtype.kind in "iuf" or listed or not found.size else none
    except (TypeError, ValueError):
        return none


def _short(given: Any) -> str:
    text = repr(given)
    return text if len(text) <= 60 else text[:57] + "..."
