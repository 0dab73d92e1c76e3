"""Find the periodic orbits of one mass in front of one rigid stop.

Orbits with one impact are known in closed form; sticking orbits are found by following the mass from its release. For
all others, Newton's method solves the equations of a cycle. Its initial guesses are motions simulated by the engine:
the attractor reached from rest, and a grid over the impact surface.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import astuple, dataclass
from functools import partial
from typing import Any

import numpy as np

from vibroimpact.backends import ImpactWindow, Measurement, Samples, get_backend
from vibroimpact.backends.scalar import outlast
from vibroimpact.model import Model, State
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.orbits import newton
from vibroimpact.orbits.admissibility import ROUNDING, contacts, objection
from vibroimpact.orbits.distance import Impacts, same_orbit, smallest_cycle
from vibroimpact.orbits.equations import Cycle, Floats, fastest_of, impact_1_orbits, parameters_of
from vibroimpact.orbits.newton import Solved
from vibroimpact.orbits.orbit import Orbit, family_of, phases_of
from vibroimpact.orbits.results import NOTHING, Guess, Orbits, Search, Solution, ordered, reached
from vibroimpact.parameters import counted, invalid, real_number


@dataclass(frozen=True)
class OneMassSearch(Search):
    """The search for the periodic orbits of one mass in front of one rigid stop."""

    def of_type(
        self,
        n_periods: int,
        n_impacts: int,
        stops: tuple[int, ...] | None = None,
        guess: Guess = NOTHING,
        *,
        symmetric: bool = False,
    ) -> Orbits:
        """Return the period-n impact-p orbits: with one impact, sticking, or others from a guess."""
        if symmetric:
            return Orbits(outcome="none", message="not symmetric: one stop has no mirror image")
        osc, cycle = self.design, Cycle(n_periods, n_impacts if stops is None else len(stops))
        times = stops is not None and guess.only_numbers
        impact = None if times else impact_of(osc, guess)
        if cycle.n_impacts == -1:
            from vibroimpact.orbits.sticking import find_sticking_orbit, why_none  # slower to import

            sticking = find_sticking_orbit(self.model, n_periods)
            return Orbits(sticking) if sticking else Orbits(outcome="none", message=why_none(osc, n_periods))
        if cycle.n_impacts == 1 or osc.amplitude == 0.0:
            solutions, why = impact_1_orbits(osc, n_periods)
            if not solutions:
                return Orbits(outcome="none", message=why)
            return ordered(make_orbit(self.model, cycle, z) for z in solutions)
        if times:
            return self._at_times(cycle, guess)
        orbit = guess.orbit
        if orbit is not None and orbit.oscillator.forgets and (orbit.n_periods, orbit.n_impacts) == astuple(cycle):
            return self._from(cycle, solution_of(orbit)[1])
        if impact is None:
            return self._anywhere(cycle)
        (chain,) = followed(osc, cycle, *np.array(impact)[:, None])
        if chain is None:
            few = f"fewer than {cycle.n_impacts} impacts follow from there; start where the mass hits more often"
            return Orbits(outcome="not_converged", message=few)
        return self._from(cycle, as_cycle(chain))

    def of_one_impact(self, n_periods: int, *, symmetric: bool = False) -> Iterator[Solution]:
        """Yield the solutions with one impact in n periods; none is symmetric."""
        osc, cycle = self.design, Cycle(n_periods, 1)
        for z in impact_1_orbits(osc, n_periods)[0]:
            orbit = partial(make_orbit, self.model, cycle, z)
            yield Solution("", float(z[1]), partial(_attracts, osc, cycle, z), orbit)

    def of_cycle(self, n_periods: int, samples: Samples, span: slice) -> Orbits:
        """Return the orbit near the sampled impacts of a cycle."""
        turns, speeds = samples.impact_turns[span], samples.impact_velocity[span]
        return self._from(Cycle(n_periods, len(speeds)), np.append(turns - math.floor(turns[0]), speeds))

    def from_motion(self, hits: Any, skipped: int, n_periods: int, n_impacts: int) -> Orbits:
        """Return the orbit that Newton's method reaches from impacts of a motion, or the one that sticks."""
        if n_impacts == -1:
            return self.of_type(n_periods, -1)
        return self.of_cycle(n_periods, hits.samples, slice(skipped, skipped + n_impacts))

    def state_of(self, guess: Guess) -> State:
        """Return the state of a guess, at an impact where that is given as numbers."""
        if guess.state is not None:
            return guess.state
        osc, impact = self.design, impact_of(self.design, guess)
        assert impact is not None  # only where nothing was given
        return State(osc.gap, impact[1], impact[0] % 1.0 * osc.period)

    def _at_times(self, cycle: Cycle, guess: Guess) -> Orbits:
        """Return the orbit near given times of its impacts, whose velocities the search for systems finds."""
        from vibroimpact.orbits.systems.search import SystemSearch  # slower to import

        (n, p), system = astuple(cycle), self.design.system
        found = SystemSearch(system, system).of_type(n, p, (0,) * p, guess)
        return self._from(cycle, solution_of(found[0])[1]) if found else found

    def _anywhere(self, cycle: Cycle) -> Orbits:
        """Return the admissible orbits found from the attractor reached from rest and from a grid of impacts."""
        osc = self.design
        solutions: list[Floats] = []
        others: list[Cycle] = []
        for start in candidates(osc, cycle):
            solved = solve(osc, cycle, start)
            if not solved.converged or solved.singular or solved.z[cycle.n_impacts :].min() <= 0.0:
                continue
            z = from_hardest(cycle, solved.z)
            if any(same_orbit(Impacts.of(z), Impacts.of(other)) for other in solutions):
                continue
            smallest = true_cycle(cycle, z)
            if smallest == cycle:
                solutions.append(z)
            elif smallest not in others:
                others.append(smallest)
        orbits = ordered(make_orbit(self.model, cycle, z) for z in solutions) if solutions else Orbits()
        real = [orbit for orbit in orbits if orbit.admissible]
        virtual = len(orbits) - len(real)
        if real:
            return Orbits(real, message=orbits.message)
        message = f"no initial guess converged to {'an admissible' if virtual else 'a'} {cycle.name} orbit"
        if others:
            message += f"; some converged to {' or '.join(other.name for other in others)} orbits"
        if virtual:
            message += f"; {counted(virtual, 'solution')} inadmissible (penetrating the stop)"
        return Orbits(outcome="other_name" if others else "none", message=message)

    def _from(self, cycle: Cycle, start: Floats) -> Orbits:
        """Return the orbit that Newton's method reaches."""
        solved = solve(self.design, cycle, start)
        return reached(solved, cycle.name, lambda z: make_orbit(self.model, cycle, from_hardest(cycle, z)))


