r"""Orbits of systems that rest at a stop.

A rest erases only the components of a perturbation that would change the clearance of that stop; the others persist.
So, unlike for one mass, the cycle does not follow from the release. It is a fixed point, P(x) = x, of the motion over n
periods, where x is the state at a phase without events. The engine computes P impact by impact, with complete chatter
and rests, together with its derivative: saltation at impacts, projection where a stop closes (A. B. Nordmark and P. T.
Piiroinen, Nonlinear Dynamics 58 (2009) 85-106). Newton's method then takes x + (1 - P')^-1 (P(x) - x); the multipliers
are the eigenvalues of P'; rests make some of them 0.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.backends import Measurement, StroboscopicWindow, get_backend
from vibroimpact.backends.modal.carry import Carrier
from vibroimpact.cells import Floats
from vibroimpact.model import State
from vibroimpact.model.elements import Contact
from vibroimpact.model.system import ImpactSystem
from vibroimpact.motion import cycle_name
from vibroimpact.motion.recognition import recurrence
from vibroimpact.options import Tolerances
from vibroimpact.orbits import newton
from vibroimpact.orbits.cycle import multipliers_of
from vibroimpact.orbits.equations import SAME, TURN
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.newton import Solved
from vibroimpact.orbits.orbit import Orbit, Rest, at_rest, family_of, phases_of
from vibroimpact.orbits.results import Guess, Orbits, Search, lost, ordered, other_name
from vibroimpact.parameters import invalid

RETURNS = 100  # most driving periods of a cycle that is recognised in the motion from rest
LATER = 0.381966  # driving periods after which a state at an event is, as a rule, at none
SETTLING = 1000  # transient driving periods from rest before the guess for Newton's method


class _History(NamedTuple):
    """The events in a cycle, in the order of time; times are in driving periods.

    Each impact has a time, a stop, a velocity (m/s) and a contact. `displacements` are the coordinates at the
    beginning and after each period, relative to a free centre.
    """

    times: Floats
    stops: tuple[str, ...]
    velocities: Floats
    contacts: tuple[Contact, ...]
    rests: tuple[Rest, ...]
    displacements: Floats


def find_sticking(search: Search, n_periods: int, guess: Guess) -> Orbits:
    """Return the period-n orbit that rests at a stop, from an orbit or a state near it, or the motion from rest."""
    system: ImpactSystem = search.design
    if guess.orbit is not None:
        if len(guess.orbit.start.displacement) != system.coordinates:
            raise invalid("near", guess.orbit.name, f"an orbit of {system.coordinates} coordinates")
    elif guess.state is not None:
        system.cells({}, guess.state)  # refused where it does not fit
    carrier, name = Carrier(system.cells({}), Tolerances()), cycle_name(n_periods, -1)
    try:
        if guess.state is None:
            samples = _settled(system)
            state = State(samples.look_displacement[0], samples.look_velocity[0], samples.look_phase[0] * system.period)
        else:
            state = guess.state
        if guess.sticks:  # at the same phase, at which there are no events
            state = replace(state, time=state.time * system.period / guess.orbit.oscillator.period)
        else:
            state = _later(system, state)
            state = _quiet_state(_follow(system, state, n_periods), carrier, state, system.period, n_periods)
        solved, derivative = _solve(carrier, state, system.period, n_periods)
    except ValueError as error:  # beyond a stop, or the motion cannot be followed
        return Orbits(outcome="not_converged", message=str(error))
    if solved.singular or not solved.converged:
        return lost(solved, name)
    state = _state(carrier, solved.z, state.time % system.period)
    history = _follow(system, state, n_periods)
    first = history.displacements[0]
    distances = np.abs(history.displacements - first).max(axis=1) / (np.abs(first).max() or 1.0)
    periods = next((n for n in range(1, n_periods + 1) if n_periods % n == 0 and distances[n] <= SAME), 0)
    if not periods:  # Newton's method stagnated away from a fixed point
        return lost(solved, name)
    if not len(history.times):
        where = f"stays at {history.rests[0].stop} for ever" if history.rests else "has no impacts"
        return Orbits(outcome="none", message=f"no {name} orbit found: the motion reached {where}")
    if not history.rests:
        reached = cycle_name(periods, len(history.times) * periods // n_periods)
        return Orbits(outcome="other_name", message=f"converged to a {reached} orbit, which rests at no stop")
    if periods < n_periods:
        return other_name(cycle_name(periods, -1), name)
    if guess.sticks:
        state = _quiet_state(history, carrier, state, system.period, n_periods)
    orbit = _orbit(search, history, state, multipliers_of(derivative), n_periods)
    return ordered([orbit])


def _settled(system: ImpactSystem, looks: int = 1) -> Any:
    """Return samples of the settled motion from rest, one per driving period."""
    (samples,) = get_backend("cpu").samples(system.cells({}), Measurement(StroboscopicWindow(SETTLING, looks)))
    if len(samples.look_phase) < looks:
        raise ValueError("the motion from rest could not be followed; give `near`")
    return samples


def _later(system: ImpactSystem, state: State) -> State:
    """Return the state somewhat later: one at an event belongs neither before nor after it."""
    window = StroboscopicWindow(0, 1, (state.time / system.period + LATER) % 1.0)
    (samples,) = get_backend("cpu").samples(system.cells({}, state), Measurement(window))
    if not len(samples.look_phase):
        raise ValueError("the motion from `near` could not be followed")
    return State(samples.look_displacement[0], samples.look_velocity[0], samples.look_phase[0] * system.period)


def periods_from_rest(system: ImpactSystem, longest: int) -> int:
    """Return the driving periods (up to 100) of the cycle reached from rest if it rests at a stop; else 0."""
    try:
        samples = _settled(system, 2 * RETURNS)
    except ValueError:
        return 0
    over = samples.rest_end.sum(axis=1) < samples.look_turns[0]
    displacements = _beside_centre(system, samples.look_displacement)
    return 0 if over.all() else recurrence(*displacements.T, tolerance=SAME, longest=min(longest, RETURNS))


def _beside_centre(system: ImpactSystem, displacements: Floats) -> Floats:
    """Return coordinates relative to a free centre, one row per instant."""
    form = system.modal()
    beside: Floats = displacements - displacements @ form.inverse[form.neutral[0]].T @ form.shapes[:, form.neutral[0]].T
    return beside


def _state(carrier: Carrier, x: Floats, time: float) -> State:
    displacement, velocity = carrier.coordinates(x)
    return State(displacement.tolist(), velocity.tolist(), time)


def _follow(system: ImpactSystem, state: State, n_periods: int) -> _History:
    """Return the events within n periods of a motion; rests in progress are followed to their ends."""
    samples: Any
    window = StroboscopicWindow(0, 2 * n_periods + 1)
    (samples,) = get_backend("cpu").samples(system.cells({}, state), Measurement(window))
    first, names = state.time / system.period, system.stop_names
    times = samples.impact_turns
    within = times < first + n_periods
    rests: list[Rest] = []
    for stop, begin, end in zip(
        samples.rest_stop, samples.rest_begin.sum(axis=1), samples.rest_end.sum(axis=1), strict=True
    ):
        lasts = math.isnan(end)
        # Near an end of sticking, the last impacts of a chatter, below the cutoff, may outlast the pressing force.
        chatters_on = end <= begin
        if not chatters_on and (first < begin < first + n_periods or (lasts and begin <= first)):
            rests.append(Rest(names[stop], float(begin), float(first + n_periods if lasts else end)))
    # If the cycle begins during a rest, that rest is recorded again, completely, at the end of the cycle.
    ends = [rest.end - n_periods for rest in rests]
    rests = [rest for rest in rests if not any(abs(rest.end - end) <= SAME for end in ends)]
    return _History(
        times[within],
        tuple(names[stop] for stop in samples.impact_stop[within]),
        samples.impact_velocity[within],
        _contacts(samples, within),
        tuple(rests),
        _beside_centre(system, samples.look_displacement),
    )


def _contacts(samples: Any, which: Any) -> tuple[Contact, ...]:
    """Return the contacts of some impacts; the NaN of rigid stops is the one of `Contact`, so that they are equal."""
    rows = np.column_stack(np.broadcast_arrays(*samples.contacts))[which].tolist()
    return tuple(Contact(*(math.nan if math.isnan(number) else number for number in row)) for row in rows)


def _quiet_state(history: _History, carrier: Carrier, state: State, period: float, n_periods: int) -> State:
    """Return the state in the middle of the longest interval without events, with all stops open if possible.

    The present interval is kept unless another is twice as long.
    """
    first = state.time / period
    begins, ends = np.array([rest[1:] for rest in history.rests]).reshape(-1, 2).T
    events = np.unique((np.concatenate([history.times, begins, ends]) - first) % n_periods)
    if not len(events):
        return state
    lengths = np.diff(events, append=events[0] + n_periods)
    middles = events + 0.5 * lengths
    free = ((first + middles[:, None] - begins) % n_periods >= ends - begins).all(axis=1)
    lengths[-1] *= 2.0  # the present interval
    at = max(range(len(middles)), key=lambda i: (free[i], lengths[i]))
    x = carrier.state(np.array(state.displacement), np.array(state.velocity))
    later = middles[at] % n_periods
    x, _ = carrier.over(x, first % 1.0, later)
    return _state(carrier, x, (first + later) % n_periods * period)


def _solve(carrier: Carrier, state: State, period: float, n_periods: int) -> tuple[Solved, Floats]:
    """Return the fixed point that Newton's method reaches, and P' there, without a free centre."""
    x, phase = carrier.state(np.array(state.displacement), np.array(state.velocity)), state.time / period % 1.0
    felt = ~carrier.neutral
    derivative = np.eye(int(felt.sum()))

    def linearised(unknown: Floats) -> tuple[Floats, Floats]:
        x[felt] = unknown
        end, slope = carrier.over(x, phase, n_periods)
        derivative[:] = slope[np.ix_(felt, felt)]
        return (x - end)[felt], np.eye(len(unknown)) - derivative

    sizes = np.full(len(derivative), np.abs(x[felt]).max() or 1.0)
    solved = newton.solve(linearised, x[felt], (sizes, sizes), lambda unknown: True)
    return replace(solved, z=x), derivative


def _from_release(history: _History, names: tuple[str, ...], n_periods: int) -> _History:
    """Return a cycle that begins at the end of its longest rest at the first stop that it rests at."""
    first = min(history.rests, key=lambda rest: (names.index(rest.stop), rest.begin - rest.end))
    release = first.end
    times = release + (history.times - release) % n_periods
    order = np.argsort(times, kind="stable")
    later = [release + (rest.begin - release) % n_periods for rest in history.rests]
    rests = sorted(
        (
            Rest(rest.stop, begin, begin + rest.end - rest.begin)
            for rest, begin in zip(history.rests, later, strict=True)
        ),
        key=lambda rest: rest.begin,
    )
    return history._replace(
        times=times[order],
        stops=tuple(history.stops[at] for at in order),
        velocities=history.velocities[order],
        contacts=tuple(history.contacts[at] for at in order),
        rests=tuple(rests),
    )


def _orbit(search: Search, history: _History, state: State, multipliers: tuple[complex, ...], n_periods: int) -> Orbit:
    system: ImpactSystem = search.design
    history = _from_release(history, system.stop_names, n_periods)
    whole, before = math.floor(history.times[0]), math.floor(state.time / system.period)
    turns = tuple((history.times - whole).tolist())
    rests = tuple(Rest(stop, begin - whole, end - whole) for stop, begin, end in history.rests)
    struck = set(zip(history.stops, turns, strict=True))
    chatters = any((rest.stop, rest.begin) not in struck for rest in rests if rest.end - rest.begin < n_periods)
    stick, release, stuck = at_rest(rests, n_periods, system.period)
    return Orbit(
        oscillator=system,
        n_periods=n_periods,
        n_impacts=-1 if chatters else len(turns),
        stops=history.stops,
        turns=turns,
        velocities=tuple(history.velocities.tolist()),
        phases=phases_of(turns),
        start=replace(state, time=state.time + ((before - whole) % n_periods - before) * system.period),
        multipliers=multipliers,
        family=family_of(search.model, system),
        contacts=history.contacts,
        neutral=multipliers_of(Flow(system).drift(TURN * n_periods)),
        rests=rests,
        stick_phase=stick,
        release_phase=release,
        stuck_time=stuck,
    )
