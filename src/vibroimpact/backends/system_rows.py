"""The rows of numbers that the engine of systems reads, time counted in steps."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from vibroimpact.backends.base import Floats
from vibroimpact.contact import KNOWN
from vibroimpact.kernels.cell import MOST
from vibroimpact.kernels.restitution import address_of
from vibroimpact.kernels.systems.layout import Layout
from vibroimpact.kernels.systems.leap import HALF, WHOLE, WITHIN
from vibroimpact.kernels.systems.series import REACH
from vibroimpact.options import Tolerances
from vibroimpact.system_cells import SystemCells

_TERMS = 30  # of a series over a leap: 2^31/31! is below rounding
SAFE = 1.001  # above the speed from which on a leap within a contact is certified: far above rounding

# By which power of a step's length a number is multiplied where time is counted in steps.
_POWERS = {
    "rate": 1,
    "square": 2,
    "damping": 1,
    "load": 2,
    "force": 2,
    "omega": 1,
    "scale": 1,
    "give": -2,
    "slide": 1,
    "sliding": -1,
    "spring": 2,
    "dashpot": 1,
}
_RENAMED = {"omega": "theta", "scale": "cut"}


def steps_of(cells: SystemCells) -> Floats:
    """Return the length of a step of every cell in s."""
    return REACH / cells.fastest_rate


def in_steps(cells: SystemCells, chatter: float, layout: Layout) -> Floats:
    """Return the engine's rows of every cell, time counted in steps, with the cut at that part of V."""
    step = steps_of(cells)[:, None]
    table = np.zeros((len(cells), layout.constants))
    for name, size in cells.shape.sizes.items():
        first = getattr(layout, _RENAMED.get(name, name), None)
        if first is not None:
            table[:, first : first + size] = cells.block(name) * step ** _POWERS.get(name, 0)
    _address_laws(layout, table)
    table[:, layout.tick] = step[:, 0]
    s, grip = layout.stops, np.einsum("ijk,ijk->ij", *(_by_stop(cells, name) for name in ("alpha", "jump")))
    table[:, layout.hard : layout.hard + s] = table[:, layout.spring : layout.spring + s] * grip / REACH**2
    table[:, layout.thick : layout.thick + s] = table[:, layout.dashpot : layout.dashpot + s] * grip / REACH
    _prepare_leaps(cells, layout, table)
    table[:, layout.speed] = table[:, layout.cut]
    table[:, layout.cut] *= chatter
    return table


def _address_laws(k: Layout, table: Floats) -> None:
    """Put the addresses of laws of restitution in the place of their marks, and those of their tables."""
    laws, numbers = (table[:, first : first + k.stops] for first in (k.law, k.restitution))
    for mark in np.unique(laws[laws != 0.0]).tolist():
        law, here = KNOWN[mark], laws == mark
        laws[here] = address_of(law.code, law.made.rule)
        if law.made.table is not None:
            numbers[here] = law.made.table.ctypes.data


def _by_stop(cells: SystemCells, name: str) -> Floats:
    return cells.block(name).reshape(len(cells), cells.shape.stops, cells.shape.modes)


