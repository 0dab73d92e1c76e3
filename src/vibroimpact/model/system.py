"""Systems of several coordinates with any periodic force and several stops."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from vibroimpact.by_value import ByValue
from vibroimpact.cells import NOWHERE, Floats
from vibroimpact.matrices import ROUNDING, matrices, nearest, table_of_modes
from vibroimpact.model import State, check_names
from vibroimpact.model.elements import NUMBERS
from vibroimpact.model.force import Force
from vibroimpact.model.modal import FREE, ModalForm, modal_form, velocity_scale
from vibroimpact.model.points import NamedPoints, checked_points, over_points, resolved, rows_of
from vibroimpact.model.stops import Stop, check_in_front, check_moves, check_room, named_stops, warn_of_short_contacts
from vibroimpact.model.system_cells import SystemCells
from vibroimpact.parameters import OF_ONE_MASS, Parameter, Scale, check_one, counted, hertz, invalid, radians


@dataclass(frozen=True, init=False, eq=False, repr=False)
class ImpactSystem(NamedPoints, ByValue):
    r"""A linear system of n coordinates under a periodic force, with stops.

    .. math:: M \ddot q + C \dot q + K q = p_0 + \sum_h \mathrm{Im}\left(p_h e^{i h \omega t}\right), \qquad
              u_j = g_j + \sum_h \mathrm{Im}\left(d_{jh} e^{i h \omega t}\right) - a_j \cdot q

    A rigid stop keeps u_j >= 0: at an impact the rate of its clearance turns from -v to r_j v, and q' changes along
    M^-1 a_j. A compliant stop pushes while u_j < 0; see `Stop`.

    Parameters
    ----------
    mass : (n, n) array_like
        M in kg, symmetric and positive definite; n is at most 128. With one coordinate, matrices may be numbers.
    damping : (n, n) array_like
        C in N s/m, zero by default; its symmetric part is positive semidefinite, its skew part is arbitrary.
    stiffness : (n, n) array_like
        K in N/m, symmetric and positive semidefinite; it may be singular, and 0 means free masses.
    force : Force, optional
        The load, with the frequency that sets the period. None means no load; without a frequency there is no period.
    stops : sequence of Stop
        At most 64; a stop without a name is named by its position, ``stop_1`` first.
    points : mapping of str to sequence of n float, optional
        Named points: the displacement of a point is its row times q. Vectors of `force` and directions of `stops` may
        then be mappings such as ``{"tip": 5.0}``, and `at_point` returns motions at a point.

    Raises
    ------
    ValueError
        A matrix has the wrong shape, or is not symmetric or definite as required; a vector has the wrong length; two
        stops have the same name; the stops leave no room, or move without a frequency. The message names the matrix and
        its entry.

    Notes
    -----
    Matrices must be symmetric to 1e-12 of their entries; the rest is averaged away. Systems are equal if all their
    numbers are. Parameters (`parameters`, `values`, `replace`) are `omega` or `frequency`, if the force has one, and of
    every stop `<stop>_gap` and `<stop>_restitution`, or `<stop>_stiffness` and `<stop>_damping`; a family has others.

    Examples
    --------
    Two masses on springs; the second one between two stops:

    >>> system = ImpactSystem(
    ...     mass=[[2.0, 0.0], [0.0, 1.0]],
    ...     damping=[[0.3, -0.1], [-0.1, 0.1]],
    ...     stiffness=[[300.0, -100.0], [-100.0, 100.0]],
    ...     force=Force(omega=8.0, harmonics={1: [5.0, 0.0]}),
    ...     stops=[Stop(direction=[0, 1], gap=0.05, name="bar"), Stop(direction=[0, -1], gap=0.02, name="baffle")],
    ... )
    >>> system
    ImpactSystem(2 coordinates, omega=8.0, bar_gap=0.05, bar_restitution=0.8, baffle_gap=0.02, baffle_restitution=0.8)
    >>> system.natural_frequencies.round(3).tolist()
    [7.071, 14.142]
    """

    kind: ClassVar[str] = "system"  # the name in files
    at_rest: ClassVar[str] = "rest at q = 0, or the nearest position in front of the stops"
    says_all: ClassVar[bool] = False  # its parameters are not all its numbers
    forgets: ClassVar[bool] = False  # the impact or rest at one stop is not the whole state
    step_cost: ClassVar[int] = 4  # cost of a certified step, in steps of one mass
    offsets: ClassVar[tuple[str, ...]] = ()  # parameters that may be zero like any other value
    labels: ClassVar[tuple[str, ...]] = ("points",)

    mass: Floats
    damping: Floats
    stiffness: Floats
    force: Force
    stops: tuple[Stop, ...]
    points: Mapping[str, Floats]

    def __init__(
        self,
        *,
        mass: Any,
        stiffness: Any,
        damping: Any = 0.0,
        force: Force | None = None,
        stops: Iterable[Stop] = (),
        points: Mapping[str, Any] | None = None,
    ) -> None:
        linear = matrices(mass, damping, stiffness)
        n = len(linear["mass"])
        rows = checked_points(points, n)
        force, stops = resolved(force, stops, rows, n)
        vars(self).update(linear, force=force, stops=named_stops(stops, n), points=rows)
        check_moves(self.stops, force.omega)
        check_room(self.stops, self.mass)
        warn_of_short_contacts(self.stops, self.mass, self.period)

    @classmethod
    def from_modes(
        cls,
        frequencies: Any,
        damping_ratios: Any,
        shapes: Any,
        *,
        force: Force | None = None,
        stops: Iterable[Stop] = (),
        points: Sequence[str] | None = None,
    ) -> ImpactSystem:
        r"""Return the system of measured or computed modes; its coordinates are modal.

        .. math:: \ddot\eta_i + 2 \zeta_i \omega_i \dot\eta_i + \omega_i^2 \eta_i = \phi_i \cdot p, \qquad
                  q_{point} = \sum_i \phi_{point,i} \eta_i

        Parameters
        ----------
        frequencies : sequence of n float
            Natural frequencies in Hz; 0 is a rigid-body mode.
        damping_ratios : sequence of n float, or float
            Damping over critical damping, 0.01 for 1 %; a single number applies to all modes.
        shapes : (points, n) array_like
            Mass-normalised mode shapes in 1/sqrt(kg): one row per point, one column per mode.
        force : Force, optional
            Forces in N at the points: sequences over all points, or mappings such as ``{"tip": 5.0}``.
        stops : sequence of Stop
            Directions over the points in the same form; ``{"tip": 1.0, "frame": -1.0}`` stops tip against frame.
        points : sequence of str, optional
            Names of the points; ``point_1``, ``point_2``, ... by default.

        Returns
        -------
        ImpactSystem
            With M = I, in m sqrt(kg); `at_point` returns motions at the points.

        Raises
        ------
        ValueError
            The table's lengths differ, a number is out of range, or a point is unknown.

        Notes
        -----
        Divide shapes of another normalisation by the square roots of their modal masses first. With rigid stops,
        results do not converge as modes are added: the struck mass 1/(a . M^-1 a) decreases with each mode. For a
        moving base, a row of `shapes` may hold the participation factors -sum(m phi): the force at that point is then
        the base's acceleration, and `at_point` returns no displacement there.

        Examples
        --------
        The first two modes of a beam from a modal test, driven at mid-span, with a stop at the tip:

        >>> beam = ImpactSystem.from_modes(
        ...     frequencies=[12.0, 75.2],
        ...     damping_ratios=[0.01, 0.008],
        ...     points=["mid", "tip"],
        ...     shapes=[[0.68, -1.43], [2.0, 2.0]],
        ...     force=Force(frequency=11.0, harmonics={1: {"mid": 3.0}}),
        ...     stops=[Stop(direction={"tip": 1.0}, gap=1e-3, restitution=0.6, name="snubber")],
        ... )
        >>> beam.stops[0].direction, beam.force.harmonics[1].real
        (array([2., 2.]), array([ 2.04, -4.29]))
        """
        rates, ratios, table = table_of_modes(frequencies, damping_ratios, shapes)
        rows = rows_of(points, table)
        force, stops = resolved(force, stops, rows, len(rates), over_points)
        linear = {"mass": np.eye(len(rates)), "damping": np.diag(2.0 * ratios * rates), "stiffness": np.diag(rates**2)}
        return cls(**linear, force=force, stops=stops, points=rows)

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the constructor by name."""
        named = {"points": dict(self.points)} if self.points else {}
        return {name: getattr(self, name) for name in ("mass", "damping", "stiffness", "force", "stops")} | named

    def __repr__(self) -> str:
        values = [f"{name}={value!r}" for name, value in self.values.items()]
        return f"ImpactSystem({', '.join([counted(self.coordinates, 'coordinate'), *values])})"

    def __str__(self) -> str:
        stops = f" with {', '.join(self.stop_names)}" * bool(self.stops)
        return f"ImpactSystem of {counted(self.coordinates, 'coordinate')}{stops}"

    @property
    def coordinates(self) -> int:
        """The number of coordinates."""
        return len(self.mass)

    @property
    def stop_names(self) -> tuple[str, ...]:
        """The names of the stops."""
        return tuple(str(stop.name) for stop in self.stops)

    @property
    def groups(self) -> tuple[str, ...]:
        """The support that each stop is a part of; a stop without a group is one by itself."""
        return tuple(str(stop.group or stop.name) for stop in self.stops)

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """The parameters that an axis may vary, by name."""
        table = {name: OF_ONE_MASS[name] for name in ("omega", "frequency") if self.periodic}
        for stop in self.stops:
            for kind in stop.kinds:
                usual, name = NUMBERS[kind], f"{stop.name}_{kind}"
                words = f"{usual.long_name} of {stop.name}"
                table[name] = replace(usual, name=name, long_name=words, symbol=f"{usual.symbol}_{stop.name}")
        return MappingProxyType(table)

    @property
    def values(self) -> dict[str, float]:
        """Their values; the frequency, if there is one, is in rad/s."""
        of_stops = {f"{stop.name}_{kind}": getattr(stop, kind) for stop in self.stops for kind in stop.kinds}
        return {"omega": self.omega, **of_stops} if self.periodic else of_stops

    def replace(self, **changes: float) -> ImpactSystem:
        """Return a copy with some parameters changed; `frequency` (Hz) may replace `omega`."""
        check_names(self.parameters, changes)
        check_one("omega", changes.get("omega"), "frequency", changes.get("frequency"))
        checked = {name: self.parameters[name].check(value) for name, value in changes.items()}
        if "frequency" in checked:
            checked["omega"] = radians(checked["frequency"])
        omega = checked.get("omega", self.omega)
        force = self.force if omega == self.omega else Force(**{**self.force.arguments(), "omega": omega})
        stops = tuple(stop.at(checked) for stop in self.stops)
        changed = object.__new__(ImpactSystem)  # the matrices are checked already
        vars(changed).update(self.arguments() | {"force": force, "stops": stops, "points": self.points})
        if any(stop is not before for stop, before in zip(stops, self.stops, strict=True)):
            check_room(stops, self.mass)
        if "_modal" in vars(self):
            vars(changed)["_modal"] = self._modal.replace(force, stops)
        return changed

    def at(self, **values: float) -> ImpactSystem:
        """Return the system with some parameters changed: the design at one point of the axes."""
        return self.replace(**values) if values else self

    def cells(self, points: Mapping[str, Any], start: State | None = None) -> SystemCells:
        """Return one cell per point, all with the same initial condition; for None, see `initial`."""
        return SystemCells.of_points(self, points).begun(start, self.stop_names)

    @staticmethod
    def cells_of(designs: Iterable[ImpactSystem]) -> SystemCells:
        """Return one cell per design, all at rest; designs must have the same numbers of coordinates and stops."""
        return SystemCells.of_systems(designs)

    @property
    def rest(self) -> State:
        """The default initial condition: at rest."""
        return State(*self.initial())

    @property
    def periodic(self) -> bool:
        """Whether there is a driving period: the force has a frequency."""
        return self.force.omega is not None

    @property
    def omega(self) -> float:
        """Angular driving frequency in rad/s; without one, the 1 rad/s at which time is counted."""
        return self.force.rate

    @property
    def frequency(self) -> float:
        """Driving frequency in Hz, that of `omega`."""
        return float(hertz(self.omega))

    @property
    def period(self) -> float:
        """Driving period T = 2 pi / w in s, even if the first harmonic is missing; without one, the unit of time."""
        return 2.0 * math.pi / self.omega

    @property
    def natural_frequencies(self) -> Floats:
        """Undamped natural angular frequencies without stops in rad/s, ascending; 0 for rigid-body modes."""
        return np.sqrt(self.modal().squares)

    @property
    def slowest_frequency(self) -> float:
        """The slowest natural angular frequency in rad/s; if all masses are free, the driving frequency."""
        sprung = self.natural_frequencies[self.natural_frequencies > FREE * self.omega]
        return float(sprung[0]) if sprung.size else self.omega

    @property
    def energy_changes(self) -> str:
        """Why the energy of its motions is not constant; empty if it is: no load, no damping, no loss at the stops."""
        lossy = [f"{stop.name!r} is not elastic" for stop in self.stops if not stop.element.lossless]
        moving = [f"{stop.name!r} moves" for stop in self.stops if any(stop.motion.values())]
        damped = ["the system is damped"] if self.damping.any() else []
        loaded = ["it has a load"] if any(np.any(load) for load in self.force.vectors.values()) else []
        return ", ".join([*damped, *loaded, *moving, *lossy])

    @property
    def steady_amplitude(self) -> float:
        """Amplitude in m of the steady a . q without the stop; NaN if it is not a sine, or unless there is one stop."""
        form = self.modal()
        if len(self.stops) != 1 or form.orders.tolist() != [1] or form.constant.any() or form.motions.any():
            return math.nan
        impedance = np.diag(form.squares - self.omega**2) + 1j * self.omega * form.damping
        resonant = np.linalg.matrix_rank(impedance) < len(impedance)
        return math.inf if resonant else float(abs(form.directions[0] @ np.linalg.solve(impedance, form.forces[0])))

    def modal(self) -> ModalForm:
        """Return the system in the coordinates of its modes."""
        return self._modal

    @cached_property
    def _modal(self) -> ModalForm:
        return modal_form(self.mass, self.damping, self.stiffness, self.force, self.stops)

    @cached_property
    def velocity_scale(self) -> float:
        r"""Scale V > 0 of every relative tolerance, in the unit of the rate of a clearance (m/s).

        The largest over the stops j of

        - a_j . M^-1 a_j under a root, times the sum over the harmonics of the norm of p_h / Omega in the mass metric,
          over modes that interact with the stops; the part of p_0 on free modes is one more term;
        - the speed of a moving stop, sum of h w \|d_jh\|;
        - the clearance in static equilibrium times sqrt(a_j . M^-1 a_j / a_j . K^-1 a_j), if the stop sees no free
          mode.

        Modes slower than 0.01 w count as free, and w (h w in a harmonic) replaces their Omega. If all three are zero
        (no load, nothing moves), V is w times the largest gap; without stops or gaps, motions are similar at every
        speed, and V is 1. V does not change with the choice of coordinates, and for one mass it is that of
        `ImpactOscillator`, max(f, k |g|)/sqrt(k m).
        """
        return velocity_scale(self.modal())

    def scales(self) -> dict[str, Scale]:
        """Return the sizes of the stops' numbers by name; the mass that hits a stop is 1/(a . M^-1 a)."""
        form = self.modal()
        scales: dict[str, Scale] = {}
        widest = max((abs(stop.gap) for stop in self.stops), default=0.0)
        struck = 1.0 / np.diag(form.mobility)
        for stop, mass, deflection in zip(self.stops, struck.tolist(), form.deflections.tolist(), strict=True):
            gap = Scale(deflection, "the static deflection") if deflection else Scale(widest, "the widest gap")
            sizes = {"gap": gap} | stop.element.scales(mass, self.omega)
            scales |= {f"{stop.name}_{name}": size for name, size in sizes.items()}
        return scales

    def clearances(self, displacement: Any, time: float = 0.0) -> Floats:
        """Return the clearances u of all stops in m; negative beyond a stop."""
        return np.asarray(self._bounds(time) - self._directions @ np.asarray(displacement, np.float64))

    def initial(self, start: State | None = None, argument: str = "start") -> tuple[Floats, Floats, float]:
        """Return coordinates, velocities and time of an initial condition after checking it.

        `argument` is its name in messages. None means at rest at time 0, at q = 0 or, if that is beyond a rigid stop,
        at the nearest q in front of all of them, in the norm sqrt(q . M q). It may lie beyond compliant stops.

        Raises
        ------
        ValueError
            It does not have n coordinates, or lies beyond rigid stops by more than rounding; the message names them.
        """
        n = len(self.mass)
        if start is None:
            bars = self._bars
            q = nearest(self.mass, self._directions[bars], self._bounds(0.0)[bars])
            if q is None:
                raise ValueError("`stops` leave no room at time 0; give an initial condition at another time")
            return q, np.zeros(n), 0.0
        if not isinstance(start, State):
            raise invalid(argument, start, "None or a State", "write State(displacement=[...], velocity=[...])")
        q, speed = (np.array(part, np.float64, ndmin=1) for part in (start.displacement, start.velocity))
        if len(q) != n:
            raise ValueError(f"`{argument}` must have {counted(n, 'coordinate')}, as the mass matrix has, got {len(q)}")
        beyond = -self.clearances(q, start.time)
        reach = np.array([stop.reach for stop in self.stops]) * (1.0 + abs(start.time) * self.omega)
        size = np.abs(self._directions) @ np.abs(q) + reach
        most = n * ROUNDING * size + NOWHERE * self.velocity_scale / self.omega
        check_in_front(self.stops, beyond, most, f"`{argument}` lies", start.time)
        return q, speed, start.time

    @cached_property
    def _directions(self) -> Floats:
        return np.array([stop.direction for stop in self.stops]).reshape(-1, len(self.mass))

    @cached_property
    def _bars(self) -> Any:
        return np.array([stop.element.impenetrable for stop in self.stops], bool)

    def _bounds(self, time: float) -> Floats:
        """Return a . q at contact for every stop at a given time."""
        return np.array([stop.gap + stop.shift(self.omega * time) for stop in self.stops], np.float64)
