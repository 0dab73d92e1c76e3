"""The parameters of a model, and how numbers are checked."""

from __future__ import annotations

import math
import operator
import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, NamedTuple

COUNTS = 1_000_000_000  # the largest number of anything
QUOTES = frozenset("\"'“”‘’„«»")  # those of word processors, too: a shell leaves them in
SMALLEST = 1e-60  # the size of a number that is not 0, 1e60 the largest: products of several are numbers, too


def invalid(name: str, value: Any, allowed: str, hint: str = "") -> ValueError:
    """Return the error for an argument with a value that is not allowed, with a hint on what to do."""
    return ValueError(f"`{name}` must be {allowed}, got {_short(value)}" + (f"; {hint}" if hint else ""))


def unknown(what: str, name: Any, choices: Iterable[str], hint: str = "", meant: str = "") -> ValueError:
    """Return the error for a name that is not among the choices, with the one probably meant, or else a hint."""
    names = list(choices)
    meant = meant or closest(str(name), names)
    hint = f"did you mean {meant!r}?" if meant else hint
    return ValueError(f"unknown {what} {name!r}; choose from {', '.join(names)}" + (f"; {hint}" if hint else ""))


class MissingExtra(ImportError):
    """Packages of an extra are not installed; the message says which, and how to install them."""


def closest(name: str, choices: Iterable[str]) -> str:
    """Return the choice probably meant, ignoring case, hyphens, underscores and spaces; "" if none is similar."""
    plain = {re.sub(r"[-_ ]", "", choice).lower(): choice for choice in choices}
    return next((plain[near] for near in get_close_matches(re.sub(r"[-_ ]", "", name).lower(), plain, 1)), "")


def to_install(extra: str) -> str:
    """Return the command that installs the packages of an extra by their names, because vibroimpact is on no index."""
    from importlib.metadata import PackageNotFoundError, requires

    with suppress(PackageNotFoundError):
        needed = [each.partition(";")[0] for each in requires("vibroimpact") or () if f"extra == '{extra}'" in each]
        quoted = '"{}"'  # for any shell
        names = [re.sub(r">=[\w.]+$", "", each.strip()) for each in needed]
        return f"`pip install {' '.join(name if name.isidentifier() else quoted.format(name) for name in names)}`"
    return f"the packages of the extra [{extra}] in pyproject.toml"


def check_one(name: str, value: Any, other: str, other_value: Any) -> None:
    """Refuse two arguments if both are given and one replaces the other; None means not given."""
    if value is not None and other_value is not None:
        raise ValueError(f"give either `{name}` or `{other}`, not both; got {value!r} and {other_value!r}")


def choice(name: str, value: Any, choices: Iterable[str], hint: str = "") -> str:
    """Return the value if it is one of the choices."""
    names = tuple(choices)
    if not isinstance(value, str) or value not in names:
        raise unknown(f"`{name}`", value, names, hint)
    return value


def real_number(name: str, value: Any, allowed: str = "a finite number", hint: str = "") -> float:
    """Return the value as a finite float."""
    try:
        if isinstance(value, (str, bytes, bool, complex)):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise invalid(name, value, allowed, _unquoted(value) or hint) from None
    if not math.isfinite(number):
        raise invalid(name, value, allowed, hint)
    return number


def truth(name: str, value: Any) -> bool:
    """Return the value if it is True or False, also NumPy's."""
    if not isinstance(value, bool) and type(value).__name__ not in ("bool", "bool_"):
        raise invalid(name, value, "True or False")
    return bool(value)


def several(name: str, values: Any, what: str) -> tuple[Any, ...]:
    """Return a list of values, or a single text, as a tuple."""
    try:
        return (values,) if isinstance(values, str) else tuple(values)
    except TypeError:
        raise invalid(name, values, what) from None


def positive_number(name: str, value: Any) -> float:
    """Return the value as a finite float above 0."""
    allowed = "a finite number > 0"
    number = real_number(name, value, allowed)
    if number <= 0.0:
        raise invalid(name, value, allowed)
    return number


def phase_number(name: str, value: Any) -> float:
    """Return a phase of the driving period, (t mod T)/T, as a float in [0, 1)."""
    allowed, hint = "at least 0 and less than 1", "give (t mod T)/T"
    number = real_number(name, value, allowed, hint)
    if not 0.0 <= number < 1.0:
        raise invalid(name, value, allowed, hint)
    return number