def _prepare_leaps(cells: SystemCells, k: Layout, table: Floats) -> None:
    """Leave the flows of leaps, and bounds of loads and of the stops' accelerations."""
    n, s, m, number = k.modes, k.stops, k.harmonics, len(cells)
    square, damping = table[:, k.square : k.square + n], table[:, k.damping : k.damping + n * n : n + 1]
    load, theta = table[:, k.load : k.load + n], table[:, k.theta, None]
    force = table[:, k.force : k.force + 2 * m * n].reshape(number, n, m, 2)
    motion = table[:, k.motion : k.motion + 2 * m * s].reshape(number, s, m, 2)
    turned = np.arange(1, m + 1) * theta
    size, swing = np.hypot(force[..., 0], force[..., 1]), np.hypot(motion[..., 0], motion[..., 1])
    bounds = (np.abs(load) + size.sum(axis=-1), *((part * turned[:, None] ** 2).sum(axis=-1) for part in (size, swing)))
    table[:, k.driven : k.driven + 2 * n + s] = np.hstack(bounds)
    coupled = np.count_nonzero(table[:, k.damping : k.damping + n * n], axis=1) > np.count_nonzero(damping, axis=1)
    for first, length in ((k.halves, HALF), (k.wholes, WHOLE)):
        room = np.where(coupled[:, None], 0.0, 1.0 - square * length**2 / 8.0 - damping * length / 2.0)
        bound = np.where(room > 0.0, 1.0 / np.where(room > 0.0, room, 1.0), np.inf)
        flow = _flow(square, damping, load, force, theta, length, bound)
        table[:, first : first + flow.shape[1]] = flow
    if k.giving and n == 1:
        forced, moved = force[:, 0] @ np.array([1.0, 1j]), motion @ np.array([1.0, 1j])
        _prepare_contacts(k, table, square, damping, load, forced, moved, theta)


def _flow(
    square: Floats, damping: Floats, load: Floats, force: Floats, theta: Floats, length: Any, bound: Floats
) -> Floats:
    """Return the flow of every mode over a length, with what bounds it, and sine and cosine of what the force turns."""
    zero, one = np.zeros_like(square), np.ones_like(square)
    own = [*_over(one, zero, square, damping, length), *_over(zero, one, square, damping, length)]
    loaded = _over(zero, zero, square, damping, length, load, zero, 0.0)
    columns = [own[0], own[2], loaded[0], own[1], own[3], loaded[1], bound]
    for order in range(force.shape[2]):
        rate, (re, im) = (order + 1) * theta, np.moveaxis(force[:, :, order], -1, 0)
        sine = _over(zero, zero, square, damping, length, re, -im * rate, rate)
        cosine = _over(zero, zero, square, damping, length, im, re * rate, rate)
        columns += [sine[0], cosine[0], sine[1], cosine[1]]
    angle = length * theta
    return np.hstack([np.stack(columns, axis=-1).reshape(len(square), -1), np.sin(angle), np.cos(angle)])


def _prepare_contacts(
    k: Layout, table: Floats, square: Floats, damping: Floats, load: Floats, force: Any, motion: Any, theta: Floats
) -> None:
    """Leave the flows of leaps within contacts of a lone mode, with the speeds from which on they are certified."""
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
        flow = _flow(stiff, damped, load + jump * spring * gap, parts, theta, length, speed)
        first = k.within + own * flow.shape[1]
        table[:, first : first + flow.shape[1]] = flow


def _over(
    y: Floats, p: Floats, square: Floats, damping: Floats, x: Any, force: Any = 0.0, slope: Any = 0.0, rate: Any = 0.0
) -> tuple[Floats, Floats]:
    """Return amplitude and rate after x steps, by the power series, under a force that turns at a rate."""
    b = [y, p]
    for _ in range(_TERMS - 1):
        b.append(force - square * b[-2] - damping * b[-1])
        force, slope = slope, -(rate**2) * force
    powers = [x**order / math.factorial(order) for order in range(_TERMS + 1)]
    amplitude, moved = 0.0 * y, 0.0 * y
    for order in range(_TERMS, 0, -1):
        amplitude, moved = amplitude + powers[order] * b[order], moved + powers[order - 1] * b[order]
    return amplitude + b[0], moved


def budgets_of(cells: SystemCells, tolerances: Tolerances, total: float) -> Floats:
    """Return the step, the longest flight in steps and the steps granted of every cell."""
    step, slowest = steps_of(cells), cells.slowest_rate
    longest = tolerances.flight_periods * 2.0 * math.pi / (slowest * step)
    granted = tolerances.steps_per_impact * total
    most = np.maximum(granted, np.minimum(granted * cells.fastest_rate / slowest, MOST))
    return np.column_stack([step, longest, most])
