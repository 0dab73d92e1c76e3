"""Lanes that also carry a tangent vector, the phases of impacts, and the closest near-miss.

The motion is stepped by the same operations as in plain lanes, so its bits are the same.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels import lanes as rows
from vibroimpact.kernels.advance import RELEASE, STUCK
from vibroimpact.kernels.arithmetic import fma, select
from vibroimpact.kernels.chatter import pressed
from vibroimpact.kernels.flight import series
from vibroimpact.kernels.lanes import LANES, step_lane
from vibroimpact.kernels.near_miss import NONE, least_gap
from vibroimpact.kernels.tangent import across_impact, undamped_flow
from vibroimpact.kernels.vector_loop import each_lane

FOLD = 1.6069380442589903e60  # 2^200: a power of two rescales without rounding
START = (1.0, 0.7)  # a tangent vector that no cell singles out


@njit(inline="always", error_model="numpy")
def step_thorough_lane(lanes, i, transient, total):
    """Make one certified step in lane i and observe all that can be observed. Return the event."""
    u0, p0 = lanes[rows.U * LANES + i], lanes[rows.P * LANES + i]
    s0, c0 = lanes[rows.S * LANES + i], lanes[rows.C * LANES + i]
    C, K = lanes[rows.DAMP * LANES + i], lanes[rows.STIFF * LANES + i]
    A, G = lanes[rows.DRIVE * LANES + i], lanes[rows.PRELOAD * LANES + i]
    th, Q, r = lanes[rows.TURN * LANES + i], lanes[rows.TURN2 * LANES + i], lanes[rows.REST * LANES + i]
    event, kept, first, last, v, x = step_lane(lanes, i, transient, total)
    u, p, s, c = (
        lanes[rows.U * LANES + i],
        lanes[rows.P * LANES + i],
        lanes[rows.S * LANES + i],
        lanes[rows.C * LANES + i],
    )
    held = (event == RELEASE) | (event == STUCK)
    contact = (u <= 0.0) & (held == False)  # noqa: E712

    du, dp = undamped_flow(lanes[rows.DU * LANES + i], lanes[rows.DP * LANES + i], C, K, x)
    du1, dp1 = across_impact(du, dp, v, s, C, A, G, r)
    du = select(held, START[0], select(contact, du1, du))
    dp = select(held, START[1], select(contact, dp1, dp))
    size = abs(du) + abs(dp)
    folds = lanes[rows.FOLDS * LANES + i]
    lanes[rows.SIZE0 * LANES + i] = select(first, size, lanes[rows.SIZE0 * LANES + i])
    lanes[rows.FOLDS0 * LANES + i] = select(first, folds, lanes[rows.FOLDS0 * LANES + i])
    lanes[rows.SIZE1 * LANES + i] = select(last, size, lanes[rows.SIZE1 * LANES + i])
    lanes[rows.FOLDS1 * LANES + i] = select(last, folds, lanes[rows.FOLDS1 * LANES + i])
    large, small = size > FOLD, size < 1.0 / FOLD
    scale = select(large, 1.0 / FOLD, select(small, FOLD, 1.0))
    lanes[rows.DU * LANES + i] = du * scale
    lanes[rows.DP * LANES + i] = dp * scale
    lanes[rows.FOLDS * LANES + i] = folds + select(large, 1.0, select(small, -1.0, 0.0))

    lanes[rows.SUM_S * LANES + i] += select(kept, s, 0.0)
    lanes[rows.SUM_C * LANES + i] += select(kept, c, 0.0)

    # The coefficients are those of the step itself: the compiler computes them once.
    at_release = (u0 <= 0.0) & (p0 == 0.0) & pressed(s0, c0, A, G)[1]
    a = series(u0, p0, s0, c0, C, K, A, G, th, Q, at_release)
    curvature = fma(-C, p, fma(-K, u, fma(-A, s, G)))
    least = least_gap(a, x, p, curvature, contact)
    least = select(held, NONE, least)
    count = lanes[rows.COUNT * LANES + i]
    margin = lanes[rows.MARGIN * LANES + i]
    within = (count > transient) & (count < total)
    lanes[rows.MARGIN * LANES + i] = select(within & (least < margin), least, margin)
    lanes[rows.LET_GO * LANES + i] += select(event == RELEASE, 1.0, 0.0)
    return event


@njit(error_model="numpy", forceinline=True)
def _step(lanes, i, transient, total):
    step_thorough_lane(lanes, i, transient, total)


_every_lane = each_lane(_step, LANES)


@njit(error_model="numpy", nogil=True)
def step_thorough_lanes(lanes, steps, transient, total):
    """Make `steps` certified steps in every lane."""
    for _ in range(steps):
        _every_lane(lanes, transient, total)