def whole_number(name: str, value: Any, least: int, most: int = COUNTS) -> int:
    """Return the value as an int that is neither below `least` nor above `most`."""
    allowed = f"a whole number >= {least}"
    try:
        if isinstance(value, bool):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        whole = isinstance(value, float) and value.is_integer() and least <= value <= most
        raise invalid(name, value, allowed, f"write {value:.0f}" if whole else _unquoted(value)) from None
    if number < least:
        raise invalid(name, value, allowed)
    if number > most:
        raise invalid(name, value, f"at most {most:,}")
    return number


def _unquoted(value: Any) -> str:
    if isinstance(value, str) and set(value) & QUOTES:
        return "leave out the quotation marks"
    if isinstance(value, str) and (comma := re.fullmatch(r"\s*([-+]?\d*),(\d.*)", value)):
        return f"write the decimals after a point: {comma[1]}.{comma[2]}"
    try:
        return "write numbers without quotes" if isinstance(value, str) and math.isfinite(float(value)) else ""
    except ValueError:
        return ""


def counted(number: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless there is one."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def times(number: int) -> str:
    """Return a number of times in words: once, 2 times."""
    return "once" if number == 1 else f"{number} times"


def with_unit(number: str, unit: str) -> str:
    """Return a number, or several, followed by the unit; pure numbers have none."""
    return number if unit in ("", "1") else f"{number} {unit}"


def labelled(name: str, unit: str) -> str:
    """Return a name with the unit in brackets, as on an axis; pure numbers have none."""
    return name if unit in ("", "1") else f"{name} [{unit}]"


def printable(text: str) -> str:
    """Return a text from elsewhere with its control codes and line ends escaped."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text)


def _short(value: Any) -> str:
    try:
        text = " ".join(line.strip() for line in repr(value).splitlines())
    except ValueError:  # an int of more digits than Python writes
        text = "a number of thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."


@dataclass(frozen=True)
class Parameter:
    """A named number of a model.

    Parameters
    ----------
    name, long_name, unit, symbol : str
        The name in arguments, the name on axes and in sentences, the unit ("1" for pure numbers) and the symbol.
    low, high : float
        The range; infinite ends are open.
    closed : bool
        Whether `low` itself is allowed.
    hint : str
        What to do about a value out of range.
    whole : bool
        Whether it is a count: only whole numbers are allowed, and it cannot be varied continuously.
    replaces : str, optional
        The parameter that may be replaced by this one: `frequency` replaces `omega`.
    follows : str, optional
        The parameter whose value is the default of this one: a `left_restitution` follows `restitution`.

    Examples
    --------
    >>> Parameter("restitution", "coefficient of restitution", "1", "r", 0.0, 1.0).check(1.2)
    Traceback (most recent call last):
    ValueError: `restitution` must be between 0 and 1, got 1.2
    """

    name: str
    long_name: str
    unit: str = "1"
    symbol: str = ""
    low: float = -math.inf
    high: float = math.inf
    closed: bool = True
    hint: str = ""
    whole: bool = False
    replaces: str | None = None
    follows: str | None = None

    @property
    def allowed(self) -> str:
        """The range in words."""
        number = "a whole number" if self.whole else "a finite number"
        if math.isinf(self.low):
            return number if math.isinf(self.high) else f"at most {self.high:g}"
        if math.isinf(self.high):
            return f"{number} {'>=' if self.closed else '>'} {self.low:g}"
        words = "between {:g} and {:g}" if self.closed else "above {:g} and up to {:g}"
        return f"{number} " * self.whole + words.format(self.low, self.high)

    def check(self, value: Any) -> float:
        """Return the value if it is in the range and neither too large nor too small for floats; an int for a count."""
        inside = type(value) is float and self.low < value <= self.high and SMALLEST <= abs(value) <= 1.0 / SMALLEST
        if inside and not self.whole:
            return float(value)  # as nearly all are; families check millions
        number = real_number(self.name, value, self.allowed, self.hint)
        outside = number < self.low or number > self.high or (number == self.low and not self.closed)
        if outside or (self.whole and number != int(number)):
            raise invalid(self.name, value, self.allowed, self.hint)
        if abs(number) > 1.0 / SMALLEST or (not self.closed and number < SMALLEST):
            raise invalid(self.name, value, f"of a size from {SMALLEST:g} to {1.0 / SMALLEST:g}", "choose other units")
        return int(number) if self.whole else number


LIGHT = 0.05  # of critical damping: a damping that machines have


class Scale(NamedTuple):
    """A size > 0 in the unit of a parameter, and its name; without a name it is the parameter's own value."""

    size: float
    of: str = ""


CRITICAL = "critical damping"  # the name of that size


def critical_damping(stiffness: float, mass: float) -> float:
    """Return the critical damping 2 sqrt(k m) of a mass on a spring, in N s/m."""
    return 2.0 * math.sqrt(stiffness * mass)


def radians(hertz: Any) -> Any:
    """Return angular frequencies in rad/s of frequencies in Hz, or angles of turns."""
    return 2.0 * math.pi * hertz


def hertz(radians: Any) -> Any:
    """Return frequencies in Hz of angular frequencies in rad/s, or turns of angles."""
    return radians / (2.0 * math.pi)


# What it costs: steps, memory

STEPS = 1 << 40  # of one call, at most
PACE = 20e-9  # seconds of a core that a certified step takes


def check_steps(name: str, what: str, steps: float, remedy: str, most: int = STEPS) -> None:
    """Refuse requests of too many steps, about one per impact; cycles are not computed twice."""
    if steps > most:
        hours = steps * PACE / 3600.0
        raise ValueError(
            f"`{name}` {what} some {steps:.2g} steps, {hours:{',.0f' if hours < 1e9 else '.2g'}} hours of a core; "
            f"one call may take at most {most:.2g} steps; {remedy}"
        )


# Whether the memory of this machine can hold it


def installed() -> int | None:
    """Return the memory of this machine in bytes; None if unknown."""
    try:
        return int(os.sysconf("SC_PHYS_PAGES")) * int(os.sysconf("SC_PAGE_SIZE")) or None
    except (AttributeError, ValueError, OSError):  # no such call, no such name, no answer
        return None


def check_fits(name: str, what: str, needed: int, remedy: str) -> None:
    """Refuse requests that need more memory than the machine has."""
    memory = installed()
    if memory is not None and needed > memory:
        raise ValueError(
            f"`{name}` {what} {in_words(needed)} of memory, but this machine has {in_words(memory)}; {remedy}"
        )


def in_words(size: int) -> str:
    """Return a number of bytes in a suitable unit.

    Examples
    --------
    >>> in_words(75 * 10**15), in_words(9_000_000)
    ('75 PB', '9 MB')
    """
    at, units = 0, ("bytes", "kB", "MB", "GB", "TB", "PB")
    while at < len(units) - 1 and size >= 1000 ** (at + 1):
        at += 1
    value = size / 1000**at
    return f"{value:.3g} {units[at]}" if value < 1000 else f"{value:.1e} {units[at]}"


_TABLE = (
    Parameter("mass", "mass", "kg", "m", 0.0, closed=False, hint="give the moving mass in kg"),
    Parameter("damping", "damping", "N s/m", "c", 0.0, hint="a damper takes energy out; use 0 for none"),
    Parameter(
        "damping_ratio", "damping ratio", "1", "zeta", 0.0, replaces="damping",
        hint="it is c / (2 sqrt(k m)), 0.01 for 1 % of critical damping",
    ),
    Parameter(
        "stiffness", "stiffness", "N/m", "k", 0.0, closed=False,
        hint="give the spring constant in N/m; without a spring there is no rest position",
    ),
    Parameter(
        "amplitude", "driving force amplitude", "N", "f", 0.0,
        hint="for the opposite sign start half a period later instead",
    ),
    Parameter(
        "omega", "angular driving frequency", "rad/s", "w", 0.0, closed=False,
        hint="give the angular driving frequency in rad/s, or `frequency` in Hz",
    ),
    Parameter(
        "frequency", "driving frequency", "Hz", "w/2pi", 0.0, closed=False, replaces="omega",
        hint="give the driving frequency in Hz, or `omega` in rad/s",
    ),
    Parameter(
        "restitution", "coefficient of restitution", "1", "r", 0.0, 1.0,
        hint="it is the speed after an impact over the speed before it",
    ),
    Parameter("gap", "gap", "m", "g", hint="give the clearance in m; negative means preloaded against the stop"),
)  # fmt: skip
# The numbers of one mass, its load and its stop that an axis may vary, by name.
OF_ONE_MASS: Mapping[str, Parameter] = MappingProxyType({entry.name: entry for entry in _TABLE})

# An orbit of a system without load and loss has it, no model.
ENERGY = Parameter("energy", "energy", "J", "E", 0.0)


def parameter_of(model: Any, name: str) -> Parameter:
    """Return a parameter of a model, or the energy of its motion."""
    parameters: Mapping[str, Parameter] = model.parameters
    return ENERGY if name == ENERGY.name and name not in parameters else parameters[name]
