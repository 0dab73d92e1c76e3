"""Formulas of restitution, as plain Python functions of a speed, a number and an order: 0 for r, 1 for dr/dv.

Laws call them as they are; the engine compiles them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.matrices import numbers
from vibroimpact.parameters import Parameter, invalid

Rule = Callable[[float, float, int], float]
Compiler = Callable[[Any], Any]

TRIED = np.logspace(-9.0, 2.0, 111)  # speeds in m/s at which a Python function is checked when it becomes a law
NEAR = 3e-4  # of a speed: the step of the finite difference, whose rounding error is about 1e-12 of r/v
SERIES = 0.05  # of D v: below it a power series replaces the formula, which loses digits there


class Formula(NamedTuple):
    """How a law is computed: a rule, built from a compiler and a table reader; its number; r if constant; its table."""

    rule: Callable[[Compiler, Callable[[float, int], float]], Rule]
    number: float = 0.0
    constant: float | None = None
    table: Any = None


def _hunt_crossley(damping: Any) -> Formula:
    """With x = D v and y = r x the law is x - ln(1 + x) = -y - ln(1 - y); the unknown is L = -ln(1 - y)."""
    number = Parameter("damping", "damping", low=0.0).check(damping)
    return Formula(lambda compiled, entry: _of_hunt_crossley, number, None if number else 1.0)


def _power_series(terms: int) -> tuple[float, ...]:
    """Return the coefficients of r in powers of x = D v, by y y' (1 + x) = x (1 - y), y = x r."""
    coefficients, last = [1.0], 1.0
    for order in range(1, terms):
        product = -coefficients[-1] - last  # of r and (x r)'
        inner = sum(coefficients[j] * coefficients[order - j] for j in range(1, order))
        coefficients.append(product / (order + 2.0) - 0.5 * inner)
        last = product
    return tuple(coefficients)


_POWERS = _power_series(14)


def _of_hunt_crossley(v: float, damping: float, order: int) -> float:
    x, r, slope = damping * v, 0.0, 0.0
    if x < SERIES:
        for j in range(len(_POWERS)):
            slope = slope * x + r
            r = r * x + _POWERS[len(_POWERS) - 1 - j]
        return damping * slope if order else r
    wanted = x - math.log1p(x)
    log = wanted + math.sqrt(2.0 * wanted)  # above the root of a convex function
    for _ in range(60):
        y = -math.expm1(-log)
        change = (log - y - wanted) / y
        log -= change
        if abs(change) <= 1e-15 * log:
            break
    r = -math.expm1(-log) / x
    return damping * (1.0 + r) * (math.exp(-log) - r) / ((1.0 + x) * r * x) if order else r


def decrement(zeta: float) -> float:
    """Return -ln r for a spring and damper of that damping ratio that release a mass when their force is zero."""
    root = math.sqrt(abs((1.0 - zeta) * (1.0 + zeta)))
    half = math.atan2(root, zeta) if zeta < 1.0 else math.asinh(root)  # half the duration of contact, times w_d
    return 2.0 * zeta * (half / root if root else 1.0)


def _kelvin_voigt(damping_ratio: Any) -> Formula:
    constant = math.exp(-decrement(Parameter("damping_ratio", "damping ratio", low=0.0).check(damping_ratio)))
    return Formula(lambda compiled, entry: lambda v, number, order: 0.0 if order else constant, constant=constant)


def _piecewise(speeds: Any, values: Any) -> Formula:
    from scipy.interpolate import PchipInterpolator

    knots, heights = numbers("speeds", speeds, 1), numbers("values", values, 1)
    if len(knots) != len(heights) or len(knots) < 2:
        raise ValueError(f"`speeds` and `values` must be equally long, at least 2, got {len(knots)} and {len(heights)}")
    if knots[0] < 0.0 or not (np.diff(knots) > 0.0).all():
        raise invalid("speeds", knots.tolist(), "ascending numbers >= 0")
    if heights.min() < 0.0 or heights.max() > 1.0:
        raise invalid("values", heights.tolist(), "numbers from 0 to 1")
    cubics = PchipInterpolator(knots, heights).c.T
    return Formula(_of_table, table=np.concatenate([[len(knots)], heights[[0, -1]], knots, cubics.ravel()]))


def _of_table(compiled: Compiler, entry: Callable[[float, int], float]) -> Rule:
    """The table holds the number of speeds, r at both ends, the speeds, and each cubic's coefficients, cube first."""

    def of_table(v: float, number: float, order: int) -> float:
        last = int(entry(number, 0)) - 1
        if v < entry(number, 3) or v >= entry(number, 3 + last):
            return 0.0 if order else entry(number, 1 if v < entry(number, 3) else 2)
        low, high = 0, last - 1
        while low < high:
            middle = (low + high + 1) // 2
            low, high = (middle, high) if v >= entry(number, 3 + middle) else (low, middle - 1)
        x, r, slope = v - entry(number, 3 + low), 0.0, 0.0
        for power in range(4):
            slope = slope * x + r
            r = r * x + entry(number, 4 + last + 4 * low + power)
        return slope if order else min(max(r, 0.0), 1.0)

    return of_table


def _function(function: Any) -> Formula:
    for v in TRIED.tolist():
        try:
            r = float(function(v))
        except Exception as error:
            raise ValueError(f"`restitution` fails at a speed of {v:.3g} m/s: {error}") from error
        if not 0.0 <= r <= 1.0:
            raise ValueError(
                f"`restitution` must be between 0 and 1, got {r!r} at a speed of {v:.3g} m/s; limit it with min and max"
            )

    def rule(compiled: Compiler, entry: Any) -> Rule:
        at = compiled(function)

        def of_function(v: float, number: float, order: int) -> float:
            if order == 0:
                return float(at(v))
            v = max(v, 1e-300)
            step = NEAR * v
            near, far = at(v + step) - at(v - step), at(v + 2.0 * step) - at(v - 2.0 * step)
            return float((8.0 * near - far) / (12.0 * step))

        return of_function

    return Formula(rule)


MAKERS: dict[str, Callable[..., Formula]] = {
    "hunt_crossley": _hunt_crossley,
    "kelvin_voigt": _kelvin_voigt,
    "piecewise": _piecewise,
    "function": _function,
}
