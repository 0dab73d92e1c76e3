"""Preparation of leaps for the engine of systems: modal flows, and bounds that certify them."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import Floats
from vibroimpact.kernels.systems.layout import Layout
from vibroimpact.kernels.systems.leap import FAR, HALF, WHOLE, WITHIN
from vibroimpact.matrices import ROUNDING

_TERMS = 30  # terms of a series over a leap: 2^31/31! is below rounding
_AT_ONCE = 512  # cells per block: their series are kept term by term
SLOW = 0.5  # largest change of a slow mode's curve over a far leap, relative to its value
CAUTION = 1e-9  # of a barrier: taken off, far above rounding
SAFE = 1.001  # margin on the least speed of certified leaps within a contact: far above rounding


def prepare_leaps(k: Layout, table: Floats) -> None:
    """Write the flows of leaps and the bounds of the clearances during leaps into the rows of cells."""
    for first in range(0, len(table), _AT_ONCE):
        _prepare(k, table[first : first + _AT_ONCE])
    if k.compliant and k.modes == 1 and not k.swinging:
        _prepare_contacts(k, table)


def _block(table: Floats, first: int, *shape: int) -> Floats:
    """Return a view of a block of numbers of every cell."""
    return table[:, first : first + math.prod(shape)].reshape(len(table), *shape)


def _prepare(k: Layout, table: Floats) -> None:
    """Write the flows and bounds of leaps in flight; the docstring of `kernels.systems.leap` gives the theory."""
    n, s, m = k.modes, k.stops, k.harmonics
    square, load, alpha = _block(table, k.square, n), _block(table, k.load, n), _block(table, k.alpha, s, n)
    force, motion = _block(table, k.force, n, m, 2), _block(table, k.motion, s, m, 2)
    damping, theta = _block(table, k.damping, n, n), _block(table, k.theta, 1)
    weight, swing = _block(table, k.weight, n), np.hypot(force[..., 0], force[..., 1]).sum(axis=-1)
    loads = np.abs(load) + swing
    _block(table, k.barrier, s)[:] = _barriers(k, table)
    power = np.linalg.norm(np.sqrt(weight) * swing, axis=-1)
    table[:, k.growth] = 1.0 / np.maximum(power, np.finfo(float).tiny)
    if k.swinging:
        return  # every step is made, and none leapt over
    lift, swings = _lift(square, load, force, motion, alpha, theta)
    _block(table, k.lift, s, n + 1 + 2 * m)[:] = lift
    diagonal = np.einsum("cjj->cj", damping)
    flow_damping = damping if k.coupled else diagonal[..., None]
    for first, length in ((k.halves, HALF), (k.wholes, WHOLE)):
        flow = _flow(square, flow_damping, load, force, theta, length)
        table[:, first : first + flow.shape[1]] = flow
        bounds = _bounds(square, damping, weight, alpha, loads, swings, length)
        _block(table, first + flow.shape[1], s, 1 + 2 * n)[:] = bounds
    if k.far:
        slow = slow_modes(square, damping, theta)
        part = alpha * slow[:, None]
        lift, swings = _lift(square, load, force, motion, part, theta)
        _block(table, k.slow, s, n)[:], _block(table, k.drawn, s, n + 1 + 2 * m)[:] = part, lift
        bounds = _bounds(square * slow, damping * slow[:, None], weight, part, loads, swings, FAR)
        _block(table, k.fars + n * k.flow + 2, s, 1 + 2 * n)[:] = bounds
        _block(table, k.reach, s, 1 + 2 * n)[:] = _reach(square, diagonal, load, force, alpha, theta, slow)
        flow = _flow(square, diagonal[..., None], load, force, theta, WHOLE)
        for _ in range(round(math.log2(FAR / WHOLE))):
            flow = _twice(flow, n, m)
        flow = _spread(flow, n) if k.coupled else flow
        table[:, k.fars : k.fars + flow.shape[1]] = flow


def _barriers(k: Layout, table: Floats) -> Floats:
    """Return the root of twice the energy that reaching each stop takes: `kernels.systems.reach` gives the theory.

    It is -inf if moving stops, negative damping or a constant load on a mode without a spring can bring any energy.
    """
    n, s = k.modes, k.stops
    sprung, alpha = _block(table, k.square, n) > 0.0, _block(table, k.alpha, s, n)
    root, damping = np.sqrt(_block(table, k.weight, n)), _block(table, k.damping, n, n)
    drag = root[:, :, None] * damping / root[:, None]
    drag = drag + drag.swapaxes(1, 2)
    bounded = np.linalg.eigvalsh(drag).min(axis=-1) >= -n * ROUNDING * np.abs(drag).sum(axis=(1, 2))
    bounded &= (sprung | (_block(table, k.load, n) == 0.0)).all(axis=-1)
    bounded &= (_block(table, k.motion, s * 2 * k.harmonics) == 0.0).all(axis=-1)
    held = ((alpha == 0.0) | sprung[:, None]).all(axis=-1) & bounded[:, None]
    clear = _block(table, k.gap, s) - (alpha @ _block(table, k.steady, n)[..., None])[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        barriers = clear / np.sqrt(_block(table, k.give, s))
    lowered: Floats = np.where(held & np.isfinite(barriers), (1.0 - CAUTION) * barriers, -np.inf)
    return lowered


def slow_modes(square: Floats, damping: Floats, theta: Floats) -> NDArray[np.bool_]:
    """Return which modes are slow over a far leap; none in cells for which far leaps are useless.

    Periods are counted from the sign of sin wt, so a leap must be shorter than half a period.
    """
    diagonal = np.einsum("cjj->cj", damping)
    slow = FAR**2 / 8.0 * square + 0.5 * FAR * diagonal < SLOW
    apart = np.count_nonzero(damping, axis=(1, 2)) == np.count_nonzero(diagonal, axis=1)
    useful = (FAR * theta[:, 0] < 3.0) & apart & (diagonal >= 0.0).all(axis=-1) & ~slow.all(axis=-1)
    useful_slow: NDArray[np.bool_] = slow & useful[:, None]
    return useful_slow


def _reach(
    square: Floats, damping: Floats, load: Floats, force: Floats, alpha: Floats, theta: Floats, slow: NDArray[np.bool_]
) -> Floats:
    """Return bounds of the change of each clearance by fast modes: a constant, and factors of |eta| and |eta'|."""
    stiff, turning = np.where(slow | (square <= 0.0), 1.0, square), theta * np.arange(1, force.shape[2] + 1)
    parts = np.abs(alpha) * ~slow[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):  # resonance without damping: there is no bound
        answer = 1.0 / np.abs(stiff[..., None] - turning[:, None] ** 2 + 1j * turning[:, None] * damping[..., None])
        swing = answer * np.hypot(force[..., 0], force[..., 1])
        rate = (turning[:, None] * swing).sum(axis=-1) / np.sqrt(stiff)
        most = 2.0 * (np.abs(load) / stiff + swing.sum(axis=-1)) + rate
        constant = np.where(parts > 0.0, parts * most[:, None], 0.0).sum(axis=-1, keepdims=True)
    constant[~slow.any(axis=-1)] = np.inf
    return np.concatenate([constant, parts, parts / np.sqrt(stiff)[:, None]], axis=-1)


