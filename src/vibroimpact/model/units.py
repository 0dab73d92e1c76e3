"""Values with a unit, such as 0.5mm or 1500rpm: read by pint, which is imported only where a unit is written."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

from vibroimpact.model import Model, check_names
from vibroimpact.parameters import Parameter, counted, invalid, to_install, with_unit

MANY = 16  # values, at most, in a line
DISPLAY = "display_units"  # the attribute of labelled values that names the unit in which they are written and drawn

# A number, then a unit; what follows the number is no exponent.
_WITH_UNIT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*((?![eE][-+]?\d)[a-zA-Zµμ%°].*)")


_POWER = re.compile(r"(?<=m|s)(?=\d)")  # N/m2 is N/m^2
_RATE = re.compile(r"^1/(min|s)$")  # of a machine: turns, as rpm and Hz count them
_ANGLE = re.compile(r"rad|deg|°")  # in a unit of angular frequency; all others count turns
_NUMBER = r"-?\d[\d.]*(?:e[-+]?\d+)?"


def without_unit(parameter: Parameter, value: Any) -> Any:
    """Return a value, or each of several, as a number in the unit of its parameter; numbers stay as they are.

    The first end of a range without a unit has the unit of the second end. A unit at the first end alone is refused:
    1mm:5 may end at 5 mm or at 5 m.

    Examples
    --------
    >>> omega = Parameter("omega", "angular driving frequency", "rad/s")
    >>> round(without_unit(omega, "1500rpm"), 9), round(without_unit(omega, "25 Hz"), 9)
    (157.079632679, 157.079632679)
    """
    if isinstance(value, Mapping):
        ends = dict(value)
        written = _WITH_UNIT.fullmatch(str(ends.get("to")))
        if written and isinstance(ends.get("from"), (int, float)):
            ends["from"] = f"{ends['from']}{written[2]}"
        if not written and ends.get("to") and isinstance(ends["to"], (int, float)) and (unit := unit_of(ends["from"])):
            both = f"{ends['from']} to {ends['to']}"
            hint = f"write {ends['to']:g}{unit}, or {ends['to']:g}{parameter.unit.removeprefix('1')}"
            raise ValueError(f"`{parameter.name}` must have a unit at its second end, got {both}; {hint}")
        return {key: without_unit(parameter, end) if key != "points" else end for key, end in ends.items()}
    if isinstance(value, (list, tuple)):
        return [without_unit(parameter, each) for each in value]
    written = _WITH_UNIT.fullmatch(value) if isinstance(value, str) else None
    if written is None:
        return value
    faults = _registry()[1]
    try:
        return _converted(float(written[1]), written[2].strip(), parameter.unit)
    except faults:
        turned = f"a number, or one with a unit that can be turned into {parameter.unit}"
        allowed = "a number without a unit, or in %" if parameter.unit == "1" else turned
        raise invalid(parameter.name, value, allowed, _meant(written[1], written[2].strip(), parameter)) from None


def _meant(number: str, unit: str, parameter: Parameter) -> str:
    """Return the unit that was probably meant by one in the wrong case, such as HZ; "" if there is none."""
    cases = unit.lower(), unit.capitalize(), unit[0].lower() + unit[1:], unit[0] + unit[1:].lower()
    for case in cases:
        with suppress(*_registry()[1]):
            _converted(1.0, case, parameter.unit)
            return f"did you mean {number}{case}?"
    return ""


def has_unit(values: Iterable[Any]) -> bool:
    """Return whether one of several values is written with a unit; a percentage has none."""
    return any(unit_of(value) not in ("", "%") for value in values)


def unit_of(value: Any) -> str:
    """Return the unit written with a value, or with the last of several values that has one; "" if there is none.

    Examples
    --------
    >>> unit_of("1500rpm"), unit_of({"from": 10, "to": "20 Hz", "points": 5}), unit_of("2%"), unit_of(0.5)
    ('rpm', 'Hz', '%', '')
    """
    if isinstance(value, (Mapping, list, tuple)):
        several = list(value.values() if isinstance(value, Mapping) else value)
        return next(filter(None, map(unit_of, reversed(several))), "")
    written = _WITH_UNIT.fullmatch(value) if isinstance(value, str) else None
    return written[2].strip() if written else ""


def shown_as(model: Model, name: str, units: Mapping[str, str]) -> tuple[Parameter, str]:
    """Return the parameter, and the unit, in which values of a parameter are written.

    `units` determines both: if it contains `frequency`, which replaces `omega`, the frequency is written instead.
    """
    table = model.parameters
    given = next((each for each in units if each in table and name in (each, table[each].replaces)), name)
    return table[given], units.get(given, table[given].unit)


def shown_value(model: Model, name: str, value: float, units: Mapping[str, str]) -> float:
    """Return a value of a parameter as `shown_as` writes it.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> round(shown_value(ImpactOscillator(), "omega", 50.0 * math.pi, {"frequency": "rpm"}), 9)
    1500.0
    """
    parameter, unit = shown_as(model, name, units)
    if parameter.name != name:
        value = float(getattr(model.replace(**{name: value}), parameter.name))
    return value if unit == parameter.unit else _converted(value, parameter.unit, unit)


def quantity(model: Model, name: str, value: float, digits: int, units: Mapping[str, str]) -> str:
    """Return a value of a parameter with its unit, both as `shown_as` writes them."""
    unit = shown_as(model, name, units)[1]
    return with_unit(f"{shown_value(model, name, value, units):.{digits}g}", unit)


def is_unit(text: str) -> bool:
    """Return whether a text is a unit alone, such as mm; False without pint."""
    try:
        units, faults = _registry()
    except ValueError:
        return False
    with suppress(*faults):
        return units.parse_units(_name_of(text)) is not None
    return False


def check_units(model: Model, units: Mapping[str, str] | None) -> dict[str, str]:
    """Return units by parameter; refuse unknown parameters and units of another dimension."""
    if not isinstance(units, Mapping | None):
        raise invalid("units", units, 'units by parameter, such as {"gap": "mm"}')
    chosen = dict(units or {})
    check_names(model.parameters, chosen)
    for name, unit in chosen.items():
        standard = model.parameters[name].unit
        try:
            if unit != standard:
                _converted(1.0, standard, unit)
        except _registry()[1]:
            allowed = "1 or %" if standard == "1" else f"a unit that {standard} can be turned into"
            raise invalid(f"units[{name!r}]", unit, allowed) from None
    return chosen


class InUnit(NamedTuple):
    """Values in the unit of their parameter, and the unit in which they are written and drawn; "" is the same."""

    values: Any
    unit: str


def in_own_unit(parameter: Parameter, values: Any) -> InUnit:
    """Return numbers, or a quantity of pint, in the unit of their parameter, with the unit that they had.

    Examples
    --------
    >>> import pint
    >>> in_own_unit(Parameter("gap", "gap", "m"), pint.UnitRegistry().Quantity(500.0, "mm"))
    InUnit(values=0.5, unit='mm')
    """
    if isinstance(values, InUnit):
        return values
    if isinstance(values, (list, tuple)) and any(hasattr(each, "magnitude") for each in values):
        several = [in_own_unit(parameter, each) for each in values]
        return InUnit([each.values for each in several], several[-1].unit)
    if not (hasattr(values, "magnitude") and hasattr(values, "units")):
        return InUnit(values, "")
    unit = f"{values.units:~}".replace(" ", "") or "1"
    try:
        return InUnit(values.magnitude * _converted(1.0, unit, parameter.unit), unit)
    except _registry()[1]:
        raise invalid(parameter.name, values, f"a quantity that can be turned into {parameter.unit}") from None


def check_pair(table: Mapping[str, Parameter], parameter: str, name: str, pair: Any) -> tuple[float, float]:
    """Return the two values of a parameter in a table of parameters, given in an argument."""
    check_names(table, [parameter])
    try:
        first, second = pair
    except (TypeError, ValueError):
        raise invalid(name, pair, f"two values of {parameter}") from None
    first, second = in_own_unit(table[parameter], [first, second]).values
    return table[parameter].check(first), table[parameter].check(second)


def display(attrs: Mapping[str, Any]) -> tuple[float, dict[str, Any]]:
    """Return the factor from the unit of labelled values to that in which they are shown, and their labels there.

    Examples
    --------
    >>> label = {"long_name": "angular driving frequency", "units": "rad/s", "symbol": "w", "display_units": "Hz"}
    >>> factor, shown = display(label)
    >>> f"{factor:.6f}", shown
    ('0.159155', {'long_name': 'driving frequency', 'units': 'Hz', 'symbol': 'w/2pi'})
    """
    labels = {key: value for key, value in attrs.items() if key != DISPLAY}
    given = str(attrs.get("units", "1"))
    unit = str(attrs.get(DISPLAY, given))
    if unit == given:
        return 1.0, labels
    try:
        factor = _converted(1.0, given, unit)
    except _registry_faults():
        return 1.0, labels
    if given == "rad/s" and not _ANGLE.search(unit):
        labels["long_name"] = str(labels.get("long_name", "")).removeprefix("angular ")
        labels["symbol"] = f"{symbol}/2pi" if (symbol := labels.get("symbol")) else ""
    return factor, labels | {"units": unit}


def displayed_text(text: str, name: str, attrs: Mapping[str, Any]) -> str:
    """Return a message with the values of a parameter, which has these labels, in the unit to show."""
    standard, (factor, labels) = str(attrs.get("units", "")), display(attrs)
    unit = labels.get("units", "")

    def converted(found: re.Match[str]) -> str:
        return name + re.sub(_NUMBER, lambda n: f"{float(n[0]) * factor:.11g}", found[1]) + f" {unit}"

    pattern = rf"\b{re.escape(name)}( (?:=|from) {_NUMBER}(?: to {_NUMBER})?)(?: {re.escape(standard)})?(?![\w.])"
    return re.sub(pattern, converted, text) if DISPLAY in attrs else text


def _converted(number: float, given: str, wanted: str) -> float:
    """Return a number of one unit in another, or raise what pint raises."""
    value = float(_registry()[0].Quantity(number, _name_of(given)).to(_name_of(wanted)).magnitude)
    short = float(f"{value:.14g}")  # 0.4 mm, not 0.39999999999999997 mm
    return short if abs(short - value) <= 2.0 * math.ulp(value) else value


def _name_of(unit: str) -> str:
    """Return pint's name of a unit."""
    named = {"1": "dimensionless", "%": "percent"}.get(unit, unit)
    return _RATE.sub(r"turn/\1", _POWER.sub("^", named))


@cache
def _registry() -> tuple[Any, tuple[type[Exception], ...]]:
    """Return pint's table of units, in which 1 Hz is a turn a second, and what it raises."""
    try:
        import pint
    except ImportError:
        raise ValueError(f"values with units need pint, which is missing; {to_install('units')} installs it") from None
    units: Any = pint.UnitRegistry()
    units.define("hertz = turn / second = Hz")  # for pint 10 Hz are 10 rad/s
    return units, (pint.PintError, AttributeError, AssertionError, TypeError, ValueError)


def _registry_faults() -> tuple[type[Exception], ...]:
    """Return the errors of a conversion, also without pint."""
    try:
        return _registry()[1]
    except ValueError:
        return (ValueError,)


def few_values(model: Model) -> tuple[dict[str, float], list[str]]:
    """Return the values that fit into a line, and a text on the numbers of stops that are left out."""
    values = dict(model.values)
    if len(values) <= MANY:
        return values, []
    stops = model.at().stops
    of_stops = {f"{stop.name}_{kind}" for stop in stops for kind in stop.kinds} & set(values)
    kept = {name: value for name, value in values.items() if name not in of_stops}
    return kept, [counted(len(stops), "stop")] if of_stops else []