def solve(osc: ImpactOscillator, cycle: Cycle, start: Floats) -> Solved:
    """Return the solution that Newton's method reaches."""
    sizes, parameters = cycle.scales(osc, fastest_of(osc, start[cycle.n_impacts :])), parameters_of(osc)
    return newton.solve(partial(cycle.linearised, parameters), start, sizes, cycle.in_order)


def _attracts(osc: ImpactOscillator, cycle: Cycle, z: Floats) -> bool:
    """Return whether nearby motions approach a solution."""
    return max(map(abs, cycle.multipliers(parameters_of(osc), z))) < 1.0


def impact_of(osc: ImpactOscillator, guess: Guess) -> tuple[float, float] | None:
    """Return phase and velocity of the impact given as an initial guess, or None."""
    orbit, state, near = guess.orbit, guess.state, guess.near
    if guess.none or (orbit is not None and not orbit.velocities):
        return None
    if orbit is not None:
        return orbit.phases[0], orbit.velocities[0]
    if state is not None:
        if state.displacement != osc.gap or state.velocity <= 0.0:
            return _first_impact(osc, state)
        phase, velocity = state.time / osc.period, state.velocity
    elif isinstance(near, (tuple, list)) and len(near) == 2:
        phase, velocity = real_number("near", near[0]), near[1]
    else:
        what = "an orbit, an attractor, a State, a section, or (phase, velocity)"
        raise invalid("near", near, what, "for example near=(0.25, 1.4)")
    allowed = "an impact of velocity > 0"
    speed = real_number("near", velocity, allowed)
    if speed <= 0.0:
        raise invalid("near", velocity, allowed, "give the speed just before contact")
    return phase, speed


def _first_impact(osc: ImpactOscillator, state: State) -> tuple[float, float]:
    """Return phase and velocity of the first impact after a state in front of the stop."""
    (samples,) = get_backend("cpu").samples(osc.cells({}, state), Measurement(ImpactWindow(0, 1)))
    if not len(samples.impact_phase):
        raise invalid("near", state, "a state from which the mass hits the stop")
    return float(samples.impact_phase[0]), float(samples.impact_velocity[0])


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
        family=family_of(model, osc),
        turns=tuple(z[:p].tolist()),
    )


def solution_of(orbit: Orbit) -> tuple[Cycle, Floats]:
    """Return the equations and the solution of an orbit."""
    return Cycle(orbit.n_periods, orbit.n_impacts), np.array([*orbit.turns, *orbit.velocities])


