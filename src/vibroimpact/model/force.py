"""The periodic force on a system, vectors over its coordinates or points, and the zeros of sums of harmonics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from vibroimpact.by_value import ByValue
from vibroimpact.cells import Floats
from vibroimpact.matrices import numbers
from vibroimpact.parameters import OF_ONE_MASS, counted, hertz, invalid, radians, whole_number


def vector(name: str, value: Any, kind: type = np.float64) -> Any:
    """Return a vector over the coordinates, read-only, or a mapping from names of points to numbers."""
    if type(value) is float or not isinstance(value, Mapping):
        return numbers(name, value, 1, kind)
    if not value:
        raise invalid(name, value, "a list of numbers, or a mapping from names of points to numbers")
    return MappingProxyType({key: numbers(f"{name}[{key!r}]", entry, 0, kind).item() for key, entry in value.items()})


def check_length(name: str, value: Any, n: int) -> None:
    """Raise unless a vector has n numbers, one per coordinate."""
    if isinstance(value, np.ndarray) and len(value) == n:
        return
    wanted = f"{counted(n, 'number')}, one per coordinate"
    if isinstance(value, np.ndarray):
        raise ValueError(f"`{name}` must have {wanted}, got {len(value)}")
    points = ", ".join(map(str, value))
    raise ValueError(f"`{name}` refers to points ({points}), but the system has none; give it `points`, or {wanted}")


def by_order(name: str, amplitudes: Any) -> dict[int, Any]:
    """Return the values by the order of the harmonic, ascending."""
    if amplitudes is None:
        return {}
    if type(amplitudes) is not dict and not isinstance(amplitudes, Mapping):
        raise invalid(name, amplitudes, "a mapping from the order of a harmonic to its amplitude", "write {1: ...}")
    return dict(sorted((whole_number(f"{name} key", order, 1), value) for order, value in amplitudes.items()))


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Force(ByValue):
    r"""The load on a system: a constant and any number of harmonics of one frequency.

    .. math:: p(t) = p_0 + \sum_h \mathrm{Im}\left(p_h e^{i h \omega t}\right)

    Parameters
    ----------
    omega : float, > 0, optional
        Angular frequency in rad/s. It also applies to moving stops, and it sets the period T = 2 pi/omega even if the
        first harmonic is missing. A constant load needs none, and a system without one has no period.
    frequency : float, > 0
        Frequency in Hz, instead of `omega`.
    harmonics : mapping of int to sequence of n complex
        p_h in N by the order h >= 1: a real number is a sine, an imaginary one a cosine.
    constant : sequence of n float, optional
        p_0 in N; zero by default.

    Raises
    ------
    ValueError
        Both `omega` and `frequency` are given, or neither for harmonics; a number is out of range, or an order is not a
        whole number >= 1.

    Notes
    -----
    For one coordinate, numbers may replace sequences. In a system with named points, mappings from their names to
    forces replace them.

    Examples
    --------
    >>> Force(omega=112.0, harmonics={1: [5.0, 0.0], 3: [0.2j, 0.0]}).harmonics[3]
    array([0.+0.2j, 0.+0.j ])
    >>> Force(frequency=50.0, constant=-9.81)
    Force(omega=314.1592653589793, constant=[-9.81])
    >>> Force(constant=-9.81)
    Force(constant=[-9.81])
    """

    omega: float | None
    harmonics: Mapping[int, Any]
    constant: Any

    def __init__(
        self,
        *,
        omega: float | None = None,
        frequency: float | None = None,
        harmonics: Mapping[int, Any] | None = None,
        constant: Any = None,
    ) -> None:
        given = (omega is not None) + (frequency is not None)
        if given == 2 or (harmonics and not given):
            raise ValueError(
                f"give either `omega` (rad/s) or `frequency` (Hz), got {omega!r} and {frequency!r}; "
                "the harmonics are multiples of it"
            )
        if frequency is not None:
            omega = radians(OF_ONE_MASS["frequency"].check(frequency))
        vectors = {
            order: vector(f"harmonics[{order}]", value, np.complex128)
            for order, value in by_order("harmonics", harmonics).items()
        }
        vars(self).update(  # the constructor of a frozen class must do this; it is fast, since families make thousands
            omega=None if omega is None else OF_ONE_MASS["omega"].check(omega),
            harmonics=MappingProxyType(vectors),
            constant=None if constant is None else vector("constant", constant),
        )

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the constructor by name."""
        return {"omega": self.omega, "harmonics": dict(self.harmonics), "constant": self.constant}

    @property
    def frequency(self) -> float | None:
        """Frequency in Hz, if there is one."""
        return None if self.omega is None else float(hertz(self.omega))

    @property
    def rate(self) -> float:
        """`omega`; without one, the 1 rad/s at which time is counted."""
        return 1.0 if self.omega is None else self.omega

    def at(self, angle: Any, n: int) -> Any:
        """Return the force on each of n coordinates in N, one row per driving angle w t."""
        turn = np.multiply.outer(1j * np.asarray(angle, np.float64), np.ones(n))
        waves = sum((wave * np.exp(order * turn)).imag for order, wave in self.harmonics.items())
        return waves + (np.zeros(n) if self.constant is None else self.constant) + 0.0 * turn.real

    @property
    def vectors(self) -> dict[str, Any]:
        """The vectors over coordinates or points, by name."""
        vectors = {f"harmonics[{order}]": value for order, value in self.harmonics.items()}
        return vectors | ({} if self.constant is None else {"constant": self.constant})


def checked_force(force: Any) -> Force:
    """Return a Force, after checking it; for None, one without a load and without a frequency."""
    if force is None:
        return Force()
    if not isinstance(force, Force):
        raise invalid("force", force, "a Force", "leave it out for an unforced system")
    return force


def turning_values(orders: Floats, factors: Any) -> tuple[Floats, Floats]:
    """Return 0 and the angles at which the sum of Im(factor e^{i h x}) turns, and its values there."""
    angles = np.array([0.0, *angles_of_zeros(orders, 0.0, 1j * orders * factors)])
    return angles, (np.exp(1j * np.outer(angles, orders)) @ factors).imag


def angles_of_zeros(orders: Floats, level: float, factors: Any) -> list[float]:
    """Return the angles in [0, 2 pi) of all zeros z of level + sum of (factor z^h - its conjugate z^-h)/(2i)."""
    top = int(orders.max(initial=0.0))
    series = np.zeros(2 * top + 1, complex)
    series[top] = level
    for order, factor in zip(orders.astype(int), factors, strict=True):
        series[top + order], series[top - order] = factor / 2j, -np.conj(factor) / 2j
    while len(series) > 1 and abs(series[-1]) <= np.finfo(np.float64).eps * np.abs(series).max():
        series = series[1:-1]
    if len(series) < 2:
        return []
    turn = 2.0 * np.pi
    return [float(angle) for angle in np.angle(np.roots(series[::-1])) % turn if angle < turn]
