"""What the engine of systems knows of leaps: the flows of the modes, and bounds that certify them."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from vibroimpact.backends.base import Floats
from vibroimpact.kernels.systems.layout import Layout
from vibroimpact.kernels.systems.leap import HALF, WHOLE, WITHIN

_TERMS = 30  # of a series over a leap: 2^31/31! is below rounding
_AT_ONCE = 512  # cells: their series are kept term by term
SAFE = 1.001  # above the speed from which on a leap within a contact is certified: far above rounding


def prepare_leaps(k: Layout, table: Floats) -> None:
    """Leave, in the rows of cells, the flows of leaps and bounds of what the clearances do on the way."""
    for first in range(0, len(table), _AT_ONCE):
        _prepare(k, table[first : first + _AT_ONCE])
    if k.giving and k.modes == 1:
        _prepare_contacts(k, table)


def _block(table: Floats, first: int, *shape: int) -> Floats:
    """Return a view of numbers of every cell."""
    return table[:, first : first + math.prod(shape)].reshape(len(table), *shape)


def _prepare(k: Layout, table: Floats) -> None:
    """Leave the flows of leaps in flight, and bounds: the head of `kernels.systems.leap` has the law."""
    number, n, s, m = len(table), k.modes, k.stops, k.harmonics
    square, load, alpha = _block(table, k.square, n), _block(table, k.load, n), _block(table, k.alpha, s, n)
    force, motion = _block(table, k.force, n, m, 2), _block(table, k.motion, s, m, 2)
    damping, theta = _block(table, k.damping, n, n), _block(table, k.theta, 1)
    squared = (theta * np.arange(1, m + 1))[:, None, :] ** 2
    turning = -squared[..., None] * motion - (alpha @ force.reshape(number, n, 2 * m)).reshape(number, s, m, 2)
    lift = [alpha * square[:, None], -alpha @ load[..., None], turning.reshape(number, s, 2 * m)]
    _block(table, k.lift, s, n + 1 + 2 * m)[:] = np.concatenate(lift, axis=-1)
    loads = np.abs(load) + np.hypot(force[..., 0], force[..., 1]).sum(axis=-1)
    swings = (squared * np.hypot(turning[..., 0], turning[..., 1])).sum(axis=-1)
    own = damping if k.coupled else np.einsum("cjj->cj", damping)[..., None]
    for first, length in ((k.halves, HALF), (k.wholes, WHOLE)):
        flow = _flow(square, own, load, force, theta, length)
        bounds = _bounds(square, damping, _block(table, k.weight, n), alpha, loads, swings, length)
        table[:, first : first + flow.shape[1]] = flow
        _block(table, first + flow.shape[1], s, 1 + 2 * n)[:] = bounds


def _bounds(
    square: Floats, damping: Floats, weight: Floats, alpha: Floats, loads: Floats, swings: Floats, length: float
) -> Floats:
    """Return what max(w0, w1) has to be raised by: a constant, and the parts of m and of |eta1 - eta0|."""
    size, coupling, ease = np.abs(damping), np.abs(alpha @ damping), 1.0 / np.sqrt(weight)[..., None]
    swing = length**2 / 8.0 * square[:, None]
    growth = 0.5 * length * size + swing * np.eye(square.shape[1])
    sure = (growth @ ease < ease).all(axis=1, keepdims=True)
    inverse = np.linalg.inv(np.eye(square.shape[1]) - np.where(sure, growth, 0.0))
    raised = (np.abs(alpha) * swing + 0.5 * length * coupling) @ inverse
    constant = length**2 / 8.0 * swings[..., None] + raised @ loads[..., None]
    parts = [np.where(sure, constant, np.inf), raised * square[:, None], (raised @ size + coupling) / length]
    return np.concatenate(parts, axis=-1)


def _flow(square: Floats, damping: Floats, load: Floats, force: Floats, theta: Floats, length: Any) -> Floats:
    """Return the flow of every mode over a length, and sine and cosine of what the force turns.

    `damping` is that of each mode, (cells, n, 1), or couples them, (cells, n, n).
    """
    (number, n), m, width = square.shape, force.shape[2], damping.shape[2]
    unit, still = np.broadcast_to(np.eye(n) if width > 1 else 1.0, (number, n, width)), np.zeros((number, n, width))
    driven, rates = np.zeros((number, n, 1 + 2 * m)), (theta * np.arange(1, m + 1))[:, None, :, None]
    waves, slopes = force.reshape(number, n, 2 * m), rates * np.stack([-force[..., 1], force[..., 0]], axis=-1)
    y, p = _over(
        np.concatenate([unit, still, driven], axis=-1),
        np.concatenate([still, unit, driven], axis=-1),
        square[..., None],
        damping,
        length,
        np.concatenate([still, still, load[..., None], waves], axis=-1),
        np.concatenate([still, still, 0.0 * load[..., None], slopes.reshape(number, n, 2 * m)], axis=-1),
        np.concatenate([np.zeros((number, 1, 2 * width + 1)), np.repeat(rates[..., 0], 2, axis=-1)], axis=-1),
    )
    free = [part[..., first : first + width] for part in (y, p) for first in (0, width)]
    loaded = [part[..., 2 * width] for part in (y, p)]
    turned = [part[..., 2 * width + 1 :].reshape(number, n, m, 2) for part in (y, p)]
    columns = np.stack(loaded, axis=-1), np.stack(free, axis=-1), np.concatenate(turned, axis=-1)
    modes = np.concatenate([part.reshape(number, n, math.prod(part.shape[2:])) for part in columns], axis=-1)
    modes = modes.reshape(number, n * modes.shape[2])
    angle = np.reshape(length, (-1, 1)) * theta
    return np.hstack([modes, np.sin(angle), np.cos(angle)])


def _prepare_contacts(k: Layout, table: Floats) -> None:
    """Leave the flows of leaps within contacts of a lone mode, with the speeds from which on they are certified."""
    square, damping, load, theta = (_block(table, first, 1) for first in (k.square, k.damping, k.load, k.theta))
    force = _block(table, k.force, k.harmonics, 2) @ np.array([1.0, 1j])
    motion = _block(table, k.motion, k.stops, k.harmonics, 2) @ np.array([1.0, 1j])
    zero, one, turned = np.zeros_like(square), np.ones_like(square), theta * np.arange(1, k.harmonics + 1)
    for own, (z, part) in enumerate(itertools.product(range(k.stops), WITHIN)):
        alpha, jump, gap, spring = (table[:, first + z, None] for first in (k.alpha, k.jump, k.gap, k.spring))
        dashpot, hard, thick = (table[:, first + z, None] for first in (k.dashpot, k.hard, k.thick))
        length = part / (np.sqrt(1.0 + hard) + thick)
        stiff, damped = square + alpha * jump * spring, damping + alpha * jump * dashpot
        y, rate = _over(zero, one, stiff, damped, length)
        whole, _ = _over(zero, zero, stiff, damped, length, one, zero, 0.0)
        pushed, whole = spring * y + dashpot * rate, spring * whole + dashpot * y
        # c^2 (y^2 + D y + K) > 0 at the beginning, where y = k/c - D
        falls = spring**2 - spring * dashpot * damped + stiff * dashpot**2 > 0.0
        moved = motion[:, z]
        driven = alpha * force - (square + 1j * turned * damping - turned**2) * moved
        least = alpha * load - square * gap - np.abs(driven).sum(axis=1, keepdims=True)
        others = np.delete(table[:, k.alpha : k.alpha + k.stops], z, axis=1)
        away = (others * alpha < 0.0).all(axis=1, keepdims=True) & (k.stops == 1 or not k.moving)
        sure = away & falls & (spring > 0.0) & (pushed > 0.0) & (stiff > 0.0)
        speed = np.where(sure, SAFE * np.maximum(-least, 0.0) * whole / np.where(sure, pushed, 1.0), np.inf)
        push = force + jump * (spring + 1j * turned * dashpot) * moved
        parts = np.stack([push.real, push.imag], axis=-1)[:, None]
        flow = _flow(stiff, damped[..., None], load + jump * spring * gap, parts, theta, length[..., None])
        flow = np.hstack([flow, speed])
        first = k.within + own * flow.shape[1]
        table[:, first : first + flow.shape[1]] = flow


def _over(
    y: Floats, p: Floats, square: Floats, damping: Floats, x: Any, force: Any = 0.0, slope: Any = 0.0, rate: Any = 0.0
) -> tuple[Floats, Floats]:
    """Return amplitude and rate after x steps, by the power series, under a force that turns at a rate."""
    b = [y, p]
    for _ in range(_TERMS - 1):
        b.append(force - square * b[-2] - (damping * b[-1] if damping.shape[-1] == 1 else damping @ b[-1]))
        force, slope = slope, -(rate**2) * force
    powers = [x**order / math.factorial(order) for order in range(_TERMS + 1)]
    amplitude, moved = 0.0 * y, 0.0 * y
    for order in range(_TERMS, 0, -1):
        amplitude, moved = amplitude + powers[order] * b[order], moved + powers[order - 1] * b[order]
    return amplitude + b[0], moved
