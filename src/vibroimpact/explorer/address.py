"""Initial views: from web addresses, and the cases of assets/cases.toml (the paper's, four machines)."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlencode

from vibroimpact.explorer.limits import Range, parts_of
from vibroimpact.explorer.models import Find, find_ready_made, first_view, usual_range
from vibroimpact.explorer.state import CHOICES, View, no_number, table, values_of
from vibroimpact.model import Model, State
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.parameters import Parameter, hertz, invalid, unknown

LONGEST = 2000  # characters
MOST = 40  # entries
KEYS = ("model", "x", "y", *(choice.key for choice in CHOICES.values()), "start", "pin")  # besides the parameters


def keys(parameters: dict[str, Parameter]) -> dict[str, str]:
    """Return the names of a model's parameters by their keys in an address: symbols if they are suitable."""
    symbols = [parameter.symbol for parameter in parameters.values()]
    names = {}
    for name, parameter in parameters.items():
        short = parameter.symbol
        key = short if short.isidentifier() and symbols.count(short) == 1 and short not in KEYS else name
        names[f"{key}_" if key in KEYS else key] = name
    return names


def to_query(view: View) -> str:
    """Return the view as the query of a web address: all parameters, and settings that differ from the default.

    Examples
    --------
    >>> from vibroimpact.explorer.state import View
    >>> to_query(View())
    'm=1&c=0.01&k=1&f=1&w=2&r=0.8&g=0&x=w,0.025,5&y=m,0.1,5&index=std'
    """
    names = keys(view.table)
    pairs = [("model", view.model)] if view.model else []
    pairs += [(key, _number(view.values[name])) for key, name in names.items()]
    for axis in ("x", "y"):
        key = next(key for key, name in names.items() if name == getattr(view, axis))
        pairs.append((axis, f"{key},{_numbers(getattr(view, f'{axis}_range'))}"))
    for name, choice in CHOICES.items():
        value = getattr(view, name)
        if name == "index" or value != getattr(View, name):
            pairs += [(choice.key, text) for text, offered in choice.texts.items() if offered == value]
    if view.start is not None:
        pairs.append(("start", _numbers(parts_of(view.start))))
    pairs += [("pin", _numbers(values_of(pin, view.hertz).values())) for pin in view.pins]
    return urlencode(pairs, safe=",:")


def from_query(query: str, find: Find = find_ready_made) -> View:
    """Return the view of a web address's query; if an entry other than `pin` is repeated, the last one counts.

    `find` returns the model of a name; links never cause a file to be run.

    Raises
    ------
    ValueError
        An entry is unknown, not a number, or beyond the limits.

    Examples
    --------
    >>> from_query("w=2.8&index=lyapunov").osc.omega
    2.8
    """
    query = query.removeprefix("?")
    if len(query) > LONGEST:
        raise ValueError(f"the address must have at most {LONGEST} characters, got {len(query)}; copy the link again")
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query), max_num_fields=MOST)
    except ValueError as error:
        raise ValueError("the address must read name=value&name=value; copy the link again") from error
    model = find(dict(pairs).get("model", ""))
    names = keys(table(model, dict(pairs).get(CHOICES["hertz"].key) == "1"))
    for name, _ in pairs:
        if name not in KEYS and name not in names:
            raise unknown("part of a view", name if len(name) <= 40 else name[:37] + "...", sorted((*names, *KEYS)))
    return _view(model, names, dict(pairs), [text for name, text in pairs if name == "pin"])


def _view(model: Model, names: dict[str, str], entries: dict[str, str], pins: list[str]) -> View:
    osc = model.replace(**{name: _float(key, entries[key]) for key, name in names.items() if key in entries})
    content: dict[str, Any] = {"osc": osc}
    if link_name := entries.get("model"):
        first = first_view(osc, link_name)
        content |= {name: getattr(first, name) for name in ("x", "y", "x_range", "y_range", "model", "index")}
    for axis in ("x", "y"):
        if axis in entries:
            content[axis], content[f"{axis}_range"] = _axis(axis, entries[axis], names)
    for name, choice in CHOICES.items():
        text = entries.get(choice.key)
        if text is not None and text not in choice.texts:
            raise invalid(name, text, f"one of {', '.join(choice.texts)}")
        if text is not None:
            content[name] = choice.texts[text]
    if "start" in entries:
        content["start"] = _start(entries["start"], osc.at().coordinates)
    if pins:
        values = [_floats("pin", pin, len(names)) for pin in pins]
        content["pins"] = tuple(model.replace(**dict(zip(names.values(), numbers, strict=True))) for numbers in values)
    return View(**content)


def _start(text: str, n: int) -> State:
    *parts, time = _floats("start", text, 2 * n + 1)
    return State(parts[:n], parts[n:], time)


def _axis(axis: str, text: str, names: dict[str, str]) -> tuple[str, tuple[float, float]]:
    symbol, _, ends = text.partition(",")
    if symbol not in names:
        allowed = f"symbol,from,to with one of the symbols {', '.join(names)}"
        raise invalid(axis, text, allowed, f"for example {axis}={next(iter(names))},0.025,5")
    low, high = _floats(axis, ends, 2)
    return names[symbol], (low, high)


def _floats(name: str, text: str, count: int) -> list[float]:
    parts = text.split(",")
    if len(parts) != count:
        raise ValueError(f"`{name}` must hold {count} numbers separated by commas, got {len(parts)}")
    return [_float(name, part) for part in parts]


def _float(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise no_number(name, text) from None


def _number(value: float) -> str:
    """Return the shortest text that parses to this double."""
    return repr(value).removesuffix(".0")


def _numbers(values: Iterable[float]) -> str:
    return ",".join(map(_number, values))


# ---- cases


@dataclass(frozen=True)
class Preset:
    """A case: its view, the ranges of its sliders, the source of its numbers, and the idealisations of its model."""

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
        osc=ImpactOscillator(**{name: value for name, (value, _, _) in numbers.items()}),
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
    """Return the case from which a view began, or the case whose view it equals."""
    if view.model:
        return None
    same = (preset for preset in PRESETS if _content(preset.view) == _content(view))
    return BY_NAME.get(view.case) or next(same, None)


def ranges_for(view: View) -> dict[str, Range]:
    """Return the range of each slider: that of the case, widened to include the view's point and plane.

    For one mass without a case, the ranges are those of the case whose sliders include the most parameters of the point
    (the first of equals). For other models they are derived from the values.
    """
    values = view.values
    of_mass = view.osc.values

    def fitting(preset: Preset) -> int:
        """Return the number of parameters within the sliders of a case."""
        return sum(low <= of_mass[name] <= high for name, (low, high) in preset.ranges.items())

    ranges = {name: usual_range(parameter, values[name], view.system) for name, parameter in view.table.items()}
    if not view.model:
        ranges |= (case_of(view) or max(PRESETS, key=fitting)).ranges
        if view.hertz:
            low, high = ranges.pop("omega")
            ranges["frequency"] = hertz(low), hertz(high)
    for name, (low, high) in ranges.items():
        value = values[name]
        ranges[name] = (min(low, value), max(high, value))
    for name, (low, high) in ((view.x, view.x_range), (view.y, view.y_range)):
        ranges[name] = (min(ranges[name][0], low), max(ranges[name][1], high))
    return ranges


def _content(view: View) -> tuple[Any, ...]:
    return view.model, view.osc, *view.plane_key, view.index
