"""Families of free vibrations along their energy: pseudo-arclength continuation through folds and grazes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.systems.admissibility import objection
from vibroimpact.orbits.systems.conserved import NONE, Member, corrected, member, sizes
from vibroimpact.orbits.systems.grazes import (
    ALIKE,
    BORN,
    alike,
    beside,
    followed,
    gained,
    recast,
    reversal,
    reversible,
    shed,
    solved,
    straight,
)

SHORTEST = 1e-6  # of the longest step
STRAIGHT = 0.97  # least cosine between the tangents at two orbits
EASY = 4  # corrections, at most, before a longer step
GROWTH = 1.6  # of the step after an easy one
RECAST = 3  # halvings of a step from one search for the events of the motion beyond a graze to the next
MOST = 1000  # orbits followed in one direction, at most
NEAR = 1e-6  # of the largest gap: a stop that is this close at an event of another is reached at the same time
SAME = 1e-6  # relative: period and energy of two orbits at one graze
NEARLY = 0.02  # of a part of the cycle: parts that differ by less nearly repeat
TIED = 1e-9  # relative: states that are this close are the same
CLOSE = 1e-13  # of a step: where a test changes its sign between two orbits
ROUGH = 0.1  # of the difference between two halves of a cycle: where they are so alike, families meet
HALVINGS = 50  # in search of that place, at most


def follow(
    first: Member, longest: float, low: float, high: float, most: int = MOST
) -> Iterator[tuple[Member, str, str]]:
    """Yield the orbits after the first along the curve, up to one of two energies in J.

    Each comes with the reason why it is the last, "range", "grazing", "lost" or "budget" (the last one again), or "",
    and that reason in words.
    """
    current, step, beyond, halved = first, longest, None, 0
    changes: list[tuple[Member, Member]] = []
    for _ in range(most):
        columns = sizes(current.cycle, current.z)
        ahead, kept = current.z + step * columns * current.tangent, reversal(current)
        done = corrected(current.cycle, ahead, current.tangent / columns, None, kept)
        following = None
        if done is not None:
            following = done.member(current.tangent * columns)
            aside = np.abs((following.z - current.z) / columns - step * current.tangent).max()
            if following.tangent @ current.tangent < STRAIGHT or aside > step:
                following = None
            elif not followed(following):
                beyond = following
                following = recast(following, step) if halved % RECAST == 0 else None
                if following is not None and alike(following, current):  # it would go back
                    following = shed(beyond, step)
                elif following is not None and straight(current, following) < STRAIGHT:
                    following = None
                if following is not None and reversible(current) and not reversible(following):
                    following = None  # another family, which has one of two contacts that begin at once
        if following is not None and not low <= following.joules <= high:
            edge = at_energy(current, following, low if following.joules < low else high)
            if edge is not None:
                yield edge, "range", ""
                return
            following = None
        if following is None:
            step, halved = 0.5 * step, halved + 1
            if step < SHORTEST * longest:
                following = (None if beyond is None else gained(beyond)) or shed(beyond or current, step)
                if following is None or (reversible(current) and not reversible(following)):
                    yield current, *ended(current, beyond)
                    return
            else:
                continue
        if (double := doubled(current, following)) is not None:
            yield double, "period_doubling", "there half its cycle is an orbit, and beyond, the same orbits come again"
            return
        if not alike(current, following):
            if any(alike(one, following) and alike(other, current) and _near(other, current) for one, other in changes):
                yield current, "lost", "it comes back to orbits that were passed, since a turning point was missed"
                return
            changes.append((current, following))
        current, beyond, halved = following, None, 0
        yield current, "", ""
        step = min(longest, step * (GROWTH if done is not None and done.number <= EASY else 1.0))
    yield current, "budget", f"{most} orbits were followed"


def doubled(one: Member, other: Member) -> Member | None:
    """Return the orbit between two whose cycle is twice that of another family, if there is one."""
    (at, odd), same = divmod(len(one.cycle.events), 2), one.cycle.events == other.cycle.events
    if odd or not same or one.cycle.events[at:] + one.cycle.next_events[:at] != one.cycle.events:
        return None
    first, second = _halves(one), _halves(other)
    if float(first @ second) > -STRAIGHT * float(np.linalg.norm(first) * np.linalg.norm(second)) or not first.any():
        return None
    return between(one, other, lambda each: float(first @ _halves(each)), ROUGH)


def _halves(one: Member) -> Floats:
    """Return by how much the times between events differ in the two halves of a cycle."""
    apart = np.diff(one.at.angles(one.unknown))
    halves: Floats = np.roll(apart, -(len(apart) // 2)) - apart
    return halves


def _near(one: Member, other: Member) -> bool:
    """Whether period and energy of two orbits are almost the same."""
    return bool(np.abs(one.z[-2:] / other.z[-2:] - 1.0).max() < SAME)


def simultaneous(names: Sequence[str], one: int, other: int) -> str:
    """Return the reason why a motion that reaches two stops at the same time is not followed."""
    pair = f"{names[one]!r} and {names[other]!r}"
    return f"{pair} are struck at the same instant, and the motion after that depends on their order"


def ended(last: Member, beyond: Member | None) -> tuple[str, str]:
    """Return the outcome of a search, and the reason, where the solution `beyond` comes after the last orbit."""
    cycle, unknown, names = last.at, last.unknown, last.cycle.flow.names
    apart, stops, number = np.diff(cycle.angles(unknown)), [event.stop for event in cycle.events], len(cycle.events)
    light = [
        apart[at : stops.index(stop, at + 1)].sum() * cycle.fastest if stop in stops[at + 1 :] else speed
        for at, (stop, speed) in enumerate(
            zip(stops, cycle.speeds(unknown) / np.abs(unknown[number:]).max(), strict=True)
        )
        if at in cycle.impacts
    ]
    if max(light) <= min(BORN, ALIKE * min(light)):
        return "grazing", f"its last contact, with {names[stops[0]]!r}, vanishes and the motion is linear"
    clear = NEAR * np.abs(cycle.flow.bounds[:, 0]).max()
    for event, x in zip(cycle.events, cycle.states(unknown), strict=False):
        for other in range(len(names)):
            reached = abs(cycle.flow.clearance(other, x, cycle.flow.drive(0.0))[0]) <= clear
            if reached and other != event.stop and not cycle.flow.commute(event.stop, other):
                return "grazing", f"beyond, {simultaneous(names, event.stop, other)}"
    for times in range(number, 1, -1):
        at, rest = divmod(number, times)
        again = cycle.events[at:] + cycle.next_events[:at] == cycle.events
        if not rest and again and np.abs(np.roll(apart, -at) - apart).max() <= NEARLY * cycle.length / times:
            return (
                "lost",
                f"its orbits nearly repeat {times} times per cycle and come too close to others to be followed",
            )
    if beyond is not None:
        return "grazing", f"no orbit was found beyond a graze: {objection(beyond.at, beyond.unknown)}"
    return "lost", "Newton's method does not converge to the next orbit"


def at_energy(inside: Member, beyond: Member, joules: float) -> Member | None:
    """Return the orbit between two at an energy in J."""
    nearest = beside(inside, beyond)
    if nearest is None:
        return None
    p, q, columns = len(nearest.cycle.events), len(beyond.cycle.events), sizes(nearest.cycle, nearest.z)
    near = 2.0 * float(np.abs((beyond.z[q:] - nearest.z[p:]) / columns[p:]).max()) + TIED
    for base in (beyond, nearest, between(inside, beyond, lambda one: one.joules - joules)):
        if base is None:
            continue
        z, events = base.z.copy(), len(base.cycle.events)
        z[-1] = joules / base.cycle.flow.omega**2
        found = solved(base.cycle, z, np.eye(len(z))[-1][events:], float(z[-1]))
        number = 0 if found is None else len(found.cycle.events)
        if found is not None and np.abs((found.z[number:] - base.z[events:]) / columns[p:]).max() <= near:
            along = np.append(np.zeros(number), base.tangent[events:] * columns[p:])
            return member(found.cycle, found.z, along)
    return None


def located(kind: str, a: Member, b: Member) -> Member | None:
    """Return the orbit between two at which a test changes its sign; None if it does not."""
    return None if (a.tests[kind] > 0.0) == (b.tests[kind] > 0.0) else between(a, b, lambda one: one.tests[kind])


def between(a: Member, b: Member, test: Callable[[Member], float], rough: float = 0.0) -> Member | None:
    """Return the orbit between two at which a test that has different signs at both is zero (Illinois method).

    Where families meet, Newton's method may not converge; a test that has fallen to a part `rough` then counts as zero.
    """
    start = beside(a, b)
    if start is None:
        return None
    p, q = len(start.cycle.events), len(b.cycle.events)
    chord, columns = b.z[q:] - start.z[p:], sizes(b.cycle, b.z)[q:]
    low, high, above, below, last, found = 0.0, 1.0, test(a), test(b), 0, None
    value = at_first = above
    for _ in range(HALVINGS):
        share = low + above / (above - below) * (high - low)
        if start.cycle.events == b.cycle.events:
            base, z, kept = start, start.z + share * (b.z - start.z), reversal(start)
        else:
            base = start if share < 0.5 else b
            z, kept = np.append(base.z[: len(base.cycle.events)], start.z[p:] + share * chord), NONE
        aim = chord / columns**2
        before, found = found, solved(base.cycle, z, aim, float(aim @ (start.z[p:] + share * chord)), kept)
        if found is None:
            return before if abs(value) < rough * abs(at_first) else None
        value = test(found)
        if value == 0.0 or not low < share < high or high - low < CLOSE:
            break
        if (value > 0.0) == (above > 0.0):
            low, above, below, last = share, value, below * (0.5 if last > 0 else 1.0), 1
        else:
            high, below, above, last = share, value, above * (0.5 if last < 0 else 1.0), -1
    return found
