"""Cases to begin with, as assets/cases.toml has them: the paper's, and four machines."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibroimpact.explorer.state import MODEL, Range, View


@dataclass(frozen=True)
class Preset:
    """A case: its view, how far its sliders reach, where its numbers come from, and what a rigid stop idealises."""

    name: str
    title: str
    view: View
    ranges: dict[str, Range]
    source: str
    idealised: str


def _preset(case: dict[str, Any], base: dict[str, Any]) -> Preset:
    numbers = base.get("numbers", {}) | case.get("numbers", {})
    ranges = {name: (low, high) for name, (_, low, high) in numbers.items()}
    x, y = case["x"], case["y"]
    view = View(
        osc=MODEL(**{name: value for name, (value, _, _) in numbers.items()}),
        x=x,
        y=y,
        x_range=ranges[x],
        y_range=tuple(case.get("y_range", ranges[y])),
        index=case["index"],
        case=case["name"],
    )
    source = base.get("source", "") + case["source"]
    return Preset(case["name"], case["title"], view, ranges, source, case.get("idealised", base.get("idealised", "")))


_CASES = tomllib.loads((Path(__file__).parent / "assets" / "cases.toml").read_text(encoding="utf-8"))
PRESETS = tuple(_preset(case, _CASES.get(case.get("base"), {})) for case in _CASES["case"])
BY_NAME = {preset.name: preset for preset in PRESETS}


def case_of(view: View) -> Preset | None:
    """Return the case that a view began with, or shows as it is."""
    same = (preset for preset in PRESETS if _content(preset.view) == _content(view))
    return BY_NAME.get(view.case) or next(same, None)


def ranges_for(view: View) -> dict[str, Range]:
    """Return how far each slider reaches: its case's ranges, widened to hold the view's point and plane.

    Without a case those of the one whose sliders hold the point best: the most parameters, the first of equals.
    """
    case = case_of(view) or max(PRESETS, key=lambda preset: _held(view, preset.ranges))
    ranges = dict(case.ranges)
    for name, (low, high) in ranges.items():
        value = getattr(view.osc, name)
        ranges[name] = (min(low, value), max(high, value))
    for name, (low, high) in ((view.x, view.x_range), (view.y, view.y_range)):
        ranges[name] = (min(ranges[name][0], low), max(ranges[name][1], high))
    return ranges


def _content(view: View) -> tuple[Any, ...]:
    return view.osc, *view.plane_key, view.index


def _held(view: View, ranges: dict[str, Range]) -> int:
    return sum(low <= getattr(view.osc, name) <= high for name, (low, high) in ranges.items())
