"""What is kept of a motion while it is stepped; observers change no state."""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE
from vibroimpact.kernels.arithmetic import fma, select

WHOLE = 6755399441055744.0  # 1.5 * 2^52: adding and taking it away again rounds to a whole number


@njit(inline="always", error_model="numpy")
def count_impact(count, event, total):
    """Return the recorded impacts so far, up to `total`, and whether this event added one."""
    hit = (event == IMPACT) & (count < total)
    return count + select(hit, 1.0, 0.0), hit


@njit(inline="always", error_model="numpy")
def velocity_sums(shift, sum1, sum2, largest, v, first, kept):
    """Accumulate velocities shifted by the first one, which keeps their variance free of cancellation."""
    shift = select(first, v, shift)
    deviation = select(kept, v - shift, 0.0)
    return shift, sum1 + deviation, fma(deviation, deviation, sum2), select(kept & (v > largest), v, largest)


@njit(inline="always", error_model="numpy")
def stamp(take, old_n, old_s, old_c, n, s, c):
    """Take down when something happened, as whole periods and the pair of the phase."""
    return select(take, n, old_n), select(take, s, old_s), select(take, c, old_c)


@njit(inline="always", error_model="numpy")
def sticks_within(stuck, event, count, transient, total):
    """Return 1 once the mass has come to rest between the first and the last kept impact."""
    rests = (event == CHATTER) | (event == RELEASE)
    return select(rests & (count > transient) & (count < total), 1.0, stuck)


@njit(inline="always", error_model="numpy")
def recurrence(ref_v, ref_count, ref_next, near, candidate, v, count, hit):
    """Watch for impacts that recur: compare the speed of each with that of a reference impact.

    `candidate` becomes the number of impacts after which the reference came back within `near`, a speed; whether the
    states agree too is looked at where a cycle is to be closed. The reference moves on every 32 impacts at first, later
    more rarely, so that longer cycles are seen too.
    """
    back = hit & (abs(v - ref_v) < near) & (candidate == 0.0)
    candidate = select(back, count - ref_count, candidate)
    moves = hit & (count == ref_next)
    stride = (0.125 * count + WHOLE) - WHOLE
    following = count + select(stride > 32.0, stride, 32.0)
    return (
        select(moves, v, ref_v),
        select(moves, count, ref_count),
        select(moves, following, ref_next),
        candidate,
    )
