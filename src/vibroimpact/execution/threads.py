"""Cells computed by threads of this process: one by one, or in tiles."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Thread
from typing import Any, TypeVar

import numpy as np

from vibroimpact.backends import Cells, Measurement, get_backend
from vibroimpact.backends.base import Counts, Outcome
from vibroimpact.execution.base import Part, Pieces, flat
from vibroimpact.parameters import whole_number
from vibroimpact.request import Places, Request

Result = TypeVar("Result")

SHARE = 1 << 15  # cells that threads share at once, per thread: about 8 MB and 1 s of work
PARTS = 1024  # parts that threads share at once
LOOK = 0.1  # seconds between checks for a stop
GRACE = 10.0  # seconds that a stopped sweep waits for running tiles before it gives them up
HASTE = 0.5  # the same for a sweep that an exception ends, such as Ctrl-C
THREADS = "vibroimpact"  # prefix of the names of computing threads


def worker_count(workers: int | None) -> int:
    """Return the number of threads to use; None means one per core available to this process."""
    if workers is not None:
        return whole_number("workers", workers, 1)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def compute_here(request: Request, part: Part) -> Outcome:
    """Return the results of a part of a request's cells, computed by the calling thread."""
    engine = get_backend(request.backend, time_step=request.time_step)
    outcome = request.completed(engine.indices(request.cells(flat(part, request)), request.measured))
    return {name: outcome[name] for name in (*request.indices, "status", "impacts", "steps")}


@dataclass(frozen=True)
class Threads:
    """Computes cells in threads of this process."""

    workers: int

    def part_size(self, request: Request, cells: int) -> int:
        """Return the number of cells that a part should hold; threads share parts of any size."""
        return SHARE * self.workers

    def compute(self, request: Request, parts: Sequence[Part], stop: Event, store: Path | None = None) -> Pieces:
        """Yield (number of a part, which of its cells have ended, their results) until all have or `stop` is set.

        Parts are begun in order, about `SHARE` cells per thread at a time.
        """
        engine = get_backend(request.backend, time_step=request.time_step)
        first = 0
        while first < len(parts) and not stop.is_set():
            block = _block(request, parts, first, SHARE * self.workers)
            bounds = np.cumsum([0, *map(len, block)])
            cells = request.cells(np.concatenate(block))
            for which, outcome in run_sweep(engine, cells, request.measured, self.workers, stop):
                ended = np.arange(which.start, which.stop) if isinstance(which, slice) else which
                owner = np.searchsorted(bounds, ended, side="right") - 1
                for part in np.unique(owner).tolist():
                    inside = owner == part
                    results = request.completed({name: values[inside] for name, values in outcome.items()})
                    yield first + part, ended[inside] - bounds[part], results
            first += len(block)


def _block(request: Request, parts: Sequence[Part], first: int, most: int) -> list[Places]:
    """Return the cells of the next parts: at least one part, and as many more as keep to `most` cells."""
    block, cells = [flat(parts[first], request)], 0
    while first + len(block) < len(parts) and len(block) < PARTS:
        cells += len(block[-1])
        following = flat(parts[first + len(block)], request)
        if cells + len(following) > most:
            break
        block.append(following)
    return block


def run_sweep(
    engine: Any, cells: Cells, measurement: Measurement, workers: int, stop: Event
) -> Iterator[tuple[Counts | slice, Outcome]]:
    """Yield which cells have ended, and their indices, until all have or `stop` is set.

    No cell depends on another, so the results do not depend on `workers`. If a back end can `share` cells, each thread
    takes the next one in turn, so that all end at about the same time.
    """
    if not hasattr(engine, "share"):
        yield from run_tiles(
            lambda part: engine.indices(cells[part], measurement),
            tiles(len(cells), workers, engine.smallest_tile, engine.largest_tile),
            workers,
            stop,
        )
        return
    for low in range(0, len(cells), SHARE * workers):
        part = cells[low : low + SHARE * workers]
        work = engine.share(part, measurement)
        shared = work(stop.is_set) if len(part) <= engine.alone else run_shared(work, workers, stop)
        for done, outcome in shared:
            yield done + low, outcome


def run_shared(work: Callable[[Callable[[], bool]], Iterator[Result]], workers: int, stop: Event) -> Iterator[Result]:
    """Yield the results of work that threads share, as they arrive."""
    results: SimpleQueue[Result | BaseException | None] = SimpleQueue()

    def run() -> None:
        try:
            for result in work(stop.is_set):
                results.put(result)
            results.put(None)
        except BaseException as error:
            results.put(error)

    threads = [Thread(target=run, name=f"{THREADS}-{number}") for number in range(workers)]
    for thread in threads:
        thread.start()
    try:
        running = workers
        while running:
            result = results.get()
            if isinstance(result, BaseException):
                raise result
            if result is None:
                running -= 1
            else:
                yield result
    except BaseException:
        stop.set()
        raise
    finally:
        for thread in threads:
            thread.join()


def tiles(number: int, workers: int, smallest: int, largest: int) -> list[slice]:
    """Cut `number` cells into shrinking tiles: large ones keep lanes full, small ones let all workers end together."""
    parts = []
    low = 0
    while low < number:
        share = math.ceil((number - low) / (1.5 * workers))
        high = min(low + min(max(share, smallest), largest), number)
        parts.append(slice(low, high))
        low = high
    return parts


def run_tiles(
    job: Callable[[slice], Result], parts: list[slice], workers: int, stop: Event
) -> Iterator[tuple[slice, Result]]:
    """Yield each tile with its result, as they finish; no tile is begun once `stop` is set.

    Tiles do not depend on each other, so the results do not depend on `workers`. Tiles still running GRACE seconds
    after `stop` was set, or HASTE seconds after an exception, are left to end by themselves, and their results are
    dropped.
    """
    following: Iterator[slice] = iter(parts)
    pool = ThreadPoolExecutor(workers, thread_name_prefix=THREADS)
    running: dict[Future[Any], slice] = {}
    deadline = math.inf
    try:
        while time.monotonic() < deadline:
            if stop.is_set():
                running = {future: part for future, part in running.items() if not future.cancel()}
                deadline = min(deadline, time.monotonic() + GRACE)
            room = 0 if stop.is_set() else 2 * workers - len(running)
            running |= {pool.submit(job, part): part for part in islice(following, max(room, 0))}
            if not running:
                return
            finished, _ = wait(running, LOOK, return_when=FIRST_COMPLETED)
            for future in finished:
                yield running.pop(future), future.result()
    except BaseException:
        stop.set()
        wait([future for future in running if not future.cancel()], HASTE)
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
