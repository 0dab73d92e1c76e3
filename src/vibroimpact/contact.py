"""Laws of restitution: the ratio of the speeds after and before an impact, as a function of the impact speed.

Each law is one plain Python function of a speed, a number and an order, 0 for r and 1 for dr/dv. Here it is called as
it is; the engine compiles it.

>>> import vibroimpact as vi
>>> stop = vi.Stop(direction=1.0, gap=1e-3, restitution=vi.contact.hunt_crossley(damping=0.2))
>>> round(stop.law(1.5), 6)
0.83287
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.by_value import ByValue, written
from vibroimpact.cells import Floats
from vibroimpact.fingerprint import fingerprint
from vibroimpact.matrices import numbers
from vibroimpact.parameters import Parameter, invalid

Rule = Callable[[float, float, int], float]
Compiler = Callable[[Any], Any]

TRIED = np.logspace(-9.0, 2.0, 111)  # speeds in m/s at which a Python function is checked when it becomes a law
NEAR = 3e-4  # of a speed: the step of the finite difference, whose rounding error is about 1e-12 of r/v
SERIES = 0.05  # of D v: below it a power series replaces the formula, which loses digits there
LAWS: dict[float, Law] = {}  # by their marks, which tables of cells hold as numbers


class _Formula(NamedTuple):
    """How a law is computed: a rule, built from a compiler and a table reader; its number; r if constant; its table."""

    rule: Callable[[Compiler, Callable[[float, int], float]], Rule]
    number: float = 0.0
    constant: float | None = None
    table: Any = None


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Law(ByValue):
    """A law of restitution r(v) of a rigid stop, made by the functions of `vibroimpact.contact`.

    Called with speeds in m/s (the `velocity` of impacts), it returns r; `slope` returns dr/dv in s/m. Two laws are
    equal if their arguments are; Python functions are equal if their bytecode, constants and captured values are.

    Raises
    ------
    ValueError
        A speed is negative.

    Examples
    --------
    >>> law = hunt_crossley(damping=0.4)
    >>> law
    hunt_crossley(damping=0.4)
    >>> law([0.0, 1.0, 2.5]).round(6).tolist(), round(law.slope(2.5), 6)
    ([1.0, 0.788539, 0.593624], -0.100536)
    """

    kind: str
    given: Mapping[str, Any]
    formula: _Formula
    code: float  # identifies the compiled code: a whole number below 2^53
    mark: float  # identifies the law, except for its number

    def __init__(self, kind: str, given: Mapping[str, Any]) -> None:
        formula = _MAKERS[kind](**given)
        arguments = {name: value if callable(value) else _kept(value) for name, value in given.items()}
        whole = _mark((kind, *arguments.values()))
        code = whole if kind == "function" else _mark(kind)
        mark = code if formula.number else whole
        vars(self).update(kind=kind, given=MappingProxyType(arguments), formula=formula, code=code, mark=mark)

    @property
    def constant(self) -> float | None:
        """The value of r if it is the same at all speeds, else None."""
        return self.formula.constant

    @property
    def number(self) -> float:
        """The number that is passed to the rule."""
        return self.formula.number

    def __call__(self, v: Any) -> Any:
        """Return r at speeds v in m/s."""
        return self._over(v, 0)

    def slope(self, v: Any) -> Any:
        """Return dr/dv in s/m at speeds v in m/s."""
        return self._over(v, 1)

    def _over(self, v: Any, order: int) -> Any:
        speeds = np.asarray(v, np.float64)
        if not (speeds >= 0.0).all():
            raise invalid("v", v, "speeds >= 0")
        table = self.formula.table
        rule = self.formula.rule(lambda function: function, lambda number, at: float(table[at]))
        values: Floats = np.array([float(rule(speed, self.number, order)) for speed in speeds.ravel().tolist()])
        return values.reshape(speeds.shape) if speeds.ndim else float(values[0])

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the constructor by name."""
        return {"kind": self.kind, "given": dict(self.given)}

    def plain(self) -> dict[str, Any]:
        """Return the law as numbers and strings; for a Python function, its name and a table of values."""
        if self.kind != "function":
            return {"law": self.kind, **self.given}
        name = getattr(self.given["function"], "__name__", "function")
        return {"law": name, "mark": self.mark, "speeds": TRIED.tolist(), "values": self(TRIED).tolist()}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Law) and (self.mark, self.number) == (other.mark, other.number)

    def __hash__(self) -> int:
        return hash((self.mark, self.number))

    def __repr__(self) -> str:
        if self.kind == "function":
            return str(self.plain()["law"])
        return f"{self.kind}({', '.join(f'{name}={written(value)}' for name, value in self.given.items())})"


