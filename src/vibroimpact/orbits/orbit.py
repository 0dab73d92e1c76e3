"""Periodic orbits: their properties, and how they follow from the impacts of one mass."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends.base import taken_by
from vibroimpact.model import Model, State, as_system
from vibroimpact.model.elements import Contact
from vibroimpact.model.system import ImpactSystem
from vibroimpact.motion import cycle_name
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.cycle import cycle_of
from vibroimpact.orbits.distance import same_orbit
from vibroimpact.orbits.equations import Floats, turns_of
from vibroimpact.orbits.events import IMPACT
from vibroimpact.orbits.symmetry import mirror
from vibroimpact.parameters import ENERGY, unknown
from vibroimpact.showing import MOST, Shown, Table

SPLIT = 1e-6  # multipliers that meet on the unit circle are known to the square root of rounding


class Rest(NamedTuple):
    """A rest at a stop: the stop's name, and begin and end in driving periods; the whole cycle if it never opens."""

    stop: str
    begin: float
    end: float


@dataclass(frozen=True, repr=False)
class Orbit(Shown):
    """A period-n impact-p orbit, stable or unstable, of one mass or of a system with rigid or compliant stops.

    On a compliant stop, an impact is the beginning of a contact. The impacts of one mass in front of one rigid stop
    determine all else, so what comes after `family` is optional there.

    Parameters
    ----------
    oscillator : ImpactOscillator or ImpactSystem
        The model that has this orbit.
    n_periods : int, >= 1
        Driving periods in a cycle.
    n_impacts : int, >= 1 or -1
        Impacts in a cycle; -1 for a complete chatter.
    velocities : tuple of float
        Speeds just before contact, in m/s, in the order of time. The impacts of a complete chatter are listed down to
        its cutoff.
    phases : tuple of float
        Driving phases of these impacts, in [0, 1).
    multipliers : tuple of complex
        Floquet multipliers of the cycle, the largest first; 0 for an orbit of one mass that sticks, which erases all
        memory.
    admissible : bool
        Whether the model can follow the orbit: no contact before the next impact, no impact velocity away from a stop.
    message : str
        Why it is inadmissible; empty if it is admissible.
    stick_phase, release_phase : float
        Driving phases, in [0, 1), at which the first of the `rests` begins and ends; NaN without a rest.
    stuck_time : float
        Time at rest per cycle, in s, the sum of all rests.
    family : family, optional
        The family, at its own values, from which the model was made.
    turns : tuple of float
        Times of the impacts in driving periods, the first in [0, 1).
    stops : tuple of str
        Names of the stops struck, in the order of time.
    start : State
        Coordinates, their rates and time just before the first impact; for an orbit with rests, at its release from the
        stop (one mass) or at a time without events.
    events : tuple of (float, str, str)
        Times in driving periods, kinds and stops of all events in a cycle without rests: "impact", and for compliant
        stops "let_go", when the force has fallen to zero, and "push_again", when the force begins again before the
        clearance is positive.
    pushing : tuple of str
        Stops that push just before the first impact.
    contacts : tuple of Contact
        For each impact, the `impulse` in N s, the `energy_lost` at the stop in J, the `exit_velocity` in m/s and, on a
        compliant stop, `contact_time` (for which it pushes) in s, `peak_force` in N and `penetration` in m, NaN on a
        rigid stop; `exit_time`, `peak_force_time` and `penetration_time` in s from the beginning of the contact.
    rests : tuple of Rest
        Rests at rigid stops: the `stop`, and its `begin` and `end` in driving periods, on the same time axis as
        `turns`. The impacts of a chatter are listed down to 1e-9 V. A cycle with rests is listed from the end of the
        longest rest, at the first of the model's stops that has one.
    half_multipliers : tuple of 2n complex
        Multipliers of the half map (half a cycle, then the mirror) if the orbit never rests and is its own mirror image
        half a cycle later; else empty.
    neutral : tuple of complex
        Multipliers of a free centre of mass, if masses without a spring to the ground strike one another: 1 for its
        position, and 1, or less with drag, for its drift. They affect no stop and do not count for stability;
        `multipliers` holds the others. The drift is the one with which the centre returns to its position, if there is
        one.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator, find_orbit
    >>> orbit = find_orbit(ImpactOscillator(omega=2.0))[0]
    >>> orbit.name, orbit.stable, round(orbit.velocities[0], 6)
    ('period-1 impact-1', True, 6.226413)
    >>> from vibroimpact import Force, ImpactSystem, Stop
    >>> ball = ImpactSystem(mass=1.0, stiffness=0.0, force=Force(omega=10.0, constant=-9.81),
    ...     stops=[Stop(direction=-1, gap=0.0, restitution=0.5, name="table", motion={1: 0.12})])
    >>> orbit = find_orbit(ball)[0]
    >>> orbit.name, orbit.stops, orbit.stable, round(orbit.velocities[0], 9)
    ('period-1 impact-1', ('table',), True, 4.109203191)
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
    _: KW_ONLY
    turns: tuple[float, ...] = ()
    stops: tuple[str, ...] = ()
    start: Any = None  # a State
    events: tuple[tuple[float, str, str], ...] = field(default=(), repr=False)
    pushing: tuple[str, ...] = field(default=(), repr=False)
    contacts: tuple[Contact, ...] = field(default=(), repr=False)
    rests: tuple[Rest, ...] = ()
    half_multipliers: tuple[complex, ...] = field(default=(), repr=False)
    neutral: tuple[complex, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        if self.start is None:
            for name, value in _of_one_mass(self).items():
                object.__setattr__(self, name, value)

    @property
    def model(self) -> Model:
        """The family from which the oscillator or system was made, or else the oscillator or system itself."""
        model: Model = self.oscillator if self.family is None else self.family
        return model

    def value(self, parameter: str) -> float:
        """Return the value of a parameter of its model, or the "energy" (J) if that is constant, or refuse the name."""
        free = parameter == ENERGY.name and not self.oscillator.energy_changes
        return self.energy if free else value_of(self.model, parameter)

    @property
    def system(self) -> ImpactSystem:
        """The system that has this orbit; one mass as a system."""
        system: ImpactSystem = as_system(self.oscillator)
        return system

    @property
    def twin(self) -> Orbit:
        """The mirror image half a driving period later, which is also an orbit of the system if that is symmetric.

        Raises
        ------
        ValueError
            The system is not symmetric; the message says why.
        """
        images, why = mirror(self.system)
        if why:
            raise ValueError(f"the orbit has no twin: its system is {why}")
        start, half, first = self.start, 0.5 * self.system.period, self.turns[0] + 0.5
        image = dict(zip(self.system.stop_names, (self.system.stop_names[at] for at in images), strict=True))
        later = first % 1.0 - self.turns[0]
        place, rate = (tuple(-number for number in part) for part in (start.displacement, start.velocity))
        turns = tuple(turn + later for turn in self.turns)
        rests = tuple(Rest(image[stop], begin + later, end + later) for stop, begin, end in self.rests)
        stick, release, _ = at_rest(rests, self.n_periods, self.system.period)
        return replace(
            self,
            stops=tuple(image[stop] for stop in self.stops),
            turns=turns,
            phases=phases_of(turns),
            start=State(place, rate, start.time + (half if first < 1.0 else -half)),
            events=tuple((turn + later, kind, image[stop]) for turn, kind, stop in self.events),
            pushing=tuple(image[stop] for stop in self.pushing),
            rests=rests,
            stick_phase=stick,
            release_phase=release,
        )

    @cached_property
    def impulses(self) -> tuple[float, ...]:
        """Impulses of the impacts in N s; on a compliant stop, the integral of its force over the contact."""
        return tuple(contact.impulse for contact in self.contacts)

    @cached_property
    def rest_impulses(self) -> tuple[float, ...]:
        """The impulse in N s that a stop takes in each of the `rests`, exact to 1e-10."""
        from vibroimpact.orbits.motion import rest_impulses_of  # slower to import

        return rest_impulses_of(self)

    @property
    def energy(self) -> float:
        """Energy in J, kinetic and elastic, if it is constant; else NaN."""
        if self.oscillator.energy_changes:
            return math.nan
        cycle, unknown = cycle_of(self)
        return cycle.flow.energy(unknown[len(cycle.events) :], cycle.pushing)[0] * cycle.flow.omega**2

    @property
    def trace(self) -> float:
        """Trace of the cycle's Jacobian: the sum of the multipliers."""
        return sum(self.multipliers).real

    @property
    def determinant(self) -> float:
        """Determinant of the cycle's Jacobian, the product of the multipliers, from the damping and the impacts."""
        if self.sticks:
            return 0.0
        form, stops = self.oscillator.modal(), self.oscillator.stops
        rates = (form.viscosity * np.diag(form.mobility)).tolist()
        names = self.oscillator.stop_names
        lost, left = float(np.diag(form.damping)[~form.neutral[1]].sum()) * self.period, 1.0
        for name, speed, contact in zip(self.stops, self.velocities, self.contacts, strict=True):
            element, rate = stops[names.index(name)].element, rates[names.index(name)]
            lost += rate * contact.contact_time if rate else 0.0
            left *= element.rebound(speed) * element.sensitivity(speed)  # 1 on a compliant stop
        return left * math.exp(-lost)

    @property
    def sticks(self) -> bool:
        """Whether the orbit includes a rest at a stop."""
        return self.stuck_time > 0.0

    @property
    def symmetric(self) -> bool:
        """Whether the orbit is its own mirror image half a cycle later."""
        rests = self.sticks and self.n_periods % 2 == 1 and not mirror(self.system)[1] and same_orbit(self, self.twin)
        return bool(self.half_multipliers) or rests

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
        return cycle_name(self.n_periods, self.n_impacts, self.sticks and not any(self.multipliers))

    @property
    def _kind(self) -> str:
        """Stability or inadmissibility of the orbit, in a word or two."""
        if self.admissible and not self.oscillator.energy_changes:
            return f"{'unstable, ' * (self.spectral_radius > 1.0 + SPLIT)}one of a continuum"
        return "stable" if self.stable else "unstable" if self.admissible else "inadmissible"

    @property
    def _names_stops(self) -> bool:
        """Whether it matters which stop is struck."""
        return len(self.oscillator.stop_names) > 1

    def _columns(self) -> dict[str, Sequence[Any]]:
        """Return the data of its impacts by column heading."""
        columns: dict[str, Sequence[Any]] = {"stop": self.stops} if self._names_stops else {}
        columns |= {"phase": self.phases, "impact velocity [m/s]": self.velocities, "impulse [N s]": self.impulses}
        if any(contact.peak_force > 0.0 for contact in self.contacts):
            columns["largest force [N]"] = [contact.peak_force for contact in self.contacts]
            columns["contact time [s]"] = [contact.contact_time for contact in self.contacts]
        return columns

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
        } | ({"stops": ", ".join(dict.fromkeys(self.stops))} if self._names_stops else {})

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
        from vibroimpact.orbits.motion import motion_of  # slower to import

        return motion_of(self, times)

    def check_flies(self) -> None:
        """Raise `ValueError` if an orbit rests at a stop: its motion does not follow from its impacts alone."""
        if self.sticks:
            raise ValueError(f"the {self.name} orbit rests at a stop; its events do not determine its motion")


