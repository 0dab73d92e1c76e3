"""Finish a cell in closed form once all its remaining impacts are known.

A cycle is closed only if it is certain. A sticking one is exact: a release erases all memory, so the motion
repeats bit for bit from release to release. Another is taken once its Jacobian M is stable and the way still to go
to the periodic orbit, (I - M)^-1 d with d the return difference of the cycle, can change no index by more than
1e-10 of V.
"""

from __future__ import annotations

import math

from numba import njit

from vibroimpact.kernels import lanes as lane
from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE, step_at, walk
from vibroimpact.kernels.cell import phase_of
from vibroimpact.kernels.cycle import ALIKE, describe
from vibroimpact.kernels.flight import flow, product
from vibroimpact.kernels.law import saltation
from vibroimpact.kernels.observers import Phases, Recurrence, Rests, Stamp, Sums, repeated
from vibroimpact.kernels.recorder import overhear

LONGEST = 4096  # impacts of the longest cycle that is closed
SURE = 1e-10  # of V: the most that the remaining way may change an index
NOT_SMALL = 1e-3  # of the cycle's weakest impact: nearer to a graze nothing is linear


@njit(error_model="numpy")
def _to_start_of_cycle(lanes, i, transient, total, sticking, limit, facts, trace, recorder):
    """Take the lane on, observed and recorded, to the next release or recorded impact.

    Return the steps made, negative if it never came.
    """
    k = lane.load_constants(lanes, i)
    made = 0
    while made < limit:
        start = lane.load_motion(lanes, i)
        rows = walk(start, k, trace, limit - made, 0 if sticking else 1)
        if recorder is not None:
            overhear(recorder, start, trace, rows)
        for row in range(rows):
            event = lane.observe_walked(lanes, i, k, trace, row, transient, total, facts)
            made += 1
            if lane.load_sums(lanes, i).hits >= total and (facts is None or sticking):
                return -made
            if event == (RELEASE if sticking else IMPACT):
                return made
    return -limit


@njit(error_model="numpy")
def _follow_cycle(start, k, impacts, cycle, limit, trace):
    """Follow one cycle from its start: up to the next release, or through `impacts` of them.

    Fill `cycle` with (n, s, c, v) of each recorded impact; return their number, the steps made, the tangent, its
    largest growth of a velocity, and the motion at the end. A number of -1 says that no cycle ended within reach.
    """
    motion = start
    tangent = (1.0, 0.0, 0.0, 1.0)
    growth = 1.0
    number = made = 0
    while made < limit:
        rows = walk(motion, k, trace, limit - made, impacts - number if impacts > 0 else 0)
        for row in range(rows):
            motion, event, v, x = step_at(trace, row, 1, 0)
            made += 1
            if impacts > 0:
                if event in (RELEASE, CHATTER):
                    return -1, made, tangent, growth, motion
                tangent = product(flow(k.C, k.K, x), tangent)
                if motion.u == 0.0:
                    tangent = product(saltation(v, motion.s, k), tangent)
                growth = max(growth, abs(tangent[2]) + abs(tangent[3]))
            if event == IMPACT:
                if number == len(cycle):
                    return -1, made, tangent, growth, motion
                cycle[number, 0], cycle[number, 1], cycle[number, 2], cycle[number, 3] = motion.n, motion.s, motion.c, v
                number += 1
            if event == RELEASE or (impacts > 0 and number == impacts):
                return number, made, tangent, growth, motion
    return -1, limit, tangent, growth, motion


@njit(error_model="numpy")
def _way_to_go(start, end, k, tangent, spread):
    """Return how far, in rate, the cycle's end still is from the periodic orbit; infinite if that is not stable."""
    a, b, d, e = tangent
    trace, determinant = a + e, a * e - b * d
    if not (determinant < 1.0 and abs(trace) < 1.0 + determinant):
        return math.inf
    # Differences of the end from the start at a common phase: the end, later by dx, is taken back along its flight.
    dx = (end.s * start.c - end.c * start.s) / k.th
    acceleration = -k.C * end.p + k.G - k.A * end.s
    du, dp = -end.p * dx, end.p - start.p - acceleration * dx
    scale = 1.0 - trace + determinant
    way_u = ((1.0 - e) * du + b * dp) / scale
    way_p = (d * du + (1.0 - a) * dp) / scale
    return (abs(way_u) + abs(way_p)) * spread