def hunt_crossley(*, damping: float) -> Law:
    r"""Return the restitution of contacts whose damping grows with their penetration, F = k d^n (1 + D d').

    .. math:: D v (1 + r) = \ln\frac{1 + D v}{1 - r D v}

    r falls from 1 at v = 0, as 1 - 2 D v/3 + ..., towards 1/(D v) at high speed, whatever k, n and the masses are.

    Parameters
    ----------
    damping : float, >= 0
        D in s/m. At low speed, measured restitution falls as r = 1 - alpha v, so that D = 3 alpha/2; alpha is 0.08 to
        0.32 s/m for steel, bronze or ivory.

    Returns
    -------
    Law
        r(v), exact to 1e-13 at any D v, with its derivative.

    Raises
    ------
    ValueError
        D is negative or not a number.

    Notes
    -----
    Since r tends to 1 at low speed, bounces under a constant acceleration a decay at the rate D a/3, but never end (see
    the page on restitution).

    References
    ----------
    K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, Journal of
    Applied Mechanics 42 (1975) 440-445; the equation, for n = 3/2: D. W. Marhefka and D. E. Orin, IEEE Transactions on
    Systems, Man, and Cybernetics A 29 (1999) 566-572.

    Examples
    --------
    >>> round(hunt_crossley(damping=1.0)(1.0), 14)
    0.59362426004004
    """
    return Law("hunt_crossley", {"damping": damping})


def kelvin_voigt(*, damping_ratio: float) -> Law:
    r"""Return the restitution of a spring and damper that separate when their force has fallen to zero.

    .. math:: r = \exp\left(-\frac{2 \zeta \arccos \zeta}{\sqrt{1 - \zeta^2}}\right)

    and, for zeta > 1, the same with arcosh and the root of zeta^2 - 1. It does not depend on speed. A compliant stop
    tends to it as its `stiffness` grows at a fixed damping ratio.

    Parameters
    ----------
    damping_ratio : float, >= 0
        zeta = c/(2 sqrt(k m)) of the contact, where m is the mass that hits the stop.

    Returns
    -------
    Law
        r, the same at all speeds.

    Raises
    ------
    ValueError
        The ratio is negative or not a number.

    Notes
    -----
    The force k d + c d' reaches zero at w_d t = 2 arccos(zeta). The common formula exp(-pi zeta/sqrt(1 - zeta^2)) ends
    the contact only at zero penetration, when the damper already pulls.

    References
    ----------
    T. Schwager and T. Poschel, Coefficient of restitution and linear-dashpot model revisited, Granular Matter 9 (2007)
    465-469.

    Examples
    --------
    >>> round(kelvin_voigt(damping_ratio=0.2)(3.0), 12)
    0.571740027585
    """
    return Law("kelvin_voigt", {"damping_ratio": damping_ratio})


def piecewise(speeds: Any, values: Any) -> Law:
    """Return a measured restitution as a smooth curve through a table, constant outside it.

    Parameters
    ----------
    speeds : sequence of float, >= 0
        Two or more in m/s, ascending.
    values : sequence of float, 0 to 1
        r at each speed.

    Returns
    -------
    Law
        r(v) with its derivative: monotone cubics that do not overshoot the table, continuously differentiable between
        the first and the last speed.

    Raises
    ------
    ValueError
        The lists differ in length, speeds do not ascend, or a value is out of its range.

    References
    ----------
    F. N. Fritsch and J. Butland, A method for constructing local monotone piecewise cubic interpolants, SIAM Journal on
    Scientific and Statistical Computing 5 (1984) 300-304: SciPy's `PchipInterpolator`.

    Examples
    --------
    >>> law = piecewise(speeds=[0.1, 0.5, 2.0], values=[0.9, 0.8, 0.6])
    >>> law([0.01, 0.5, 1.0, 5.0]).round(4).tolist()
    [0.9, 0.8, 0.7117, 0.6]
    """
    return Law("piecewise", {"speeds": speeds, "values": values})


