"""What is kept of a motion while it is stepped; observers change no state.

Each tuple is what one observer keeps of a cell, and the function of its name in lower case brings it up to date. What
a cycle adds that is closed, and the indices that follow from velocities, stand beside them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE, STUCK
from vibroimpact.kernels.flight import acceleration, least_gap, undamped_flow
from vibroimpact.kernels.law import across_impact
from vibroimpact.kernels.leaps import dipping
from vibroimpact.kernels.machine import inner, whole
from vibroimpact.kernels.state import Motion
from vibroimpact.kernels.vectors import anywhere, fma, least, no, select

FOLD = 1.6069380442589903e60  # 2^200: a power of two rescales without rounding
DEVIATION = (1.0, 0.7)  # a tangent vector to begin with, in a direction that no cell singles out


class Sums(NamedTuple):
    """Recorded impacts so far, and sums of the kept speeds, each less the first one `shift`."""

    hits: float
    shift: float
    sum1: float
    sum2: float
    largest: float


class VelocityIndices(NamedTuple):
    """Indices from sums over the velocities of impacts."""

    std: float
    mean_velocity: float
    max_velocity: float
    impacts_per_period: float


class Stamp(NamedTuple):
    """When something happened: whole periods and the pair of the phase."""

    n: float
    s: float
    c: float


class Rests(NamedTuple):
    """Whether the mass came to rest among the kept impacts; steps since the last impact; releases."""

    stuck: float
    age: float
    releases: float


class Turn(NamedTuple):
    """Recorded impacts, sums and whole periods at the latest release."""

    hits: float
    sum1: float
    sum2: float
    n: float


class Recurrence(NamedTuple):
    """The reference impact, its number, when the next one takes its place, how near is a return, and the return.

    `candidate` is the number of impacts after which the reference came back within `near`, a speed, or 0; whether the
    states agree too is looked at where a cycle is to be closed.
    """

    speed: float
    number: float
    following: float
    near: float
    candidate: float


class Deviation(NamedTuple):
    """A tangent vector, and folds by 2^200 taken out of it."""

    du: float
    dp: float
    folds: float


class Grown(NamedTuple):
    """The size of the tangent vector at a kept impact, the first or the last, and its folds."""

    size: float
    folds: float


class Phases(NamedTuple):
    """Sums of (sin wt, cos wt) of the kept impacts."""

    s: float
    c: float


class Misses(NamedTuple):
    """The least gap of a near-miss within the window."""

    margin: float


@inner(forceinline=True)
def count_impact(count, event, total):
    """Return the recorded impacts so far, up to `total`, and whether this event added one."""
    hit = (event == IMPACT) & (count < total)
    return count + select(hit, 1.0, 0.0), hit


@inner(forceinline=True)
def sums(old, count, v, first, kept):
    """Accumulate velocities shifted by the first one, which keeps their variance free of cancellation."""
    shift = select(first, v, old.shift)
    deviation = select(kept, v - shift, 0.0)
    largest = select(kept & (v > old.largest), v, old.largest)
    return Sums(count, shift, old.sum1 + deviation, fma(deviation, deviation, old.sum2), largest)


@inner
def repeated(old, hits, shift, v, times):
    """Return the sums after an impact of speed v has been kept so many times more, with the new `hits` and `shift`."""
    sum1 = old.sum1 + times * (v - shift)
    sum2 = old.sum2 + times * (v - shift) ** 2
    return Sums(hits, shift, sum1, sum2, max(old.largest, v))


@inner
def velocity_indices(summed, span, ratio, h, keep):
    """Return the indices of `keep` impacts within `span` periods; `ratio` is the p/n of a closed cycle, or 0."""
    mean = summed.sum1 / keep
    variance = summed.sum2 / keep - mean * mean
    rate = (keep - 1.0) / span if keep > 1.0 else math.nan
    return VelocityIndices(
        std=math.sqrt(max(variance, 0.0)) / h,
        mean_velocity=(summed.shift + mean) / h,
        max_velocity=summed.largest / h,
        impacts_per_period=ratio if ratio > 0.0 else rate,  # of a closed cycle exactly p/n
    )


@inner(forceinline=True)
def stamp(old, motion, take):
    """Record the time of a motion where `take` holds."""
    return Stamp(select(take, motion.n, old.n), select(take, motion.s, old.s), select(take, motion.c, old.c))


@inner(forceinline=True)
def rests(old, event, x, count, transient, total):
    """Note sticks between the first and the last kept impact, and how long the last impact is past."""
    stays = (event == CHATTER) | (event == RELEASE)
    return Rests(
        stuck=select(stays & (count > transient) & (count < total), 1.0, old.stuck),
        age=select(event == IMPACT, 0.0, old.age + x),
        releases=old.releases + select(event == RELEASE, 1.0, 0.0),
    )


@inner(forceinline=True)
def turn(old, motion, event, summed):
    """Note what has been summed up to a release."""
    released = event == RELEASE
    return Turn(
        select(released, summed.hits, old.hits),
        select(released, summed.sum1, old.sum1),
        select(released, summed.sum2, old.sum2),
        select(released, motion.n, old.n),
    )


@inner(forceinline=True)
def recurrence(old, v, count, hit):
    """Watch for impacts that recur: compare the speed of each with that of a reference impact.

    The reference moves on every 32 impacts at first, later more rarely, so that longer cycles are noticed too.
    """
    back = hit & (abs(v - old.speed) < old.near) & (old.candidate == 0.0)
    moves = hit & (count == old.following)
    stride = whole(0.125 * count)
    following = count + select(stride > 32.0, stride, 32.0)
    return Recurrence(
        speed=select(moves, v, old.speed),
        number=select(moves, count, old.number),
        following=select(moves, following, old.following),
        near=old.near,
        candidate=select(back, count - old.number, old.candidate),
    )


@inner(forceinline=True)
def deviation(old, motion, k, event, v, x):
    """Carry a tangent vector over a step; a hold erases what came before."""
    du, dp = undamped_flow(old.du, old.dp, k.C, k.K, x)
    du1, dp1 = across_impact(du, dp, v, motion.s, k)
    contact = motion.u <= 0.0
    du, dp = select(contact, du1, du), select(contact, dp1, dp)
    held = (event == RELEASE) | (event == STUCK)
    if anywhere(held):
        du, dp = select(held, DEVIATION[0], du), select(held, DEVIATION[1], dp)
    return Deviation(du, dp, old.folds)


@inner(forceinline=True)
def size_of(deviation):
    """Return the size of a tangent vector."""
    return abs(deviation.du) + abs(deviation.dp)


@inner(forceinline=True)
def folded(vector):
    """Return a tangent vector that is neither very large nor very small."""
    size = size_of(vector)
    large, small = size > FOLD, size < 1.0 / FOLD
    if anywhere(large | small):
        scale = select(large, 1.0 / FOLD, select(small, FOLD, 1.0))
        folds = vector.folds + select(large, 1.0, select(small, -1.0, 0.0))
        vector = Deviation(vector.du * scale, vector.dp * scale, folds)
    return vector


@inner(forceinline=True)
def grown(old, now, take):
    """Note the size of the tangent vector where `take` holds."""
    return Grown(select(take, size_of(now), old.size), select(take, now.folds, old.folds))


@inner(forceinline=True)
def phases(old, motion, kept):
    """Add up the phases of kept impacts, as points on the unit circle."""
    return Phases(old.s + select(kept, motion.s, 0.0), old.c + select(kept, motion.c, 0.0))


@inner(forceinline=True)
def phases_until(old, now, event):
    """Note the phases added up to a release."""
    released = event == RELEASE
    return Phases(select(released, now.s, old.s), select(released, now.c, old.c))


@inner(forceinline=True)
def margin_to_beat(old, count, transient, total):
    """Return the gap below which a near-miss of the flight after so many impacts counts."""
    return select((count > transient) & (count < total), old.margin, 0.0)


@inner(forceinline=True)
def misses(old, leapt, a, after, k, event, v, x, below):
    """Note near-misses `below` a gap in leaps and in the step after them, whose coefficients are `a`."""
    margin, contact = leapt.margin, after.u <= 0.0
    held = (event == RELEASE) | (event == STUCK)
    end = Motion(after.u, select(contact, -v, after.p), after.s, after.c, after.n)
    dips = (dipping(leapt.at, end, k) > 0.0) & no(held)
    if anywhere(dips):
        slope = acceleration(end.u, end.p, end.s, k)
        margin = select(dips, least(margin, least_gap(a, x - leapt.steps, end.p, slope)), margin)
    return Misses(select(margin < below, margin, old.margin))
