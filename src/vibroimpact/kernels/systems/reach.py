"""Which stops a motion may reach soon: the others need no look until then.

The energy about rest under the constant load, E = sum m (eta'^2 + L (eta - eta_0)^2)/2 and that of springs of stops,
grows by the power of the harmonics alone: at fixed stops impacts, damping and forces that hold only take from it. With
|f|^2 = sum m f^2 of their amplitudes and e = sqrt(2 E),

    e(t) <= e(0) + |f| t,   |alpha . (eta - eta_0)| <= sqrt(alpha L^-1 M^-1 alpha) e,

so that a clearance stays above zero until e has grown to its `barrier`, g - alpha eta_0 over that root. There is none
where a constant load acts on a mode without a spring, as its work has no bound.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import anywhere, fma, get, least, put, select
from vibroimpact.kernels.systems.elements import CLOSED, force_law

SPAN = 12.0  # steps: the most that are made before stops are sorted again, but for far leaps


@inner(forceinline=True)
def in_reach(rows, z, k, wide):
    """Return whether a stop may be reached before stops are sorted again."""
    return get(rows, k.remote + z, wide) <= 0.0


@inner(forceinline=True)
def look_around(rows, k, wide):
    """Mark the stops that are remote, and leave for how long none of these can be reached."""
    level = 0.0 * get(rows, k.growth, wide)
    for j in range(k.modes):
        y, p = get(rows, k.eta + j, wide) - get(rows, k.steady + j, wide), get(rows, k.rate + j, wide)
        energy = fma(get(rows, k.square + j, wide) * y, y, p * p)
        level = fma(get(rows, k.weight + j, wide), energy, level)
    if k.compliant and anywhere(get(rows, k.engaged, wide) > 0.0):
        level = level + _stored(rows, k, wide)
    level = math.sqrt(level)
    calm = 0.0 * level + math.inf
    for z in range(k.stops):
        lasts = (get(rows, k.barrier + z, wide) - level) * get(rows, k.growth, wide)
        remote = lasts > SPAN
        put(rows, k.remote + z, wide, select(remote, 1.0, 0.0))
        calm = select(remote, least(lasts, calm), calm)
    put(rows, k.calm, wide, calm)


@inner(forceinline=True)
def _stored(rows, k, wide):
    """Return twice the energy in the springs of stops that are pressed in."""
    total = 0.0 * get(rows, k.engaged, wide)
    for z in range(k.stops):
        pressed = (get(rows, k.kind + z, wide) >= CLOSED) | (get(rows, k.leaving + z, wide) > 0.0)
        stiffness = select(pressed, force_law(rows, z, k, wide)[0], 0.0)
        if anywhere(stiffness > 0.0):
            u = get(rows, k.gap + z, wide)
            for j in range(k.modes):
                u = fma(-get(rows, k.alpha + z * k.modes + j, wide), get(rows, k.eta + j, wide), u)
            total = fma(stiffness * u, u, total)
    return total