def law_of(value: Any) -> Any:
    """Return the law that a Python function or the result of `Law.plain` stands for, and other values unchanged.

    A function takes the speed alone, in Python that numba compiles. Its derivative is a finite difference, accurate to
    1e-9 of r/v where the function is smooth. A function in `plain` form is found again if this process has seen it
    before; otherwise, the table of its values replaces it.

    Raises
    ------
    ValueError
        The function fails, or does not return a number from 0 to 1, at one of 111 speeds from 1e-9 to 100 m/s.

    Examples
    --------
    >>> law_of(lambda v: 0.9 / (1.0 + v))(0.5)
    0.6
    >>> law_of(lambda v: 2.0)
    Traceback (most recent call last):
    ValueError: `restitution` must be between 0 and 1, got 2.0 at a speed of 1e-09 m/s; limit it with min and max
    """
    if isinstance(value, Mapping):
        arguments = {name: entry for name, entry in value.items() if name not in ("law", "mark")}
        return LAWS.get(value.get("mark", 0.0)) or Law("piecewise" if "mark" in value else value["law"], arguments)
    if isinstance(value, Law) or not callable(value):
        return value
    return Law("function", {"function": value})


def _hunt_crossley(damping: Any) -> _Formula:
    """With x = D v and y = r x the law is x - ln(1 + x) = -y - ln(1 - y); the unknown is L = -ln(1 - y)."""
    number = Parameter("damping", "damping", low=0.0).check(damping)
    return _Formula(lambda compiled, entry: _of_hunt_crossley, number, None if number else 1.0)


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


def _kelvin_voigt(damping_ratio: Any) -> _Formula:
    zeta = Parameter("damping_ratio", "damping ratio", low=0.0).check(damping_ratio)
    root = math.sqrt(abs((1.0 - zeta) * (1.0 + zeta)))
    half = math.atan2(root, zeta) if zeta < 1.0 else math.asinh(root)  # half the duration of contact, times w_d
    constant = math.exp(-2.0 * zeta * (half / root if root else 1.0))
    return _Formula(lambda compiled, entry: lambda v, number, order: 0.0 if order else constant, constant=constant)


def _piecewise(speeds: Any, values: Any) -> _Formula:
    from scipy.interpolate import PchipInterpolator

    knots, heights = numbers("speeds", speeds, 1), numbers("values", values, 1)
    if len(knots) != len(heights) or len(knots) < 2:
        raise ValueError(f"`speeds` and `values` must be equally long, at least 2, got {len(knots)} and {len(heights)}")
    if knots[0] < 0.0 or not (np.diff(knots) > 0.0).all():
        raise invalid("speeds", knots.tolist(), "ascending numbers >= 0")
    if heights.min() < 0.0 or heights.max() > 1.0:
        raise invalid("values", heights.tolist(), "numbers from 0 to 1")
    cubics = PchipInterpolator(knots, heights).c.T
    return _Formula(_of_table, table=np.concatenate([[len(knots)], heights[[0, -1]], knots, cubics.ravel()]))


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


def _function(function: Any) -> _Formula:
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

    return _Formula(rule)


_MAKERS: dict[str, Callable[..., _Formula]] = {
    "hunt_crossley": _hunt_crossley,
    "kelvin_voigt": _kelvin_voigt,
    "piecewise": _piecewise,
    "function": _function,
}


def _mark(value: Any) -> float:
    return float(int(fingerprint(value)[:13], 16))


def _kept(value: Any) -> Any:
    plain = np.asarray(value, np.float64).tolist()
    return tuple(plain) if isinstance(plain, list) else plain
