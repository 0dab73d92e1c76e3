"""The orbit near a motion: the one that it is on, settles to, or comes closest to, whatever its type.

A motion from a state is followed until its cycle is certain (or for 32,767 impacts), and the cycle is solved for. A
state may also lie on an unstable orbit, which the motion leaves: then its first impacts come back, and Newton's method
finds that orbit from them. Chaos comes close to many unstable orbits: those of its closest returns are solved for.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.cells import Floats
from vibroimpact.dataset import model_of, start_of
from vibroimpact.model import State
from vibroimpact.motion import NAMING, Motion, MotionClass, decide, may_wind
from vibroimpact.orbits.distance import Impacts, orbit_distance, points_of, smallest_cycle
from vibroimpact.orbits.results import IMPACTS, Orbits, Search, ordered
from vibroimpact.parameters import counted
from vibroimpact.status import Status

WATCHED = ImpactWindow((1 << 14) - 1, 1 << 14)  # as `attractors` watches systems
ON = 1e-4  # `orbit_distance` of a motion from an orbit that it is on
CLOSE = 0.05  # the same from an orbit that it is near
ALIKE = 1e-6  # of the same: parts of one settled cycle
APPROACH = 0, 49, 193, 769  # impacts after which the motion of a system is compared with a stable orbit, one by one
SETTLED = 1e-3  # `orbit_distance` from a stable orbit at which a motion counts as settling to it
RETURN = 0.02  # of phases as points of the unit circle, and of the hardest impact: returns that are tried
LONGEST = 64  # impacts of the longest cycle found from its first return, as attractors of systems are solved for
PASSING = 8  # the same where a chaotic motion passes by
TRIED = 12  # returns that are solved for, the closest first
SEEN = 2048  # impacts of a motion that does not repeat among which its closest returns are
SECTIONS = "impact_section", "stroboscopic_section", "simulate"


class _Return(NamedTuple):
    """A return of a motion close to where it was: how far off, from which impact, after so many impacts and periods."""

    miss: float
    at: int
    p: int
    n: int


@dataclass(frozen=True)
class Hits:
    """The first impacts of a motion: times in driving periods, speeds in m/s and numbers of stops; the rests."""

    cell: Any
    keep: int

    @cached_property
    def samples(self) -> Any:
        """The samples of all impacts that are kept."""
        (samples,) = get_backend("cpu").samples(self.cell, Measurement(ImpactWindow(0, self.keep)))
        return samples

    @cached_property
    def turns(self) -> Floats:
        """The times of the impacts."""
        turns: Floats = self.samples.impact_turns
        return turns

    def part(self, first: int, p: int) -> Impacts:
        """Return p impacts in a row."""
        row = slice(first, first + p)
        return Impacts(self.turns[row] % 1.0, self.samples.impact_velocity[row])

    def rests(self, p: int) -> bool:
        """Return whether the motion rests at a stop within its first p impacts, or has fewer."""
        begins = self.samples.rest_begin.sum(axis=1)
        return len(self.turns) <= p or bool(((begins >= self.turns[0]) & (begins <= self.turns[p])).any())

    def returns(self, firsts: int, longest: int) -> list[_Return]:
        """Return the returns to the first impacts, the closest first, each of the shortest cycle that explains it."""
        samples, found = self.samples, []
        fastest = samples.impact_velocity.max(initial=0.0)
        points = points_of(Impacts(self.turns, samples.impact_velocity), fastest)
        for p in range(1, min(longest, len(points) - 1) + 1):
            rows = np.arange(min(firsts, len(points) - p))
            waits = self.turns[rows + p] - self.turns[rows]
            misses = np.abs(points[rows + p] - points[rows]).max(axis=1)
            same = samples.impact_stop[rows + p] == samples.impact_stop[rows]
            good = (misses < RETURN) & same & (np.rint(waits) >= 1.0) & (np.abs(waits - np.rint(waits)) < RETURN)
            found += [_Return(float(misses[at]), int(at), p, int(np.rint(waits[at]))) for at in np.flatnonzero(good)]
        return sorted(found)[:TRIED]


def state_of(near: Any, design: Any) -> Any:
    """Return the last state of a motion that `simulate` or a section holds, in a design; anything else as it is."""
    if not hasattr(near, "data_vars"):
        return near
    function = near.attrs.get("function", "")
    if function not in SECTIONS:
        what = f"a Dataset of {function}" if function else "another Dataset"
        raise ValueError(f"`near` must be an orbit, an attractor, a State, a section or a simulation, got {what}")
    source: Any = model_of(near)
    if source.coordinates != design.coordinates:
        wanted = counted(design.coordinates, "coordinate")
        raise ValueError(f"`near` must be a motion with {wanted}, got one with {source.coordinates}")
    if function != "impact_section":
        last = [near[name].values[-1:] for name in ("displacement", "velocity", "time")]
    elif design.forgets:
        last = [
            np.full(near.sizes["impact"], design.gap)[-1:],
            *(near[name].values[-1:] for name in ("velocity", "time")),
        ]
    else:  # impacts alone do not determine all coordinates: the motion is computed once more
        arguments = json.loads(near.attrs["arguments"])
        window = ImpactWindow(arguments["transient_impacts"], arguments["sample_impacts"])
        samples: Any
        (samples,) = get_backend("cpu").samples(source.cells({}, start_of(near)), Measurement(window))
        time = [samples.last_phase * source.period][: near.sizes["impact"]]
        last = [np.array([samples.last_displacement]), np.array([samples.last_velocity]), time]
    if not len(last[2]):
        raise ValueError(
            f"`near` must be a motion that strikes a stop, got a result of {function} with none in its window"
        )
    return State(last[0][0], last[1][0], float(last[2][0]) % source.period * design.period / source.period)


def orbit_near(search: Search, state: State) -> Orbits:
    """Return the orbit that the motion from a state is on, settles to or comes closest to; the message says which."""
    design = search.design
    cell = design.cells({}, state)
    approached = Orbits() if design.forgets else _approached(search, cell)
    if approached:
        return _nearest(search, Hits(cell, 2 * PASSING + 1), approached, PASSING)[0]
    outcome = get_backend("cpu").indices(cell, Measurement(WATCHED, indices=NAMING))
    growth, n, p = (float(outcome[name][0]) for name in NAMING)
    status, impacts = Status(int(outcome["status"][0])), int(outcome["impacts"][0])
    winds = WATCHED.keep if may_wind(design) else 0
    kind = MotionClass(int(decide(status, WATCHED.keep * growth, n, p, winds)))
    if not kind.hits and kind != MotionClass.UNDECIDED:
        why = Motion(kind.word, status=status).sentence(design.period)
        return Orbits(outcome="none", message=f"the motion from `near` ends without impacts: {why}")
    first, settled = Hits(cell, 2 * LONGEST + 1), Orbits()
    if n:
        settled = _settled(search, Hits(_after(cell, impacts) or cell, max(int(p), 1) + 1), int(n), int(p))
        if settled:
            settled.message = f"the motion from `near` settles to this {settled[0].name} orbit within {impacts} impacts"
    found, near = _nearest(search, first, settled, LONGEST)
    if n or near:
        return found
    return _passed(search, Hits(_after(cell, SEEN) or cell, SEEN), Motion(kind.word, status=status))


def _nearest(search: Search, first: Hits, settled: Orbits, longest: int) -> tuple[Orbits, bool]:
    """Return the orbit that the first impacts are on or near, if there is one, and True; else the settled one."""
    if settled and _distance(settled[0], first) <= ON:
        return ordered(settled), True
    nearest = min(CLOSE, *(_distance(orbit, first) for orbit in settled), math.inf)
    for back in first.returns(1, longest):
        found = _solved(search, first, back)
        if found and _distance(found[0], first) < (1.0 - ALIKE) * nearest:  # else it is the same orbit
            return found, True
    return settled, False


def _approached(search: Search, cell: Any) -> Orbits:
    """Return the stable orbit that a motion is close to after some impacts; empty if there is none.

    Until its cycle is certain, a stiff system may take millions of steps more.
    """
    skipped = 0
    for further in APPROACH:
        if (cell := _after(cell, further)) is None:
            break
        skipped += further
        hits = Hits(cell, 2 * PASSING + 1)
        for back in hits.returns(1, PASSING):
            found = _solved(search, hits, back)
            if found and found[0].stable and (distance := _distance(found[0], hits, back.at)) <= SETTLED:
                what = f"the motion from `near` settles to this {found[0].name} orbit"
                found.message = f"{what}: after {skipped} impacts its distance from it is {distance:.1g}"
                return found
    return Orbits()


def _after(cell: Any, impacts: int) -> Any:
    """Return the cell started after so many impacts, or None if there are fewer."""
    if not impacts:
        return cell
    (samples,) = get_backend("cpu").samples(cell, Measurement(ImpactWindow(impacts - 1, 1)))
    return cell.continuing(samples) if len(samples.impact_phase) else None


def _settled(search: Search, hits: Hits, n: int, p: int) -> Orbits:
    """Return the orbit of a motion that has settled, from the first impact of a cycle on."""
    if p > IMPACTS:
        message = f"the motion from `near` repeats after {p} impacts; orbits of up to {IMPACTS} are solved for"
        return Orbits(outcome="not_converged", message=message)
    if p > 0 and not hits.rests(p):
        # A part of the cycle is enough if all its parts are alike.
        n, p = smallest_cycle(n, hits.part(0, p), hits.samples.impact_stop[:p], tolerance=ALIKE)
        return _solved(search, hits, _Return(0.0, 0, p, n))
    return search.from_motion(hits, 0, n, -1)


def _solved(search: Search, hits: Hits, back: _Return) -> Orbits:
    """Return the admissible orbit that Newton's method reaches from the impacts before a return."""
    orbits = search.from_motion(hits, back.at, back.n, back.p)
    return orbits if orbits and orbits[0].admissible else Orbits(outcome=orbits.outcome, message=orbits.message)


def _distance(orbit: Any, hits: Hits, at: int = 0) -> float:
    """Return the distance of an orbit from the impacts of a motion from one on."""
    return orbit_distance(orbit, hits.part(at, len(orbit.velocities)))


def _passed(search: Search, hits: Hits, motion: Motion) -> Orbits:
    """Return the orbit that a motion which does not repeat comes closest to, of those of its closest returns."""
    what = f"the motion from `near` is {motion.sentence(search.design.period)}"
    for back in hits.returns(SEEN, PASSING):
        found = _solved(search, hits, back)
        if found and (distance := _distance(found[0], hits, back.at)) <= CLOSE:
            kind = "stable" if found[0].stable else "unstable"
            found.message = f"{what}; this {kind} {found[0].name} orbit is {distance:.2g} from some of its impacts"
            found.outcome = "not_periodic"
            return found
    return Orbits(outcome="not_periodic", message=f"{what}; no periodic orbit was found near its impacts")
