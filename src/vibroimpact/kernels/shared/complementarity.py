"""Complementarity: which of the stops act, and how much: over all sets of a few, by pivoting among more.

    0 <= x,   0 <= y = free + G x,   x . y = 0

holds for the impulses of an impact and for the forces of closed stops. G = alpha M^-1 alpha^T is positive semidefinite,
so what x makes of the rates or accelerations is unique.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from vibroimpact.kernels.shared.machine import rare

ROUNDING = 1e-13  # relative: a smaller rate, force or acceleration may be zero
FEW = 6  # stops, whose 64 sets are tried one after the other
PIVOTS = 4  # per stop, at most: about one is usual


class Room(NamedTuple):
    """Arrays to solve in, one entry a stop, and what an impact was: speeds, impulses, durations of chatter, d(r v)/dv;
    of the modes accelerations before and after, and by what the rates jumped; and room for the form of a phase.
    """

    gram: Any
    equations: Any
    free: Any
    solution: Any
    rate: Any
    speed: Any
    impulse: Any
    tail: Any
    rebound: Any
    before: Any
    after: Any
    jumped: Any
    forces: Any
    kept: Any
    form: Any


@rare
def solve(room, members, size):
    """Solve gram x = -free over a set of stops, x = 0 elsewhere; return whether it is regular."""
    a = room.equations
    for y in range(size):
        room.solution[y] = 0.0
        if members >> y & 1:
            for x in range(size):
                a[y, x] = room.gram[y, x] if members >> x & 1 else 0.0
            a[y, size] = -room.free[y]
    for y in range(size):
        if members >> y & 1:
            if not a[y, y] > ROUNDING * room.gram[y, y]:
                return False
            for x in range(size):
                if x != y and members >> x & 1:
                    part = a[x, y] / a[y, y]
                    for column in range(size + 1):
                        a[x, column] -= part * a[y, column]
    for y in range(size):
        if members >> y & 1:
            room.solution[y] = a[y, size] / a[y, y]
    return True


@rare
def complementary(room, members, size):
    """Find x >= 0 with free + gram x >= 0 and no stop with both above zero; return the set of those with x.

    `members` are the stops among which, bit by bit.
    """
    number, scale = 0, 0.0
    for y in range(size):
        if members >> y & 1:
            number, scale = number + 1, max(scale, abs(room.free[y]))
    return _among_all(room, members, size, scale) if number <= FEW else _by_pivoting(room, members, size, scale)


@rare
def _among_all(room, members, size, scale):
    """Try the sets of a few stops: one of all solves it but for rounding, and the best is taken."""
    best, least, chosen = int(0.0), 1e300, int(0.0)
    while True:
        if solve(room, chosen, size):
            worst = _worst(room, chosen, members, size)
            if worst < least:
                best, least = chosen, worst
            if worst <= ROUNDING * scale:
                break
        chosen = (chosen - members) & members  # the next of its subsets
        if chosen == 0:
            break
    solve(room, best, size)
    return best


@rare
def _worst(room, chosen, members, size):
    """Return by how much a solution on a set fails: an impulse below zero, or a stop that is still approached."""
    worst = 0.0
    for y in range(size):
        if chosen >> y & 1:
            worst = max(worst, -room.solution[y] * room.gram[y, y])
        elif members >> y & 1:
            worst = max(worst, -_slack(room, y, chosen, room.solution, size))
    return worst


@rare
def _slack(room, y, chosen, x, size):
    slack = room.free[y]
    for z in range(size):
        slack += room.gram[y, z] * x[z] if chosen >> z & 1 else 0.0
    return slack


@rare
def _by_pivoting(room, members, size, scale):
    """Minimise x . (free + gram x/2) over x >= 0, whose conditions these are: one stop after the other is taken in.

    It is the method of C. L. Lawson and R. J. Hanson, Solving Least Squares Problems, 1974, chapter 23. A stop that
    depends on those taken in takes the place of one of them.
    """
    x, chosen, given_up = room.forces, int(0.0), int(0.0)
    for y in range(size):
        x[y] = 0.0
    for _ in range(PIVOTS * size):
        entering, worst = -1, ROUNDING * scale
        for y in range(size):
            if members & ~chosen & ~given_up & 1 << y:
                slack = _slack(room, y, chosen, x, size)
                if -slack > worst:
                    entering, worst = y, -slack
        if entering < 0:
            break
        if not solve(room, chosen | 1 << entering, size):
            leaving = _exchange(room, chosen, entering, size)
            if leaving < 0:  # stops that contradict each other
                given_up |= 1 << entering
                continue
            chosen &= ~(1 << leaving)
            solve(room, chosen | 1 << entering, size)
        chosen = _descend(room, chosen | 1 << entering, size)
    solve(room, chosen, size)
    return chosen


@rare
def _descend(room, chosen, size):
    """Go towards the solution on a set while all stay above zero, without those that do not; return the set left."""
    x = room.forces
    while True:
        part, first = 1.0, -1
        for y in range(size):
            if chosen >> y & 1 and room.solution[y] <= 0.0:
                share = x[y] / (x[y] - room.solution[y]) if x[y] > room.solution[y] else 0.0
                if share < part:
                    part, first = share, y
        for y in range(size):
            x[y] = x[y] + part * (room.solution[y] - x[y]) if chosen >> y & 1 else 0.0
        if first < 0:
            return chosen
        x[first] = 0.0
        chosen &= ~(1 << first)
        solve(room, chosen, size)


@rare
def _exchange(room, chosen, entering, size):
    """Let a stop that depends on those of a set push for them until one of these need not; return that one, or -1."""
    x, leaving, most = room.forces, -1, 1e300
    for y in range(size):
        room.kept[y], room.free[y] = room.free[y], -room.gram[y, entering]
    solve(room, chosen, size)
    for y in range(size):
        room.free[y] = room.kept[y]
        if chosen >> y & 1 and room.solution[y] > ROUNDING and x[y] < most * room.solution[y]:
            leaving, most = y, x[y] / room.solution[y]
    for y in range(size):
        if leaving >= 0 and chosen >> y & 1:
            x[y] = max(x[y] - most * room.solution[y], 0.0)
    if leaving >= 0:
        x[entering], x[leaving] = most, 0.0
    return leaving
