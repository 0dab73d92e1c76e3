"""A periodic orbit of a system, and how to make it from a solution of the equations."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.motion import cycle_name
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.orbit import Orbit, value_of
from vibroimpact.orbits.systems.admissibility import objection
from vibroimpact.orbits.systems.cycle import Cycle
from vibroimpact.orbits.systems.flow import Flow
from vibroimpact.orbits.systems.symmetry import mirror
from vibroimpact.oscillator import Model, State
from vibroimpact.stops import Stop
from vibroimpact.system import ImpactSystem


@dataclass(frozen=True)
class SystemOrbit:
    """A period-n impact-p motion, stable or not, of a system with rigid stops.

    Parameters
    ----------
    system : ImpactSystem
        The system that moves so.
    n_periods : int, >= 1
        Driving periods in a cycle.
    stops : tuple of str
        Names of the stops that are struck, in the order of time.
    turns : tuple of float
        Times of these impacts in driving periods, the first in [0, 1).
    velocities : tuple of float
        Rates at which clearances close just before contact, in m/s.
    impulses : tuple of float
        Impulses of the impacts in N s.
    start : State
        Coordinates, their rates and time just before the first impact.
    multipliers : tuple of 2n complex
        Floquet multipliers of the cycle in the coordinates and their rates, the largest first.
    half_multipliers : tuple of 2n complex
        Those of half a cycle and the mirror, if the orbit is its own mirror image half a cycle later; else empty.
    admissible : bool
        Whether the system can move so: no clearance below zero, every impact towards its stop.
    message : str
        Why it is inadmissible; empty if it is admissible.
    family : family, optional
        The family, at its own values, that the system was made by.

    Examples
    --------
    >>> from vibroimpact import Force, ImpactSystem, Stop
    >>> from vibroimpact.orbits.systems import find
    >>> ball = ImpactSystem(mass=1.0, stiffness=0.0, force=Force(omega=10.0, constant=-9.81),
    ...     stops=[Stop(direction=-1, gap=0.0, restitution=0.5, name="table", motion={1: 0.12})])
    >>> orbit = find(ball)[0]
    >>> orbit.name, orbit.stops, orbit.stable, round(orbit.velocities[0], 9)
    ('period-1 impact-1', ('table',), True, 4.109203191)
    """

    system: ImpactSystem
    n_periods: int
    stops: tuple[str, ...]
    turns: tuple[float, ...]
    velocities: tuple[float, ...]
    impulses: tuple[float, ...]
    start: State
    multipliers: tuple[complex, ...]
    half_multipliers: tuple[complex, ...] = ()
    admissible: bool = True
    message: str = ""
    family: Model | None = field(default=None, repr=False, compare=False)

    @property
    def model(self) -> Model:
        """The family that made the system, or the system itself."""
        return self.system if self.family is None else self.family

    def value(self, parameter: str) -> float:
        """Return the value of a parameter of its model."""
        return value_of(self.model, parameter)

    @property
    def sticks(self) -> bool:
        """Whether it rests at a stop: orbits of systems that do are not solved for."""
        return False

    @property
    def twin(self) -> SystemOrbit:
        """Its mirror image half a driving period later, a motion of the same system if that is symmetric.

        Raises
        ------
        ValueError
            The system is not symmetric; the message says why.
        """
        images, why = mirror(self.system)
        if why:
            raise ValueError(f"the orbit has no twin: its system is {why}")
        names, start, half = self.system.stop_names, self.start, 0.5 * self.system.period
        first = self.turns[0] + 0.5
        place, rate = (tuple(-number for number in part) for part in (start.displacement, start.velocity))
        state = State(place, rate, start.time + (half if first < 1.0 else -half))
        return replace(
            self,
            stops=tuple(names[images[names.index(stop)]] for stop in self.stops),
            turns=tuple(turn + first % 1.0 - self.turns[0] for turn in self.turns),
            start=state,
        )

    @property
    def n_impacts(self) -> int:
        """Impacts in a cycle."""
        return len(self.turns)

    @property
    def phases(self) -> tuple[float, ...]:
        """Driving phases of the impacts, in [0, 1)."""
        return tuple(turn % 1.0 for turn in self.turns)

    @property
    def symmetric(self) -> bool:
        """Whether the orbit is its own mirror image half a cycle later."""
        return bool(self.half_multipliers)

    @property
    def stable(self) -> bool:
        """Whether perturbations decay: all multipliers lie inside the unit circle, by more than rounding."""
        return self.spectral_radius < 1.0 - ROUNDING

    @property
    def spectral_radius(self) -> float:
        """Size of the largest multiplier."""
        return max(map(abs, self.multipliers))

    @property
    def trace(self) -> float:
        """Trace of the cycle's Jacobian: the sum of the multipliers."""
        return sum(self.multipliers).real

    @property
    def determinant(self) -> float:
        """Determinant of the cycle's Jacobian, exp(-tr(M^-1 C) n T) times r d(r v)/dv of each impact."""
        stops = dict(zip(self.system.stop_names, self.system.stops, strict=True))
        lost = math.exp(-float(np.trace(self.system.modal().damping)) * self.period)
        struck = zip((stops[name] for name in self.stops), self.velocities, strict=True)
        return math.prod((_shrinks(stop, v) for stop, v in struck), start=lost)

    @property
    def period(self) -> float:
        """Length of the cycle in s."""
        return self.n_periods * self.system.period

    @property
    def lyapunov(self) -> float:
        """Largest exponent in 1/s: ln of the spectral radius over the cycle's time."""
        return math.log(self.spectral_radius) / self.period if self.spectral_radius > 0.0 else -math.inf

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        return cycle_name(self.n_periods, self.n_impacts)


