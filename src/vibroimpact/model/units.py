"""Values with a unit, such as 0.5mm or 1500rpm: read by pint, which is imported only where a unit is written."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from vibroimpact.parameters import Parameter, invalid, to_install

# A number, then a unit; what follows the number is no exponent.
_WITH_UNIT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*((?![eE][-+]?\d)[a-zA-Zµμ%°].*)")


_POWER = re.compile(r"(?<=m|s)(?=\d)")  # N/m2 is N/m^2
_RATE = re.compile(r"^1/(min|s)$")  # of a machine: turns, as rpm and Hz count them


def without_unit(parameter: Parameter, value: Any) -> Any:
    """Return a value, or each of several, as a number in the unit of its parameter; what has no unit stays as it is.

    Of a span the first end is in the unit of the second one unless it has its own.

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
        return {key: without_unit(parameter, end) if key != "points" else end for key, end in ends.items()}
    if isinstance(value, (list, tuple)):
        return [without_unit(parameter, each) for each in value]
    written = _WITH_UNIT.fullmatch(value) if isinstance(value, str) else None
    if written is None:
        return value
    return _converted(parameter, value, float(written[1]), written[2].strip().replace("%", "percent"))


def has_unit(value: Any) -> bool:
    """Return whether a value, or one of several, is written with a unit; a percentage has none."""
    if isinstance(value, (Mapping, list, tuple)):
        return any(map(has_unit, value.values() if isinstance(value, Mapping) else value))
    return isinstance(value, str) and (written := _WITH_UNIT.fullmatch(value)) is not None and written[2].strip() != "%"


def _converted(parameter: Parameter, text: str, number: float, unit: str) -> float:
    wanted, given = (_RATE.sub(r"turn/\1", _POWER.sub("^", each)) for each in (parameter.unit, unit))
    if wanted == "1":
        allowed = "a number without a unit, or in %"
    else:
        allowed = f"a number, or one with a unit that can be turned into {parameter.unit}"
    units, faults = _registry()
    try:
        value = float(units.Quantity(number, given).to("dimensionless" if wanted == "1" else wanted).magnitude)
    except faults:
        raise invalid(parameter.name, text, allowed) from None
    short = float(f"{value:.14g}")  # 0.4 mm, not 0.39999999999999997 mm
    return short if abs(short - value) <= 2.0 * math.ulp(value) else value


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