@njit(error_model="numpy")
def _stamp_at(cycle, number, periods, ahead):
    """Return when impact `ahead` from now (0: the next one) of a cycle happens."""
    at = int(ahead) % number
    return Stamp(cycle[at, 0] + math.floor(ahead / number) * periods, cycle[at, 1], cycle[at, 2])


@njit(error_model="numpy")
def _finish_sums(lanes, i, cycle, number, periods, transient, total):
    """Add the impacts up to `total`, cycle upon cycle, to the lane's observers; the largest is then the cycle's own."""
    found, largest = lane.load_sums(lanes, i), 0.0
    count, shift = found.hits, found.shift
    sine, cosine = lane.load_phases(lanes, i)
    if count <= transient:
        shift = cycle[int(transient - count) % number, 3]
        lane.store_first(lanes, i, _stamp_at(cycle, number, periods, transient - count))
    for j in range(number):
        largest = max(largest, cycle[j, 3])
        # Impact j of the cycle is number count + 1 + j + k p, k = 0, 1, ...; kept are those in (transient, total].
        rounds = math.floor((total - count - 1.0 - j) / number) + 1.0
        skipped = max(math.ceil((transient - count - j) / number), 0.0)
        times = rounds - skipped
        if times > 0.0:
            found = repeated(found, total, shift, cycle[j, 3], times)
            sine += times * cycle[j, 1]
            cosine += times * cycle[j, 2]
    lane.store_last(lanes, i, _stamp_at(cycle, number, periods, total - count - 1.0))
    lane.store_sums(lanes, i, Sums(found.hits, found.shift, found.sum1, found.sum2, largest))
    lane.store_phases(lanes, i, Phases(sine, cosine))
    # A stick lies at every end of a sticking cycle: is there one between the first and the last kept impact?
    first = max(transient, count)
    return math.floor((first - count) / number) < math.floor((total - 1.0 - count) / number)


@njit(error_model="numpy")
def try_to_close(lanes, i, transient, total, scale, limit, finish, cycle, facts, trace, recorder):
    """Close lane i if its cycle is certain.

    Return the impacts and periods of the cycle (0 and 0 if it is not), the steps made, and the impacts that need not
    be computed. `scale` is V in lengths of a step. With `finish` the observers are brought to what `total` impacts
    would give. Thorough lanes have the cycle's `facts` noted; of others that is None. `recorder` is that of the lane,
    or None.
    """
    impacts = int(lane.load_recurrence(lanes, i).candidate)
    sticking = lane.load_rests(lanes, i).releases >= 2.0
    made = _to_start_of_cycle(lanes, i, transient, total, sticking, limit, facts, trace, recorder)
    if made < 0:
        return 0, 0.0, -made, 0.0
    start, k = lane.load_motion(lanes, i), lane.load_constants(lanes, i)
    number, walked, tangent, growth, end = _follow_cycle(start, k, 0 if sticking else impacts, cycle, limit, trace)
    made += walked
    # Not before the reference has moved on, or two more releases have passed, is it tried again.
    watched, rested = lane.load_recurrence(lanes, i), lane.load_rests(lanes, i)
    lane.store_recurrence(lanes, i, Recurrence(-math.inf, watched.number, watched.following, watched.near, 0.0))
    lane.store_rests(lanes, i, Rests(rested.stuck, rested.age, 0.0))
    if number < 1:
        return 0, 0.0, made, 0.0
    count = lane.load_sums(lanes, i).hits
    periods = end.n - start.n
    way = 0.0
    if not sticking:
        turned = phase_of(end.s, end.c) - phase_of(start.s, start.c)
        periods += 1.0 if turned < -0.5 else (-1.0 if turned > 0.5 else 0.0)
        weakest = math.inf
        for j in range(number):
            weakest = min(weakest, cycle[j, 3])
        way = _way_to_go(start, end, k, tangent, growth)
        # A cycle that is to be described must be near whatever its weight in the sums.
        left = min(1.0, (total - count) / (total - transient)) if facts is None else 1.0
        if not (way * left < SURE * scale and way < NOT_SMALL * weakest):
            return 0, 0.0, made, 0.0
    if facts is not None and not sticking:
        describe(start, k, number, periods, tangent, cycle, ALIKE * scale + 4.0 * way, facts, trace)
    known = 0.0
    if finish and count + number < total:
        known = total - count - number
        sticks = _finish_sums(lanes, i, cycle, number, periods, transient, total)
        if sticking and sticks:
            lane.store_rests(lanes, i, Rests(1.0, rested.age, 0.0))
    return number, periods, made, known
