"""Finish a cell in closed form once all its remaining impacts are known.

A cycle is closed only if it is certain. A sticking one is exact: a release erases all memory, so the motion
repeats bit for bit from release to release, and what lanes sum up between two releases is that of every turn. Another
cycle is walked alone, and taken once its Jacobian M is stable and the way still to go
to the periodic orbit, (I - M)^-1 d with d the return difference of the cycle, can change no index by more than
1e-10 of V.
"""

from __future__ import annotations

import math

from vibroimpact.kernels import lanes as lane
from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE, step_at, walk
from vibroimpact.kernels.cell import phase_of
from vibroimpact.kernels.cycle import ALIKE, NOT_SMALL, PERIODS, describe, describe_turn
from vibroimpact.kernels.flight import flow, product
from vibroimpact.kernels.law import saltation
from vibroimpact.kernels.observers import Deviation, Misses, Phases, Recurrence, Stamp, Sums, repeated
from vibroimpact.kernels.recorder import overhear
from vibroimpact.kernels.results import ADDED, RATIO, RELEASES, SCALE, STEPS, TURN, WALK
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.state import Motion

LONGEST = 4096  # impacts of the longest cycle that is closed
SURE = 1e-10  # of V: the most that the remaining way may change an index


@inner
def _skip_turns(lanes, i, note, transient, total, finish):
    """Skip turns from release to release once two releases of lane i frame one: all are alike, bit for bit.

    With `finish` those that end before the kept impacts begin are skipped, and later all but the last whole one: it
    tells the largest speed, and the lane ends as it would have.
    """
    sums, now, phases = lane.load_sums(lanes, i), lane.load_turn(lanes, i), lane.load_turn_phases(lanes, i)
    framed, kept = note[TURN] >= 0.0, note[TURN] >= transient
    hits, sum1, sum2, periods = (
        now.hits - note[TURN], now.sum1 - note[TURN + 1], now.sum2 - note[TURN + 2], now.n - note[TURN + 3]
    )  # fmt: skip
    sine, cosine = phases.s - note[TURN + 4], phases.c - note[TURN + 5]
    note[RELEASES] = lane.load_rests(lanes, i).releases
    note[TURN], note[TURN + 1], note[TURN + 2], note[TURN + 3] = now
    note[TURN + 4], note[TURN + 5] = phases
    if not framed or hits == 0.0 or now.hits >= total:  # past the window impacts are no longer counted
        return
    note[RATIO] = hits / periods
    if kept or not finish:
        note[RELEASES] = math.inf  # all is known
    if not finish:
        return
    times = math.floor((total - sums.hits) / hits) - 1.0 if kept else math.floor((transient - sums.hits) / hits)
    if times < 1.0:
        return
    motion = lane.load_motion(lanes, i)
    lane.store_motion(lanes, i, Motion(motion.u, motion.p, motion.s, motion.c, motion.n + times * periods))
    note[ADDED] += times * hits
    count, largest = sums.hits + times * hits, sums.largest
    if kept:
        sum1, sum2, largest = sums.sum1 + times * sum1, sums.sum2 + times * sum2, 0.0
        added = lane.load_phases(lanes, i)
        lane.store_phases(lanes, i, Phases(added.s + times * sine, added.c + times * cosine))
    else:
        sum1, sum2 = sums.sum1, sums.sum2
        note[TURN] = -1.0
    lane.store_sums(lanes, i, Sums(count, sums.shift, sum1, sum2, largest))


@inner
def _to_next_impact(lanes, i, transient, total, facts, trace, recorder):
    """Take the lane on, observed and recorded, to the next recorded impact.

    Return the steps made, negative if it never came.
    """
    k = lane.load_constants(lanes, i)
    steps = 0
    while steps < WALK:
        start = lane.load_motion(lanes, i)
        rows = walk(start, k, trace, WALK - steps, 1.0)
        if recorder is not None:
            overhear(recorder, start, trace, rows)
        for row in range(rows):
            event = lane.observe_walked(lanes, i, k, trace, row, transient, total, facts)
            steps += 1
            if lane.load_sums(lanes, i).hits >= total and facts is None:
                return -steps
            if event == IMPACT:
                return steps
    return -WALK


@inner
def _follow_cycle(start, k, impacts, cycle, trace):
    """Follow a cycle of so many impacts once.

    Fill `cycle` with (n, s, c, v) of each recorded impact; return whether it came to its end without a stick, the steps
    made, the tangent, its largest growth of a velocity, and the motion at the end.
    """
    motion = start
    tangent = (1.0, 0.0, 0.0, 1.0)
    growth = 1.0
    number = steps = 0
    while steps < WALK and impacts <= len(cycle):
        rows = walk(motion, k, trace, WALK - steps, float(impacts - number))
        for row in range(rows):
            motion, event, v, x = step_at(trace, row, 1, 0)
            steps += 1
            if event in (RELEASE, CHATTER):
                return False, steps, tangent, growth, motion
            tangent = product(flow(k.C, k.K, x), tangent)
            if motion.u == 0.0:
                tangent = product(saltation(v, motion.s, k), tangent)
            growth = max(growth, abs(tangent[2]) + abs(tangent[3]))
            if event == IMPACT:
                cycle[number, 0], cycle[number, 1], cycle[number, 2], cycle[number, 3] = motion.n, motion.s, motion.c, v
                number += 1
            if number == impacts:
                return True, steps, tangent, growth, motion
    return False, steps, tangent, growth, motion


