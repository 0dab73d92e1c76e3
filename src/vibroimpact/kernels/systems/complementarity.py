"""Complementarity: which of a few stops act, and how much, solved over all sets of them.

    0 <= x,   0 <= y = free + G x,   x . y = 0

holds for the impulses of an impact and for the forces of closed stops. G = alpha M^-1 alpha^T is positive semidefinite,
so what x makes of the rates or accelerations is unique.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from vibroimpact.kernels.machine import rare

ROUNDING = 1e-13  # relative: a smaller rate, force or acceleration may be zero


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
    form: Any


@rare
def solve(room, members, size):
    """Solve gram x = -free over a set of stops, x = 0 elsewhere; return whether it is regular."""
    a, order = room.equations, 0
    for y in range(size):
        room.solution[y] = 0.0
        if members >> y & 1:
            for x in range(size):
                a[y, x] = room.gram[y, x]
            a[y, size] = -room.free[y]
            order += 1
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

    `members` are the stops among which, bit by bit. One of all sets solves it but for rounding: the best is taken.
    """
    scale = 0.0
    for y in range(size):
        if members >> y & 1:
            scale = max(scale, abs(room.free[y]))
    best, least = 0, 1e300
    for chosen in range(1 << size):
        if chosen & ~members or not solve(room, chosen, size):
            continue
        worst = 0.0
        for y in range(size):
            if chosen >> y & 1:
                worst = max(worst, -room.solution[y] * room.gram[y, y])
            elif members >> y & 1:
                slack = room.free[y]
                for x in range(size):
                    slack += room.gram[y, x] * room.solution[x]
                worst = max(worst, -slack)
        if worst < least:
            best, least = chosen, worst
        if worst <= ROUNDING * scale:
            break
    solve(room, best, size)
    return best
