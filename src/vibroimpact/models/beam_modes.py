"""The bending modes of uniform beams, exact to rounding up to high modes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.parameters import choice, hertz, invalid

_EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class BeamModes:
    r"""The first modes of a uniform Euler-Bernoulli beam with given end conditions.

    .. math:: \phi(x) = A \cos \beta x + B \sin \beta x + C e^{-\beta x} + D e^{-\beta (L - x)}, \qquad
              \frac{1}{L} \int_0^L \phi_i \phi_j \, dx = \delta_{ij}

    The natural angular frequencies are (beta L)^2 sqrt(E I / (m' L^4)), where m' is the mass per length. Divided by the
    root of the beam's mass, phi is mass-normalised. A mode with beta L = 0 turns the rigid beam about x = 0; its shape
    is sqrt(3) x/L.

    Parameters
    ----------
    wave_numbers : (n,) array
        beta L, ascending.
    cosine, sine, decaying, growing : (n,) array
        A, B, C, D: no term exceeds a few units, so that nothing cancels in high modes, as it does with cosh and sinh.
    """

    wave_numbers: Floats
    cosine: Floats
    sine: Floats
    decaying: Floats
    growing: Floats

    def __post_init__(self) -> None:
        for value in vars(self).values():
            value.setflags(write=False)

    def at(self, place: float) -> Floats:
        """Return phi of all modes at a place x/L; exactly 0 at fixed ends and at nodes."""
        b = self.wave_numbers
        z = b * place
        waves = self.cosine * np.cos(z) + self.sine * np.sin(z)
        bent = self._clean(waves + self.decaying * np.exp(-z) + self.growing * np.exp(z - b))
        return np.where(b > 0.0, bent, math.sqrt(3.0) * place)

    @property
    def means(self) -> Floats:
        """Means of phi over the length: the participation of each mode in a uniform load; exactly 0 for odd shapes."""
        b = self.wave_numbers
        far = self.cosine * np.sin(b) - self.sine * np.cos(b) - self.decaying * np.exp(-b) + self.growing
        near = -self.sine - self.decaying + self.growing * np.exp(-b)
        rigid = np.full(len(b), math.sqrt(0.75))
        means: Floats = np.divide(self._clean(far - near), b, out=rigid, where=b > 0.0)
        return means

    def hertz(self, rigidity: float, mass_per_length: float, length: float) -> Floats:
        """Return the natural frequencies in Hz, given E I in N m^2, the mass per length in kg/m and the length in m."""
        rate = math.sqrt(rigidity / mass_per_length) / length**2
        frequencies: Floats = self.wave_numbers**2 * hertz(rate)
        return frequencies

    def _clean(self, values: Floats) -> Floats:
        cleaned: Floats = np.where(np.abs(values) <= 8.0 * _EPS * self.wave_numbers, 0.0, values)
        return cleaned


@lru_cache(maxsize=64)
def beam_modes(ends: str, count: int) -> BeamModes:
    r"""Return the first modes of a beam.

    Parameters
    ----------
    ends : str
        ``"clamped-free"``, ``"clamped-clamped"``, ``"clamped-pinned"``, ``"pinned-pinned"`` or ``"pinned-free"``; the
        end at x = 0 first.
    count : int
        The number of modes. The first one of a pinned-free beam is its rigid rotation, of frequency zero.

    Returns
    -------
    BeamModes
        Wave numbers are accurate to 1e-15 relatively, and shapes to a few rounding errors of beta L.

    Notes
    -----
    The characteristic equations, cos b cosh b = -1, cos b cosh b = 1, tan b = tanh b (also of pinned-free beams) and
    sin b = 0 for b = beta L, are solved in bounded forms, such as cos b + 1/cosh b = 0, between b0 - 1/2 and b0 + 1/2,
    where b0 are their roots for large b. With s = (sinh b - sin b)/(cosh b + cos b) for a cantilever, and similarly for
    the others, C = (1 + s)/2 and D = (1 - s) e^b/2 are written so that e^b cancels before it is computed.

    References
    ----------
    R. D. Blevins, Formulas for Natural Frequency and Mode Shape, 1979, table 8-1.

    Examples
    --------
    >>> beam_modes("clamped-free", 3).wave_numbers.round(10).tolist()
    [1.8751040687, 4.694091133, 7.8547574382]
    """
    choice("ends", ends, _ENDS)
    asymptote, equation, coefficients = _ENDS[ends]
    b = np.array([_root(equation, (n + asymptote) * math.pi) for n in range(1, count + 1)])
    return BeamModes(b, *coefficients(b))


def _root(equation: Callable[[float], float] | None, near: float) -> float:
    from scipy.optimize import brentq

    if equation is None:
        return near
    if near < 1.0:
        return 0.0  # a rigid rotation; the first bending mode of all other ends has b0 > 1.5
    return float(brentq(equation, near - 0.5, near + 0.5, xtol=1e-15, rtol=4.0 * _EPS))


def _clamped_free(b: Floats) -> tuple[Floats, ...]:
    decay, sine, cosine = np.exp(-b), np.sin(b), np.cos(b)
    growing = (decay + cosine + sine) / (1.0 + decay**2 + 2.0 * cosine * decay)
    return _clamped(b, growing)


def _clamped_clamped(b: Floats) -> tuple[Floats, ...]:
    decay, sine, cosine = np.exp(-b), np.sin(b), np.cos(b)
    growing = (cosine - sine - decay) / (1.0 - decay**2 - 2.0 * sine * decay)
    return _clamped(b, growing)


def _clamped_pinned(b: Floats) -> tuple[Floats, ...]:
    decay = np.exp(-b)
    return _clamped(b, -decay / (1.0 - decay**2))


def _clamped(b: Floats, growing: Floats) -> tuple[Floats, ...]:
    """Return the coefficients of cosh z - cos z - s (sinh z - sin z), whose mean square is 1, from D."""
    rest = growing * np.exp(-b)  # (1 - s)/2
    return -np.ones(len(b)), 1.0 - 2.0 * rest, 1.0 - rest, growing


def _pinned_free(b: Floats) -> tuple[Floats, ...]:
    """Return the coefficients of s (sin z/sin b + sinh z/sinh b), s = sign(sin b), whose mean square is 1."""
    bends = b > 0.0
    tanh = np.where(bends, np.tanh(b), 1.0)
    growing = np.sign(np.sin(b)) / np.where(bends, 1.0 - np.exp(-2.0 * b), 1.0)
    sine = bends * np.hypot(1.0, tanh) / tanh  # 1/|sin b|, where tan b = tanh b
    return np.zeros(len(b)), sine, -growing * np.exp(-b), growing


def _pinned_pinned(b: Floats) -> tuple[Floats, ...]:
    none = np.zeros(len(b))
    return none, np.full(len(b), math.sqrt(2.0)), none, none


# b0/pi - n, the characteristic equation (none if b0 is exact), and the coefficients
_ENDS: dict[str, tuple[float, Callable[[float], float] | None, Callable[[Floats], tuple[Floats, ...]]]] = {
    "clamped-free": (-0.5, lambda b: math.cos(b) + 1.0 / math.cosh(b), _clamped_free),
    "clamped-clamped": (0.5, lambda b: math.cos(b) - 1.0 / math.cosh(b), _clamped_clamped),
    "clamped-pinned": (0.25, lambda b: math.sin(b) - math.tanh(b) * math.cos(b), _clamped_pinned),
    "pinned-pinned": (0.0, None, _pinned_pinned),
    "pinned-free": (-0.75, lambda b: math.sin(b) - math.tanh(b) * math.cos(b), _pinned_free),
}


def moving_row(name: str, place: float, shapes: BeamModes) -> Floats:
    """Return phi of all modes at the place x/L of a stop, which must move."""
    row = shapes.at(place)
    if not row.any():
        raise invalid(name, place, "a place that moves", "keep stops away from fixed ends and from nodes of all modes")
    return row