AnyOrbit = Orbit | SystemOrbit


def _shrinks(stop: Stop, v: float) -> float:
    """Return r d(r v)/dv of an impact."""
    r = float(stop.rebound(v))
    return r * (r + v * stop.law.slope(v)) if stop.law else r * r


def solution_of(orbit: SystemOrbit, flow: Flow) -> tuple[Floats, Floats]:
    """Return the driving angles of the impacts of an orbit, and the state before the first one."""
    state = np.append(orbit.start.displacement, orbit.start.velocity)
    return TURN * np.array(orbit.turns), np.linalg.solve(flow.physical, state)


def at_first_contact(orbit: SystemOrbit) -> SystemOrbit:
    """Return the steady motion that an orbit is whose impacts all have velocity 0, as one impact a driving period."""
    flow = Flow(orbit.system)
    angles, state = solution_of(orbit, flow)
    cycle = Cycle(flow, 1, (orbit.system.stop_names.index(orbit.stops[0]),))
    return make_orbit(orbit.model, cycle, np.append(angles[:1], state))


def make_orbit(model: Model, cycle: Cycle, unknown: Floats) -> SystemOrbit:
    """Return the orbit of a solution of a cycle's equations, of a system or of the family that makes it."""
    system: ImpactSystem = model.at()
    flow, p = cycle.flow, len(cycle.stops)
    angles, speeds, stops = unknown[:p], cycle.speeds(unknown), np.array(cycle.stops)
    grazing = np.abs(speeds) <= ROUNDING * np.abs(unknown[p:]).max()
    speeds = np.where(grazing, 0.0, speeds)
    multipliers = (complex(math.inf), *(0j for _ in unknown[p + 1 :])) if grazing.any() else cycle.multipliers(unknown)
    halves: tuple[complex, ...] = ()
    if cycle.images:
        halves, multipliers = multipliers, tuple(value * value for value in multipliers)
        angles, speeds = np.append(angles, angles + cycle.length), np.tile(speeds, 2)
        stops = np.append(stops, [cycle.images[stop] for stop in cycle.stops])
    turns = angles / TURN - math.floor(angles[0] / TURN)
    lengths = flow.lengths[stops]
    ratios = np.array([flow.rebound(*at)[0] for at in zip(stops, -speeds, strict=True)])
    state = flow.physical @ unknown[p:]
    message = objection(cycle, unknown, system.stop_names)
    return SystemOrbit(
        system=system,
        n_periods=cycle.n_periods,
        stops=tuple(system.stop_names[stop] for stop in stops),
        turns=tuple(turns.tolist()),
        velocities=tuple((speeds * lengths * flow.omega).tolist()),
        impulses=tuple(((1.0 + ratios) * speeds * flow.omega / lengths).tolist()),
        start=State(state[: flow.n].tolist(), state[flow.n :].tolist(), float(turns[0]) * system.period),
        multipliers=multipliers,
        half_multipliers=halves,
        admissible=not message,
        message=message,
        family=None if model is system else model,
    )
