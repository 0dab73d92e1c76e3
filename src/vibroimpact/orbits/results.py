"""The result of a search for periodic orbits, also as a labelled dataset, and its initial guess."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vibroimpact.backends import Samples
from vibroimpact.cells import Floats
from vibroimpact.dataset import dataset_of, flags, impact_speed, plain_variable, provenance, variable
from vibroimpact.model import Model, State
from vibroimpact.model.elements import REPORTS, reports_of
from vibroimpact.motion import cycle_name
from vibroimpact.orbits.distance import smallest_cycle
from vibroimpact.orbits.newton import Solved
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.parameters import choice, counted, invalid, several
from vibroimpact.showing import Table, written

if TYPE_CHECKING:
    import xarray as xr

IMPACTS = 1000  # most impacts in a cycle: the number of matrix entries grows as its square


class Orbits(list[Orbit]):
    """The orbits of one (n, p) type, stable ones first, with the outcome of the search.

    Attributes
    ----------
    outcome : str
        "found"; "inadmissible" (there are solutions, but each penetrates the stop); "none" (none exists, or no initial
        guess converged to one); "other_name" (the guess converged to an orbit of fewer periods and impacts);
        "not_converged"; "not_periodic" (the motion from `near` does not repeat: the list holds an orbit that it passes
        by, if one was found); "singular" (it converged to a fold or a graze, where the equations do not determine an
        isolated orbit, or did not converge where they hardly do).
    message : str
        The outcome as a sentence.
    """

    def __init__(self, orbits: Iterable[Orbit] = (), *, outcome: str = "found", message: str = "") -> None:
        super().__init__(orbits)
        self.outcome = outcome
        self.message = message

    @property
    def sentence(self) -> str:
        """The outcome of the search and the number of orbits found, as a sentence."""
        name = self[0].name if self else ""
        if self.outcome == "inadmissible":
            return f"no admissible {name} orbit: the equations have {len(self)}"
        return self.message or counted(len(self), f"{name} orbit")

    def _repr_html_(self) -> str:
        rows = [orbit._row() for orbit in self]
        return written(Table(self.sentence, [*rows[0]] if rows else (), [[*row.values()] for row in rows]))


class Solution(NamedTuple):
    """A solution of the equations of a cycle with one impact, or with one in each mirrored half, as `orbit` makes it.

    With what it strikes, the velocity in m/s, and whether it `may_attract`: few others than stable orbits do.
    """

    struck: Hashable
    velocity: float
    may_attract: Callable[[], bool]
    orbit: Callable[[], Orbit]


@dataclass(frozen=True)
class Search(ABC):
    """A search for the periodic orbits of a model, of one mass or of systems, made once for each model.

    Those of a family are sought at its own values, at which it makes the oscillator or system `design`.
    """

    model: Model
    design: Any

    @abstractmethod
    def of_type(
        self, n_periods: int, n_impacts: int, stops: tuple[int, ...] | None, guess: Guess, *, symmetric: bool
    ) -> Orbits:
        """Return the orbits of a type: on any stops, on given ones in the order of time, or symmetric ones."""

    @abstractmethod
    def of_one_impact(self, n_periods: int, *, symmetric: bool = False) -> Iterator[Solution]:
        """Yield the solutions with one impact on any stop and, if asked, those with one in each mirrored half."""

    @abstractmethod
    def of_cycle(self, n_periods: int, samples: Samples, span: slice) -> Orbits:
        """Return the orbits near a motion that has settled, from the impacts of one cycle in its samples."""

    @abstractmethod
    def from_motion(self, hits: Any, skipped: int, n_periods: int, n_impacts: int) -> Orbits:
        """Return the orbit that Newton's method reaches from a motion, given by `Hits`, after some of its impacts."""

    @abstractmethod
    def state_of(self, guess: Guess) -> State | None:
        """Return the state that a guess stands for, or None."""


