"""Finish a cell in closed form once all its remaining impacts are known.

A cycle is closed only if it is certain. A sticking one is exact: a release erases all memory, so the motion
repeats bit for bit from release to release. Another is taken once its Jacobian M is stable and the way still to go
to the periodic orbit, (I - M)^-1 d with d the return difference of the cycle, can change no index by more than
1e-10 of V.
"""

from __future__ import annotations

import math

from numba import njit

from vibroimpact.kernels import lanes as rows
from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE, advance
from vibroimpact.kernels.cell import phase_of
from vibroimpact.kernels.cycle import ALIKE, describe
from vibroimpact.kernels.lanes import LANES, constants_of, state_of, step_lane
from vibroimpact.kernels.tangent import flow, product, saltation
from vibroimpact.kernels.thorough_lanes import step_thorough_lane

LONGEST = 4096  # impacts of the longest cycle that is closed
SURE = 1e-10  # of V: the most that the remaining way may change an index
NOT_SMALL = 1e-3  # of the cycle's weakest impact: nearer to a graze nothing is linear
TURN = 2.0 * math.pi


@njit(error_model="numpy")
def _to_start_of_cycle(lanes, i, transient, total, sticking, limit, facts):
    """Step on, observed, to the next release or recorded impact. Return the steps made, negative if it never came."""
    for made in range(1, limit + 1):
        if facts is None:
            event = step_lane(lanes, i, transient, total)[0]
        else:
            event = step_thorough_lane(lanes, i, transient, total)
        if lanes[rows.COUNT * LANES + i] >= total and (facts is None or sticking):
            return -made
        if event == (RELEASE if sticking else IMPACT):
            return made
    return -limit


@njit(error_model="numpy")
def _walk_cycle(lanes, i, impacts, cycle, limit):
    """Walk one cycle unobserved from the lane's state: up to the next release, or through `impacts` of them.

    Fill `cycle` with (n, s, c, v) of each recorded impact; return their number, the steps made, the tangent, its
    largest growth of a velocity, and the state at the end. A number of -1 says that no cycle ended within reach.
    """
    C, K, A, G, th, Q, r, cut, tail, sr, cr = constants_of(lanes, i)
    u, p, s, c, n = state_of(lanes, i)
    tangent = (1.0, 0.0, 0.0, 1.0)
    growth = 1.0
    number = 0
    for made in range(1, limit + 1):
        u, p, s, c, n, event, v, x = advance(u, p, s, c, n, C, K, A, G, th, Q, r, cut, tail, sr, cr)
        if impacts > 0:
            if event in (RELEASE, CHATTER):
                return -1, made, tangent, growth, (u, p, s, c, n)
            tangent = product(flow(C, K, x), tangent)
            if u == 0.0:
                tangent = product(saltation(v, s, c, C, A, G, r), tangent)
            growth = max(growth, abs(tangent[2]) + abs(tangent[3]))
        if event == IMPACT:
            if number == len(cycle):
                return -1, made, tangent, growth, (u, p, s, c, n)
            cycle[number, 0], cycle[number, 1], cycle[number, 2], cycle[number, 3] = n, s, c, v
            number += 1
        if event == RELEASE or (impacts > 0 and number == impacts):
            return number, made, tangent, growth, (u, p, s, c, n)
    return -1, limit, tangent, growth, (u, p, s, c, n)


@njit(error_model="numpy")
def _way_to_go(lanes, i, end, tangent, spread):
    """Return how far, in rate, the cycle's end still is from the periodic orbit; infinite if that is not stable."""
    p, s, c = state_of(lanes, i)[1:4]
    C, A, G, th = (
        lanes[rows.DAMP * LANES + i],
        lanes[rows.DRIVE * LANES + i],
        lanes[rows.PRELOAD * LANES + i],
        lanes[rows.TURN * LANES + i],
    )
    a, b, d, e = tangent
    trace, determinant = a + e, a * e - b * d
    if not (determinant < 1.0 and abs(trace) < 1.0 + determinant):
        return math.inf
    # Differences of the end from the start at a common phase: the end, later by dx, is taken back along its flight.
    dx = (end[2] * c - end[3] * s) / th
    acceleration = -C * end[1] + G - A * end[2]
    du, dp = -end[1] * dx, end[1] - p - acceleration * dx
    scale = 1.0 - trace + determinant
    way_u = ((1.0 - e) * du + b * dp) / scale
    way_p = (d * du + (1.0 - a) * dp) / scale
    return (abs(way_u) + abs(way_p)) * spread


