"""The facts of a cycle that is certain: its name, its growth, what it loses, its rest, its closest near-miss."""

from __future__ import annotations

import math

from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE, step_at, walk
from vibroimpact.kernels.cell import phase_of
from vibroimpact.kernels.flight import NONE, least_gap_exactly, undamped_flow
from vibroimpact.kernels.law import across_impact, tail_duration
from vibroimpact.kernels.observers import DEVIATION
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.state import Motion

NOT_SMALL = 1e-3  # of a cycle's weakest impact: nearer to a graze nothing is linear
UNREPEATED = 63.0  # periods over which a motion that does not repeat is followed for what it swings
RETURNED = 1e-9  # of V: how near a cycle comes back to where it was
ALIKE = 1e-8  # of V: two impacts of a cycle that are one and the same
HOP = 0.2  # of a step: a flight from contact to contact as short as this has no dip
# What is noted: periods, impacts (-1 of a complete chatter), ln of the spectral radius, the sum of the squared speeds,
# periods at rest, the closest near-miss, by how much neighbours part on the way; speeds and gaps in steps. PERIODS is 0
# while no cycle is known.
PERIODS, IMPACTS, LOG_RADIUS, SQUARES, RESTS, MISS, PARTING = range(7)
FACTS = 7
# The growth that carries rounding up to where it decides how a turn ends: moved by one digit of a double, no turn of 87
# that parted by less took another number of periods, one of 3 up to 1e15, and all of 47 beyond.
UNRESOLVED = 1e13


@inner
def forget(facts):
    """Begin with the facts of another cell: none is known."""
    for j in range(FACTS):
        facts[j] = 0.0


@inner
def fewest_impacts(cycle, number, periods, blur):
    """Return the least number of impacts after which a cycle of `number` repeats itself, within a speed `blur`."""
    for fewer in range(1, number):
        if number % fewer or periods * fewer % number != 0.0:
            continue
        same = True
        for j in range(number - fewer):
            _, s, c, v = cycle[j]
            _, s1, c1, v1 = cycle[j + fewer]
            close = abs(v1 - v) < blur and abs(s1 * c - c1 * s) * max(v, v1) < blur and s1 * s + c1 * c > 0.0
            if not close:
                same = False
                break
        if same:
            return fewer
    return number


@inner
def log_spectral_radius(tangent):
    """Return ln of the larger modulus of a 2 x 2 matrix's eigenvalues, given row by row."""
    a, b, d, e = tangent
    half, determinant = 0.5 * (a + e), a * e - b * d
    discriminant = half * half - determinant
    radius = math.sqrt(determinant) if discriminant < 0.0 else abs(half) + math.sqrt(discriminant)
    return math.log(radius) if radius > 0.0 else -math.inf


@inner
def describe(start, k, number, periods, tangent, cycle, blur, facts, trace):
    """Note the facts of a certain cycle, which starts at the motion `start`."""
    fewest = fewest_impacts(cycle, number, periods, blur)
    facts[PERIODS], facts[IMPACTS] = periods * fewest / number, fewest
    facts[LOG_RADIUS] = log_spectral_radius(tangent) * fewest / number
    squares = 0.0
    for j in range(fewest):
        squares += cycle[j, 3] * cycle[j, 3]
    facts[SQUARES], facts[RESTS], facts[PARTING] = squares, 0.0, 1.0
    facts[MISS] = _closest_miss(start, k, fewest, trace)


@inner
def _closest_miss(motion, k, impacts, trace):
    """Return the least gap between two contacts of a cycle of so many impacts."""
    least = NONE
    number = 0
    while number < impacts:
        for row in range(walk(motion, k, trace, len(trace), float(impacts - number))):
            before = motion
            motion, event, _, x = step_at(trace, row, 1, 0)
            least = min(least, least_gap_exactly(before, k, x, least))
            number += event == IMPACT
    return least


@inner
def describe_turn(k, limit, facts, trace):
    """Note the facts of a motion that sticks: those of the turn from its release to the next one.

    No cycle is known if none comes within `limit` steps. The turn is exact, but where rounding on the way grows to the
    size of the motion, how long it takes is an accident: PARTING is the largest growth between any two of its times.
    """
    motion = Motion(0.0, 0.0, k.sr, k.cr, 0.0)
    squares, hits, rests, least, settling = 0.0, 0.0, 0.0, NONE, 0.0
    facts[PERIODS], facts[IMPACTS], facts[PARTING] = 0.0, 0.0, 1.0
    du, dp = DEVIATION
    steps, event = 0, -1.0
    while steps < limit and event != RELEASE:
        rows = walk(motion, k, trace, limit - steps, 0.0)
        steps += rows
        for row in range(rows):
            before = motion
            motion, event, v, x = step_at(trace, row, 1, 0)
            if event == RELEASE:
                turned = phase_of(motion.s, motion.c) - phase_of(before.s, before.c)
                rests = turned + (1.0 if turned <= 0.0 else 0.0) - settling
                facts[PERIODS], facts[IMPACTS] = motion.n, (-1.0 if k.r > 0.0 else hits)
                break
            if x > HOP or before.u > 0.0 or motion.u > 0.0:
                least = min(least, least_gap_exactly(before, k, x, least))
            settling = tail_duration(v, motion.s, motion.c, k) * k.th / (2.0 * math.pi) if event == CHATTER else 0.0
            if event == IMPACT:
                hits += 1.0
                squares += v * v
            if facts[PARTING] < UNRESOLVED:
                du, dp = undamped_flow(du, dp, k.C, k.K, x)
                decay = math.exp(-0.5 * k.C * x)
                du, dp = decay * du, decay * dp
                if motion.u == 0.0:
                    du, dp = across_impact(du, dp, v, motion.s, k)
                parted = (abs(du) + abs(dp)) / (DEVIATION[0] + DEVIATION[1])
                if parted < 1.0:  # nothing of what came before matters more than the rounding made here
                    du, dp = DEVIATION
                facts[PARTING] = max(facts[PARTING], parted)
    facts[LOG_RADIUS], facts[SQUARES], facts[RESTS], facts[MISS] = -math.inf, squares, rests, least
