"""Reading one lane: its state, its constants."""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels import lanes as rows
from vibroimpact.kernels.lanes import LANES


@njit(error_model="numpy")
def constants_of(lanes, i):
    """Return C, K, A, G, th, Q, r, cut, tail, sr, cr of lane i."""
    return (
        lanes[rows.DAMP * LANES + i],
        lanes[rows.STIFF * LANES + i],
        lanes[rows.DRIVE * LANES + i],
        lanes[rows.PRELOAD * LANES + i],
        lanes[rows.TURN * LANES + i],
        lanes[rows.TURN2 * LANES + i],
        lanes[rows.REST * LANES + i],
        lanes[rows.CUT * LANES + i],
        lanes[rows.TAIL * LANES + i],
        lanes[rows.SIN_R * LANES + i],
        lanes[rows.COS_R * LANES + i],
    )


@njit(error_model="numpy")
def state_of(lanes, i):
    """Return u, p, s, c, n of lane i."""
    return (
        lanes[rows.U * LANES + i],
        lanes[rows.P * LANES + i],
        lanes[rows.S * LANES + i],
        lanes[rows.C * LANES + i],
        lanes[rows.N * LANES + i],
    )
