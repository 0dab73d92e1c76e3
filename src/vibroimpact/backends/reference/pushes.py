"""Effects of stops while they push or are held: impulse, peak force, contact time, penetration and energy lost."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from vibroimpact.backends.reference.phases import CLEARANCE, FORCE, NEARLY, TERMS, Phase
from vibroimpact.backends.reference.stops import Floats
from vibroimpact.model.elements import Contact

# Quadrature over a stride, exact to rounding even for the product of two series.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


def pushes(phase: Phase, x: Floats, time: float) -> dict[int, Contact]:
    """Return the effect of each stop that pushes or is held in a phase over a time from x, at most a block.

    Times count from x.
    """
    if not phase.pushing and not phase.held:
        return {}
    states, lengths = phase.strides(x, time)
    series = phase.series(states.T)  # (powers of time, X, strides)
    powers = (lengths[:, None] * (1.0 + NODES) / 2.0)[..., None] ** np.arange(TERMS)
    weights = lengths[:, None] * WEIGHTS / 2.0
    work = {}
    for j in (*phase.pushing, *phase.held):
        force = np.einsum("x,pxi->ip", phase.rows[FORCE, j, 0], series)
        clearance, rate = np.einsum("ox,pxi->oip", phase.rows[CLEARANCE, j, :2], series)
        at = np.einsum("ip,inp->in", force, powers) * weights
        lost = -at * np.einsum("ip,inp->in", rate, powers)
        (peak, largest), (deepest, depth) = _largest(force, lengths), _largest(-clearance, lengths)
        leaves = float(rate[-1] @ lengths[-1] ** np.arange(TERMS))
        work[j] = Contact(float(at.sum()), time, largest, depth, float(lost.sum()), leaves, time, peak, deepest)
    return work


def drained(phase: Phase, damping: Floats, x: Floats, time: float) -> float:
    """Return the energy in J that dampers C take in a phase over a time from x: the integral of q' . C q'."""
    states, lengths = phase.strides(x, time)
    n = len(damping)
    powers = (lengths[:, None] * (1.0 + NODES) / 2.0)[..., None] ** np.arange(TERMS)
    v = np.einsum("pxi,inp->inx", phase.series(states.T)[:, n : 2 * n], powers)
    power = np.einsum("inx,xy,iny->in", v, damping, v)
    return float((power * lengths[:, None] * WEIGHTS / 2.0).sum())


def _largest(series: Floats, lengths: Floats) -> tuple[float, float]:
    """Return where a function is largest, and its value there, from its power series over successive intervals."""
    order = np.arange(TERMS)
    slopes = series[:, 1:] * order[1:]
    begins, ends = np.cumsum(lengths) - lengths, np.einsum("ip,ip->i", series, lengths[:, None] ** order)
    falls = np.einsum("ip,ip->i", slopes, lengths[:, None] ** order[:-1])
    places = [(float(series[0, 0]), 0.0), *zip(ends.tolist(), (begins + lengths).tolist(), strict=True)]
    for i in np.flatnonzero((slopes[:, 0] > 0.0) & (falls < 0.0)):
        slope = slopes[i]
        top = brentq(lambda t, slope=slope: slope @ t ** order[:-1], 0.0, lengths[i], rtol=NEARLY)
        places.append((float(series[i] @ top**order), float(begins[i] + top)))
    value, place = max(places)
    return place, value
