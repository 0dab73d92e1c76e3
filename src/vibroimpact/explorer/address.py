"""A view as the query of a web address, and back."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from urllib.parse import parse_qsl, urlencode

from vibroimpact.dataset import SYMBOLS, VARIABLES
from vibroimpact.explorer.limits import cut, no_number
from vibroimpact.explorer.state import View
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, State

LONGEST = 2000  # characters
MOST = 40  # entries
_SYMBOL = {name: VARIABLES[name][2] for name in PARAMETERS}
_FLAGS = {"log": "log", "b": "boundaries"}


def to_query(view: View) -> str:
    """Return the view as the query of a web address; what stands at its default is left out, but the seven numbers.

    Examples
    --------
    >>> from vibroimpact.explorer.state import View
    >>> to_query(View())
    'm=1&c=0.01&k=1&f=1&w=2&r=0.8&g=0&x=w,0.025,5&y=m,0.1,5&index=std'
    """
    pairs = [(_SYMBOL[name], _number(getattr(view.osc, name))) for name in PARAMETERS]
    for axis in ("x", "y"):
        name, ends = getattr(view, axis), getattr(view, f"{axis}_range")
        pairs.append((axis, ",".join([_SYMBOL[name], *map(_number, ends)])))
    pairs.append(("index", view.index))
    pairs += [(key, "1") for key, name in _FLAGS.items() if getattr(view, name)]
    if view.line != "x":
        pairs.append(("line", view.line))
    if view.samples != View.samples:
        pairs.append(("n", str(view.samples)))
    if not view.settled:
        pairs.append(("from", "start"))
    if view.start is not None:
        pairs.append(("start", _numbers((view.start.displacement, view.start.velocity, view.start.time))))
    if view.case:
        pairs.append(("case", view.case))
    pairs += [("pin", _numbers(getattr(pin, name) for name in PARAMETERS)) for pin in view.pins]
    return urlencode(pairs, safe=",")


def from_query(query: str) -> View:
    """Return the view that the query of a web address tells.

    Raises
    ------
    ValueError
        Anything in it is unknown, given twice, no number, or beyond the limits.

    Examples
    --------
    >>> from_query("w=2.8&index=lyapunov").osc.omega
    2.8
    """
    query = query.removeprefix("?")
    if len(query) > LONGEST:
        raise ValueError(f"the address has {len(query)} characters; allowed are {LONGEST}; copy the link anew")
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query), max_num_fields=MOST)
    except ValueError as error:
        raise ValueError("the address cannot be read; allowed is name=value&name=value; copy the link anew") from error
    told: dict[str, list[str]] = {}
    for name, text in pairs:
        told.setdefault(name, []).append(text)
    known = {*_SYMBOL.values(), *_FLAGS, "x", "y", "index", "line", "n", "from", "start", "case", "pin"}
    for name, texts in told.items():
        if name not in known:
            raise ValueError(f"`{cut(name)}` is no part of a view; allowed are {', '.join(sorted(known))}; drop it")
        if len(texts) > 1 and name != "pin":
            raise ValueError(f"`{name}` is given {len(texts)} times; allowed is once; drop the others")
    return _view({name: texts[0] for name, texts in told.items() if name != "pin"}, told.get("pin", []))


def _view(told: dict[str, str], pins: list[str]) -> View:
    usual = View()
    numbers = {SYMBOLS[symbol]: _float(symbol, told[symbol]) for symbol in _SYMBOL.values() if symbol in told}
    content: dict[str, Any] = {"osc": usual.osc.replace(**numbers)}
    for axis in ("x", "y"):
        if axis in told:
            content[axis], content[f"{axis}_range"] = _axis(axis, told[axis])
    for name in ("index", "line", "case"):
        if name in told:
            content[name] = cut(told[name])
    for key, name in _FLAGS.items():
        if key in told:
            content[name] = _choice(key, told[key], {"0": False, "1": True})
    if "n" in told:
        content["samples"] = int(told["n"]) if told["n"].isascii() and told["n"].isdigit() else cut(told["n"])
    if "from" in told:
        content["settled"] = _choice("from", told["from"], {"start": False, "settled": True})
    if "start" in told:
        content["start"] = State(*_floats("start", told["start"], 3))
    if pins:
        content["pins"] = tuple(
            ImpactOscillator(**dict(zip(PARAMETERS, _floats("pin", pin, len(PARAMETERS)), strict=True))) for pin in pins
        )
    return View(**content)


def _axis(axis: str, text: str) -> tuple[str, tuple[float, float]]:
    symbol, _, ends = text.partition(",")
    if symbol not in SYMBOLS:
        raise ValueError(
            f"`{axis}` is {cut(text)!r}; allowed is symbol,from,to with a symbol out of {', '.join(SYMBOLS)}; "
            f"write for example {axis}=w,0.025,5"
        )
    low, high = _floats(axis, ends, 2)
    return SYMBOLS[symbol], (low, high)


def _floats(name: str, text: str, count: int) -> list[float]:
    parts = text.split(",")
    if len(parts) != count:
        raise ValueError(f"`{name}` holds {len(parts)} numbers; allowed are {count}; separate them by commas")
    return [_float(name, part) for part in parts]


def _float(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise no_number(name, text) from None


def _choice(name: str, text: str, allowed: dict[str, Any]) -> Any:
    if text not in allowed:
        raise ValueError(f"`{name}` is {cut(text)!r}; allowed are {', '.join(allowed)}; choose one of them")
    return allowed[text]


def _number(value: float) -> str:
    """Return the shortest text that reads as this double."""
    return repr(value).removesuffix(".0")


def _numbers(values: Iterable[float]) -> str:
    return ",".join(map(_number, values))
