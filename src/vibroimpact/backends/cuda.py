"""The `cuda` back end: one cell per thread of an NVIDIA GPU, with the functions that step the lanes of `cpu`.

The device may contract a b + c to one rounding (FMA), so statistics, classes and statuses agree with `cpu`, but not bit
for bit.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from threading import BoundedSemaphore, Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import scalar
from vibroimpact.backends.base import (
    Counts,
    Floats,
    ImpactWindow,
    Measurement,
    Outcome,
    Samples,
)
from vibroimpact.backends.one_mass import OfOneMass
from vibroimpact.cells import Cells
from vibroimpact.indices import INDICES
from vibroimpact.kernels.cell import RUNNING, Cell
from vibroimpact.kernels.closing import LONGEST
from vibroimpact.kernels.cycle import FACTS
from vibroimpact.kernels.lanes import LANES, ROWS
from vibroimpact.kernels.results import NOTES, PLAIN, THOROUGH
from vibroimpact.kernels.shared.machine import config
from vibroimpact.parameters import to_install

THREADS = 64  # threads per block
LOOKS = 32  # between two compactions: about 1000 steps, a few milliseconds
AT_ONCE = 2  # tiles on the device: one fills it while the last cells of the other finish
SHARE = 0.25  # of the device's free memory that one tile may take
CLOSERS = 2048  # cycles followed in parallel
# Bytes per cell: row, lane, notes, facts, columns, and indices in lists.
CELL_BYTES = 8 * (len(Cell._fields) + ROWS + NOTES + FACTS + len(THOROUGH) + 2)
CYCLE_BYTES = 8 * 4 * LONGEST

# The simulator runs one kernel at a time.
_turns = BoundedSemaphore(1 if config.ENABLE_CUDASIM else AT_ONCE)
_launching = Lock()  # numba-cuda loads a kernel at its first launch, and fails if two threads do so at once


class CudaBackend(OfOneMass):
    """Indices of many cells at once on the GPU; single orbits would not be faster there and are followed on the CPU."""

    name, sampler = "cuda", "cpu"
    smallest_tile = 16_384
    largest_tile = 131_072
    known_indices = frozenset(INDICES)

    def check_here(self) -> None:
        """Raise `ValueError`, with the reason, if there is no NVIDIA GPU or no numba-cuda."""
        problem = _lack()
        if problem:
            what, remedy = problem
            raise ValueError(f"back end 'cuda' cannot be used here: {what}; {remedy}")

    def _indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        rows, thorough = scalar.rows_of(cells), measurement.thorough
        results = np.zeros((len(rows), len(THOROUGH if thorough else PLAIN)))
        ends = np.zeros(len(rows), dtype=np.int8)
        low = 0
        while low < len(rows):
            with _turns:
                size, closers = _room(len(rows) - low)
                part = slice(low, low + size)
                tile = _Tile(rows[part], closers, measurement.impacts, scalar.limits(measurement.tolerances), thorough)
                results[part], ends[part] = tile.run(measurement.early_closing)
            low += size
        return scalar.outcomes(results, ends, measurement.impacts)

    def _samples(self, cells: Cells, measurement: Measurement) -> list[Samples]:
        return scalar.samples(cells, measurement)


def create() -> CudaBackend:
    """Return the back end."""
    return CudaBackend()


def _numba_cuda() -> Any:
    """Return numba's CUDA module, imported only if a GPU is used."""
    return import_module("numba.cuda")


def _lack() -> tuple[str, str] | None:
    if not (config.ENABLE_CUDASIM or find_spec("numba_cuda")):
        return "numba-cuda is not installed", f"{to_install('cuda')} installs it"
    cuda = _numba_cuda()
    if cuda.is_available():
        return None
    reason = " ".join(str(cuda.cuda_error() or "").split()) or "the driver lists no device"
    return f"no NVIDIA GPU was found ({reason.rstrip('.')})", "choose another back end, or see what `nvidia-smi` shows"


def _room(cells: int) -> tuple[int, int]:
    """Return the numbers of cells, and of cycles followed at once, that fit into a tile's share of the free memory."""
    half = 0.5 * SHARE * _numba_cuda().current_context().get_memory_info().free
    return int(max(min(cells, half // CELL_BYTES), 1)), int(max(min(cells, CLOSERS, half // CYCLE_BYTES), 1))


class _Tile:
    """Cells on the device, and the launches that compute them."""

    def __init__(self, rows: Floats, closers: int, window: ImpactWindow, tolerances: scalar.Limits, thorough: bool):
        from vibroimpact.kernels import device

        cuda = _numba_cuda()

        self.kernels, self.closers, self.number = device, closers, len(rows)
        self.step, self.close, self.hand_out = (
            (device.step_thoroughly, device.close_thoroughly, device.hand_out_thoroughly)
            if thorough
            else (device.step, device.close, device.hand_out)
        )
        self.transient, self.total = float(window.transient), float(window.transient + window.keep)
        self.stream = cuda.stream()

        def room(*shape: int, dtype: Any = np.float64) -> Any:
            return cuda.device_array(shape, dtype=dtype, stream=self.stream)

        self.lanes = room(-(-self.number // LANES), ROWS * LANES)
        self.notes = room(self.number, NOTES)
        self.states = room(self.number, dtype=np.int8)
        self.facts = room(self.number, FACTS)
        self.sums = self.lanes, self.notes, self.facts, self.states
        self.listing = room(self.number, dtype=np.int64)
        self.cycles = room(closers, LONGEST, 4)
        self.results = room(self.number, len(THOROUGH if thorough else PLAIN))
        self.cells = cuda.to_device(rows, stream=self.stream)
        self._launch(device.begin, self.number, self.cells, *self.sums, self.total, *tolerances)

    def run(self, early_closing: bool) -> tuple[Floats, NDArray[np.int8]]:
        """Return the result columns of the cells and why each ended.

        Between launches, finished cells are removed from the list, so that the next warps are full.
        """
        running: Counts = np.arange(self.number)
        states = np.zeros(self.number, np.int8)
        while len(running):
            self._launch_listed(self.step, running, LOOKS, self.transient, self.total)
            states = self._fetch(self.states)
            waiting = running[states[running] == self.kernels.CLOSES]
            for low in range(0, len(waiting), self.closers):
                some = waiting[low : low + self.closers]
                self._launch_listed(self.close, some, self.cycles, self.transient, self.total, early_closing)
            if len(waiting):
                states = self._fetch(self.states)
            running = running[states[running] == RUNNING]
        kept = self.total - self.transient
        self._launch(self.hand_out, self.number, self.cells, self.lanes, self.notes, self.facts, self.results, kept)
        return self._fetch(self.results), states

    def _launch(self, kernel: Any, threads: int, *arguments: Any) -> None:
        with _launching:
            kernel[-(-threads // THREADS), THREADS, self.stream](*arguments)

    def _launch_listed(self, kernel: Any, chosen: Counts, *arguments: Any) -> None:
        listed = self.listing[: len(chosen)]
        listed.copy_to_device(chosen, stream=self.stream)
        self._launch(kernel, len(chosen), listed, *self.sums, *arguments)

    def _fetch(self, array: Any) -> NDArray[Any]:
        fetched: NDArray[Any] = array.copy_to_host(stream=self.stream)
        self.stream.synchronize()
        return fetched
