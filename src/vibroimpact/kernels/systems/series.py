"""Power series of a step: tuples of the derivatives 0 to DEGREE at its beginning, with every operation written out.

A tuple lives in registers, for all lanes at once; a loop over its places would send it through memory. So these
functions are made of their text, place by place.
"""

from __future__ import annotations

import math
from typing import Any

from vibroimpact.kernels.machine import inner
from vibroimpact.kernels.vectors import anywhere, fma, get, put, select

# A step is at most REACH radians of the fastest rate; what the series leaves out is some REACH^21/21! = 5e-18 of the
# motion's size.
DEGREE, REACH = 20, 1.3
SIZE = DEGREE + 1
PARTS = 4  # of a way, in which a rate is asked for a sign, where what is least is looked for
_SHARES = [1.0 / math.factorial(place) for place in range(SIZE)]


def _written(name: str, arguments: str, lines: list[str], result: str) -> Any:
    """Return an inlined function of the given text."""
    known: dict[str, Any] = {"fma": fma, "select": select, "get": get, "put": put}
    exec(f"def {name}({arguments}):\n" + "".join(f"    {line}\n" for line in [*lines, f"return {result}"]), known)
    return inner(forceinline=True)(known[name])


def _each(text: str, first: int = 0) -> str:
    return "(" + "".join(text.format(o=o, share=repr(_SHARES[o])) + ", " for o in range(first, SIZE)) + ")"


def _lines(text: str, places: Any) -> list[str]:
    return [
        line.strip()
        for o in places
        for line in text.format(o=o, b=o - 1, a=o - 2, part=repr(1.0 / max(o, 1))).split(";")
    ]


_DOWN = range(DEGREE - 1, 0, -1)

# b0, b1 and the derivatives of b'' = f - K b - C b'
oscillation = _written(
    "oscillation",
    "b0, b1, K, C, f",
    _lines("b{o} = fma(-C, b{b}, fma(-K, b{a}, f[{a}]))", range(2, SIZE)),
    _each("b{o}"),
)
# of a sine, from its value and its rate; q = -theta^2
wave = _written("wave", "b0, b1, q", _lines("b{o} = q * b{a}", range(2, SIZE)), _each("b{o}"))
plus = _written("plus", "a, b", [], _each("a[{o}] + b[{o}]"))
plus_times = _written("plus_times", "a, t, b", [], _each("fma(t, b[{o}], a[{o}])"))
coefficients = _written("coefficients", "b", [], _each("b[{o}] * {share}"))
either = _written("either", "truth, a, b", [], _each("select(truth, a[{o}], b[{o}])"))
load = _written("load", "rows, first, wide", [], _each("get(rows, first + {o}, wide)"))
store = _written("store", "rows, first, wide, b", _lines("put(rows, first + {o}, wide, b[{o}])", range(SIZE)), "None")
# value and rate at x: sum of b_j x^j/j! and of b_{j+1} x^j/j!
evaluate = _written(
    "evaluate",
    "b, x",
    [
        f"y = p = b[{DEGREE}]",
        f"y = fma(y, {1.0 / DEGREE!r} * x, b[{DEGREE - 1}])",
        *_lines("t = {part} * x; p = fma(p, t, b[{o}]); y = fma(y, t, b[{b}])", _DOWN),
    ],
    "y, p",
)
# the same from the coefficients, b_j/j!
valued = _written(
    "valued",
    "a, x",
    [f"y = a[{DEGREE}]", "p = 0.0 * y", *_lines("p = fma(p, x, y); y = fma(y, x, a[{o}])", range(DEGREE - 1, -1, -1))],
    "y, p",
)
# integral from 0 to x: the sum of b_j x^{j+1}/(j+1)!
integral = _written(
    "integral",
    "b, x",
    [f"y = {1.0 / SIZE!r} * x * b[{DEGREE}]", *_lines("y = {part} * x * (b[{b}] + y)", range(DEGREE, 0, -1))],
    "y",
)
# p b + q b'
slipped = _written(
    "slipped",
    "b, p, q",
    [],
    "(" + "".join(f"fma(p, b[{o}], q * b[{o + 1}]), " for o in range(DEGREE)) + f"p * b[{DEGREE}])",
)
times = _written("times", "b, t", [], _each("t * b[{o}]"))
# sum of the negative coefficients from the eighth on: a lower bound of their part of the series over 0 <= x <= 1
tail = _written(
    "tail", "a", ["t = 0.0 * a[8]", *_lines("t = t + select(a[{o}] < 0.0, a[{o}], 0.0)", range(8, SIZE))], "t"
)
# a bound of |u''| over 0 <= x <= 1
bend = _written(
    "bend", "a", ["t = 2.0 * abs(a[2])", *(f"t = fma(abs(a[{o}]), {o * (o - 1.0)!r}, t)" for o in range(3, SIZE))], "t"
)


# coefficients of the rate
rates = _written("rates", "a", [], "(" + "".join(f"{o}.0 * a[{o}], " for o in range(1, SIZE)) + "0.0 * a[0])")


@inner
def _zero(a, wanted, low, high, y0, y1):
    """Return the zero of a polynomial between points where its values differ in sign, by the Illinois method."""
    sign = select(y0 < 0.0, 1.0, -1.0)
    y0, y1, side, x = select(wanted, sign * y0, -1.0), select(wanted, sign * y1, 1.0), 0.0 * y1, low
    for _ in range(8):
        x = low - y0 * (high - low) / (y1 - y0)
        y, _ = valued(a, x)
        beyond = sign * y > 0.0
        y0 = select(beyond, select(side > 0.0, 0.5 * y0, y0), sign * y)
        y1 = select(beyond, sign * y, select(side < 0.0, 0.5 * y1, y1))
        low, high, side = select(beyond, low, x), select(beyond, x, high), select(beyond, 1.0, -1.0)
    return x


@inner
def trough(a, end, flown, least):
    """Return the least of a number and of a polynomial where its rate rises through zero on the way to `end`.

    The rate is looked at four times on the way, and where it turns between two looks, if it comes nearer to zero there.
    """
    c = rates(a)
    after, slope_after = valued(c, 0.0 * end)
    for part in range(PARTS):
        low, high = (part / PARTS) * end, ((part + 1.0) / PARTS) * end
        p0, slope, (p1, slope1) = after, slope_after, valued(c, high)
        after, slope_after = p1, slope1
        rises = flown & (p0 < 0.0) & (p1 > 0.0)
        nears = flown & (p0 * p1 > 0.0) & (p0 * slope < 0.0) & (p1 * slope1 > 0.0)
        if anywhere(nears):
            x = _zero(rates(c), nears, low, high, slope, slope1)
            p, _ = valued(c, x)
            before, dips = nears & (p0 < 0.0) & (p > 0.0), nears & (p0 > 0.0) & (p < 0.0)
            high, p1 = select(before, x, high), select(before, p, p1)
            low, p0 = select(dips, x, low), select(dips, p, p0)
            rises = rises | before | dips
        if anywhere(rises):
            y, _ = valued(a, _zero(c, rises, low, high, p0, p1))
            least = select(rises & (y < least), y, least)
    return least
