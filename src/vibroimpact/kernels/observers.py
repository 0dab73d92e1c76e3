"""What is kept of a motion while it is stepped; observers change no state.

Each tuple is what one observer keeps of a cell, and the function of its name in lower case brings it up to date. What
a cycle adds that is closed, and the indices that follow from velocities, stand beside them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE, STUCK
from vibroimpact.kernels.flight import acceleration, evaluate, least_gap, series, undamped_flow
from vibroimpact.kernels.law import across_impact
from vibroimpact.kernels.leaps import dipping, flown_over
from vibroimpact.kernels.shared.machine import inner, whole
from vibroimpact.kernels.shared.vectors import anywhere, fma, least, most, never, no, select
from vibroimpact.kernels.state import Motion, chosen

FOLD = 1.6069380442589903e60  # 2^200: a power of two rescales without rounding
SLOW = 1e-3  # of a step: a decay so slow is added up by its series
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


class Swings(NamedTuple):
    """Integrals over the time since a contact, of y = g - u from the place of rest without load.

    The time in flight, the integrals of y and y^2 over it, those of y sin wt and y cos wt over all of the time, the
    largest gap and the number of rests.
    """

    flown: float
    mean: float
    square: float
    sine: float
    cosine: float
    deepest: float
    rests: float


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


@inner(forceinline=True)
def swings(old, before, after, k, two, event, v, x):
    """Add what a motion swings on its way to `after`, x steps later: a flight, or a rest; `two` is a flow of 2 steps.

    With Y = a sin wt + b cos wt the steady motion without a stop and z = y - Y, in flight E = z'^2 + C z z' + K z^2
    decays as e^{-Cx}. [ ] is the difference between the ends, D = K - th^2 - i th C:

        K int y = int A sin wt - [y' + C y],    D int y e^{iwt} = int A sin wt e^{iwt} - [(y' - i th y + C y) e^{iwt}],
        int y^2 = 2 int y Y - int Y^2 + int z^2,    2 K int z^2 = int E - [z z' + C z^2].
    """
    u, p, s, c, _ = before
    u1, s1, c1 = after.u, after.s, after.c
    held = (event == RELEASE) | (event == STUCK)
    p1 = select(u1 <= 0.0, -v, after.p)
    inertia, damper, gap = k.K - k.Q, k.C * k.th, k.G / k.K
    scale = 1.0 / fma(inertia, inertia, damper * damper)
    a, b = k.A * inertia * scale, -k.A * damper * scale
    y, q, y1, q1 = gap - u, -p, gap - u1, -p1
    z, r = y - fma(a, s, b * c), q - k.th * fma(a, c, -b * s)
    z1, r1 = y1 - fma(a, s1, b * c1), q1 - k.th * fma(a, c1, -b * s1)
    turn = 0.5 / k.th
    crossed, squares = turn * (s1 - s) * (s1 + s), 0.5 * x - turn * (s1 * c1 - s * c)  # int sin cos, int sin^2
    kick, kick1 = fma(k.C, y, q), fma(k.C, y1, q1)
    real = k.A * crossed - (kick1 * c1 - kick * c) - k.th * (y1 * s1 - y * s)
    imaginary = k.A * squares - (kick1 * s1 - kick * s) + k.th * (y1 * c1 - y * c)
    cosine, sine = scale * (inertia * real - damper * imaginary), scale * (inertia * imaginary + damper * real)
    mean = (2.0 * turn * k.A * (c - c1) - (kick1 - kick)) / k.K
    e, e1 = fma(r, r, z * fma(k.C, r, k.K * z)), fma(r1, r1, z1 * fma(k.C, r1, k.K * z1))
    energy = select(k.C > SLOW, (e - e1) / k.C, e * x * _faded(k.C * x))
    free = (energy - z1 * fma(k.C, z1, r1) + z * fma(k.C, z, r)) / (2.0 * k.K)
    steady = a * a * squares + 2.0 * a * b * crossed + b * b * (x - squares)
    square = fma(2.0, fma(a, sine, b * cosine), free - steady)
    end = Motion(u1, p1, s1, c1, after.n)
    # A bound of the fourth to sixth derivatives: those of Y, and those of z, whose energy only falls.
    rate, size = k.C + math.sqrt(k.K), abs(a) + abs(b)
    level = math.sqrt(fma(r, r, k.K * z * z))
    rough = (size * k.Q * k.Q + rate * rate * rate * level) * fma(rate, rate, 1.0)
    far = no(held) & (gap + size + level / math.sqrt(k.K) > old.deepest)
    return Swings(
        flown=old.flown + select(held, 0.0, x),
        mean=old.mean + select(held, 0.0, mean),
        square=old.square + select(held, 0.0, square),
        sine=old.sine + select(held, 2.0 * turn * gap * (c - c1), sine),
        cosine=old.cosine + select(held, 2.0 * turn * gap * (s1 - s), cosine),
        deepest=_deepest(old.deepest, before, end, select(far, x, 0.0), rough, k, two),
        rests=old.rests + select(held, 1.0, 0.0),
    )


@inner(forceinline=True)
def _faded(t):
    """Return (1 - e^{-t})/t for small t."""
    return fma(-t, fma(-t, fma(-t, fma(-t, fma(-t, fma(-t, 1 / 5040, 1 / 720), 1 / 120), 1 / 24), 1 / 6), 1 / 2), 1.0)


@inner(forceinline=True)
def _deepest(deepest, at, end, left, rough, k, two):
    """Return the largest gap so far after a flight of so many steps, no derivative above the third beyond `rough`.

    Over a leap of d steps the coefficients that Bernstein's form gives to Hermite's cubic of the rate, within d^4/384
    of that, say whether it may vanish, and those of the quintic of the gap, within d^6/46080, how large that may be.
    """
    slope = acceleration(at.u, at.p, at.s, k)
    while anywhere(left > 0.0):
        to, d = chosen(left <= 2.0, end, flown_over(at, two)), least(left, 2.0)
        slope1, square = acceleration(to.u, to.p, to.s, k), d * d
        p0, p1, bend0, bend1 = d * at.p, d * to.p, square * slope, square * slope1
        early, late, blur = fma(1 / 3, bend0, p0), fma(-1 / 3, bend1, p1), square * square * rough
        rising, falling = most(most(p0, p1), most(early, late)), least(least(p0, p1), least(early, late))
        off = d * blur * (1 / 384)
        inner0, inner1 = fma(0.4, p0, fma(0.05, bend0, at.u)), fma(-0.4, p1, fma(0.05, bend1, to.u))
        highest = most(most(fma(0.2, p0, at.u), fma(-0.2, p1, to.u)), most(inner0, inner1))
        deepest = select(left > 0.0, most(deepest, to.u), deepest)
        blur = square * blur * (1 / 46080)
        turns = (left > 0.0) & (rising > -off) & (falling < off) & (highest + blur > deepest)
        if anywhere(turns):
            deepest = _top(deepest, at, to, p0, p1, bend0, bend1, d, blur, turns, k)
        at, slope, left = to, slope1, left - 2.0
    return deepest


@inner(forceinline=True)
def _top(deepest, at, to, p0, p1, bend0, bend1, d, blur, turns, k):
    """Return the largest gap so far after a leap in which it may turn: where Hermite's quintic does, then exactly."""
    c2 = 0.5 * bend0
    last, rate, bend = to.u - at.u - p0 - c2, p1 - p0 - bend0, bend1 - bend0
    c3, c4 = fma(10.0, last, fma(-4.0, rate, 0.5 * bend)), fma(-15.0, last, fma(7.0, rate, -bend))
    c5 = fma(6.0, last, fma(-3.0, rate, 0.5 * bend))
    low, high = 0.0 * d, 0.0 * d + 1.0
    t = select(p0 > 0.0, select(p1 < 0.0, p0 / (p0 - p1), -p0 / bend0), 1.0 - p1 / bend1)
    for _ in range(5):
        t = select((t >= low) & (t <= high), t, 0.5 * (low + high))
        rate = fma(t, fma(t, fma(t, fma(t, 5.0 * c5, 4.0 * c4), 3.0 * c3), bend0), p0)
        bend = fma(t, fma(t, fma(t, 20.0 * c5, 12.0 * c4), 6.0 * c3), bend0)
        low, high = select(rate > 0.0, t, low), select(rate > 0.0, high, t)
        t = t - rate / bend
    t = select((t >= low) & (t <= high), t, 0.5 * (low + high))
    highest = fma(t, fma(t, fma(t, fma(t, fma(t, c5, c4), c3), c2), p0), at.u)
    doubtful = turns & (highest + blur > deepest)
    if anywhere(doubtful):
        x, bend = t * d, bend / (d * d)
        while anywhere(doubtful & (x > 1.0)):
            far = x > 1.0
            at, x = chosen(far, flown_over(at, k.short.flow), at), x - select(far, 1.0, 0.0)
        a, begun = series(at, k, never(x)), x
        for _ in range(2):
            _, rate = evaluate(a, x)
            x = x - rate / bend
        u, _ = evaluate(a, x)
        deepest = select(doubtful & (abs(x - begun) < 0.1) & (u > deepest), u, deepest)
    return deepest
