"""Effects of compliant stops while they push: impulse, peak force, contact time, penetration and energy lost."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from vibroimpact.backends.reference.phases import CLEARANCE, FORCE, NEARLY, TERMS, Phase
from vibroimpact.backends.reference.stops import Floats

NODES, WEIGHTS = np.polynomial.legendre.leggauss(
    12
)  # quadrature over a stride, exact to rounding even for the product of two series


class Push(NamedTuple):
    """The effect of a stop during an interval in which it pushed.

    Parameters
    ----------
    impulse, energy_lost : float
        Integrals of F in N s and of F d' in J, d = -u.
    peak_force, penetration, contact_time : float
        The largest F in N and d in m, and the duration in s.
    """

    impulse: float
    energy_lost: float
    peak_force: float
    penetration: float
    contact_time: float


def pushes(phase: Phase, x: Floats, time: float) -> dict[int, Push]:
    """Return the effect of each pushing stop in a phase over a time from x, at most a block."""
    count = max(1, math.ceil(time / phase.stride))
    states = np.concatenate([x[None], phase.block @ x])[:count]
    lengths = np.full(count, phase.stride)
    lengths[-1] = time - (count - 1) * phase.stride
    series = phase.series(states.T)  # (powers of time, X, strides)
    powers = (lengths[:, None] * (1.0 + NODES) / 2.0)[..., None] ** np.arange(TERMS)
    weights = lengths[:, None] * WEIGHTS / 2.0
    work = {}
    for j in phase.pushing:
        force = np.einsum("x,pxi->ip", phase.rows[FORCE, j, 0], series)
        clearance, rate = np.einsum("ox,pxi->oip", phase.rows[CLEARANCE, j, :2], series)
        at = np.einsum("ip,inp->in", force, powers) * weights
        lost = -at * np.einsum("ip,inp->in", rate, powers)
        work[j] = Push(
            float(at.sum()), float(lost.sum()), _largest(force, lengths), _largest(-clearance, lengths), time
        )
    return work


def _largest(series: Floats, lengths: Floats) -> float:
    """Return the largest value of a function given by its power series over successive intervals."""
    order = np.arange(TERMS)
    slopes = series[:, 1:] * order[1:]
    ends = np.einsum("ip,ip->i", series, lengths[:, None] ** order)
    falls = np.einsum("ip,ip->i", slopes, lengths[:, None] ** order[:-1])
    best = max(float(series[0, 0]), float(ends.max()))
    for i in np.flatnonzero((slopes[:, 0] > 0.0) & (falls < 0.0)):
        slope = slopes[i]
        top = brentq(lambda t, slope=slope: slope @ t ** order[:-1], 0.0, lengths[i], rtol=NEARLY)
        best = max(best, float(series[i] @ top**order))
    return best