@dataclass(frozen=True)
class Guess:
    """The initial guess of a search: the argument `near`, and the orbit and the state that it gives, if any.

    For an orbit, also the stops that it strikes, and whether it rests and is symmetric. Without a state, `near` holds
    unchecked numbers: a phase and a velocity for one mass, times of impacts in s for systems.
    """

    near: Any = None
    orbit: Any = None
    state: State | None = None
    stops: tuple[str, ...] = ()
    sticks: bool = False
    symmetric: bool = False

    @staticmethod
    def of(near: Any) -> Guess:
        """Return the guess given by an orbit, an attractor, a State, numbers or None."""
        state = near if isinstance(near, State) else getattr(near, "start", None)
        if not isinstance(state, State):
            return Guess(near)
        orbit = None if near is state else getattr(near, "orbit", near)
        if orbit is None:
            return Guess(near, state=state)
        return Guess(near, orbit, state, orbit.stops, orbit.sticks, orbit.symmetric)

    @property
    def none(self) -> bool:
        """Whether nothing was given."""
        return self.near is None

    @property
    def only_numbers(self) -> bool:
        """Whether numbers were given: a phase and a velocity, or times."""
        return self.near is not None and self.state is None

    @property
    def only_state(self) -> bool:
        """Whether only a state was given, without an orbit."""
        return self.state is not None and self.orbit is None


NOTHING = Guess()


def numbers_of(stops: Any, names: tuple[str, ...]) -> tuple[int, ...]:
    """Return the numbers of the stops struck, in the order given, from their names."""
    struck = several("stops", stops, "a stop's name or a list of them")
    numbers = tuple(names.index(choice("stops", name, names)) for name in struck)
    if not 1 <= len(numbers) <= IMPACTS:
        raise invalid("stops", stops, f"1 to {IMPACTS} stops to strike")
    return numbers


def ordered(orbits: Iterable[Orbit]) -> Orbits:
    """Return orbits of one type sorted into stable, unstable and inadmissible ones, with the outcome."""
    ranked = sorted(orbits, key=lambda orbit: (not orbit.stable, not orbit.admissible, -max(orbit.velocities)))
    admissible = sum(orbit.admissible for orbit in ranked)
    if not admissible:
        return Orbits(ranked, outcome="inadmissible", message=ranked[0].message)
    return Orbits(ranked, message=counted(admissible, f"{ranked[0].name} orbit"))


def reached(solved: Solved, name: str, orbit_of: Callable[[Floats], Orbit]) -> Orbits:
    """Return the orbit of a name that Newton's method reached, made from its solution, or why it is none."""
    if solved.singular or not solved.converged:
        return lost(solved, name)
    orbit = orbit_of(solved.z)
    stops = [orbit.oscillator.stop_names.index(stop) for stop in orbit.stops]
    flights = np.diff(np.append(orbit.turns, orbit.turns[0] + orbit.n_periods))
    n, p = smallest_cycle(orbit.n_periods, orbit, flights, stops)
    return ordered([orbit]) if n == orbit.n_periods else other_name(cycle_name(n, p), name)


def lost(solved: Solved, name: str) -> Orbits:
    """Return the outcome of a search whose Newton's method did not converge to an orbit."""
    if solved.singular:
        what = "converged to" if solved.converged else "not converged; the equations are nearly singular, as at"
        return Orbits(outcome="singular", message=f"{what} a fold or a graze; give a guess away from it")
    message = f"not converged to a {name} orbit; give a guess nearer to one as `near`"
    return Orbits(outcome="not_converged", message=message)


def other_name(reached: str, name: str) -> Orbits:
    """Return the outcome of a search that converged to an orbit with a shorter cycle than requested."""
    return Orbits(outcome="other_name", message=f"converged to a {reached} orbit instead of a {name} one")


