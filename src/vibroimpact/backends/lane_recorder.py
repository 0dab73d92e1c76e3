"""Write down what a window sees of many cells, stepped side by side in lanes."""

from __future__ import annotations

from typing import Any

from vibroimpact.backends.recorder import read
from vibroimpact.kernels.cell import FILLED, RUNNING
from vibroimpact.kernels.compilation import compiled
from vibroimpact.kernels.lanes import LANES
from vibroimpact.kernels.traced_lanes import CELL, trace_lanes

IDLE = FILLED  # the ending of a lane without a cell


@compiled
def record_lanes(
    lanes: Any, trace: Any, memory: Any, ends: Any, window: Any, impacts: Any, looks: Any, sticks: Any, filled: Any
) -> None:
    """Step the lanes until a cell ends, or a buffer of one is full.

    Each lane has its own row of `memory`, from which it begins, of `ends`, of the three buffers and of `filled`; those
    that have ended are left alone.
    """
    for i in range(LANES):
        for row in range(CELL):
            lanes[row * LANES + i] = memory[i, row]
    halted = False
    while not halted:
        trace_lanes(lanes, trace)
        for i in range(LANES):
            if ends[i] == RUNNING:
                ends[i] = read(trace, LANES, i, memory[i], window, impacts[i], looks[i], sticks[i], filled[i])
                full = filled[i, 0] == impacts.shape[1] or filled[i, 2] == sticks.shape[1]
                halted |= ends[i] != RUNNING or full
