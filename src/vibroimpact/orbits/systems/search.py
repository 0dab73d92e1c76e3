"""Find the periodic orbits of a system: with one impact in closed form, others by Newton's method from a guess."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.cells import Floats
from vibroimpact.model import Model, State
from vibroimpact.model.system import ImpactSystem
from vibroimpact.motion import cycle_name
from vibroimpact.motion.recognition import cycle_length
from vibroimpact.orbits.cycle import Cycle
from vibroimpact.orbits.distance import same_orbit
from vibroimpact.orbits.equations import SAME
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.results import IMPACTS, NOTHING, Guess, Orbits, Solution, numbers_of, ordered, reached
from vibroimpact.orbits.symmetry import mirror
from vibroimpact.orbits.systems.admissibility import far_beyond
from vibroimpact.orbits.systems.closed_form import one_impact
from vibroimpact.orbits.systems.guesses import beginning, traced
from vibroimpact.orbits.systems.one_contact import one_contact
from vibroimpact.orbits.systems.orbit import make_orbit
from vibroimpact.orbits.systems.sticking import find_sticking
from vibroimpact.parameters import counted, invalid

# Transient impacts of the motion from rest before the guess for Newton's method; the second number, as in verdicts, is
# used if no cycle is reached after the first.
TRANSIENTS = 2000, 1 << 15
LOOK = 128  # impacts sampled, in which cycles of up to half as many are recognised


def find(model: Model, n_periods: int, n_impacts: int, guess: Guess) -> Orbits:
    """Return the period-n impact-p orbits of a system, on any stops.

    All orbits with one impact, or with two that are mirror images of each other, are found. Other orbits, and orbits
    that rest, are found from `near` or if the motion from rest settles to one.
    """
    if guess.state is None and not guess.none:
        raise invalid("near", guess.near, "an orbit or an attractor of a system, or a State")
    if n_impacts == -1:
        return find_sticking(model, n_periods, guess)
    if guess.stops and len(guess.stops) != n_impacts:
        hint = f"or give n_impacts={len(guess.stops)}"
        raise invalid("near", guess.orbit.name, f"an orbit of {n_impacts} impacts", hint)
    if n_impacts == 1:
        return _with_near(striking(model, n_periods), model, n_periods, guess)
    if guess.none:
        return _anywhere(model, n_periods, n_impacts)
    return from_near(model, n_periods, n_impacts, guess)


def striking(
    model: Model,
    n_periods: int,
    stops: tuple[int, ...] | None = None,
    guess: Guess = NOTHING,
    *,
    symmetric: bool = False,
) -> Orbits:
    """Return the orbits that strike given stops in order; without these, one stop each, or the stops of the guess."""
    system: ImpactSystem = model.at()
    images, why = mirror(system)
    if symmetric and why:
        return Orbits(outcome="none", message=why)
    if stops is None and guess.stops:
        stops = numbers_of(guess.stops[: len(guess.stops) // (2 if symmetric else 1)], system.stop_names)
    singles = [(at,) for at in range(len(system.stops)) if not symmetric or at < images[at]]
    sequences = singles if stops is None else [stops]
    if not sequences:
        raise invalid("stops", None, f"1 to {IMPACTS} stops to strike", "the system has none")
    flow, mirrored = Flow(system), images if symmetric else ()
    needs_no_guess = guess.none or not (guess.only_state or flow.compliant[sequences[0][0]])
    if len(sequences[0]) == 1 and needs_no_guess:
        return _of_one(model, [Cycle(flow, n_periods, flow.contact(stop), mirrored) for (stop,) in sequences])
    return _from(model, *beginning(flow, n_periods, sequences[0], mirrored, guess), images)


def of_one_impact(model: Model, n_periods: int, *, symmetric: bool) -> Iterator[Solution]:
    """Yield the solutions with one impact on any stop and, if asked, those with one on each stop of a mirrored pair."""
    system: ImpactSystem = model.at()
    flow, images = Flow(system), mirror(system)[0] if symmetric and n_periods % 2 else ()
    cycles = [Cycle(flow, n_periods, flow.contact(stop)) for stop in range(len(system.stops))]
    cycles += [Cycle(flow, n_periods, flow.contact(at), images) for at, image in enumerate(images) if at < image]
    for cycle, unknown in chain.from_iterable(_solutions(one)[0] for one in cycles):
        yield Solution(
            (cycle.stops, cycle.images),
            float(cycle.velocities(unknown)[0]),
            partial(_may_attract, cycle, unknown),
            partial(make_orbit, model, cycle, unknown),
        )


def _may_attract(cycle: Cycle, unknown: Floats) -> bool:
    """Return whether nearby motions approach a solution that is not far beyond a stop."""
    return abs(cycle.multipliers(unknown)[0]) < 1.0 and not far_beyond(cycle, unknown)


def _solutions(cycle: Cycle) -> tuple[list[tuple[Cycle, Floats]], str]:
    """Return all solutions with the one impact of a cycle, and the reason if there are none.

    For contacts that last the reason also says which others may have been missed.
    """
    return (one_contact if len(cycle.events) > 1 else one_impact)(cycle)


def _of_one(model: Model, cycles: Iterable[Cycle]) -> Orbits:
    orbits, reasons = Orbits(), []
    for cycle in cycles:
        solutions, why = _solutions(cycle)
        orbits += [make_orbit(model, *solution) for solution in solutions]
        if why:
            reasons.append((bool(solutions), f"{model.at().stop_names[cycle.events[0].stop]}: {why}"))
    if not orbits:
        return Orbits(outcome="none", message="; ".join(reason for _, reason in reasons))
    orbits = ordered(orbits)
    orbits.message = "; ".join([orbits.message, *(reason for beside, reason in reasons if beside)])
    return orbits


def _anywhere(model: Model, n_periods: int, n_impacts: int) -> Orbits:
    """Return the admissible symmetric orbits with two impacts, and that to which the motion from rest settles."""
    symmetric = Orbits()
    if n_impacts == 2 and n_periods % 2 and not mirror(model.at())[1]:
        symmetric = striking(model, n_periods, symmetric=True)
    orbits = [orbit for orbit in symmetric if orbit.admissible]
    orbits += [
        orbit for orbit in settled(model, n_periods, n_impacts) if not any(same_orbit(orbit, other) for other in orbits)
    ]
    orbits = orbits or [orbit for orbit in find_sticking(model, n_periods, NOTHING) if orbit.n_impacts == n_impacts]
    if orbits:
        return ordered(orbits)
    tried = f"does not settle to a {cycle_name(n_periods, n_impacts)} orbit within {TRANSIENTS[-1]} impacts"
    beside = f"{counted(len(symmetric), 'symmetric orbit')} found, but inadmissible; " if symmetric else ""
    return Orbits(outcome="none", message=f"{beside}the motion from rest {tried}; give `near`")


def from_near(model: Model, n_periods: int, n_impacts: int, guess: Guess) -> Orbits:
    """Return the orbit that Newton's method reaches from another orbit, or from the motion that begins in a state."""
    if guess.stops:
        return striking(model, n_periods, guess=guess)
    system: ImpactSystem = model.at()
    system.cells({}, guess.state)  # refused where it does not fit
    cycle_and_start = traced(Flow(system), n_periods, guess.state, n_impacts)
    if cycle_and_start is None:
        message = f"the motion from `near` does not come close to a {cycle_name(n_periods, n_impacts)} orbit at once"
        return Orbits(outcome="not_converged", message=f"{message}; give a state closer to one")
    return _from(model, *cycle_and_start, mirror(system)[0])


