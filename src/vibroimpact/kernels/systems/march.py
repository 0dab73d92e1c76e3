"""What lanes and the walk share: what ends a step, the sums of impacts, and what ends a cell."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from vibroimpact.kernels.cell import FILLED, PINNED, QUIET, RUNNING, SPENT
from vibroimpact.kernels.systems.law import release, stalled, strike
from vibroimpact.kernels.systems.step import CLOSED, CONTACT

LOOK = 32  # steps between two looks at whether a cell has ended
TURN = 2.0 * math.pi

# Columns of a cell's note: the length of its step, what it is granted, and what it has come to; then the sums.
H, FLIGHT, GRANTED, MADE, HITS, STICKS = range(6)
FIRST, SUM, SQUARES, LARGEST, COSINE, SINE, ENERGY, BEGAN, ENDED, GREW = range(6, 16)
# of a cycle: recorded impacts, periods and stop of the impact that is known, and impacts and periods until it returned
FROM, SINCE, AT, CHATTERED, IMPACTS, PERIODS = range(16, 22)
NOTES = 22


class Window(NamedTuple):
    """Recorded impacts left out, and those left out or kept."""

    transient: float
    total: float


@njit(error_model="numpy", forceinline=True)
def moment(sine, cosine, periods):
    """Return whole driving periods and phase."""
    phase = math.atan2(sine, cosine) / TURN
    if phase < 0.0:
        phase = phase + 1.0 if phase + 1.0 < 1.0 else 0.0
    return periods, phase


@njit(error_model="numpy")
def _never_again(rows, k):
    """Return whether no stop can be reached any more.

    What free motion is left over the steady one has an energy E that cannot grow; so it takes at most sqrt(2 E `give`)
    of a clearance, give = alpha L^-1 M^-1 alpha, and the steady motion leaves `margin`.
    """
    energy = 0.0
    for j in range(k.modes):
        y, p = rows[k.steady + j], 0.0
        a, b = rows[k.turn], rows[k.turn + 1]
        for m in range(k.harmonics):
            first = k.steady + k.modes + 2 * (k.harmonics * j + m)
            y += rows[first] * a + rows[first + 1] * b
            p += (m + 1.0) * rows[k.theta] * (rows[first] * b - rows[first + 1] * a)
            a, b = a * rows[k.turn + 1] + b * rows[k.turn], b * rows[k.turn + 1] - a * rows[k.turn]
        y, p = rows[k.eta + j] - y, rows[k.rate + j] - p
        energy += rows[k.weight + j] * (p * p + rows[k.square + j] * y * y)
    clear = True
    for z in range(k.stops):
        clear &= rows[k.margin + z] > math.sqrt(energy * rows[k.give + z])
    return clear


@njit(error_model="numpy")
def ending(rows, k, notes, lane, total):
    """Return why a cell ends here, or RUNNING."""
    if notes[lane, HITS] >= total:
        return FILLED
    closed = rows[k.closed]
    if closed >= k.modes and rows[k.age] * rows[k.theta] > TURN:
        return PINNED  # nothing is free to move, and the force has gone through a whole period
    if closed == 0.0 and _never_again(rows, k):
        return QUIET
    return SPENT if rows[k.made] > notes[lane, GRANTED] or rows[k.age] > notes[lane, FLIGHT] else RUNNING


@njit(error_model="numpy")
def happen(rows, k, room):
    """Make what ended a step, but for the usual impact; return the sets of stops struck, and closed by it."""
    z = int(rows[k.which])
    if rows[k.hit] != CONTACT:
        return 0, stalled(rows, k, room)
    rows[k.age] = 0.0
    if rows[k.kind + z] >= CLOSED:
        return 0, release(rows, k, room)
    return strike(rows, k, room)


@njit(error_model="numpy", forceinline=True)
def add(notes, lane, v, energy, sine, cosine, periods, window):
    """Add a recorded impact to the sums of its window, with the energy that it cost."""
    notes[lane, HITS] += 1.0
    kept = notes[lane, HITS] - window.transient
    if kept <= 0.0 or notes[lane, HITS] > window.total:
        return
    if kept == 1.0:
        at, phase = moment(sine, cosine, periods)
        notes[lane, FIRST], notes[lane, BEGAN] = v, at + phase
    else:
        notes[lane, ENERGY] += energy
    if notes[lane, HITS] == window.total:
        at, phase = moment(sine, cosine, periods)
        notes[lane, ENDED] = at + phase
    notes[lane, SUM] += v - notes[lane, FIRST]
    notes[lane, SQUARES] += (v - notes[lane, FIRST]) ** 2
    notes[lane, LARGEST] = max(notes[lane, LARGEST], v)
    notes[lane, COSINE] += cosine
    notes[lane, SINE] += sine


@njit(error_model="numpy")
def add_all(rows, k, room, notes, lane, struck, window):
    """Add an unusual impact, stop by stop; weak ones are not recorded."""
    recorded = 0
    for z in range(k.stops):
        if struck >> z & 1 and room.speed[z] >= rows[k.cut]:
            after = -room.speed[z]
            for y in range(k.stops):
                after += room.gram[z, y] * room.impulse[y]
            lost = 0.5 * (room.speed[z] - after) * room.impulse[z]  # -(w- + w+) P/2
            add(notes, lane, room.speed[z], lost, rows[k.turn], rows[k.turn + 1], rows[k.turn + 2], window)
            recorded += 1
    return recorded
