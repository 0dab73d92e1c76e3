"""Newton's method on the equations of an orbit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.orbits.equations import Cycle, Floats, parameters_of
from vibroimpact.oscillator import ImpactOscillator

MOST = 40
CLOSE = 1e-9  # relative: the correction after which convergence, being quadratic, is complete
SINGULAR = 1e13


@dataclass(frozen=True)
class Solved:
    """Where Newton's method arrived, and whether that is a solution and an isolated one."""

    z: Floats
    converged: bool
    singular: bool = False


def scales(osc: ImpactOscillator, cycle: Cycle, z: Floats) -> tuple[Floats, Floats]:
    """Return the sizes of the misses (m, m/s) and of the unknown (turns, m/s)."""
    p = cycle.n_impacts
    speed = max(float(np.abs(z[p:]).max()), osc.velocity_scale)
    length = speed / max(osc.natural_frequency, osc.omega)
    return np.repeat([length, speed], p), np.repeat([1.0, speed], p)


def solve(osc: ImpactOscillator, cycle: Cycle, start: Floats) -> Solved:
    """Return the orbit that Newton's method reaches from a start, its steps cut while they raise the misses."""
    parameters, z = parameters_of(osc), np.array(start, dtype=float)
    rows, columns = scales(osc, cycle, z)
    misses = _misses(parameters, cycle, z) / rows
    for _ in range(MOST):
        matrix = cycle.jacobian(parameters, z) * columns / rows[:, None]
        if not np.isfinite(matrix).all():
            break
        correction = np.linalg.lstsq(matrix, misses, rcond=None)[0]
        size, part = float(np.abs(correction).max()), 1.0
        while part > 1e-3:
            trial = z - part * columns * correction
            left = _misses(parameters, cycle, trial) / rows
            if size < CLOSE or (np.abs(left).max() < np.abs(misses).max() and _in_order(cycle, trial)):
                break
            part *= 0.5
        else:
            break
        z, misses = trial, left
        if size < CLOSE:
            return Solved(z, _in_order(cycle, z), bool(np.linalg.cond(matrix) > SINGULAR))
    matrix = cycle.jacobian(parameters, z) * columns / rows[:, None]
    singular = bool(not np.isfinite(matrix).all() or np.linalg.cond(matrix) > 1e6)
    return Solved(z, False, singular)


def _misses(parameters: list[float], cycle: Cycle, z: Floats) -> Floats:
    return np.array(cycle.misses(parameters, z))


def _in_order(cycle: Cycle, z: Floats) -> bool:
    turns = np.append(z[: cycle.n_impacts], z[0] + cycle.n_periods)
    return bool((np.diff(turns) > 0.0).all())
