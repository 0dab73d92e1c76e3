"""Laws of restitution of rigid stops, and their representation in files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from vibroimpact.by_value import ByValue, written
from vibroimpact.cells import Floats
from vibroimpact.contact.fingerprint import fingerprint
from vibroimpact.contact.rules import MAKERS, TRIED
from vibroimpact.parameters import invalid

LAWS: dict[float, Law] = {}  # by their marks, which tables of cells hold as numbers


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
    formula: Any  # how it is computed, a `rules.Formula`
    code: float  # identifies the compiled code: a whole number below 2^53
    mark: float  # identifies the law, except for its number

    def __init__(self, kind: str, given: Mapping[str, Any]) -> None:
        formula = MAKERS[kind](**given)
        arguments = {name: value if callable(value) else _kept(value) for name, value in given.items()}
        whole = _mark((kind, *arguments.values()))
        code = whole if kind == "function" else _mark(kind)
        mark = code if formula.number else whole
        vars(self).update(kind=kind, given=MappingProxyType(arguments), formula=formula, code=code, mark=mark)

    @property
    def constant(self) -> float | None:
        """The value of r if it is the same at all speeds, else None."""
        constant: float | None = self.formula.constant
        return constant

    @property
    def number(self) -> float:
        """The number that is passed to the rule."""
        return float(self.formula.number)

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


def _mark(value: Any) -> float:
    return float(int(fingerprint(value)[:13], 16))


def _kept(value: Any) -> Any:
    plain = np.asarray(value, np.float64).tolist()
    return tuple(plain) if isinstance(plain, list) else plain