@njit(error_model="numpy")
def _finish_sums(lanes, i, cycle, number, periods, transient, total):
    """Add the impacts up to `total`, cycle upon cycle, to the lane's observers."""
    count = lanes[rows.COUNT * LANES + i]
    shift = lanes[rows.SHIFT * LANES + i]
    if count <= transient:
        at = int(transient - count) % number
        round_ = math.floor((transient - count) / number)
        shift = cycle[at, 3]
        lanes[rows.SHIFT * LANES + i] = shift
        lanes[rows.N0 * LANES + i] = cycle[at, 0] + round_ * periods
        lanes[rows.S0 * LANES + i], lanes[rows.C0 * LANES + i] = cycle[at, 1], cycle[at, 2]
    for j in range(number):
        # Impact j of the cycle is number count + 1 + j + k p, k = 0, 1, ...; kept are those in (transient, total].
        rounds = math.floor((total - count - 1.0 - j) / number) + 1.0
        skipped = max(math.ceil((transient - count - j) / number), 0.0)
        times = rounds - skipped
        if times > 0.0:
            v = cycle[j, 3]
            lanes[rows.SUM1 * LANES + i] += times * (v - shift)
            lanes[rows.SUM2 * LANES + i] += times * (v - shift) ** 2
            lanes[rows.LARGEST * LANES + i] = max(lanes[rows.LARGEST * LANES + i], v)
            lanes[rows.SUM_S * LANES + i] += times * cycle[j, 1]
            lanes[rows.SUM_C * LANES + i] += times * cycle[j, 2]
    at = int(total - count - 1.0) % number
    round_ = math.floor((total - count - 1.0) / number)
    lanes[rows.N1 * LANES + i] = cycle[at, 0] + round_ * periods
    lanes[rows.S1 * LANES + i], lanes[rows.C1 * LANES + i] = cycle[at, 1], cycle[at, 2]
    # A stick lies at every end of a sticking cycle: is there one between the first and the last kept impact?
    first = max(transient, count)
    return math.floor((first - count) / number) < math.floor((total - 1.0 - count) / number)


@njit(error_model="numpy")
def try_to_close(lanes, i, transient, total, scale, limit, finish, cycle, facts):
    """Close lane i if its cycle is certain.

    Return the impacts and periods of the cycle (0 and 0 if it is not), the steps made, and the impacts that need not
    be computed. `scale` is V in lengths of a step. With `finish` the observers are brought to what `total` impacts
    would give. Thorough lanes have the cycle's `facts` noted; of others that is None.
    """
    impacts = int(lanes[rows.CANDIDATE * LANES + i])
    sticking = lanes[rows.RELEASES * LANES + i] >= 2.0
    made = _to_start_of_cycle(lanes, i, transient, total, sticking, limit, facts)
    if made < 0:
        return 0, 0.0, -made, 0.0
    number, walked, tangent, growth, end = _walk_cycle(lanes, i, 0 if sticking else impacts, cycle, limit)
    made += walked
    lanes[rows.CANDIDATE * LANES + i] = 0.0
    # Not before the reference has moved on, or two more releases have passed, is it tried again.
    lanes[rows.REF_V * LANES + i] = -math.inf
    lanes[rows.RELEASES * LANES + i] = 0.0
    if number < 1:
        return 0, 0.0, made, 0.0
    periods = end[4] - lanes[rows.N * LANES + i]
    way = 0.0
    if not sticking:
        turned = phase_of(end[2], end[3]) - phase_of(lanes[rows.S * LANES + i], lanes[rows.C * LANES + i])
        periods += 1.0 if turned < -0.5 else (-1.0 if turned > 0.5 else 0.0)
        weakest = math.inf
        for j in range(number):
            weakest = min(weakest, cycle[j, 3])
        way = _way_to_go(lanes, i, end, tangent, growth)
        # A cycle that is to be described must be near whatever its weight in the sums.
        left = min(1.0, (total - lanes[rows.COUNT * LANES + i]) / (total - transient)) if facts is None else 1.0
        if not (way * left < SURE * scale and way < NOT_SMALL * weakest):
            return 0, 0.0, made, 0.0
    if facts is not None and not sticking:
        describe(lanes, i, number, periods, tangent, cycle, ALIKE * scale + 4.0 * way, facts)
    known = 0.0
    if finish and lanes[rows.COUNT * LANES + i] < total:
        known = max(total - lanes[rows.COUNT * LANES + i] - number, 0.0)
        sticks = _finish_sums(lanes, i, cycle, number, periods, transient, total)
        if sticking and sticks:
            lanes[rows.STUCK_SEEN * LANES + i] = 1.0
        lanes[rows.COUNT * LANES + i] = total
    return number, periods, made, known
