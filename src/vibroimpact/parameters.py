"""Checking one number."""

from __future__ import annotations

import math
import operator
from typing import Any


def real_number(name: str, value: Any, allowed: str = "a finite number", remedy: str = "give a plain number") -> float:
    """Return `value` as a float, or say why it is not one."""
    try:
        if isinstance(value, (str, bytes, bool, complex)):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"`{name}` is {value!r}; allowed is {allowed}; {remedy}{_unquoted(value)}") from None
    if not math.isfinite(number):
        raise ValueError(f"`{name}` is {value!r}; allowed is {allowed}; {remedy}")
    return number


def _unquoted(value: Any) -> str:
    """Return the remedy for a number that is given as text; nothing for anything else."""
    try:
        return "; write numbers without quotes" if isinstance(value, str) and math.isfinite(float(value)) else ""
    except ValueError:
        return ""


def whole_number(name: str, value: Any, least: int) -> int:
    """Return `value` as an int not below `least`, or say what is allowed."""
    try:
        if isinstance(value, bool):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        quoted = isinstance(value, str) and value.strip().isdecimal()
        remedy = "write numbers without quotes" if quoted else "give a plain integer"
        raise ValueError(f"`{name}` is {value!r}; allowed is a whole number >= {least}; {remedy}") from None
    if number < least:
        raise ValueError(f"`{name}` is {value!r}; allowed is a whole number >= {least}; give a larger count")
    return number
