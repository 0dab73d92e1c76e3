"""The search for the orbit of a given energy: the family born from a mode, followed from its first contact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from vibroimpact.model import as_system
from vibroimpact.model.force import Force
from vibroimpact.model.system import ImpactSystem
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.results import Orbits
from vibroimpact.orbits.systems.admissibility import flown, objection
from vibroimpact.orbits.systems.conserved import FreeCycle, Member, corrected, member, misses, sizes
from vibroimpact.orbits.systems.events import LET_GO, Event
from vibroimpact.orbits.systems.flow import Flow
from vibroimpact.orbits.systems.guesses import occurrences
from vibroimpact.orbits.systems.orbit import SystemOrbit
from vibroimpact.orbits.systems.symmetry import mirror
from vibroimpact.parameters import counted, hertz, invalid, real_number, whole_number
from vibroimpact.progress import reporter

BORN = 0.02  # radians of the fastest rate, or part of the largest speed: first contact or impact of a family
TIED = 1e-9  # relative: stops that a mode touches at amplitudes this close are touched together
BEYOND = 1.05  # of the energy of the first contact: beyond it, orbits of less energy are not sought
LONGEST = 0.1  # longest step along the curve, relative to the size of each unknown
SHORTEST = 1e-6  # of the longest step
TOUCHED = 1e-6  # of its size: a smaller clearance at a graze is a contact
BESIDE = (1e-5, 1e-4, 1e-3, 1e-2)  # of the size of each unknown: steps from a graze onto the orbits without a contact
ALIKE = 2.0  # times the lightest contact: lighter ones vanish with it, at once in an orbit that is its own reversal
SHORTENED = 8  # halvings of the first contact beyond a graze, at most
STRAIGHT = 0.97  # least cosine between the tangents at two orbits
EASY = 4  # corrections, at most, before a longer step
GROWTH = 1.6  # of the step after an easy one
MOST = 500  # orbits followed in one direction, at most
_ENDS = {"grazing": "grazes a stop", "lost": "is lost", "budget": f"was left after {MOST} orbits"}
HALVINGS = 50  # in search of a fold between two orbits
REVERSED = 1e-6  # of a cycle: times that differ by less are equal


def find_of_energy(design: Any, energy: Any, mode: Any) -> Orbits[SystemOrbit]:
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
    amplitude, _ = first_contact(flow, at)
    if math.isinf(amplitude):
        raise ValueError(f"{linear} at every energy, since it moves no stop's clearance; choose another `mode`")
    contact = 0.5 * (amplitude * rate) ** 2
    size = 0.5 * math.sqrt(joules / contact - 1.0) if joules > contact else BORN
    first, end, least, most = born(system, at, size), "lost", contact, contact
    crossings: list[Member | None] = []
    before, number = first, 0
    with reporter(None, "orbits") as report:
        for one, end in () if before is None else follow(before, LONGEST, 0.0, max(joules, BEYOND * contact)):
            if end == "range" and abs(one.joules - joules) < TIED * joules:
                crossings.append(one)
                break
            for each in filter(None, (before and located("fold", before, one), one)):
                if before and (before.joules < joules) != (each.joules < joules):
                    crossings.append(at_energy(before, each, joules))
                before, least, most = each, min(least, each.joules), max(most, each.joules)
            if crossings and joules > contact:
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
    if first is None:
        message = f"no orbit was found at the first contact of mode {at + 1}, at {contact:.7g} J"
    else:
        energies = f"at energies from {least:.7g} to {most:.7g} J, to where it {_ENDS[end]}"
        message = f"no orbit was found on the family of mode {at + 1}, which was followed {energies}"
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
    return None if done is None else member(cycle, done[0], done[2], row)


def turned(one: Member) -> Member:
    """Return the same orbit from the impact that is farthest from the other events, which is lost last."""
    cycle, unknown, p = one.at, one.unknown, len(one.cycle.events)
    gaps = np.diff(cycle.angles(unknown))
    first = max(cycle.impacts, key=lambda at: min(gaps[at - 1], gaps[at]))
    if first == 0:
        return one
    rotated, start = cycle.rotated(unknown, first)
    start[:p] -= start[0]
    z = np.append(start, one.z[-2:])
    found = member(rotated, z, misses(rotated, z)[1], np.zeros(len(z)))
    sign = 1.0 if found.tangent[-2:] @ one.tangent[-2:] >= 0.0 else -1.0
    return replace(found, tangent=sign * found.tangent)


def recast(passed: Member, near: float, *, of_energy: bool = False) -> Member | None:
    """Return the orbit near a solution that the system cannot follow, with the events that its motion has.

    State, Theta and E change along the curve as little as in the solution, and by at most `near` of their sizes; or the
    energy is kept.
    """
    passed = turned(passed)
    cycle, unknown, old = passed.at, passed.unknown, passed.cycle.events
    aim = np.eye(len(passed.z))[-1][len(old) :] if of_energy else passed.tangent[len(old) :]
    i = int(np.argmax(np.diff(cycle.angles(unknown))))
    leg, n = cycle.leg(unknown, i), 2 * cycle.flow.n
    x = cycle.flow.fly(leg.start[:n], 0.0, 0.5 * leg.duration, leg.pushing)
    seen = list(islice(occurrences(cycle.flow, x, 0.0, 2.2 * cycle.length), 4 * len(old) + 12))
    starts = [at for at, o in enumerate(seen) if o.event == old[0] and o.angle < 1.05 * cycle.length]
    if not starts:
        return None
    begin = min(starts, key=lambda at: float(np.abs(seen[at].x - unknown[len(old) :]).max()))
    first = seen[begin]
    back = first.event.in_mirror(cycle.images) if cycle.images else first.event
    end = first.angle + cycle.length
    again = min(
        (at for at, o in enumerate(seen) if o.event == back), key=lambda at: abs(seen[at].angle - end), default=0
    )
    events = seen[begin:again]
    if not events:
        return None
    new = replace(passed.cycle, events=tuple(o.event for o in events), pushing=first.pushing)
    z = np.concatenate([[o.angle - first.angle for o in events], first.x, passed.z[-2:]])
    p, q, columns = len(events), len(old), sizes(new, z)
    row = np.append(np.zeros(p), aim / columns[p:])
    done = corrected(new, z, row, float(row[p:] @ passed.z[q:]))
    if done is None or np.abs((done[0][p:] - passed.z[q:]) / columns[p:]).max() > near:
        return None
    found = member(new, done[0], done[2], row * columns**2)
    return found if _followed(found) else None


def _followed(one: Member) -> bool:
    """Whether the system can follow a solution."""
    cycle, unknown = one.at, one.unknown
    names = tuple(map(str, range(len(cycle.flow.beta))))
    return cycle.in_order(unknown) and not objection(cycle, unknown, names)


def _alike(one: FreeCycle, other: FreeCycle) -> bool:
    """Whether two cycles have the same events in the same order, from whichever on."""
    first, second = (each.events + each.next_events for each in (one, other))
    return len(first) == len(second) and any(first == second[at:] + second[:at] for at in range(len(second)))


def _reversible(one: Member) -> bool:
    """Whether the times between events are the same in reverse, as those of a motion that is its own reversal."""
    times = np.diff(one.at.angles(one.unknown))
    close = REVERSED * float(times.sum())
    return any(bool(np.abs(np.roll(times[::-1], at) - times).max() <= close) for at in range(len(times)))


def gained(passed: Member) -> Member | None:
    """Return the first orbit beyond a graze with one more contact, short or slow, or with a short gap in a contact.

    Where an orbit is its own reversal in time, it grazes twice at once.
    """
    cycle, unknown, flow = passed.at, passed.unknown, passed.cycle.flow
    touches = [
        (float(begin + place), course.stop, cycle.phases[i + 1])
        for i, begin in enumerate(unknown[: len(cycle.events)])
        for course in flown(cycle, unknown, i)[1]
        for place in course.places[course.lowest <= TOUCHED * course.size]
    ]
    if not touches:
        return None
    rates = [
        flow.phase(tuple(sorted({*pushing, stop}))).fastest for _, stop, pushing in touches if flow.compliant[stop]
    ]
    size = BORN / max(cycle.fastest, *rates, 1.0)
    for _ in range(SHORTENED):
        events = list(zip(unknown.tolist(), cycle.events, strict=False))
        for angle, stop, pushing in touches:
            contact = flow.contact(stop)
            times = (angle - size, angle + size) if len(contact) > 1 else (angle,)
            events += zip(times, contact[::-1] if stop in pushing else contact, strict=True)
        new = events[len(cycle.events)]
        events.sort(key=lambda each: each[0])
        at, p = events.index(new), len(events)
        longer = replace(cycle, events=tuple(event for _, event in events))
        start = np.append([angle for angle, _ in events], unknown[len(cycle.events) :])
        row = np.zeros(len(start) + 2)
        if flow.compliant[new[1].stop]:
            row[[at, at + 1]] = -1.0, 1.0
            target = 2.0 * size
        else:
            longer, start = longer.rotated(start, at)
            row[p + flow.n : -2] = flow.beta[new[1].stop]
            target = size * float(np.abs(start[p + flow.n :]).max())
        start[:p] -= start[0]
        done = corrected(longer, np.append(start, passed.z[-2:]), row, target)
        if done is not None and _followed(found := member(longer, done[0], done[2], row)):
            return found
        size *= 0.5
    return None


def shed(passed: Member) -> Member | None:
    """Return the first orbit beyond a graze with one contact, or one gap in a contact, less.

    Where an orbit is its own reversal in time, two vanish at once. Of the two directions along the shorter equations,
    the one is taken that the system can follow.
    """
    passed = turned(passed)
    cycle, unknown, flow = passed.at, passed.unknown, passed.cycle.flow
    p, speeds, gaps = len(cycle.events), np.abs(cycle.speeds(unknown)), np.abs(np.diff(cycle.angles(unknown)))
    speeds = speeds / float(np.abs(unknown[p:]).max())
    pairs = [
        at
        for at in range(p - 1)
        if flow.compliant[cycle.events[at].stop] and cycle.events[at].stop == cycle.events[at + 1].stop
    ]
    singles = [at for at in cycle.impacts if not flow.compliant[cycle.events[at].stop]]
    least = min((gaps[at] for at in pairs), default=math.inf), min((speeds[at] for at in singles), default=math.inf)
    if least[0] < least[1]:
        gone = {each for at in pairs if gaps[at] <= ALIKE * least[0] for each in (at, at + 1)}
    else:
        gone = {at for at in singles if speeds[at] <= ALIKE * least[1]}
    kept = [at for at in cycle.impacts if at not in gone]
    if not kept:
        return None
    turned_cycle, start = cycle.rotated(unknown, kept[0])
    left = [at for at in range(p) if (at + kept[0]) % p not in gone]
    new = replace(turned_cycle, events=tuple(turned_cycle.events[at] for at in left))
    z = np.concatenate([start[left] - start[0], start[p:], passed.z[-2:]])
    beside = member(new, z, misses(new, z)[1], np.zeros(len(z)))
    columns = sizes(new, z)
    done = corrected(new, z, beside.tangent / columns)
    if done is None or np.abs((done[0] - z) / columns).max() > LONGEST:
        return None
    graze = member(new, done[0], done[2], np.zeros(len(z)))
    for size in BESIDE:
        ways = []
        for tangent in (graze.tangent, -graze.tangent):
            done = corrected(new, graze.z + size * columns * tangent, tangent / columns)
            if done is not None and _followed(found := member(new, done[0], done[2], tangent * columns)):
                ways.append(found)
        if len(ways) == 1:
            return ways[0]
    return None


def follow(first: Member, longest: float, low: float, high: float, most: int = MOST) -> Iterator[tuple[Member, str]]:
    """Yield the orbits after the first along the curve, up to one of two energies in J.

    Each comes with the reason why it is the last, "range", "grazing", "lost" or "budget" (the last one again), or "".
    """
    current, step, beyond = first, longest, None
    for _ in range(most):
        columns = sizes(current.cycle, current.z)
        done = corrected(current.cycle, current.z + step * columns * current.tangent, current.tangent / columns)
        following = None
        if done is not None:
            following = member(current.cycle, done[0], done[2], current.tangent * columns)
            aside = np.abs((following.z - current.z) / columns - step * current.tangent).max()
            if following.tangent @ current.tangent < STRAIGHT or aside > step:
                following = None
            elif not _followed(following):
                beyond = following
                following = recast(following, step)
                if following is not None and _alike(following.cycle, current.cycle):  # it would go back
                    following = shed(beyond)
                if following is not None and _reversible(current) and not _reversible(following):
                    following = None  # another family, which has one of two contacts that begin at once
        if following is not None and not low <= following.joules <= high:
            edge = at_energy(current, following, low if following.joules < low else high)
            if edge is not None:
                yield edge, "range"
                return
            following = None
        if following is None:
            step *= 0.5
            if step < SHORTEST * longest:
                following = (None if beyond is None else gained(beyond)) or shed(beyond or current)
                if following is None:
                    yield current, "lost" if beyond is None else "grazing"
                    return
            else:
                continue
        current, beyond = following, None
        yield current, ""
        step = min(longest, step * (GROWTH if done is not None and done[1] <= EASY else 1.0))
    yield current, "budget"


def at_energy(inside: Member, beyond: Member, joules: float) -> Member | None:
    """Return the orbit between two at an energy in J."""
    (p, q), columns = (len(each.cycle.events) for each in (inside, beyond)), sizes(inside.cycle, inside.z)
    near = 2.0 * float(np.abs((beyond.z[q:] - inside.z[p:]) / columns[p:]).max()) + TIED
    for base in (beyond, inside):
        z, events = base.z.copy(), len(base.cycle.events)
        z[-1] = joules / base.cycle.flow.omega**2
        done = corrected(base.cycle, z, np.eye(len(z))[-1])
        if done is None or np.abs((done[0] - base.z)[events:] / columns[p:]).max() > near:
            continue
        found = member(base.cycle, done[0], done[2], base.tangent * sizes(base.cycle, base.z))
        if _followed(found):
            return found
        again = recast(found, near, of_energy=True)
        if again is not None:
            return again
    return None


def located(kind: str, a: Member, b: Member) -> Member | None:
    """Return the orbit between two of the same events at which a test changes its sign; None if it does not."""
    if a.cycle.events != b.cycle.events or (a.tests[kind] > 0.0) == (b.tests[kind] > 0.0):
        return None
    chord, columns, low, high = b.z - a.z, sizes(a.cycle, a.z), 0.0, 1.0
    found = None
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        done = corrected(a.cycle, a.z + share * chord, chord / columns**2)
        if done is None:
            return None
        found = member(a.cycle, done[0], done[2], a.tangent * columns)
        low, high = (share, high) if (found.tests[kind] > 0.0) == (a.tests[kind] > 0.0) else (low, share)
    return found