def _lift(
    square: Floats, load: Floats, force: Floats, motion: Floats, alpha: Floats, theta: Floats
) -> tuple[Floats, Floats]:
    """Return the acceleration of the clearances without damping, and the amplitude of its second derivative."""
    number, n, m = force.shape[:3]
    squared = (theta * np.arange(1, m + 1))[:, None] ** 2
    turning = -squared[..., None] * motion - (alpha @ force.reshape(number, n, 2 * m)).reshape(motion.shape)
    parts = [alpha * square[:, None], -alpha @ load[..., None], turning.reshape(number, motion.shape[1], 2 * m)]
    return np.concatenate(parts, axis=-1), (squared * np.hypot(turning[..., 0], turning[..., 1])).sum(axis=-1)


def _bounds(
    square: Floats, damping: Floats, weight: Floats, alpha: Floats, loads: Floats, swings: Floats, length: float
) -> Floats:
    """Return the amount by which max(w0, w1) must be raised: a constant, and factors of m and |eta1 - eta0|."""
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
    """Return the flow of every mode over a length, and sine and cosine of the force's phase change.

    `damping` is modal, (cells, n, 1), or couples the modes, (cells, n, n).
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


def _twice(flow: Floats, n: int, m: int) -> Floats:
    """Return the flow of modes without damping coupling over twice the length."""
    number, sine, cosine = len(flow), flow[:, -2:-1], flow[:, -1:]
    modes, angle = flow[:, :-2].reshape(number, n, -1), np.arctan2(sine, cosine) * np.arange(1, m + 1)
    loaded, free, turned = (
        modes[..., :2],
        modes[..., 2:6].reshape(-1, n, 2, 2),
        modes[..., 6:].reshape(number, n, m, 2, 2),
    )
    turn = np.stack([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)], axis=-1).reshape(number, 1, m, 2, 2)
    loaded = loaded + (free @ loaded[..., None])[..., 0]
    turned = free[:, :, None] @ turned + turned @ turn
    parts = [loaded, (free @ free).reshape(number, n, 4), turned.reshape(number, n, 4 * m)]
    both = [2.0 * sine * cosine, cosine**2 - sine**2]
    return np.hstack([np.concatenate(parts, axis=-1).reshape(number, -1), *both])


def _spread(flow: Floats, n: int) -> Floats:
    """Return the same flow in the form for modes coupled by damping, with zeros for the coupling."""
    modes = flow[:, :-2].reshape(len(flow), n, -1)
    free = (modes[:, :, None, 2:6] * np.eye(n)[..., None]).reshape(len(flow), n, 4 * n)
    modes = np.concatenate([modes[..., :2], free, modes[..., 6:]], axis=-1)
    return np.hstack([modes.reshape(len(flow), -1), flow[:, -2:]])


def _prepare_contacts(k: Layout, table: Floats) -> None:
    """Write the flows of leaps within contacts of a single mode, and the least speeds at which they are certified."""
    square, damping, load, theta = (_block(table, first, 1) for first in (k.square, k.damping, k.load, k.theta))
    force = _block(table, k.force, k.harmonics, 2) @ np.array([1.0, 1j])
    motion = _block(table, k.motion, k.stops, k.harmonics, 2) @ np.array([1.0, 1j])
    zero, one, turned = np.zeros_like(square), np.ones_like(square), theta * np.arange(1, k.harmonics + 1)
    for number, (z, part) in enumerate(itertools.product(range(k.stops), WITHIN)):
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
        first = k.within + number * flow.shape[1]
        table[:, first : first + flow.shape[1]] = flow


def _over(
    y: Floats, p: Floats, square: Floats, damping: Floats, x: Any, force: Any = 0.0, slope: Any = 0.0, rate: Any = 0.0
) -> tuple[Floats, Floats]:
    """Return amplitude and rate after x steps, from the power series, under a harmonic force of the given rate."""
    b = [y, p]
    for _ in range(_TERMS - 1):
        b.append(force - square * b[-2] - (damping * b[-1] if damping.shape[-1] == 1 else damping @ b[-1]))
        force, slope = slope, -(rate**2) * force
    powers = [x**order / math.factorial(order) for order in range(_TERMS + 1)]
    amplitude, moved = 0.0 * y, 0.0 * y
    for order in range(_TERMS, 0, -1):
        amplitude, moved = amplitude + powers[order] * b[order], moved + powers[order - 1] * b[order]
    return amplitude + b[0], moved
