"""Computing batches of scattered cells into a picture, or taking them from where they were kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator
from contextlib import closing
from time import perf_counter
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from vibroimpact.dataset import missing
from vibroimpact.progress import Stop
from vibroimpact.refinement.computing import Computer, chunk_of
from vibroimpact.refinement.lattice import Places
from vibroimpact.refinement.picture import Picture
from vibroimpact.request import Request

COUNTS = ("impacts", "steps")
Arrays = dict[str, NDArray[Any]]


class Keeper(Protocol):
    """Keeps chunks of computed cells by number."""

    def begin(self, turn: int, level: int, cells: int) -> None:
        """Note how large batch `turn` is."""
        ...

    def recall(self, number: int, at: Places) -> Arrays | None:
        """Return what was kept of these cells under that number, or None."""
        ...

    def keep(self, number: int, at: Places, result: Arrays, seconds: float) -> None:
        """Keep it."""
        ...


class Points:
    """Computes batches of cells into a picture, each batch some chunks at a time.

    Parameters
    ----------
    told : callable
        Gets cells computed, cells known to be needed, impacts and steps after every part; False asks to stop.
    """

    def __init__(
        self,
        request: Request,
        picture: Picture,
        computer: Computer,
        told: Callable[[int, int, int, int], Any],
        stop: Stop,
        keeper: Keeper | None = None,
    ) -> None:
        self.request, self.picture, self.computer = request, picture, computer
        self.told, self.stop, self.keeper = told, stop, keeper
        self.turns = self.chunks = self.done = self.total = 0
        self.counts = dict.fromkeys(COUNTS, 0)

    def __call__(self, at: Places, level: int) -> bool:
        """Compute the cells `at` of the fine grid; return whether all ended."""
        self.total += len(at)
        if self.keeper:
            self.keeper.begin(self.turns, level, len(at))
        self.turns += 1
        whole, portion = True, self.computer.chunks * chunk_of(self.request)  # which bounds the memory that it takes
        for low in range(0, len(at), portion):
            if self.stop.is_set():
                return False
            whole &= self._compute(at[low : low + portion], level)
        return whole and not self.stop.is_set()

    def _compute(self, at: Places, level: int) -> bool:
        portion = _Portion(at, self.chunks, self.request)
        self.chunks += len(portion.chunks)
        recalled: Counter[str] = Counter()
        for chunk, part in enumerate(portion.chunks):
            kept = self.keeper.recall(*portion.chunk(chunk)) if self.keeper else None
            if kept is not None:
                recalled += portion.take(part, kept)
        self._tell(recalled)
        if not portion.ended.all() and not self.stop.is_set():
            self._run(portion)
        self.picture.put(*portion.known(), level)
        return bool(portion.ended.all())

    def _run(self, portion: _Portion) -> None:
        waiting, began = np.flatnonzero(~portion.ended), perf_counter()
        finished = cast("Generator[tuple[Any, Arrays]]", self.computer.run(portion.at[waiting], self.stop))
        with closing(finished):
            for which, outcome in finished:
                new = waiting[which]
                counts = portion.take(new, outcome)
                if self.keeper:
                    for chunk in portion.filled(new):
                        began, before = perf_counter(), began
                        self.keeper.keep(*portion.chunk(chunk), portion.of(chunk), began - before)
                self._tell(counts)

    def _tell(self, counts: Counter[str]) -> None:
        self.done += counts["cells"]
        for name in COUNTS:
            self.counts[name] += counts[name]
        if self.told(self.done, self.total, *self.counts.values()) is False:
            self.stop.set()


class _Portion:
    """Some chunks of a batch on their way."""

    def __init__(self, at: Places, first: int, request: Request) -> None:
        self.at, self.first = at, first
        self.result: Arrays = {name: missing(name, len(at)) for name in request.indices}
        self.result |= {"status": np.zeros(len(at), np.int8)} | {name: np.zeros(len(at), np.int64) for name in COUNTS}
        self.ended = np.zeros(len(at), bool)
        chunk = chunk_of(request)
        self.chunks = [slice(low, min(low + chunk, len(at))) for low in range(0, len(at), chunk)]

    def chunk(self, chunk: int) -> tuple[int, Places]:
        """Return the number of a chunk, and where its cells lie."""
        return self.first + chunk, self.at[self.chunks[chunk]]

    def of(self, chunk: int) -> Arrays:
        """Return the numbers of a chunk."""
        return {name: values[self.chunks[chunk]] for name, values in self.result.items()}

    def take(self, which: slice | Places, outcome: Arrays) -> Counter[str]:
        """Write cells down; return how many, and what they took."""
        for name, values in self.result.items():
            values[which] = outcome[name]
        self.ended[which] = True
        return Counter({"cells": len(outcome["status"])} | {name: int(outcome[name].sum()) for name in COUNTS})

    def filled(self, new: Places) -> list[int]:
        """Return the chunks that have ended with these cells."""
        touched = np.unique(new // self.chunks[0].stop)
        return [chunk for chunk in touched.tolist() if self.ended[self.chunks[chunk]].all()]

    def known(self) -> tuple[Places, Arrays]:
        """Return where cells have ended, and their numbers."""
        if self.ended.all():
            return self.at, self.result
        return self.at[self.ended], {name: values[self.ended] for name, values in self.result.items()}
