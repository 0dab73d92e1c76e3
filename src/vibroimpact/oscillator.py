"""The seven numbers of an impact oscillator, and the state it starts from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from typing import Any

from vibroimpact.parameters import real_number

PARAMETERS = ("mass", "damping", "stiffness", "amplitude", "omega", "restitution", "gap")
_SYMBOLS = {**dict(zip("mckfwrg", PARAMETERS, strict=True)), "zeta": "damping_ratio"}
STAND_FOR = {"frequency": "omega", "damping_ratio": "damping"}  # a name in whose place another may be given

# name: (lower bound, bound itself allowed, upper bound, what to do about a refused value)
_RANGES: dict[str, tuple[float, bool, float, str]] = {
    "mass": (0.0, False, math.inf, "give the moving mass in kg"),
    "damping": (0.0, True, math.inf, "a damper takes energy out; use 0 for none"),
    "damping_ratio": (0.0, True, math.inf, "it is c / (2 sqrt(k m)), 0.01 for 1 % of critical damping"),
    "stiffness": (0.0, False, math.inf, "give the spring constant in N/m; without a spring there is no rest position"),
    "amplitude": (0.0, True, math.inf, "for the opposite sign start half a period later instead"),
    "omega": (0.0, False, math.inf, "give the angular driving frequency in rad/s, or `frequency` in Hz"),
    "frequency": (0.0, False, math.inf, "give the driving frequency in Hz, or `omega` in rad/s"),
    "restitution": (0.0, True, 1.0, "it is the speed after an impact over the speed before it"),
    "gap": (-math.inf, False, math.inf, "give the clearance in m; negative means preloaded against the stop"),
}


def _allowed(name: str) -> str:
    low, closed, high, _ = _RANGES[name]
    if math.isinf(low):
        return "any finite number"
    if math.isinf(high):
        return f"a finite number {'>=' if closed else '>'} {low:g}"
    return f"a number from {low:g} to {high:g}"


def nearest_parameter(name: str, allowed: Iterable[str] = tuple(_RANGES)) -> str:
    """Return the remedy for a name that is no parameter's: the one that was probably meant, also by its symbol."""
    close = [_SYMBOLS[name]] if name in _SYMBOLS else get_close_matches(name, list(allowed), 1)
    return f"did you mean {close[0]!r}?" if close else "check the spelling"


def _check_names(names: Mapping[str, Any]) -> None:
    for name in names:
        if name not in _RANGES:
            raise ValueError(
                f"`{name}` is no parameter of the oscillator; allowed are "
                f"{', '.join(PARAMETERS)}, {' and '.join(STAND_FOR)}; {nearest_parameter(name)}"
            )


def _check_one(name: str, value: Any, other: str, other_value: Any, remedy: str) -> None:
    if value is not None and other_value is not None:
        raise ValueError(f"`{name}` is {value!r} and `{other}` is {other_value!r}; allowed is one of the two; {remedy}")


def parameter_value(name: str, value: Any) -> float:
    """Return a parameter as a float inside its range, or raise `ValueError` naming range and remedy."""
    low, closed, high, remedy = _RANGES[name]
    number = real_number(name, value, _allowed(name), remedy)
    if number < low or number > high or (number == low and not closed):
        raise ValueError(f"`{name}` is {value!r}; allowed is {_allowed(name)}; {remedy}")
    return number


