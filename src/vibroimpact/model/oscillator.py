"""An impact oscillator: one mass, one stop, seven numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from vibroimpact.model import State, check_model, check_names
from vibroimpact.parameters import (
    CRITICAL,
    OF_ONE_MASS,
    Parameter,
    Scale,
    check_one,
    critical_damping,
    hertz,
    invalid,
    radians,
)

if TYPE_CHECKING:
    from vibroimpact.cells import Cells, Floats
    from vibroimpact.model.modal import ModalForm
    from vibroimpact.model.stops import Stop
    from vibroimpact.model.system import ImpactSystem

_AS_SYSTEM = (
    "write ImpactSystem(mass=m, damping=c, stiffness=k, force=Force(omega=w, harmonics={1: f}), "
    "stops=[Stop(direction=1.0, gap=g, restitution=law)]) for a law of restitution"
)
PARAMETERS = tuple(name for name, parameter in OF_ONE_MASS.items() if parameter.replaces is None)


@dataclass(frozen=True, init=False)
class ImpactOscillator:
    r"""One mass on a spring and damper, driven by a sine, in front of a stop.

    .. math:: m \ddot y + c \dot y + k y = f \sin \omega t \quad (y < g), \qquad
              \dot y \to -r \dot y \quad (y = g,\ \dot y > 0)

    Parameters
    ----------
    mass : float, > 0
        m in kg.
    damping : float, >= 0
        c in N s/m; 0.01 by default, unless `damping_ratio` is given.
    stiffness : float, > 0
        k in N/m.
    amplitude : float, >= 0
        f, amplitude of the driving force in N.
    omega : float, > 0
        w, angular driving frequency in rad/s; 2 by default, unless `frequency` is given.
    restitution : float, 0 to 1
        r, speed after an impact over speed before it.
    gap : float
        g, clearance in m from the rest position to the stop; negative means preloaded.
    frequency : float, > 0
        Driving frequency in Hz, instead of `omega`; do not give both.
    damping_ratio : float, >= 0
        zeta = c / (2 sqrt(k m)), instead of `damping`; do not give both.

    Raises
    ------
    ValueError
        A parameter is unknown, out of range, infinite, NaN or text.

    Notes
    -----
    All seven numbers may also be dimensionless. The defaults are those of Lee's paper, section 3.

    Examples
    --------
    >>> osc = ImpactOscillator(omega=2.8)
    >>> osc.natural_frequency, osc.damping_ratio
    (1.0, 0.005)
    >>> round(osc.replace(frequency=0.5).omega, 6)
    3.141593
    """

    parameters: ClassVar[Mapping[str, Parameter]] = OF_ONE_MASS
    kind: ClassVar[str] = "oscillator"  # its name in files
    at_rest: ClassVar[str] = "rest at y = min(0, gap)"
    coordinates: ClassVar[int] = 1
    stop_names: ClassVar[tuple[str, ...]] = ("stop",)
    groups: ClassVar[tuple[str, ...]] = stop_names
    says_all: ClassVar[bool] = True  # its parameters are all its numbers
    forgets: ClassVar[bool] = True  # phase and velocity of an impact are the whole state; a rest erases all memory
    step_cost: ClassVar[int] = 1  # cost of a certified step, the unit for other models
    offsets: ClassVar[tuple[str, ...]] = ("gap",)  # parameters that may be zero like any other value

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
        check_names(self.parameters, misnamed)
        if callable(restitution):
            raise invalid("restitution", restitution, "a number", _AS_SYSTEM)
        check_one("omega", omega, "frequency", frequency)
        check_one("damping", damping, "damping_ratio", damping_ratio)
        check = {name: parameter.check for name, parameter in self.parameters.items()}
        if frequency is not None:
            omega = radians(check["frequency"](frequency))
        if damping_ratio is not None:
            critical = critical_damping(check["stiffness"](stiffness), check["mass"](mass))
            damping = check["damping_ratio"](damping_ratio) * critical
        damping, omega = 0.01 if damping is None else damping, 2.0 if omega is None else omega
        numbers = (mass, damping, stiffness, amplitude, omega, restitution, gap)
        for name, value in zip(PARAMETERS, numbers, strict=True):
            object.__setattr__(self, name, check[name](value))

    def replace(self, **changes: float) -> ImpactOscillator:
        """Return a copy with changed parameters; `frequency` (Hz) and `damping_ratio` replace `omega` and `damping`."""
        check_names(self.parameters, changes)
        for name, value in changes.items():  # the constructor takes None for "not given"; here it is refused
            self.parameters[name].check(value)
        dropped = {self.parameters[name].replaces for name in changes}
        kept = {name: value for name, value in self.values.items() if name not in dropped}
        return ImpactOscillator(**{**kept, **changes})

    @property
    def values(self) -> dict[str, float]:
        """The seven numbers by name."""
        return {name: getattr(self, name) for name in PARAMETERS}

    def plain(self) -> dict[str, Any]:
        """Return its numbers by name, as files store them."""
        return self.values

    @cached_property
    def system(self) -> ImpactSystem:
        """The same oscillator as a system of one coordinate in front of one rigid stop."""
        from vibroimpact.model.force import Force
        from vibroimpact.model.stops import Stop
        from vibroimpact.model.system import ImpactSystem

        force = Force(omega=self.omega, harmonics={1: self.amplitude})
        stop = Stop(direction=1.0, gap=self.gap, restitution=self.restitution, name=self.stop_names[0])
        linear: dict[str, Any] = {"mass": self.mass, "damping": self.damping, "stiffness": self.stiffness}
        return ImpactSystem(**linear, force=force, stops=[stop])

    @property
    def stops(self) -> tuple[Stop, ...]:
        """Its stop, in the form that systems use."""
        return self.system.stops

    def initial(self, start: State | None = None, argument: str = "start") -> tuple[Floats, Floats, float]:
        """Return displacement, velocity and time of an initial condition after checking it, as systems do."""
        return self.system.initial(start, argument)

    def modal(self) -> ModalForm:
        """Return the oscillator in its modal coordinate, as systems do."""
        return self.system.modal()

    def at(self, **values: float) -> ImpactOscillator:
        """Return the oscillator with some parameters changed: the design at one point of the axes."""
        return self.replace(**values) if values else self

    def cells(self, points: Mapping[str, Any], start: State | None = None) -> Cells:
        """Return one cell per point, all with the same initial condition; None means at rest at min(0, gap) at time 0.

        `points` holds the values of some parameters, arrays of equal length; without parameters there is one cell.
        """
        import numpy as np

        from vibroimpact.cells import Cells

        shape = np.shape(next(iter(points.values()), 0.0))
        columns = {name: np.full(shape, points.get(name, getattr(self, name))) for name in PARAMETERS}
        if "frequency" in points:
            columns["omega"] = radians(points["frequency"])
        if "damping_ratio" in points:
            columns["damping"] = points["damping_ratio"] * (2.0 * np.sqrt(columns["stiffness"] * columns["mass"]))
        return Cells.at_rest(columns).begun(start)

    @staticmethod
    def cells_of(designs: Iterable[ImpactOscillator]) -> Cells:
        """Return one cell per design, all at rest."""
        import numpy as np

        from vibroimpact.cells import Cells

        rows = list(designs)
        return Cells.at_rest({name: np.array([getattr(design, name) for design in rows]) for name in PARAMETERS})

    @property
    def rest(self) -> State:
        """The default initial condition: at rest."""
        return State(min(0.0, self.gap))

    @property
    def periodic(self) -> bool:
        """Whether there is a driving period; `omega` always has a value."""
        return True

    @property
    def frequency(self) -> float:
        """Driving frequency in Hz."""
        return float(hertz(self.omega))

    @property
    def period(self) -> float:
        """Driving period T = 2 pi / w in s."""
        return 2.0 * math.pi / self.omega

    @property
    def natural_frequency(self) -> float:
        """Undamped natural angular frequency w_n = sqrt(k/m) in rad/s."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def slowest_frequency(self) -> float:
        """The natural angular frequency in rad/s, the only one."""
        return self.natural_frequency

    @property
    def damping_ratio(self) -> float:
        """Damping over critical damping, c / (2 sqrt(k m)); 1 is critical."""
        return self.damping / critical_damping(self.stiffness, self.mass)

    @property
    def energy_changes(self) -> str:
        """Why the energy of its motions is not constant; empty if it is."""
        return self.system.energy_changes

    @property
    def steady_amplitude(self) -> float:
        """Amplitude R in m of the steady motion without a stop; infinite at undamped resonance."""
        inertia = self.stiffness - self.mass * self.omega**2
        impedance = math.hypot(inertia, self.damping * self.omega)
        return math.inf if impedance == 0.0 else self.amplitude / impedance

    @property
    def steady_state(self) -> State:
        """State at time 0 of the steady motion without a stop, Im(f H e^(i w t)) with H = 1/(k - m w^2 + i c w)."""
        if not self.amplitude:
            return State(0.0)
        inertia = self.stiffness - self.mass * self.omega**2
        impedance = inertia**2 + (self.damping * self.omega) ** 2
        sine, cosine = (self.amplitude * part / impedance for part in (inertia, -self.damping * self.omega))
        return State(cosine, sine * self.omega)

    @property
    def velocity_scale(self) -> float:
        """Scale V = max(f, k |g|) / sqrt(k m) in m/s of every relative tolerance."""
        force = max(self.amplitude, self.stiffness * abs(self.gap))
        return force / math.sqrt(self.stiffness * self.mass)

    def scales(self) -> dict[str, Scale]:
        """Return the sizes that relative changes of parameters refer to when a parameter is 0, by name."""
        critical = critical_damping(self.stiffness, self.mass)
        return {
            "damping": Scale(critical, CRITICAL),
            "damping_ratio": Scale(1.0, CRITICAL),
            "amplitude": Scale(self.stiffness * abs(self.gap), "k |g|"),
            "restitution": Scale(1.0, "1"),
            "gap": Scale(self.amplitude / self.stiffness, "f/k"),
        }

    def dimensionless(self) -> tuple[ImpactOscillator, dict[str, float]]:
        """Return the same oscillator with m = k = 1 and f = 1 (g = +-1 if unforced), and its units.

        The dictionary holds one unit of `time` in s, of `displacement` in m and of `velocity` in m/s.
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


def the_oscillator(model: Any) -> ImpactOscillator:
    """Return the oscillator of a model at its own values; raise if it is a system.

    Some methods hold only for one mass and one stop: a rest erases all memory, so that two rests close a cycle and all
    motions with rests are one attractor; velocity and phase of an impact are the whole state.
    """
    check_model(model)
    osc: ImpactOscillator = model.at()
    if not osc.forgets:
        raise ValueError(
            f"`osc` must be one mass with one stop, got {osc!s}; for systems use simulate, impact_section, "
            "stroboscopic_section, bifurcation_diagram, parameter_map, attractors, basins or describe"
        )
    return osc
