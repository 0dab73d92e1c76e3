"""Where an orbit of a free vibration gains or loses a contact, or its contacts change places along its family."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.events import Event
from vibroimpact.orbits.systems.admissibility import flown, objection
from vibroimpact.orbits.systems.conserved import NONE, FreeCycle, Member, corrected, correction, member, sizes
from vibroimpact.orbits.systems.guesses import occurrences

BORN = 0.02  # radians of the fastest rate, or part of the largest speed: first contact or impact of a family
LONGEST = 0.1  # longest step along the curve, relative to the size of each unknown
SLOW = 1e-3  # of the largest speed: first impact on a rigid stop beyond a graze
TOUCHED = 1e-6  # of its size: a smaller clearance at a graze is a contact
BESIDE = (1e-5, 1e-4, 1e-3, 1e-2)  # of the size of each unknown: steps from a graze onto the orbits without a contact
AROUND, MORE = 1e-4, 10.0  # of the size of each unknown, and of a step: farthest graze at which a contact vanishes
ALIKE = 2.0  # times the lightest contact: lighter ones vanish with it, at once in an orbit that is its own reversal
SHORTENED = 8  # halvings of the first contact beyond a graze, at most
RETRACED = 3  # motions whose events are tried in search of an orbit, at most
REVERSED = 1e-6  # of a cycle: times that differ by less are equal


def turned(one: Member) -> Member:
    """Return the same orbit from the impact that is farthest from the other events, which is lost last."""
    gaps = np.diff(one.at.angles(one.unknown))
    return begun(one, max(one.cycle.impacts, key=lambda at: min(gaps[at - 1], gaps[at])))


def begun(one: Member, first: int) -> Member:
    """Return the same orbit from another of its events on."""
    if first == 0:
        return one
    p = len(one.cycle.events)
    rotated, start = one.at.rotated(one.unknown, first)
    start[:p] -= start[0]
    z = np.append(start, one.z[-2:])
    found = member(rotated, z, np.zeros(len(z)))
    sign = 1.0 if found.tangent[-2:] @ one.tangent[-2:] >= 0.0 else -1.0
    return replace(found, tangent=sign * found.tangent)


def beside(one: Member, other: Member) -> Member | None:
    """Return an orbit from the event on at which its state is nearest to that of another orbit; None if it has none."""
    if one.cycle is other.cycle:
        return one
    p, q, events = len(one.cycle.events), len(other.cycle.events), one.cycle.events
    states = one.at.states(one.unknown)[:p]
    alike = [at for at in one.cycle.impacts if events[at] == other.cycle.events[0]]
    nearest = min(alike, key=lambda at: float(np.abs(states[at] - other.unknown[q:]).max()), default=None)
    return None if nearest is None else begun(one, nearest)


def straight(one: Member, other: Member) -> float:
    """Return the least cosine between the tangent at an orbit, that at the next, and the chord; without event times."""
    start = beside(one, other)
    if start is None:
        return 0.0
    p, q = len(start.cycle.events), len(other.cycle.events)
    chord = (other.z[q:] - start.z[p:]) / sizes(start.cycle, start.z)[p:]
    first, *others = (each / np.linalg.norm(each) for each in (start.tangent[p:], other.tangent[q:], chord))
    return min(float(first @ each) for each in others)


def recast(passed: Member, near: float) -> Member | None:
    """Return the orbit near a solution that the system cannot follow, with the events that its motion has.

    State, Theta and E change along the curve as little as in the solution, and by at most `near` of their sizes.
    """
    passed = turned(passed)
    q = len(passed.cycle.events)
    columns = sizes(passed.cycle, passed.z)[q:]
    aim = passed.tangent[q:] / columns
    found = solved(passed.cycle, passed.z, aim, float(aim @ passed.z[q:]))
    if found is None or np.abs((found.z[len(found.cycle.events) :] - passed.z[q:]) / columns).max() > near:
        return None
    return found if rigid_impacts(found) == rigid_impacts(passed) else None  # there the motion is not smooth


def rigid_impacts(one: Member) -> int:
    """Return the number of impacts on rigid stops."""
    return sum(not one.cycle.flow.compliant[event.stop] for event in one.cycle.events)


def solved(cycle: FreeCycle, z: Floats, aim: Floats, target: float, kept: Floats = NONE) -> Member | None:
    """Return the orbit near z whose state, Theta and E give `target` in the direction `aim`.

    The motion depends smoothly on the state, also where contacts with compliant stops begin, vanish or change places.
    Newton's method therefore converges if the events follow the motion from one correction to the next.
    """
    for _ in range(RETRACED + 1):
        p = len(cycle.events)
        row = np.append(np.zeros(p), aim)
        done = corrected(cycle, z, row, target, kept)
        if done is not None:
            found = done.member(row * sizes(cycle, done.z) ** 2)
            if followed(found):
                return found
        after = done or correction(cycle, z, row, target)
        traced = None if after is None else retraced(cycle, after[0])
        if traced is None:
            return None
        (cycle, z), kept = traced, NONE
    return None


def retraced(cycle: FreeCycle, z: Floats) -> tuple[FreeCycle, Floats] | None:
    """Return a cycle near z with the events of the motion from the middle of its last leg, and its z."""
    old, unknown, cycle = cycle.events, z[:-2], replace(cycle, span=float(z[-2]))
    leg, n = cycle.leg(unknown, len(old) - 1), 2 * cycle.flow.n
    x = cycle.sign * cycle.flow.fly(leg.start[:n], 0.0, 0.5 * leg.duration, leg.pushing)
    met = list(islice(occurrences(cycle.flow, x, 0.0, leg.duration + 1.05 * cycle.length), 4 * len(old) + 12))
    starts = [at for at, o in enumerate(met) if o.event == old[0] and o.angle <= leg.duration]
    if not starts:
        return None
    begin = min(starts, key=lambda at: float(np.abs(met[at].x - unknown[len(old) :]).max()))
    first = met[begin]
    back = first.event.in_mirror(cycle.images) if cycle.images else first.event
    end = first.angle + cycle.length
    again = min(
        (at for at, o in enumerate(met) if o.event == back),
        key=lambda at: abs(met[at].angle - end),
        default=0,
    )
    events = met[begin:again]
    if not events:
        return None
    new = replace(cycle, events=tuple(o.event for o in events), pushing=first.pushing)
    return new, np.concatenate([[o.angle - first.angle for o in events], first.x, z[-2:]])


def followed(one: Member) -> bool:
    """Whether the system can follow a solution."""
    cycle, unknown = one.at, one.unknown
    return cycle.in_order(unknown) and not objection(cycle, unknown)


def alike(one: Member, other: Member) -> bool:
    """Whether two orbits have the same events in the same order, from whichever on."""
    first, second = _groups(one), _groups(other)
    return len(first) == len(second) and any(first == second[at:] + second[:at] for at in range(len(second)))


def _groups(one: Member) -> list[frozenset[Event]]:
    """Return the events of two cycles, or of both halves of one; those at one time are a set."""
    tied, events = one.at.tied(one.unknown), one.cycle.events + one.cycle.next_events
    starts = [at for at in range(len(events)) if not tied[at % len(tied) - 1]]
    ends = [*starts[1:], starts[0] + len(events)]
    return [frozenset((events * 2)[start:end]) for start, end in zip(starts, ends, strict=True)]


def reversible(one: Member) -> bool:
    """Whether the times between events are the same in reverse, as those of a motion that is its own reversal."""
    return _center(one) is not None


def _center(one: Member) -> Any:
    """Return the indices of the times between events in reverse, from the one on that makes them the same."""
    times = np.diff(one.at.angles(one.unknown))
    for at in range(len(times)):
        back = np.roll(np.arange(len(times))[::-1], at)
        if np.abs(times[back] - times).max() <= REVERSED * float(times.sum()):
            return back
    return None


def reversal(one: Member) -> Floats:
    """Return the linear forms that are 0 as long as the times between events are the same in reverse.

    Near resonances of high order, orbits of other families that are not their own reversals come very close.
    """
    back, p = _center(one), len(one.cycle.events)
    if back is None:
        return NONE
    times = np.diff(np.eye(p + 1, len(one.z)), axis=0)
    times[-1, p], times[-1, [0, -2]] = 0.0, (1.0, one.at.length / one.at.span)
    forms: Floats = (times - times[back])[np.arange(p) < back]
    return forms


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
    size = BORN / max(cycle.fastest, *rates, 1.0) if rates else SLOW
    for _ in range(SHORTENED):
        events = list(zip(unknown.tolist(), cycle.events, strict=False))
        for angle, stop, pushing in touches:
            contact = flow.contact(stop)
            times = (angle - size, angle + size) if len(contact) > 1 else (angle,)
            events += zip(times, contact[::-1] if stop in pushing else contact, strict=True)
        new, *rest = events[len(cycle.events) :]
        events.sort(key=lambda each: each[0])
        at, p = events.index(new), len(events)
        longer = replace(cycle, events=tuple(event for _, event in events))
        start = np.append([angle for angle, _ in events], unknown[len(cycle.events) :])
        row = np.zeros(len(start) + 2)
        if flow.compliant[new[1].stop]:
            row[[at, events.index(rest[0])]] = -1.0, 1.0
            target = 2.0 * size
        else:
            longer, start = longer.rotated(start, at)
            row[p + flow.n : -2] = flow.beta[new[1].stop]
            target = size * float(np.abs(start[p + flow.n :]).max())
        start[:p] -= start[0]
        done = corrected(longer, np.append(start, passed.z[-2:]), row, target)
        if done is not None and followed(found := done.member(row)):
            return found
        size *= 0.5
    return None


def shed(passed: Member, step: float) -> Member | None:
    """Return the first orbit beyond a graze with one contact, or one gap in a contact, less.

    Where an orbit is its own reversal in time, two vanish at once. Of the two directions along the shorter equations,
    the one is taken that the system can follow. The unknowns change by little more than a step.
    """
    passed = turned(passed)
    cycle, unknown, flow = passed.at, passed.unknown, passed.cycle.flow
    p, speeds = len(cycle.events), np.abs(cycle.speeds(unknown))
    speeds = speeds / float(np.abs(unknown[p:]).max())
    stops = [event.stop for event in cycle.events]
    pairs = [
        (at, stops.index(stop, at + 1))
        for at, stop in enumerate(stops)
        if flow.compliant[stop] and stop in stops[at + 1 :]
    ]
    singles = [at for at in cycle.impacts if not flow.compliant[cycle.events[at].stop]]
    lasting = [abs(unknown[end] - unknown[at]) for at, end in pairs]
    least = min(lasting, default=math.inf), min((speeds[at] for at in singles), default=math.inf)
    if least[0] < least[1]:
        gone = {each for pair, time in zip(pairs, lasting, strict=True) if time <= ALIKE * least[0] for each in pair}
    else:
        gone = {at for at in singles if speeds[at] <= ALIKE * least[1]}
    kept = [at for at in cycle.impacts if at not in gone]
    if not kept:
        return None
    turned_cycle, start = cycle.rotated(unknown, kept[0])
    left = [at for at in range(p) if (at + kept[0]) % p not in gone]
    new = replace(turned_cycle, events=tuple(turned_cycle.events[at] for at in left))
    z = np.concatenate([start[left] - start[0], start[p:], passed.z[-2:]])
    beside = member(new, z, np.zeros(len(z)))
    columns = sizes(new, z)
    done = corrected(new, z, beside.tangent / columns)
    if done is None or np.abs((done.z - z) / columns).max() > max(AROUND, MORE * step):
        return None
    graze = done.member(np.zeros(len(z)))
    for size in BESIDE:
        ways = []
        for tangent in (graze.tangent, -graze.tangent):
            done = corrected(new, graze.z + size * columns * tangent, tangent / columns)
            if done is not None and followed(found := done.member(tangent * columns)):
                ways.append(found)
        if len(ways) == 1:
            return ways[0]
    return None