def family_of(model: Model, design: Any) -> Model | None:
    """Return a model of that design if it is a family, else None, for the attribute `family` of an `Orbit`."""
    return None if model is design else model


def value_of(model: Model, name: str) -> float:
    """Return the value of a parameter of a model, also if that parameter replaces another one."""
    if name not in model.parameters:
        raise unknown("parameter", name, model.parameters)
    values = model.values
    value = values[name] if name in values else getattr(model, name)
    return int(value) if model.parameters[name].whole else float(value)


def phases_of(turns: Iterable[float]) -> tuple[float, ...]:
    """Return driving phases, in [0, 1), from times in driving periods."""
    phases = (turn % 1.0 for turn in turns)
    return tuple(phase if phase < 1.0 else 0.0 for phase in phases)  # just below 0 it rounds to 1


def at_rest(rests: Sequence[Rest], n_periods: int, period: float) -> tuple[float, float, float]:
    """Return the phases at which the first rest in a cycle begins and ends, and the total time at rest in s."""
    if not rests:
        return math.nan, math.nan, 0.0
    _, begin, end = rests[0]
    release = end % 1.0 if end - begin < n_periods else math.nan
    return begin % 1.0, release, sum(rest.end - rest.begin for rest in rests) * period


def _of_one_mass(orbit: Orbit) -> dict[str, Any]:
    """Return what follows from the impacts of one mass in front of one rigid stop, by field."""
    osc, speeds = orbit.oscillator, orbit.velocities
    (stop,) = osc.stop_names
    turns = tuple(orbit.turns or turns_of(osc, orbit.n_periods, orbit.phases, speeds))
    whole = math.floor(turns[0]) if turns else 0
    turns = tuple([turn - whole for turn in turns]) if whole else turns
    taken = taken_by(osc.mass, osc.restitution, np.array(speeds))
    contacts = tuple(map(Contact, *(part.tolist() if isinstance(part, np.ndarray) else repeat(part) for part in taken)))
    content: dict[str, Any] = {"turns": turns, "stops": (stop,) * len(turns), "contacts": contacts}
    if orbit.sticks:
        end = orbit.n_periods + orbit.release_phase - whole
        rests = (Rest(stop, end - orbit.stuck_time / osc.period, end),)
        release = orbit.release_phase + -whole % orbit.n_periods
        return content | {"rests": rests, "start": State(osc.gap, 0.0, release * osc.period)}
    events = tuple([(turn, IMPACT, stop) for turn in turns])
    return content | {"events": events, "start": State(osc.gap, speeds[0], orbit.phases[0] * osc.period)}
