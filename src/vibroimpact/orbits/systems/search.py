"""Find the periodic orbits of a system: with one impact in closed form, others by Newton's method from a guess."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from typing import Any

import numpy as np

from vibroimpact.backends import ImpactWindow, Measurement, Samples, get_backend
from vibroimpact.cells import Floats
from vibroimpact.model import State
from vibroimpact.motion import cycle_name
from vibroimpact.motion.recognition import cycle_length
from vibroimpact.orbits.cycle import Cycle
from vibroimpact.orbits.distance import same_orbit
from vibroimpact.orbits.equations import SAME
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.results import IMPACTS, NOTHING, Guess, Orbits, Search, Solution, numbers_of, ordered, reached
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


@dataclass(frozen=True)
class SystemSearch(Search):
    """The search for the periodic orbits of a system."""

    @cached_property
    def flow(self) -> Flow:
        """The flights and contacts of the system."""
        return Flow(self.design)

    @cached_property
    def mirror(self) -> tuple[tuple[int, ...], str]:
        """The mirror image of each stop, and the reason why the system is not symmetric."""
        return mirror(self.design)

    def of_type(
        self,
        n_periods: int,
        n_impacts: int,
        stops: tuple[int, ...] | None = None,
        guess: Guess = NOTHING,
        *,
        symmetric: bool = False,
    ) -> Orbits:
        """Return the period-n impact-p orbits on any stops, or those that strike given ones or are symmetric.

        All orbits with one impact, or with two that are mirror images of each other, are found. Other orbits, and
        orbits that rest, are found from `near` or if the motion from rest settles to one.
        """
        if guess.orbit is not None and guess.orbit.oscillator.forgets:
            guess = Guess.of(guess.state)  # an orbit of one mass gives no more than a state of a system
        if symmetric or stops is not None:
            return self.striking(n_periods, stops, guess, symmetric=symmetric)
        if guess.only_numbers:
            raise invalid("near", guess.near, "an orbit or an attractor of a system, or a State")
        if n_impacts == -1:
            return find_sticking(self, n_periods, guess)
        if guess.stops and len(guess.stops) != n_impacts:
            hint = f"or give n_impacts={len(guess.stops)}"
            raise invalid("near", guess.orbit.name, f"an orbit of {n_impacts} impacts", hint)
        if n_impacts == 1:
            return self._with_near(self.striking(n_periods), n_periods, guess)
        if guess.none:
            return self._anywhere(n_periods, n_impacts)
        return self._from_near(n_periods, n_impacts, guess)

    def of_one_impact(self, n_periods: int, *, symmetric: bool = False) -> Iterator[Solution]:
        """Yield the solutions with one impact on any stop and, if asked, those with one in each mirrored half."""
        images = self.mirror[0] if symmetric and n_periods % 2 else ()
        singles = [self._striking_once(n_periods, stop) for stop in range(len(self.design.stops))]
        pairs = [self._striking_once(n_periods, at, images) for at, image in enumerate(images) if at < image]
        for cycle, unknown in chain.from_iterable(_solutions(one)[0] for one in singles + pairs):
            yield Solution(
                (cycle.stops, cycle.images),
                float(cycle.velocities(unknown)[0]),
                partial(_may_attract, cycle, unknown),
                partial(make_orbit, self.model, cycle, unknown),
            )

    def of_cycle(self, n_periods: int, samples: Samples, span: slice) -> Orbits:
        """Return the orbit near the sampled impacts of a cycle; where contacts last, near the last state sampled."""
        stops, period = samples.impact_stop[span].tolist(), self.design.period
        turns = samples.impact_turns[span]
        times = ((turns - math.floor(turns[0])) * period).tolist()
        lasting = self.flow.compliant[stops].any()
        guess = Guess.of(samples.last_state(period)) if lasting else Guess(times)
        try:
            return self.striking(n_periods, tuple(stops), guess)
        except ValueError:  # the motion does not repeat these impacts
            return Orbits()

    def from_motion(self, hits: Any, skipped: int, n_periods: int, n_impacts: int) -> Orbits:
        """Return the orbit that Newton's method reaches from the state of a motion at an impact."""
        (samples,) = get_backend("cpu").samples(hits.cell, Measurement(ImpactWindow(skipped, 1)))
        guess = Guess.of(samples.last_state(self.design.period))
        if n_impacts == -1:
            return find_sticking(self, n_periods, guess)
        return self._from_near(n_periods, n_impacts, guess)

    def state_of(self, guess: Guess) -> State | None:
        """Return the state of a guess, if it gives one."""
        return guess.state

    def striking(
        self, n_periods: int, stops: tuple[int, ...] | None = None, guess: Guess = NOTHING, *, symmetric: bool = False
    ) -> Orbits:
        """Return the orbits that strike given stops in order; without these, one stop each, or those of the guess."""
        images, why = self.mirror if symmetric else ((), "")
        if why:
            return Orbits(outcome="none", message=why)
        if stops is None and guess.stops:
            struck = guess.stops[: len(guess.stops) // (2 if symmetric else 1)]
            stops = numbers_of(struck, self.design.stop_names)
        singles = [(at,) for at in range(len(self.design.stops)) if not images or at < images[at]]
        sequences = singles if stops is None else [stops]
        if not sequences:
            raise invalid("stops", None, f"1 to {IMPACTS} stops to strike", "the system has none")
        needs_no_guess = guess.none or not (guess.only_state or self.flow.compliant[sequences[0][0]])
        if len(sequences[0]) == 1 and needs_no_guess:
            return self._of_one([self._striking_once(n_periods, stop, images) for (stop,) in sequences])
        return self._from(*beginning(self.flow, n_periods, sequences[0], images, guess))

    def _striking_once(self, n_periods: int, stop: int, images: tuple[int, ...] = ()) -> Cycle:
        """Return the cycle with one impact, or with one in each mirrored half."""
        return Cycle(self.flow, n_periods, self.flow.contact(stop), images)

    def _of_one(self, cycles: Iterable[Cycle]) -> Orbits:
        orbits, reasons = Orbits(), []
        for cycle in cycles:
            solutions, why = _solutions(cycle)
            orbits += [make_orbit(self.model, *solution) for solution in solutions]
            if why:
                reasons.append((bool(solutions), f"{self.design.stop_names[cycle.events[0].stop]}: {why}"))
        if not orbits:
            return Orbits(outcome="none", message="; ".join(reason for _, reason in reasons))
        orbits = ordered(orbits)
        orbits.message = "; ".join([orbits.message, *(reason for beside, reason in reasons if beside)])
        return orbits

    def _anywhere(self, n_periods: int, n_impacts: int) -> Orbits:
        """Return the admissible symmetric orbits with two impacts, and that to which the motion from rest settles."""
        symmetric = Orbits()
        if n_impacts == 2 and n_periods % 2 and not self.mirror[1]:
            symmetric = self.striking(n_periods, symmetric=True)
        orbits = [orbit for orbit in symmetric if orbit.admissible]
        settled = [orbit for orbit in self._from_rest(n_periods, n_impacts) if orbit.admissible]
        orbits += [orbit for orbit in settled if not any(same_orbit(orbit, other) for other in orbits)]
        resting = [] if orbits else find_sticking(self, n_periods, NOTHING)
        orbits += [orbit for orbit in resting if orbit.n_impacts == n_impacts]
        if orbits:
            return ordered(orbits)
        tried = f"does not settle to a {cycle_name(n_periods, n_impacts)} orbit within {TRANSIENTS[-1]} impacts"
        beside = f"{counted(len(symmetric), 'symmetric orbit')} found, but inadmissible; " if symmetric else ""
        return Orbits(outcome="none", message=f"{beside}the motion from rest {tried}; give `near`")

    def _from_near(self, n_periods: int, n_impacts: int, guess: Guess) -> Orbits:
        """Return the orbit that Newton's method reaches from an orbit, or from the motion that begins in a state."""
        if guess.stops:
            return self.striking(n_periods, guess=guess)
        self.design.cells({}, guess.state)  # refused where it does not fit
        cycle_and_start, name = traced(self.flow, n_periods, guess.state, n_impacts), cycle_name(n_periods, n_impacts)
        if cycle_and_start is None:
            message = f"the motion from `near` does not come close to a {name} orbit at once"
            return Orbits(outcome="not_converged", message=f"{message}; give a state closer to one")
        return self._from(*cycle_and_start)

    def _with_near(self, orbits: Orbits, n_periods: int, guess: Guess) -> Orbits:
        """Return orbits, with the one near a guess added if it is missing."""
        if guess.none or guess.sticks or not self.flow.compliant.any():
            return orbits
        near = self._from_near(n_periods, 1, guess)
        more = [one for one in near if not any(same_orbit(one, each) for each in orbits)]
        return ordered([*orbits, *more]) if more else orbits

    def _from(self, cycle: Cycle, start: Floats) -> Orbits:
        """Return the orbit that Newton's method reaches."""
        name, images = cycle_name(cycle.n_periods, len(cycle.stops) * (2 if cycle.images else 1)), self.mirror[0]
        return reached(cycle.solve(start), name, lambda z: make_orbit(self.model, *halved(cycle, z, images)))

    def _from_rest(self, n_periods: int, n_impacts: int) -> Orbits:
        """Return the orbit to which the motion from rest settles, if it is of this (n, p) type."""
        samples: Any
        for transient in TRANSIENTS:
            keep = n_impacts * math.ceil(LOOK / n_impacts) + 1  # the window ends as the transient does
            window = ImpactWindow(transient, keep)
            (samples,) = get_backend("cpu").samples(self.design.cells({}), Measurement(window))
            turns = samples.impact_turns[-n_impacts - 1 :]
            if len(turns) <= n_impacts:
                break
            if abs(turns[-1] - turns[0] - n_periods) <= SAME * n_periods:
                if orbits := self.of_cycle(n_periods, samples, slice(-n_impacts - 1, -1)):
                    return orbits
            elif cycle_length(samples.impact_velocity, samples.impact_phase):  # of another type
                break
        return Orbits()


def _may_attract(cycle: Cycle, unknown: Floats) -> bool:
    """Return whether nearby motions approach a solution that is not far beyond a stop."""
    return abs(cycle.multipliers(unknown)[0]) < 1.0 and not far_beyond(cycle, unknown)


def _solutions(cycle: Cycle) -> tuple[list[tuple[Cycle, Floats]], str]:
    """Return all solutions with the one impact of a cycle, and the reason if there are none.

    For contacts that last the reason also says which others may have been missed.
    """
    return (one_contact if len(cycle.events) > 1 else one_impact)(cycle)


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
