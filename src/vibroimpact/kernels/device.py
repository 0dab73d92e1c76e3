"""The device's half of the `cuda` back end: one cell a thread, stepped by the functions that step a lane.

Cell j is lane j % LANES of group j // LANES, so that neighbouring threads find their numbers side by side.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from numba import cuda, float64, njit

from vibroimpact.kernels import runner
from vibroimpact.kernels.advance import LOOK, TRACE
from vibroimpact.kernels.cell import RUNNING, cell_of
from vibroimpact.kernels.closing import close as close_lane
from vibroimpact.kernels.cycle import forget
from vibroimpact.kernels.lanes import LANES, step_lane, step_thorough_lane
from vibroimpact.kernels.results import STEPS, harvest, harvest_thoroughly
from vibroimpact.kernels.runner import ending_of, may_close
from vibroimpact.kernels.shared.machine import cache_folder, config

CLOSES = 100  # a cell that waits for its cycle to be walked; other codes are why a cell ended, or RUNNING
CHUNK = 8  # rows of a thread's trace, which lies in its local memory
SIMULATED = bool(config.ENABLE_CUDASIM)


def _kernel(function: Any) -> Any:
    """Make a device kernel whose compiled code is kept on disk beside that of the `cpu` back end."""
    if SIMULATED or not find_spec("numba_cuda"):
        return cuda.jit(function)
    from numba.cuda.core import config as device_config

    kept = device_config.CACHE_DIR
    device_config.CACHE_DIR = cache_folder()
    device_config.CUDA_LOW_OCCUPANCY_WARNINGS = 0  # a few cells are a fair question too
    try:
        return cuda.jit(cache=True)(function)
    except RuntimeError:  # no folder to write to: compile anew in each process
        return cuda.jit(function)
    finally:
        device_config.CACHE_DIR = kept


@njit
def _as_it_is(array):
    return array


def _unwrapped(array):
    return array.__array__()


# In the simulator the compiled functions run on the host and want the array inside the simulator's wrapper.
_plain = _unwrapped if SIMULATED else _as_it_is


@_kernel
def begin(cells, lanes, notes, facts, states, total, chatter, flight_periods, steps_per_impact):
    """Put every cell at its start."""
    j = cuda.grid(1)
    if j < len(cells):
        runner.begin(
            _plain(lanes[j // LANES]),
            j % LANES,
            _plain(notes[j]),
            cell_of(_plain(cells[j])),
            total,
            chatter,
            flight_periods,
            steps_per_impact,
        )
        forget(_plain(facts[j]))
        states[j] = RUNNING


@_kernel
def step(running, lanes, notes, facts, states, looks, transient, total):
    """Step each running cell until it ends, may close its cycle, or has been looked at `looks` times."""
    t = cuda.grid(1)
    if t < len(running):
        j = running[t]
        group, i, note = _plain(lanes[j // LANES]), j % LANES, _plain(notes[j])
        state = RUNNING
        for _ in range(looks):
            for _ in range(LOOK):
                step_lane(group, i, transient, total)
            note[STEPS] += LOOK
            state = CLOSES if may_close(group, i, note, total, None) else ending_of(group, i, note, total)
            if state != RUNNING:
                break
        states[j] = state


@_kernel
def step_thoroughly(running, lanes, notes, facts, states, looks, transient, total):
    """Do what `step` does, with all observers."""
    t = cuda.grid(1)
    if t < len(running):
        j = running[t]
        group, i, note, facts_of_cell = _plain(lanes[j // LANES]), j % LANES, _plain(notes[j]), _plain(facts[j])
        state = RUNNING
        for _ in range(looks):
            for _ in range(LOOK):
                step_thorough_lane(group, i, transient, total)
            note[STEPS] += LOOK
            state = CLOSES if may_close(group, i, note, total, facts_of_cell) else ending_of(group, i, note, total)
            if state != RUNNING:
                break
        states[j] = state


@_kernel
def close(waiting, lanes, notes, facts, states, cycles, transient, total, early_closing):
    """Walk the cycle of each waiting cell, and close it if it is certain."""
    t = cuda.grid(1)
    if t < len(waiting):
        j = waiting[t]
        group, i, note = _plain(lanes[j // LANES]), j % LANES, _plain(notes[j])
        trace = cuda.local.array((CHUNK, TRACE), float64)
        close_lane(group, i, note, transient, total, early_closing, _plain(cycles[t]), None, trace, None)
        states[j] = ending_of(group, i, note, total)


@_kernel
def close_thoroughly(waiting, lanes, notes, facts, states, cycles, transient, total, early_closing):
    """Do what `close` does, and note the facts of the cycle."""
    t = cuda.grid(1)
    if t < len(waiting):
        j = waiting[t]
        group, i, note, facts_of_cell = _plain(lanes[j // LANES]), j % LANES, _plain(notes[j]), _plain(facts[j])
        trace = cuda.local.array((CHUNK, TRACE), float64)
        close_lane(group, i, note, transient, total, early_closing, _plain(cycles[t]), facts_of_cell, trace, None)
        states[j] = ending_of(group, i, note, total)


@_kernel
def hand_out(cells, lanes, notes, facts, results, keep):
    """Turn the sums of every cell into what it hands out."""
    j = cuda.grid(1)
    if j < len(results):
        harvest(_plain(lanes[j // LANES]), j % LANES, _plain(notes[j]), keep, _plain(results[j]))


@_kernel
def hand_out_thoroughly(cells, lanes, notes, facts, results, keep):
    """Do what `hand_out` does, with all indices."""
    j = cuda.grid(1)
    if j < len(results):
        group, note, result = _plain(lanes[j // LANES]), _plain(notes[j]), _plain(results[j])
        harvest(group, j % LANES, note, keep, result)
        trace = cuda.local.array((CHUNK, TRACE), float64)
        cell = cell_of(_plain(cells[j]))
        harvest_thoroughly(group, j % LANES, note, _plain(facts[j]), cell, keep, result, trace)
