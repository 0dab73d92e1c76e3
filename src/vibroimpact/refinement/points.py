"""Computing batches of scattered cells, or taking them from where they were kept."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import get_backend
from vibroimpact.dataset import missing
from vibroimpact.distributed import run_sweep
from vibroimpact.refinement.lattice import Places
from vibroimpact.refinement.picture import Picture
from vibroimpact.refinement.request import RefinedRequest

CHUNK = 1 << 14  # cells kept together: a second or more of work
Arrays = dict[str, NDArray[Any]]


class Keeper(Protocol):
    """Keeps chunks of computed cells by number."""

    def recall(self, number: int, at: Places) -> Arrays | None:
        """Return what was kept of these cells under that number, or None."""
        ...

    def keep(self, number: int, at: Places, result: Arrays, seconds: float) -> None:
        """Keep it."""
        ...


class Points:
    """Computes batches of cells into a picture; each batch is handed to the back end as a whole.

    Parameters
    ----------
    told : callable
        Gets cells computed, cells known to be needed, impacts and steps after every part; False asks to stop.
    """

    def __init__(
        self,
        request: RefinedRequest,
        picture: Picture,
        workers: int,
        told: Callable[[int, int, int, int], Any],
        keeper: Keeper | None = None,
    ) -> None:
        self.request, self.picture, self.workers, self.told, self.keeper = request, picture, workers, told, keeper
        self.engine = get_backend(request.backend, time_step=request.time_step)
        self.stop = Event()
        self.chunks = self.done = self.total = 0
        self.counts = {"impacts": 0, "steps": 0}

    def __call__(self, at: Places, level: int) -> bool:
        """Compute the cells `at` of the fine grid; return whether all ended."""
        self.total += len(at)
        result: Arrays = {name: missing(name, len(at)) for name in self.request.indices}
        result |= {"status": np.zeros(len(at), np.int8)}
        result |= {name: np.zeros(len(at), np.int64) for name in self.counts}
        ended = np.zeros(len(at), bool)
        for part, number in self._parts(len(at)):
            kept = self.keeper.recall(number, at[part]) if self.keeper else None
            for name, values in (kept or {}).items():
                result[name][part] = values
                ended[part] = True
        self._tell(result, ended)
        if not ended.all() and not self.stop.is_set():
            self._run(at, result, ended)
        self.chunks += -(-len(at) // CHUNK)
        self.picture.put(at[ended], {name: values[ended] for name, values in result.items()}, level)
        return bool(ended.all()) and not self.stop.is_set()

    def _parts(self, number: int) -> list[tuple[slice, int]]:
        """Return where a batch is cut into chunks, and their numbers."""
        cuts = range(0, number, CHUNK)
        return [(slice(low, min(low + CHUNK, number)), self.chunks + turn) for turn, low in enumerate(cuts)]

    def _run(self, at: Places, result: Arrays, ended: NDArray[np.bool_]) -> None:
        request, began = self.request, perf_counter()
        waiting = np.flatnonzero(~ended)
        left = np.bincount(waiting // CHUNK, minlength=-(-len(at) // CHUNK))
        parts = self._parts(len(at))
        how = request.window, request.tolerances, request.early_closing, request.indices
        for which, outcome in run_sweep(self.engine, request.cells(at[waiting]), *how, self.workers, self.stop):
            new = waiting[which]
            for name, values in result.items():
                values[new] = outcome[name]
            ended[new] = True
            ends = np.bincount(new // CHUNK, minlength=len(left))
            left -= ends
            for full in np.flatnonzero((left == 0) & (ends > 0)).tolist() if self.keeper else ():
                part, number = parts[full]
                now = perf_counter()
                kept = {name: values[part] for name, values in result.items()}
                self.keeper.keep(number, at[part], kept, now - began)  # type: ignore[union-attr]
                began = now
            self._tell({name: outcome[name] for name in self.counts}, None)

    def _tell(self, result: Arrays, ended: NDArray[np.bool_] | None) -> None:
        for name in self.counts:
            self.counts[name] += int(result[name].sum())
        self.done += len(result["steps"]) if ended is None else int(ended.sum())
        if self.told(self.done, self.total, self.counts["impacts"], self.counts["steps"]) is False:
            self.stop.set()
