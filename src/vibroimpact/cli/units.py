"""Values with a unit, such as 0.5mm or 1500rpm: read by pint, which is imported only where a unit is written."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.parameters import Parameter, invalid, to_install

# A number, then a unit; what follows the number is no exponent.
_WITH_UNIT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*((?![eE][-+]?\d)[a-zA-Zµμ%°].*)")


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
    wanted = parameter.unit
    if wanted == "1":
        allowed = "a number without a unit, or in %"
    else:
        allowed = f"a number, or one with a unit that can be turned into {wanted}"
    units, faults = _registry()
    try:
        return float(units.Quantity(number, unit).to("dimensionless" if wanted == "1" else wanted).magnitude)
    except faults:
        raise invalid(parameter.name, text, allowed) from None


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


def mixed_units_warning(names: set[str]) -> str:
    """Return a warning where numbers in SI stand beside numbers of the paper, which are dimensionless."""
    table, usual = ImpactOscillator.parameters, ImpactOscillator()
    names = {table[name].replaces or name for name in names}
    defaults = [name for name in ("mass", "damping", "stiffness", "amplitude", "omega") if name not in names]
    numbers = ", ".join(f"{name} = {getattr(usual, name):g} {table[name].unit}" for name in defaults)
    return f"numbers of the paper stand beside your own: {numbers}; give them too" if defaults else ""
