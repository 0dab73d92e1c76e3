"""Whether a motion without impacts repeats: stops let go and push again, but stay pressed in all the while.

A damper takes the force of a stop to zero before the stop is free, and what pushes on may press it in again before it
is: nothing is struck, and no phase lasts. Such a motion goes on for ever once it comes back to its state at a moment
when a stop lets go, within 1e-12 of V and at the same phase. That is checked a few periods after an impact, and
whenever twice as many have passed.
"""

from __future__ import annotations

from vibroimpact.kernels.leaps import TURN
from vibroimpact.kernels.shared.machine import copy, inner, rare
from vibroimpact.kernels.systems.elements import CLOSED
from vibroimpact.kernels.systems.march import AGAIN, HITS, STILL, WAITS

SAME = 1e-12  # of V, and of a period
AFTER = 4.0  # periods after an impact it is checked first
LONGEST = 8.0  # periods in which it must come back
WALK = 1 << 16  # steps after which a walk is given up


@rare
def repetition_is_due(notes, stride, lane, periods):
    """Return whether to check for a repetition in this period, in a lane or (stride 1) a cell alone."""
    hits, still = HITS * stride + lane, STILL * stride + lane
    again, waits = AGAIN * stride + lane, WAITS * stride + lane
    if notes[waits] == 0.0 or notes[hits] != notes[still]:
        notes[still], notes[waits], notes[again] = notes[hits], AFTER, periods + AFTER
    if periods < notes[again]:
        return False
    notes[waits], notes[again] = 2.0 * notes[waits], periods + 2.0 * notes[waits]
    return True


@inner
def in_contact(rows, z, k):
    """Return whether a compliant stop pushes, or may push again before it is free."""
    return rows[k.kind + z] >= CLOSED or rows[k.leaving + z] > 0.0


@inner
def same_contacts(a, b, k):
    """Return whether the same stops are closed or pushed, and pressed in, in two states."""
    same = True
    for z in range(k.stops):
        same &= (a[k.kind + z] >= CLOSED) == (b[k.kind + z] >= CLOSED)
        same &= (a[k.leaving + z] > 0.0) == (b[k.leaving + z] > 0.0)
    return same


@rare
def is_pressed(rows, k):
    """Return whether a compliant stop is in contact, and one let go or pushed lately."""
    return rows[k.engaged] > 0.0 and rows[k.age] * rows[k.theta] <= LONGEST * TURN


@rare
def comes_back(rows, k, pushed, begun):
    """Return whether a stop that `pushed` lets go as it did when that was noted; `begun[k.which]` is -1 before."""
    z = int(rows[k.which])
    if not (pushed and rows[k.kind + z] < CLOSED and rows[k.leaving + z] > 0.0):
        return False
    if begun[k.which] < 0.0:
        copy(rows, begun)
        return False
    apart = abs(rows[k.turn] - begun[k.turn]) + abs(rows[k.turn + 1] - begun[k.turn + 1])
    same = begun[k.which] == rows[k.which] and apart < SAME and same_contacts(rows, begun, k)
    size = 0.0
    for at, neutral in ((k.eta, k.neutral), (k.rate, k.neutral + k.modes)):
        for j in range(k.modes):
            drifts = k.free and rows[neutral + j] > 0.0
            size += 0.0 if drifts else abs(rows[at + j] - begun[at + j])
    return same and size < SAME * rows[k.speed]