def from_hardest(cycle: Cycle, z: Floats) -> Floats:
    """Return the same cycle rotated so that its hardest impact comes first, at turns in [0, 1)."""
    p = cycle.n_impacts
    first = int(np.argmax(z[p:]))
    turns = np.concatenate([z[first:p], z[:first] + cycle.n_periods])
    return np.concatenate([turns - np.floor(turns[0]), np.roll(z[p:], -first)])


def true_cycle(cycle: Cycle, z: Floats) -> Cycle:
    """Return the smallest n and p with which the cycle repeats."""
    n, p = cycle.n_periods, cycle.n_impacts
    return Cycle(*smallest_cycle(n, Impacts.of(z), np.diff(np.append(z[:p], z[0] + n))))


GRID = (40, 28)  # initial impacts: phases, velocities
TRIES = 40  # number of guesses tried besides the local minima of the residual
SETTLING = 2000  # transient impacts before the attractor is sampled


def followed(osc: ImpactOscillator, cycle: Cycle, phases: Floats, velocities: Floats) -> list[Floats | None]:
    """Return turns and velocities of p + 1 consecutive impacts, beginning with each given one."""
    return [_chain(samples, cycle.n_impacts) for samples in contacts(osc, phases, velocities, cycle.n_impacts)]


def _chain(samples: Samples, p: int) -> Floats | None:
    """Return turns and velocities of p + 1 impacts in a row, or None if there are fewer."""
    if len(samples.impact_phase) < p + 1:
        return None
    periods, phases, velocities = (
        column[-p - 1 :] for column in (samples.impact_periods, samples.impact_phase, samples.impact_velocity)
    )
    return np.concatenate([periods - periods[0] + phases, velocities])


def as_cycle(chain: Floats) -> Floats:
    """Return the cycle obtained by identifying the last impact of a chain with its first."""
    p = len(chain) // 2 - 1
    return np.concatenate([chain[:p], chain[p + 1 : -1]])


def _miss(cycle: Cycle, chain: Floats | None, speed: float) -> float:
    """Return by how much a chain fails to close after n periods, in turns and relative to a speed; or infinity."""
    if chain is None:
        return np.inf
    p = cycle.n_impacts
    late = abs(chain[p] - chain[0] - cycle.n_periods)
    return float(late + abs(chain[-1] - chain[p + 1]) / speed) if late < 0.5 else np.inf


def attractor_chain(osc: ImpactOscillator, cycle: Cycle) -> Floats | None:
    """Return the last impacts of the attractor reached from rest."""
    cells = osc.cells({})
    if osc.gap <= 0.0:  # slightly out of balance: in exact balance nothing would move
        cells = cells.replace(velocity=cells["velocity"] - 1e-3 * osc.velocity_scale)
    window = ImpactWindow(SETTLING, cycle.n_impacts + 1)
    (samples,) = get_backend("cpu").samples(cells, Measurement(window))
    return _chain(samples, cycle.n_impacts)


def candidates(osc: ImpactOscillator, cycle: Cycle) -> list[Floats]:
    """Return initial guesses: the attractor's cycle, then those of a grid on the impact surface that close best."""
    attractor = attractor_chain(osc, cycle)
    if attractor is None and outlast(osc.cells({}), Measurement(ImpactWindow(0, cycle.n_impacts + 1))):
        return []  # impacts of the grid would not be followed that far either
    hardest = 0.0 if attractor is None else float(attractor[cycle.n_impacts + 1 :].max())
    fastest = max(2.0 * osc.velocity_scale, 1.5 * hardest)
    phases, velocities = np.meshgrid(np.arange(GRID[0]) / GRID[0], fastest * (np.arange(GRID[1]) + 0.5) / GRID[1])
    chains = followed(osc, cycle, phases.ravel(), velocities.ravel())
    misses = np.array([_miss(cycle, chain, fastest) for chain in chains]).reshape(phases.shape)
    # Rows are velocities and columns phases on the circle; beyond the rows the residual counts as infinite.
    walled = np.pad(np.pad(misses, ((0, 0), (1, 1)), mode="wrap"), ((1, 1), (0, 0)), constant_values=np.inf)
    around = [np.roll(walled, (a, b), (0, 1))[1:-1, 1:-1] for a in (-1, 0, 1) for b in (-1, 0, 1)]
    lowest = np.isfinite(misses) & (misses <= np.min(around, axis=0))
    best = misses.ravel() <= np.partition(misses.ravel(), TRIES)[TRIES]
    chosen = np.flatnonzero((lowest.ravel() | best) & np.isfinite(misses.ravel()))
    chosen = chosen[np.argsort(misses.ravel()[chosen])]
    return [as_cycle(chain) for chain in [attractor, *(chains[j] for j in chosen)] if chain is not None]
