"""The rules that turn numbers into verdicts, independent of the paper and of the engine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal
from enum import Enum
from itertools import pairwise

NEARLY_ALL = 0.95  # the share that counts as "throughout" or "strong" if the paper gives no number


class Verdict(Enum):
    """The result of comparing the engine's numbers with a statement."""

    HOLDS = "holds"
    LAST_DIGIT = "last digit"
    FAILS = "does not hold"


@dataclass(frozen=True)
class Assessment:
    """A verdict and the rule behind it, as text."""

    verdict: Verdict
    rule: str


def _verdict(holds: bool, close: bool = False) -> Verdict:
    return Verdict.HOLDS if holds else Verdict.LAST_DIGIT if close else Verdict.FAILS


def _unit(printed: str) -> Decimal:
    return Decimal(1).scaleb(int(Decimal(printed).as_tuple().exponent))


def last_unit(printed: str) -> float:
    """Return one unit of the last printed digit.

    Examples
    --------
    >>> last_unit("0.23"), last_unit("2.0"), last_unit("35")
    (0.01, 0.1, 1.0)
    """
    return float(_unit(printed))


def cut_like(measured: float, printed: str) -> bool:
    """Return whether cutting `measured` off after the printed digits, without rounding, gives the printed number.

    Examples
    --------
    >>> cut_like(0.447, "0.44"), cut_like(0.447, "0.45")
    (True, False)
    """
    return Decimal(repr(float(measured))).quantize(_unit(printed), ROUND_DOWN) == Decimal(printed)


def printed_value(measured: float, printed: str) -> Assessment:
    """Assess a number the paper prints.

    Examples
    --------
    >>> printed_value(0.228634, "0.23").verdict.value, printed_value(3.1623, "3.1").verdict.value
    ('holds', 'last digit')
    >>> printed_value(2.085, "2.5").verdict.value
    'does not hold'
    """
    rule = "equal after rounding to the printed digits; one unit of the last digit away is 'last digit'"
    if not math.isfinite(measured):
        return Assessment(Verdict.FAILS, rule)
    away = abs(Decimal(repr(float(measured))).quantize(_unit(printed), ROUND_HALF_UP) - Decimal(printed))
    return Assessment(_verdict(away == 0, away <= _unit(printed)), rule)


def is_true(holds: bool, rule: str) -> Assessment:
    """Assess a statement that a measurement decides directly; `rule` is the criterion."""
    return Assessment(_verdict(holds), rule)


def fills_interval(positions: Sequence[float], has_it: Sequence[bool], low: str, high: str) -> Assessment:
    """Assess "this motion throughout [low, high]" by frequencies scanned inside.

    Examples
    --------
    >>> positions = [1.15, 1.3, 1.5, 1.9]
    >>> fills_interval(positions, [False, True, True, True], "1.0", "2.0").verdict.value
    'does not hold'
    >>> fills_interval(positions, [False, True, True, True], "1.1", "2.0").verdict.value
    'last digit'
    """
    rule = (
        "every scanned frequency inside the interval has the motion; 'last digit' if those without it all lie "
        "within one unit of the last printed digit of an end"
    )
    inside = [(x, has) for x, has in zip(positions, has_it, strict=True) if float(low) <= x <= float(high)]
    without = [x for x, has in inside if not has]
    from_low = [x - float(low) <= last_unit(low) * (1 + 1e-9) for x in without]
    from_high = [float(high) - x <= last_unit(high) * (1 + 1e-9) for x in without]
    close = all(near or far for near, far in zip(from_low, from_high, strict=True))
    return Assessment(_verdict(bool(inside) and not without, bool(inside) and close), rule)


def nearly_all(share: float, of_what: str) -> Assessment:
    """Assess "throughout", "strong agreement", "largely": the share must reach `NEARLY_ALL`."""
    return Assessment(_verdict(share >= NEARLY_ALL), f"at least {NEARLY_ALL:.0%} of {of_what}")


def trend(values: Sequence[float], what: str, *, grows: bool) -> Assessment:
    """Assess a trend: every value above the one before it, or below it."""
    steady = all(b > a for a, b in pairwise(values if grows else values[::-1]))
    return Assessment(_verdict(len(values) > 1 and steady), f"{what} {'rises' if grows else 'falls'} at every step")


def axis_limit(largest: float, printed: str) -> Assessment:
    """Assess the height of a printed axis: the largest velocity rounded up to the printed digits.

    Examples
    --------
    >>> axis_limit(2.895, "3").verdict.value, axis_limit(8.09, "8").verdict.value, axis_limit(77.6, "35").verdict.value
    ('holds', 'last digit', 'does not hold')
    """
    top, unit = float(printed), last_unit(printed)
    rule = (
        "the end of the axis is the largest velocity, rounded up to the printed digits; one unit of the last digit "
        "away is 'last digit'"
    )
    holds, close = (top - n * unit < largest <= top + (n - 1) * unit for n in (1, 2))
    return Assessment(_verdict(holds, close), rule)


def proportional(ratios: Sequence[float], factor: float) -> Assessment:
    """Assess strict proportionality: every ratio equals the factor to within rounding."""
    tolerance = 1e-9
    worst = max((abs(ratio / factor - 1.0) for ratio in ratios), default=math.inf)
    return Assessment(_verdict(worst <= tolerance), f"every ratio equals the factor to a relative {tolerance:g}")


def all_of(assessments: Sequence[Assessment]) -> Assessment:
    """Assess a statement of several parts by its weakest part; the rule names all parts."""
    order = list(Verdict)
    worst = max((assessment.verdict for assessment in assessments), key=order.index)
    return Assessment(worst, "; and ".join(dict.fromkeys(assessment.rule for assessment in assessments)))