def orbits_dataset(orbits: Orbits, model: Model, arguments: Mapping[str, Any]) -> xr.Dataset:
    """Return orbits over `orbit` and `impact`, rows padded with NaN; `count` is the number of impacts."""
    design, counts = model.at(), [len(orbit.velocities) for orbit in orbits]
    content = orbit_variables(orbits, max(counts, default=0), "orbit")
    parts = {"real": "real part of a Floquet multiplier", "imag": "imaginary part of a Floquet multiplier"}
    several = not design.says_all
    for part, text in parts.items():
        rows = [[getattr(complex(value), part) for value in orbit.multipliers] for orbit in orbits]
        width = 2 * np.size(design.mass, 0) if several else 2
        table = rows_of(rows, max(map(len, rows), default=width))
        if several:
            content[f"multiplier_{part}"] = number(("orbit", "multiplier"), table, text)
        else:
            content |= {f"multiplier_{i}_{part}": number("orbit", column, text) for i, column in enumerate(table.T, 1)}
    whole = {
        "n_periods": ([orbit.n_periods for orbit in orbits], "driving periods per cycle"),
        "n_impacts": ([orbit.n_impacts for orbit in orbits], "impacts per cycle"),
        "count": (counts, "number of impacts listed"),
    }
    for key, (kept, long_name) in whole.items():
        content[key] = plain_variable("orbit", np.array(kept, np.int32), {"long_name": long_name, "units": "1"})
    outcome = {"outcome": orbits.outcome, "message": orbits.sentence}
    outcome["messages"] = json.dumps([orbit.message for orbit in orbits])
    real = {
        "stick_phase": "phase of coming to rest at the stop",
        "release_phase": "phase of leaving the stop",
        "stuck_time": "time at rest per cycle",
    }
    content |= {key: number("orbit", [getattr(orbit, key) for orbit in orbits], text) for key, text in real.items()}
    content["stuck_time"].attrs["units"] = "s"
    content |= _struck(orbits, max(counts, default=0), design)
    return dataset_of(content, attrs=provenance("find_orbit", model, arguments) | outcome)


def _struck(orbits: Orbits, p: int, design: Any) -> dict[str, xr.Variable]:
    """Return the effects of impacts, and the times and stops of those of a system."""
    dims, begins = ("orbit", "impact"), [np.multiply(orbit.turns, orbit.oscillator.period) for orbit in orbits]

    def column(name: str) -> xr.Variable:
        rows = [np.array([getattr(contact, name) for contact in orbit.contacts]) for orbit in orbits]
        if REPORTS[name].since:
            rows = [begin + row for begin, row in zip(begins, rows, strict=True)]
        return variable(name, dims, rows_of(rows, p))

    columns = {name: column(name) for name in reports_of(design.stops)}
    if design.says_all:
        return columns
    names = np.full((len(orbits), p), "", dtype=object)
    for at, orbit in enumerate(orbits):
        names[at, : len(orbit.stops)] = orbit.stops
    stops = plain_variable(dims, names.astype(str), {"long_name": "stop that is struck"})
    return columns | {"time": variable("time", dims, rows_of(begins, p)), "stop": stops}


def orbit_variables(orbits: Sequence[Any], p: int, dim: str) -> dict[str, xr.Variable]:
    """Return velocities, phases, stability and admissibility of orbits as variables."""
    return {
        "velocity": impact_speed((dim, "impact"), rows_of([orbit.velocities for orbit in orbits], p)),
        "phase": variable("phase", (dim, "impact"), rows_of([orbit.phases for orbit in orbits], p)),
        "stable": flags(dim, [orbit.stable for orbit in orbits], "whether the orbit is stable", ("unstable", "stable")),
        "admissible": flags(
            dim, [q.admissible for q in orbits], "whether the orbit is admissible", ("inadmissible", "admissible")
        ),
    }


def number(dims: Any, data: Any, long_name: str) -> xr.Variable:
    """Return plain numbers, labelled."""
    return plain_variable(dims, np.asarray(data, dtype=np.float64), {"long_name": long_name, "units": "1"})


def rows_of(rows: Sequence[Any], width: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return rows of one width, padded with NaN."""
    table = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        table[i, : len(row)] = row
    return table
