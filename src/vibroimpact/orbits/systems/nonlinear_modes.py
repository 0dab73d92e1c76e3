"""The search for the orbit of a given energy: the family born from a mode, followed from its first contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from vibroimpact.model import as_system
from vibroimpact.model.force import Force
from vibroimpact.model.system import ImpactSystem
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import LET_GO, Event
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.results import Orbits
from vibroimpact.orbits.symmetry import mirror
from vibroimpact.orbits.systems.conserved import FreeCycle, Member, corrected
from vibroimpact.orbits.systems.free_families import at_energy, follow, located, simultaneous
from vibroimpact.orbits.systems.grazes import BORN, LONGEST, followed, recast
from vibroimpact.parameters import counted, hertz, invalid, real_number, whole_number
from vibroimpact.progress import reporter

TIED = 1e-9  # relative: stops that a mode touches at amplitudes this close are touched together
SHORTER = 0.1  # of a first contact or impact that is no orbit's: the next one tried
SMALLEST = 1e-6  # radians: shortest one tried
BEYOND = 1.05  # of the energy of the first contact: beyond it, orbits of less energy are not sought


def find_of_energy(design: Any, energy: Any, mode: Any) -> Orbits:
    """Return the orbits of an energy in J in the family that is born from a mode, counted from 1.

    Above the energy of the first contact it is the first on the curve, below it all of them.
    """
    if why := design.energy_changes:
        hint = "an orbit of a given energy needs a system without damping, load and loss at its stops"
        raise ValueError(f"`energy` was given, but the energy of the motion is not constant: {why}; {hint}")
    system: ImpactSystem = as_system(design)
    if not system.periodic:  # each orbit has a frequency of its own
        system = ImpactSystem(**system.arguments() | {"force": Force(omega=1.0)})
    joules = real_number("energy", energy, "a number > 0, in J")
    if joules <= 0.0:
        raise invalid("energy", energy, "a number > 0, in J")
    at = whole_number("mode", 1 if mode is None else mode, 1) - 1
    if at >= system.coordinates:
        raise invalid("mode", mode, f"at most {system.coordinates}, the number of modes")
    rate = float(system.natural_frequencies[at])
    if rate == 0.0:
        raise invalid("mode", at + 1, "the number of a mode with a frequency", "this one is a rigid-body mode")
    linear = f"mode {at + 1} is linear, with {hertz(rate):.7g} Hz"
    flow = Flow(system.replace(omega=rate))
    for stop in np.flatnonzero(flow.bounds[:, 0] <= 0.0).tolist():
        raise ValueError(f"the `gap` of {system.stop_names[stop]!r} must be > 0 for an orbit of a given energy")
    amplitude, touched = first_contact(flow, at)
    if math.isinf(amplitude):
        raise ValueError(f"{linear} at every energy, since it moves no stop's clearance; choose another `mode`")
    contact = 0.5 * (amplitude * rate) ** 2
    size = 0.5 * math.sqrt(joules / contact - 1.0) if joules > contact else BORN
    first, why, least, most = born(system, at, size), "", contact, contact
    crossings: list[Member | None] = []
    before, number = first, 0
    with reporter(None, "orbits") as report:
        for one, end, reason in () if before is None else follow(before, LONGEST, 0.0, max(joules, BEYOND * contact)):
            why = reason
            if end == "range" and abs(one.joules - joules) < TIED * joules:
                crossings.append(one)
                break
            for each in filter(None, (before and located("fold", before, one), one)):
                if before and (before.joules < joules) != (each.joules < joules):
                    crossings.append(at_energy(before, each, joules))
                before, least, most = each, min(least, each.joules), max(most, each.joules)
            if any(crossings) and joules > contact:
                break
            number += 1
            report(number, None, None)  # type: ignore[arg-type]
    orbits = [one.orbit(system) for one in crossings if one is not None]
    if orbits:
        return Orbits(orbits, message=counted(len(orbits), f"{orbits[0].name} orbit"))
    if joules <= contact:
        lowest = f"; orbits with contact in its family have at least {least:.7g} J" * (least < contact * (1.0 - TIED))
        hint = f"{linear}, up to its first contact at {contact:.7g} J{lowest}"
        raise invalid("energy", joules, f"larger than {least:.7g} J", hint)
    if before is None:
        message = (
            f"no orbit was found at the first contact of mode {at + 1}, at {contact:.7g} J{_unclear(flow, touched)}"
        )
    elif crossings:
        message = f"the family of mode {at + 1} passes {joules:.7g} J at a graze where no orbit was found"
    else:
        energies = f"with energies from {least:.7g} to {most:.7g} J, was followed up to {before.joules:.4g} J"
        message = f"no orbit was found: the family of mode {at + 1}, {energies}: {why}"
    return Orbits(outcome="not_converged", message=message)


def first_contact(flow: Flow, at: int) -> tuple[float, Any]:
    """Return the amplitude of a mode at its first contact, and the stops that it touches there (none: infinite)."""
    reach = np.abs(flow.beta[:, at])
    reach[reach <= TIED] = 0.0
    with np.errstate(divide="ignore"):
        amplitudes = flow.bounds[:, 0] / reach
    least = float(amplitudes.min(initial=math.inf))
    return least, np.flatnonzero(amplitudes <= least * (1.0 + TIED))


def born(system: ImpactSystem, at: int, size: float = BORN) -> Member | None:
    """Return the first orbit of the family that is born from a mode at its first contact, in the direction of others.

    A contact with a compliant stop is short, an impact on a rigid one slow: at most `size` radians of the mode.
    """
    flow = Flow(system.replace(omega=float(system.natural_frequencies[at])))
    amplitude, touched = first_contact(flow, at)
    images, _ = mirror(system)
    half = min(size, BORN / max(flow.phase((stop,)).fastest if flow.compliant[stop] else 1.0 for stop in touched))
    events: list[tuple[float, Event]] = []
    for stop in touched.tolist():
        middle = 0.0 if flow.beta[stop, at] > 0.0 else math.pi
        if not (images and middle):
            events += zip((middle - half, middle + half), flow.contact(stop), strict=False)
    events.sort(key=lambda each: each[0])
    p, begin, stop = len(events), events[0][0], events[0][1].stop
    z = np.zeros(p + 2 * flow.n + 2)
    z[:p] = [angle - begin for angle, _ in events]
    z[[p + at, p + flow.n + at]] = amplitude * np.array([math.cos(begin) / math.cos(half), -math.sin(begin)])
    cycle = FreeCycle(flow, 1, tuple(event for _, event in events), images)
    z[-2:] = TURN, flow.energy(z[p:-2], ())[0]
    row = np.zeros(len(z))
    if flow.compliant[stop]:
        row[[0, cycle.events.index(Event(stop, LET_GO))]] = -1.0, 1.0
    else:
        row[p + flow.n : -2] = flow.beta[stop]
    done = corrected(cycle, z, row)
    found = None if done is None else done.member(row)
    if found is not None and not followed(found):
        found = recast(found, LONGEST)
    return born(system, at, SHORTER * half) if found is None and half > SMALLEST else found


def _unclear(flow: Flow, touched: Sequence[int]) -> str:
    """Return which of the stops touched at the same time cannot be struck in either order; empty if all can."""
    for one, other in combinations(touched, 2):
        if not flow.commute(one, other):
            return f": {simultaneous(flow.names, one, other)}"
    return ""