@dataclass(frozen=True, init=False)
class ImpactOscillator:
    r"""One mass on a spring and damper, shaken by a sine, in front of a stop.

    .. math:: m \ddot y + c \dot y + k y = f \sin \omega t \quad (y < g), \qquad
              \dot y \to -r \dot y \quad (y = g,\ \dot y > 0)

    Parameters
    ----------
    mass : float, > 0
        m in kg.
    damping : float, >= 0
        c in N s/m; 0.01 unless `damping_ratio` is given.
    stiffness : float, > 0
        k in N/m.
    amplitude : float, >= 0
        f, amplitude of the driving force in N.
    omega : float, > 0
        w, angular driving frequency in rad/s; 2 unless `frequency` is given.
    restitution : float, 0 to 1
        r, speed after an impact over speed before it.
    gap : float
        g, clearance in m from the rest position to the stop; negative means preloaded.
    frequency : float, > 0
        Driving frequency in Hz, in place of `omega`; both at once is an error.
    damping_ratio : float, >= 0
        zeta = c / (2 sqrt(k m)), in place of `damping`; both at once is an error.

    Raises
    ------
    ValueError
        A parameter is misnamed, out of its range, infinite, NaN or text.

    Notes
    -----
    All seven numbers may equally be dimensionless. The defaults are those of Lee's paper, section 3.

    Examples
    --------
    >>> osc = ImpactOscillator(omega=2.8)
    >>> osc.natural_frequency, osc.damping_ratio
    (1.0, 0.005)
    >>> round(osc.replace(frequency=0.5).omega, 6)
    3.141593
    """

    mass: float
    damping: float
    stiffness: float
    amplitude: float
    omega: float
    restitution: float
    gap: float

    def __init__(
        self,
        *,
        mass: float = 1.0,
        damping: float | None = None,
        stiffness: float = 1.0,
        amplitude: float = 1.0,
        omega: float | None = None,
        restitution: float = 0.8,
        gap: float = 0.0,
        frequency: float | None = None,
        damping_ratio: float | None = None,
        **misnamed: Any,
    ) -> None:
        _check_names(misnamed)
        _check_one("omega", omega, "frequency", frequency, "keep `omega` for rad/s or `frequency` for Hz")
        _check_one("damping", damping, "damping_ratio", damping_ratio, "keep c or zeta")
        if frequency is not None:
            omega = 2.0 * math.pi * parameter_value("frequency", frequency)
        if damping_ratio is not None:
            critical = 2.0 * math.sqrt(parameter_value("stiffness", stiffness) * parameter_value("mass", mass))
            damping = parameter_value("damping_ratio", damping_ratio) * critical
        damping, omega = 0.01 if damping is None else damping, 2.0 if omega is None else omega
        given = (mass, damping, stiffness, amplitude, omega, restitution, gap)
        for name, value in zip(PARAMETERS, given, strict=True):
            object.__setattr__(self, name, parameter_value(name, value))

    def replace(self, **changes: float) -> ImpactOscillator:
        """Return a copy with some parameters changed; `frequency` (Hz), `damping_ratio` may stand for theirs."""
        _check_names(changes)
        for name, value in changes.items():  # None, which the constructor takes for nothing given, is no value
            parameter_value(name, value)
        dropped = {STAND_FOR.get(name) for name in changes}
        kept = {name: value for name, value in asdict(self).items() if name not in dropped}
        return ImpactOscillator(**{**kept, **changes})

    @property
    def frequency(self) -> float:
        """Driving frequency in Hz."""
        return self.omega / (2.0 * math.pi)

    @property
    def period(self) -> float:
        """Driving period T = 2 pi / w in s."""
        return 2.0 * math.pi / self.omega

    @property
    def natural_frequency(self) -> float:
        """Undamped natural angular frequency w_n = sqrt(k/m) in rad/s."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def damping_ratio(self) -> float:
        """Damping over critical damping, c / (2 sqrt(k m)); 1 is critical."""
        return self.damping / (2.0 * math.sqrt(self.stiffness * self.mass))

    @property
    def steady_amplitude(self) -> float:
        """Amplitude R in m of the steady motion without a stop; infinite at undamped resonance."""
        inertia = self.stiffness - self.mass * self.omega**2
        impedance = math.hypot(inertia, self.damping * self.omega)
        return math.inf if impedance == 0.0 else self.amplitude / impedance

    @property
    def velocity_scale(self) -> float:
        """Scale V = max(f, k |g|) / sqrt(k m) in m/s of every relative tolerance."""
        force = max(self.amplitude, self.stiffness * abs(self.gap))
        return force / math.sqrt(self.stiffness * self.mass)

    def dimensionless(self) -> tuple[ImpactOscillator, dict[str, float]]:
        """Return the same oscillator with m = k = 1 and f = 1 (g = +-1 if unforced), and its units.

        The dictionary holds the size of one unit of `time` (s), `displacement` (m) and `velocity` (m/s).
        """
        force = max(self.amplitude, 0.0) or self.stiffness * abs(self.gap) or 1.0
        time, length = 1.0 / self.natural_frequency, force / self.stiffness
        scaled = ImpactOscillator(
            mass=1.0,
            stiffness=1.0,
            damping=2.0 * self.damping_ratio,
            amplitude=self.amplitude / force,
            omega=self.omega * time,
            restitution=self.restitution,
            gap=self.gap / length,
        )
        return scaled, {"time": time, "displacement": length, "velocity": length / time}


def check_oscillator(osc: Any) -> None:
    """Refuse what is no `ImpactOscillator`."""
    if not isinstance(osc, ImpactOscillator):
        raise ValueError(
            f"`osc` is {osc!r}; allowed is an ImpactOscillator; write for example ImpactOscillator(mass=1.0, omega=2.8)"
        )


@dataclass(frozen=True)
class State:
    """Where the mass is, how fast it moves towards the stop, and when.

    Parameters
    ----------
    displacement : float
        y in m; at most the gap.
    velocity : float
        y' in m/s; at the stop, > 0 is an impact at this very time.
    time : float
        t in s; the force is f sin(w t).

    Examples
    --------
    >>> State(-1.0)
    State(displacement=-1.0, velocity=0.0, time=0.0)
    """

    displacement: float
    velocity: float = 0.0
    time: float = 0.0

    def __post_init__(self) -> None:
        for name in ("displacement", "velocity", "time"):
            object.__setattr__(self, name, real_number(name, getattr(self, name)))
