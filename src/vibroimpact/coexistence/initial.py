"""Initial conditions of one oscillator: a grid of them, a list of them, or some spread over the impact surface."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends.base import Floats
from vibroimpact.cells import Cells, cells_at
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.parameters import invalid, unknown
from vibroimpact.sections import section_phase

SPREAD = 256  # initial conditions where none are given
FASTEST = 4.0  # of V: the hardest impact among them
_STRIDES = 0.7548776662466927, 0.5698402909980532  # 1/x and 1/x^2 with x^3 = x + 1: what spreads points most evenly
_NAMES = ("displacement", "velocity", "phase")
_PAIRS = "(displacement, velocity), with `phase` a number, or (phase, velocity)"


def spread_cells(osc: ImpactOscillator, number: int = SPREAD) -> Cells:
    """Return impacts spread evenly over the impact surface: phases 0 to 1, velocities 0 to 4 V; always the same.

    Without a scale (V = 0) the motions are alike at every speed, and 1 m/s stands for V.
    """
    phase, part = (np.mod(0.5 + np.arange(number, dtype=np.float64) * stride, 1.0) for stride in _STRIDES)
    return cells_at(osc, np.zeros(number), FASTEST * (osc.velocity_scale or 1.0) * part, phase)


def state_cells(osc: ImpactOscillator, starts: Iterable[State]) -> Cells:
    """Return one cell per state, or raise `ValueError` naming what is wrong with `starts`."""
    allowed = "a list of at least one State in front of the stop"
    if isinstance(starts, State):
        raise invalid("starts", starts, allowed, f"write starts=[{starts}]")
    try:
        states = list(starts)
    except TypeError:
        raise invalid("starts", starts, allowed, "leave it out for 256 spread ones") from None
    if not states:
        raise invalid("starts", states, allowed, "leave it out for 256 spread ones")
    for state in states:
        if not isinstance(state, State):
            raise invalid("starts", state, allowed, "write State(displacement, velocity=0.0, time=0.0)")
        if state.displacement > osc.gap:
            raise invalid("starts", state, allowed, f"displacements are at most the gap, {osc.gap:g} m here")
    y, v, t = (np.array([getattr(state, name) for state in states]) for name in ("displacement", "velocity", "time"))
    return cells_at(osc, osc.gap - y, v, t * osc.omega / (2.0 * math.pi))


def check_grid(osc: ImpactOscillator, axes: Mapping[str, Any]) -> tuple[dict[str, Floats], float]:
    """Return the two axes in the order given, and the phase of initial conditions that have no axis of phases."""
    for name in axes:
        if name not in _NAMES:
            raise unknown("coordinate", name, _NAMES)
    phase = 0.0
    given = dict(axes)
    if "displacement" in given and np.ndim(given.get("phase", ())) == 0:
        phase = section_phase(given.pop("phase"))
    if set(given) not in ({"displacement", "velocity"}, {"phase", "velocity"}):
        got = ", ".join(f"`{name}`" for name in axes) or "no axis"
        raise ValueError(f"the axes must be {_PAIRS}, got {got}")
    grid = {name: _values(name, values) for name, values in given.items()}
    if "phase" in grid:
        _within("phase", grid["phase"], 0.0, 1.0, "give (t mod T)/T")
        _within("velocity", grid["velocity"], 0.0, math.inf, "an impact has velocity > 0, a mass at rest 0")
    else:
        _within("displacement", grid["displacement"], -math.inf, osc.gap, "start the mass in front of the stop")
    return grid, phase


def grid_cells(osc: ImpactOscillator, grid: Mapping[str, Floats], phase: float) -> Cells:
    """Return one cell per point of the grid, the last axis fastest."""
    columns = {
        name: np.ravel(values) for name, values in zip(grid, np.meshgrid(*grid.values(), indexing="ij"), strict=True)
    }
    if "phase" in grid:
        return cells_at(osc, np.zeros_like(columns["phase"]), columns["velocity"], columns["phase"])
    clearance = osc.gap - columns["displacement"]
    return cells_at(osc, clearance, columns["velocity"], np.full_like(clearance, phase))


def _values(name: str, given: ArrayLike) -> Floats:
    allowed, example = "a one-dimensional list of finite numbers", f"write for example {name}=np.linspace(0, 1, 200)"
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise invalid(name, given, allowed, example) from None
    if values.ndim != 1 or values.size == 0 or not np.isfinite(values).all():
        raise invalid(name, given, allowed, example)
    falls = np.flatnonzero(np.diff(values) <= 0.0)
    if falls.size:
        low, high = values[falls[0]], values[falls[0] + 1]
        raise ValueError(f"`{name}` must be strictly increasing, got {low:g} before {high:g}; sort the values")
    return values


def _within(name: str, values: Floats, low: float, high: float, hint: str) -> None:
    if values[0] >= low and values[-1] <= high:
        return
    wrong = float(values[0] if values[0] < low else values[-1])
    if math.isinf(low):
        allowed = f"at most the gap, {high:g} here"
    else:
        allowed = f">= {low:g}" if math.isinf(high) else f"between {low:g} and {high:g}"
    raise invalid(name, wrong, allowed, hint)