def _with_near(orbits: Orbits, model: Model, n_periods: int, guess: Guess) -> Orbits:
    """Return orbits, with the one near a guess added if it is missing."""
    if guess.none or guess.sticks or all(stop.element.instantaneous for stop in model.at().stops):
        return orbits
    more = [one for one in from_near(model, n_periods, 1, guess) if not any(same_orbit(one, each) for each in orbits)]
    return ordered([*orbits, *more]) if more else orbits


def _from(model: Model, cycle: Cycle, start: Floats, images: tuple[int, ...]) -> Orbits:
    """Return the orbit that Newton's method reaches."""
    name = cycle_name(cycle.n_periods, len(cycle.stops) * (2 if cycle.images else 1))
    return reached(cycle.solve(start), name, lambda z: make_orbit(model, *halved(cycle, z, images)))


def halved(cycle: Cycle, unknown: Floats, images: tuple[int, ...]) -> tuple[Cycle, Floats]:
    """Return half of a cycle, with its unknown, if the halves are mirror images, else the cycle and its unknown."""
    p, angles = len(cycle.events), unknown[: len(cycle.events)]
    half = replace(cycle, events=cycle.events[: p // 2], images=images)
    possible = images and not cycle.images and cycle.n_periods % 2
    if not possible or cycle.events[p // 2 :] != half.next_events:
        return cycle, unknown
    x, mirrored = (state[~cycle.flow.neutral] for state in (unknown[p:], cycle.states(unknown)[p // 2]))
    late = np.abs(angles[p // 2 :] - angles[: p // 2] - half.length).max()
    alike = late <= SAME and np.abs(x + mirrored).max() <= SAME * np.abs(x).max()
    return (half, np.append(angles[: p // 2], unknown[p:])) if alike else (cycle, unknown)


def settled(model: Model, n_periods: int, n_impacts: int, transients: Sequence[int] = TRANSIENTS) -> list[Orbit]:
    """Return the orbit to which the motion from rest settles, if it is of this (n, p) type."""
    system = model.at()
    samples: Any
    for transient in transients:
        window = ImpactWindow(transient, n_impacts * math.ceil(LOOK / n_impacts) + 1)  # it ends as the transient does
        (samples,) = get_backend("cpu").samples(system.cells({}), Measurement(window))
        turns = (samples.impact_periods + samples.impact_phase)[-n_impacts - 1 :]
        if len(turns) <= n_impacts:
            break
        if abs(turns[-1] - turns[0] - n_periods) <= SAME * n_periods:
            stops = samples.impact_stop[-n_impacts - 1 : -1].tolist()
            times = (turns[:-1] * system.period).tolist()
            if orbits := find_near(model, n_periods, stops, times, ended(system, samples)):
                return list(orbits)
        elif cycle_length(samples.impact_velocity, samples.impact_phase):  # of another type
            break
    return []


def ended(system: Any, samples: Any) -> State:
    """Return the state in which a sampled motion ended."""
    return State(samples.last_displacement, samples.last_velocity, samples.last_phase * system.period)


def find_near(model: Model, n_periods: int, stops: Sequence[int], times: Sequence[float], state: State) -> Orbits:
    """Return the orbit to which a motion has settled, from the times of its impacts, or a state if contacts last."""
    all_stops = model.at().stops
    guess = Guess(times) if all(all_stops[stop].element.instantaneous for stop in stops) else Guess.of(state)
    try:
        return striking(model, n_periods, tuple(stops), guess)
    except ValueError:  # the motion does not repeat these impacts
        return Orbits(outcome="none", message="the motion does not repeat these impacts")
