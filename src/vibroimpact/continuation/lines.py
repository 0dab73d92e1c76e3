"""The bifurcations of orbits with one impact, known in closed form, on a line across a plane of two parameters."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from vibroimpact.continuation.branch import walk
from vibroimpact.continuation.equations import Range
from vibroimpact.continuation.flights import equations_of
from vibroimpact.continuation.following import UNKNOWN, both_ways
from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.model import Model
from vibroimpact.orbits import systems
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import Cycle, Floats, fastest_of
from vibroimpact.orbits.one_mass import from_hardest, make_orbit, solution_of, true_cycle
from vibroimpact.orbits.search import search_of
from vibroimpact.orbits.sticking import periods_from_release
from vibroimpact.orbits.sticking_end import StickingEnd, end_of_sticking
from vibroimpact.progress import Report

SEEDS = 60  # values along a line at which orbits are sought


def points_on_line(
    model: Model, parameter: str, range: Range, n: int, longest: float, look: Report
) -> Iterator[BifurcationPoint]:
    """Yield the special points of period-n impact-1 orbits along a line, following each branch once.

    For symmetric systems, those of orbits with one impact in each half of a cycle are included.
    """
    followed: dict[Hashable, list[Floats]] = defaultdict(list)
    for value in np.linspace(*range, SEEDS).tolist():
        look(0, UNKNOWN, None)
        for solution in search_of(model.replace(**{parameter: value})).of_one_impact(n, symmetric=True):
            if any(covered(rows, value, solution.velocity) for rows in followed[solution.struck]):
                continue
            orbit = solution.orbit()
            if not orbit.admissible:
                continue
            equations, solved = equations_of(orbit, (parameter,), (range,))
            for way in both_ways(partial(walk, equations, equations.pack(solved), longest, False), look):
                rows = [[p.value, p.equations.velocities(p.x)[0]] for p in way.points]
                followed[solution.struck].append(np.array(rows))
                yield from (special.bifurcation(parameter) for special in way.special)


def ends_on_line(model: Model, parameter: str, range: Range, n: int, report: Report) -> Iterator[StickingEnd]:
    """Yield the ends of period-n sticking along a line, between neighbouring seeds that differ."""

    def periods(value: float) -> int:
        report(0, UNKNOWN, None)
        return periods_from_release(model.at(**{parameter: value}), n)

    values = np.linspace(*range, SEEDS).tolist()
    lengths = [periods(value) for value in values]
    for (low, before), (high, after) in pairwise(zip(values, lengths, strict=True)):
        if before != after and n in (before, after):
            inside, beyond = (low, high) if before == n else (high, low)
            end = end_of_sticking(model, parameter, (inside, beyond), longest=n)
            if end.found and end.n_periods == n:
                yield end


def covered(branch: Floats, value: float, speed: float) -> bool:
    """Whether an orbit is on a branch already followed: between two of its points in parameter and velocity."""
    values, speeds = branch.T
    jumps = np.abs(np.diff(speeds, prepend=speeds[:1], append=speeds[-1:]))
    nearby = np.maximum.reduce([jumps[:-2], jumps[1:-1], jumps[2:]])  # at the top of an arch neighbours differ little
    around = np.flatnonzero((values[:-1] - value) * (values[1:] - value) <= 0.0)
    low, high = np.sort([speeds[around], speeds[around + 1]], axis=0)
    slack = 0.25 * nearby[around] + 1e-6 * high
    return bool(((low - slack <= speed) & (speed <= high + slack)).any())


def without_grazing_impacts(point: BifurcationPoint | StickingEnd) -> BifurcationPoint | StickingEnd:
    """Return a graze at velocity 0 as a graze of the orbit without this impact, which may have a shorter cycle.

    An orbit with one impact becomes the steady motion, which repeats every driving period; it is represented as a
    period-1 impact-1 orbit of velocity 0.
    """
    if not isinstance(point, BifurcationPoint) or point.kind != "grazing":
        return point
    if not point.orbit.oscillator.forgets:
        return point if any(point.orbit.velocities) else replace(point, orbit=systems.at_first_contact(point.orbit))
    cycle, z = solution_of(point.orbit)
    turns, speeds = z[: cycle.n_impacts], z[cycle.n_impacts :]
    hits = speeds > ROUNDING * fastest_of(point.orbit.oscillator, speeds)
    if hits.all():
        return point
    if not hits.any():
        cycle, z = Cycle(1, 1), np.array([turns[0], 0.0])
    else:
        whole = Cycle(cycle.n_periods, int(hits.sum()))
        z = from_hardest(whole, np.concatenate([turns[hits], speeds[hits]]))
        cycle = true_cycle(whole, z)
        p = cycle.n_impacts
        z = np.concatenate([z[:p], z[whole.n_impacts :][:p]])
    return replace(point, orbit=make_orbit(point.orbit.model, cycle, z))
