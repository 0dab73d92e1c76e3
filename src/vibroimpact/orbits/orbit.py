"""Periodic orbits: their properties, their construction from solutions of the equations, and tests of equality."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends.base import taken_by
from vibroimpact.model import Model, State, as_system, check_names
from vibroimpact.model.elements import Contact
from vibroimpact.model.system import ImpactSystem
from vibroimpact.model.units import in_own_unit
from vibroimpact.motion import cycle_name
from vibroimpact.orbits.admissibility import ROUNDING, objection
from vibroimpact.orbits.distance import Impacts, points_of
from vibroimpact.orbits.equations import SAME, Cycle, Floats, fastest_of, parameters_of
from vibroimpact.parameters import Parameter, invalid
from vibroimpact.showing import MOST, Shown, Table

SPLIT = 1e-6  # multipliers that meet on the unit circle are known to the square root of rounding


class Rest(NamedTuple):
    """A rest at a stop: the stop's name, and begin and end in driving periods; the whole cycle if it never opens."""

    stop: str
    begin: float
    end: float


@dataclass(frozen=True, repr=False)
class Orbit(Shown):
    """A period-n impact-p orbit of one oscillator, stable or unstable; base class of `SystemOrbit`.

    Parameters
    ----------
    oscillator : ImpactOscillator or ImpactSystem
        The model that has this orbit.
    n_periods : int, >= 1
        Driving periods in a cycle.
    n_impacts : int, >= 1 or -1
        Impacts in a cycle; -1 for a complete chatter.
    velocities : tuple of float
        Speeds just before contact, in m/s, in the order of time; for a complete chatter, those above its cutoff.
    phases : tuple of float
        Driving phases of these impacts, in [0, 1).
    multipliers : tuple of complex
        Floquet multipliers of the cycle, in (y, y'); both 0 for an orbit that sticks, which erases all memory.
    admissible : bool
        Whether the mass can follow the orbit: no contact before the next impact, no impact velocity away from the stop.
    message : str
        Why it is inadmissible; empty if it is admissible.
    stick_phase, release_phase : float
        Driving phases, in [0, 1), at which the mass comes to rest at the stop and is released; NaN without a rest.
    stuck_time : float
        Time at rest per cycle, in s.
    family : family, optional
        The family, at its own values, from which the oscillator was made.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator, find_orbit
    >>> orbit = find_orbit(ImpactOscillator(omega=2.0))[0]
    >>> orbit.name, orbit.stable, round(orbit.velocities[0], 6)
    ('period-1 impact-1', True, 6.226413)
    """

    oscillator: Any
    n_periods: int
    n_impacts: int
    velocities: tuple[float, ...]
    phases: tuple[float, ...]
    multipliers: tuple[complex, ...]
    admissible: bool = True
    message: str = ""
    stick_phase: float = math.nan
    release_phase: float = math.nan
    stuck_time: float = 0.0
    family: Model | None = field(default=None, repr=False, compare=False)

    @property
    def model(self) -> Model:
        """The family from which the oscillator or system was made, or else the oscillator or system itself."""
        model: Model = self.oscillator if self.family is None else self.family
        return model

    def value(self, parameter: str) -> float:
        """Return the value of a parameter of its model."""
        return value_of(self.model, parameter)

    @cached_property
    def stops(self) -> tuple[str, ...]:
        """Names of the stops struck, in the order of time."""
        return tuple(stop.name for stop in self.oscillator.stops) * len(self.velocities)

    @property
    def system(self) -> ImpactSystem:
        """The system that has this orbit; one mass as a system."""
        system: ImpactSystem = as_system(self.oscillator)
        return system

    @cached_property
    def turns(self) -> tuple[float, ...]:
        """Times of the impacts in driving periods, the first in [0, 1)."""
        self.check_flies()
        return tuple(solution_of(self)[1][: len(self.phases)].tolist())

    @property
    def events(self) -> tuple[tuple[float, str, str], ...]:
        """Times in driving periods, kinds and stops of all events in a cycle."""
        return tuple((turn, "impact", stop) for turn, stop in zip(self.turns, self.stops, strict=True))

    @property
    def pushing(self) -> tuple[str, ...]:
        """Stops that push just before the first impact."""
        return ()

    @cached_property
    def start(self) -> State:
        """A state on the orbit: just before its first impact, or at its release from the stop."""
        phase, velocity = (self.release_phase, 0.0) if self.sticks else (self.phases[0], self.velocities[0])
        return State(self.oscillator.gap, velocity, phase * self.oscillator.period)

    @cached_property
    def rests(self) -> tuple[Rest, ...]:
        """Rests at the stop: one in a cycle that sticks."""
        if not self.sticks:
            return ()
        end = self.n_periods + self.release_phase
        return (Rest(self.oscillator.stops[0].name, end - self.stuck_time / self.oscillator.period, end),)

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """The impulse (N s), the energy lost (J) and the speed of separation (m/s) of each impact."""
        mass, r = self.oscillator.mass, self.oscillator.restitution
        return tuple(taken_by(mass, r, v) for v in self.velocities)

    @cached_property
    def impulses(self) -> tuple[float, ...]:
        """Impulses of the impacts in N s."""
        return tuple(contact.impulse for contact in self.contacts)

    @cached_property
    def rest_impulses(self) -> tuple[float, ...]:
        """The impulse in N s that a stop takes in each of the `rests`, exact to 1e-10."""
        home: Any = import_module("vibroimpact.orbits.systems.motion")  # which imports this one
        return home.rest_impulses_of(self)  # type: ignore[no-any-return]

    @property
    def trace(self) -> float:
        """Trace of the cycle's Jacobian: the sum of the multipliers."""
        return sum(self.multipliers).real

    @property
    def determinant(self) -> float:
        """Determinant of the cycle's Jacobian, r^(2p) exp(-c n T/m): the product of the multipliers."""
        return math.prod(self.multipliers).real

    @property
    def sticks(self) -> bool:
        """Whether the orbit includes a rest at a stop."""
        return self.stuck_time > 0.0

    @property
    def symmetric(self) -> bool:
        """Whether the orbit is its own mirror image half a cycle later."""
        return False

    @property
    def spectral_radius(self) -> float:
        """Size of the largest multiplier."""
        return max(map(abs, self.multipliers))

    @property
    def stable(self) -> bool:
        """Whether nearby motions settle to the orbit: it is admissible, with all multipliers inside the unit circle.

        The margin must exceed rounding. An orbit of a system without load and loss is one of a continuum, to which
        nothing settles, so it is never stable. Nor is an inadmissible orbit, since it is not a motion of the mass; its
        multipliers are those of the equations.
        """
        return self.admissible and self.spectral_radius < 1.0 - ROUNDING

    @property
    def period(self) -> float:
        """Length of the cycle in s."""
        length: float = self.n_periods * self.oscillator.period
        return length

    @property
    def frequency(self) -> float:
        """Cycles per second, in Hz."""
        return 1.0 / self.period

    @property
    def lyapunov(self) -> float:
        """Largest exponent in 1/s: ln of the spectral radius per time of the cycle; -inf if the radius is 0.

        Without load and loss it is 0 where all multipliers are on the unit circle, to 1e-6.
        """
        if not self.oscillator.energy_changes and self.spectral_radius <= 1.0 + SPLIT:
            return 0.0
        return math.log(self.spectral_radius) / self.period if self.spectral_radius > 0.0 else -math.inf

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        return cycle_name(self.n_periods, self.n_impacts, self.sticks)

    @property
    def _kind(self) -> str:
        """Stability or inadmissibility of the orbit, in a word or two."""
        if self.admissible and not self.oscillator.energy_changes:
            return f"{'unstable, ' * (self.spectral_radius > 1.0 + SPLIT)}one of a continuum"
        return "stable" if self.stable else "unstable" if self.admissible else "inadmissible"

    def _columns(self) -> dict[str, Sequence[Any]]:
        """Return the data of its impacts by column heading."""
        return {"phase": self.phases, "impact velocity [m/s]": self.velocities, "impulse [N s]": self.impulses}

    def _table(self) -> Table:
        columns = self._columns()
        notes = [f"largest multiplier {self.spectral_radius:.4g} in size"]
        notes += [
            f"at rest at {rest.stop} from phase {rest.begin % 1.0:.4g} for "
            f"{(rest.end - rest.begin) * self.oscillator.period:.4g} s, which takes {impulse:.4g} N s"
            for rest, impulse in zip(self.rests[:MOST], self.rest_impulses, strict=False)
        ]
        return Table(
            f"{self.name}, {self._kind}, repeats every {self.period:.4g} s",
            ["impact", *columns],
            [(at, *row) for at, row in enumerate(zip(*columns.values(), strict=True), start=1)],
            [*([self.message] if self.message else []), *notes],
        )

    def _row(self) -> dict[str, Any]:
        """Return its row in a list of orbits, by column heading."""
        return {
            "orbit": self.name,
            "": self._kind,
            "hardest impact [m/s]": max(self.velocities, default=0.0),
            "repeats every [s]": self.period,
            "largest multiplier": self.spectral_radius,
        }

    def motion(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return displacements, velocities and accelerations at times in s, each of shape (times, coordinates).

        At the instant of an impact they are those after it. Rests at a stop are followed by the engine.

        Examples
        --------
        >>> from vibroimpact import ImpactOscillator, find_orbit
        >>> orbit = find_orbit(ImpactOscillator(omega=2.0))[0]
        >>> displacement, _, _ = orbit.motion([0.0, orbit.period])
        >>> [round(float(y), 6) for y in displacement[:, 0]]
        [-5.605775, -5.605775]
        """
        home: Any = import_module("vibroimpact.orbits.systems.motion")  # which imports this one
        return home.motion_of(self, times)  # type: ignore[no-any-return]

    def check_flies(self) -> None:
        """Raise `ValueError` if an orbit rests at a stop: its motion does not follow from its impacts alone."""
        if self.sticks:
            raise ValueError(f"the {self.name} orbit rests at a stop; its events do not determine its motion")


def family_of(model: Model) -> Model | None:
    """Return the model if it is a family, else None, for the attribute `family` of an `Orbit`."""
    return None if model is model.at() else model


def value_of(model: Model, name: str) -> float:
    """Return the value of a parameter of a model, also if that parameter replaces another one."""
    values = model.values
    value = values[name] if name in values else getattr(model, name)
    return int(value) if model.parameters[name].whole else float(value)


def check_pair(table: Mapping[str, Parameter], parameter: str, name: str, pair: Any) -> tuple[float, float]:
    """Return the two values of a parameter in a table of parameters, given in an argument."""
    check_names(table, [parameter])
    try:
        first, second = pair
    except (TypeError, ValueError):
        raise invalid(name, pair, f"two values of {parameter}") from None
    first, second = in_own_unit(table[parameter], [first, second]).values
    return table[parameter].check(first), table[parameter].check(second)


def make_orbit(model: Model, cycle: Cycle, z: Floats) -> Orbit:
    """Return the orbit of a solution z = (turns, velocities); the engine decides whether it is admissible."""
    osc, p = model.at(), cycle.n_impacts
    rounding = ROUNDING * fastest_of(osc, z[p:])
    z = np.where((np.arange(2 * p) >= p) & (np.abs(z) <= rounding), 0.0, z)  # grazes
    message = objection(osc, cycle, z)
    return Orbit(
        oscillator=osc,
        n_periods=cycle.n_periods,
        n_impacts=p,
        velocities=tuple(z[p:].tolist()),
        phases=phases_of(z[:p].tolist()),
        multipliers=cycle.multipliers(parameters_of(osc), z),
        admissible=not message,
        message=message,
        family=family_of(model),
    )


def phases_of(turns: Iterable[float]) -> tuple[float, ...]:
    """Return driving phases, in [0, 1), from times in driving periods."""
    phases = (turn % 1.0 for turn in turns)
    return tuple(phase if phase < 1.0 else 0.0 for phase in phases)  # just below 0 it rounds to 1


def solution_of(orbit: Orbit) -> tuple[Cycle, Floats]:
    """Return the equations and the solution of an orbit; the whole periods in each flight are those that fit best."""
    cycle, p = Cycle(orbit.n_periods, orbit.n_impacts), orbit.n_impacts
    parameters, turns = parameters_of(orbit.oscillator), [orbit.phases[0]]
    for i in range(p - 1):
        ahead = (orbit.phases[i + 1] - orbit.phases[i]) % 1.0

        def miss(whole: int, i: int = i, ahead: float = ahead) -> float:
            arrival = turns[i] + ahead + whole
            pair = np.array([turns[i], arrival, orbit.velocities[i], orbit.velocities[i + 1]])
            gap, _, speed, _ = Cycle(orbit.n_periods, 2).misses(parameters, pair)
            return float(abs(gap) * orbit.oscillator.natural_frequency + abs(speed))

        turns.append(turns[i] + ahead + min(range(orbit.n_periods + 1), key=miss))
    return cycle, np.array([*turns, *orbit.velocities])


def from_hardest(cycle: Cycle, z: Floats) -> Floats:
    """Return the same cycle rotated so that its hardest impact comes first, at turns in [0, 1)."""
    p = cycle.n_impacts
    first = int(np.argmax(z[p:]))
    turns = np.concatenate([z[first:p], z[:first] + cycle.n_periods])
    return np.concatenate([turns - np.floor(turns[0]), np.roll(z[p:], -first)])


def true_cycle(cycle: Cycle, z: Floats) -> Cycle:
    """Return the smallest n and p with which the cycle repeats."""
    n, p = cycle.n_periods, cycle.n_impacts
    impacts, flights = points_of(Impacts.of(z), z[p:].max()), np.diff(np.append(z[:p], z[0] + n))
    for parts in range(math.gcd(n, p), 1, -1):
        if math.gcd(n, p) % parts == 0:
            moved = [np.abs(table - np.roll(table, p // parts, axis=0)).max() for table in (impacts, flights)]
            if max(moved) < SAME:
                return Cycle(n // parts, p // parts)
    return cycle