@inner
def _way_to_go(start, end, k, tangent, spread):
    """Return the distance, in rate, of the cycle's end from the periodic orbit; infinite if that is not stable."""
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


@inner
def _stamp_at(cycle, number, periods, ahead):
    """Return the time at which impact `ahead` from now (0: the next one) of a cycle happens."""
    at = int(ahead) % number
    return Stamp(cycle[at, 0] + math.floor(ahead / number) * periods, cycle[at, 1], cycle[at, 2])


@inner
def _finish_sums(lanes, i, cycle, number, periods, transient, total):
    """Add the impacts up to `total`, cycle upon cycle, to the lane's observers; the largest is then the cycle's own."""
    sums, largest = lane.load_sums(lanes, i), 0.0
    count, shift = sums.hits, sums.shift
    phases = lane.load_phases(lanes, i)
    sine, cosine = phases.s, phases.c
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
            sums = repeated(sums, total, shift, cycle[j, 3], times)
            sine += times * cycle[j, 1]
            cosine += times * cycle[j, 2]
    lane.store_last(lanes, i, _stamp_at(cycle, number, periods, total - count - 1.0))
    lane.store_sums(lanes, i, Sums(sums.hits, sums.shift, sums.sum1, sums.sum2, largest))
    lane.store_phases(lanes, i, Phases(sine, cosine))


@inner
def _look_no_further(lanes, i, facts):
    """Look for no near-miss, and follow no tangent, where the facts tell what comes of them."""
    if facts[PERIODS] > 0.0:
        lane.store_misses(lanes, i, Misses(0.0))
        lane.store_deviation(lanes, i, Deviation(0.0, 0.0, 0.0))


@inner
def close(lanes, i, note, transient, total, finish, cycle, facts, trace, recorder):
    """Close lane i, and note it, if it repeats: turns that stick are skipped, another cycle is walked once.

    With `finish` the observers are brought to what `total` impacts would give. Thorough lanes have the `facts` of a
    walked cycle noted; of others that is None. `recorder` is that of the lane, or None.
    """
    if lane.load_rests(lanes, i).releases > note[RELEASES]:
        _skip_turns(lanes, i, note, transient, total, finish)
        if facts is not None and math.isinf(note[RELEASES]):
            describe_turn(lane.load_constants(lanes, i), WALK, facts, trace)
            _look_no_further(lanes, i, facts)
        return
    impacts = int(lane.load_recurrence(lanes, i).candidate)
    steps = _to_next_impact(lanes, i, transient, total, facts, trace, recorder)
    note[STEPS] += abs(steps)
    if steps < 0:
        return
    start, k = lane.load_motion(lanes, i), lane.load_constants(lanes, i)
    ended, walked, tangent, growth, end = _follow_cycle(start, k, impacts, cycle, trace)
    note[STEPS] += walked
    # Not before the reference has moved on is it tried again.
    watched = lane.load_recurrence(lanes, i)
    lane.store_recurrence(lanes, i, Recurrence(-math.inf, watched.number, watched.following, watched.near, 0.0))
    if not ended:
        return
    count, scale = lane.load_sums(lanes, i).hits, note[SCALE]
    turned = phase_of(end.s, end.c) - phase_of(start.s, start.c)
    periods = end.n - start.n + (1.0 if turned < -0.5 else (-1.0 if turned > 0.5 else 0.0))
    weakest = math.inf
    for j in range(impacts):
        weakest = min(weakest, cycle[j, 3])
    way = _way_to_go(start, end, k, tangent, growth)
    # A cycle that is to be described must be near whatever its weight in the sums.
    weight = min(1.0, (total - count) / (total - transient)) if facts is None else 1.0
    if not (way * weight < SURE * scale and way < NOT_SMALL * weakest):
        return
    if facts is not None:
        describe(start, k, impacts, periods, tangent, cycle, ALIKE * scale + 4.0 * way, facts, trace)
        if lane.load_rests(lanes, i).stuck == 0.0:  # else the turn from a release may take the cycle's place
            _look_no_further(lanes, i, facts)
    note[RATIO] = impacts / periods
    if finish and count + impacts < total:
        note[ADDED] = total - count - impacts
        _finish_sums(lanes, i, cycle, impacts, periods, transient, total)
