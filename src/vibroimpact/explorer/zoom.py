"""Another part of the plane, as far as it is allowed."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

from vibroimpact.explorer.limits import Range, cut, no_number
from vibroimpact.explorer.state import View
from vibroimpact.oscillator import parameter_value

HALVINGS = 24  # of the way to an end that is not allowed
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


def with_ranges(view: View, x_range: Range, y_range: Range) -> tuple[View, str]:
    """Return the view moved to these ranges as far as its limits allow, and a message where they did not."""
    try:
        return replace(view, x_range=x_range, y_range=y_range), ""
    except ValueError as error:
        message = str(error)
    wanted = {"x_range": x_range, "y_range": y_range}
    if not all(_some_range(ends) for ends in wanted.values()):
        return view, message
    view = _together(view, wanted)
    for name, ends in wanted.items():
        for end in (0, 1):
            view = _moved(view, name, end, ends[end])
    return view, message


def typed_number(name: str, value: Any) -> float:
    """Return what was typed as a parameter of the oscillator, or say what is allowed."""
    if isinstance(value, str):
        if "," in value:
            raise no_number(name, value)
        value = float(value) if NUMBER.fullmatch(value) else cut(value)
    return parameter_value(name, value)


def _some_range(ends: Any) -> bool:
    try:
        low, high = ends
        return math.isfinite(low) and math.isfinite(high) and bool(low < high)
    except (TypeError, ValueError):
        return False


def _together(view: View, wanted: dict[str, Range]) -> View:
    """Return the view with all four ends moved by the largest common share of their ways that is allowed."""
    begins, best = {name: getattr(view, name) for name in wanted}, view
    done, refused = 0.0, 1.0
    for _ in range(HALVINGS):
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
    done, refused, best = 0.0, 1.0, view
    for share in (1.0, *[0.0] * HALVINGS):
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
