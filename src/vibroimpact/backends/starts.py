"""From an oscillator, its axes and a start to the cells a back end runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from vibroimpact.backends.base import Cells, Floats
from vibroimpact.oscillator import ImpactOscillator, State, check_oscillator

COUNTABLE = 2.0**53  # periods: the next whole number is the next number


def make_cells(osc: ImpactOscillator, start: State | None, axes: Mapping[str, Floats] | None = None) -> Cells:
    """Return one cell a point of the axes' grid (the last axis fastest), all from the same start.

    `start` None is at rest at min(0, gap) at time 0. A start beyond the stop is refused, also where an axis of
    gaps makes it so.
    """
    check_oscillator(osc)
    axes = axes or {}
    grids = np.meshgrid(*axes.values(), indexing="ij")
    shape = grids[0].shape if grids else ()
    columns = {name: np.full(shape, value) for name, value in asdict(osc).items()}
    for name, grid in zip(axes, grids, strict=True):
        if name == "frequency":
            columns["omega"] = 2.0 * math.pi * grid
        else:
            columns[name] = grid
    gap = columns["gap"]
    if start is None:
        start = State(0.0)
        clearance = np.maximum(gap, 0.0)
    else:
        _refuse_beyond(start, gap)
        clearance = gap - start.displacement
    turns = start.time * columns["omega"] / (2.0 * math.pi)
    _refuse_endless(start, turns)
    whole = np.floor(turns)
    columns |= {
        "clearance": clearance,
        "velocity": np.full(shape, start.velocity),
        "periods": whole,
        "phase": turns - whole,
    }
    return Cells(**{name: np.ravel(column).astype(np.float64) for name, column in columns.items()})


def _refuse_beyond(start: State, gap: Floats) -> None:
    nearest = float(np.min(gap))
    if start.displacement > nearest:
        raise ValueError(
            f"`start` has displacement {start.displacement!r}; allowed is at most the gap, {nearest:g} here; "
            "start the mass in front of the stop"
        )


def _refuse_endless(start: State, turns: Floats) -> None:
    most = float(np.max(np.abs(turns), initial=0.0))
    if not most < COUNTABLE:
        raise ValueError(
            f"`start` has time {start.time!r}, {most:.3g} driving periods; allowed are less than 2^53, beyond which "
            "periods cannot be counted; start nearer to time 0"
        )


def check_start(start: State | None) -> None:
    """Refuse a start that is no `State`."""
    if not (start is None or isinstance(start, State)):
        raise ValueError(
            f"`start` is {start!r}; allowed is None or a State; write State(displacement, velocity=0.0, time=0.0)"
        )
