"""Where a sweep runs: its cells one by one, or in tiles, in threads."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice, takewhile
from queue import SimpleQueue
from threading import Event, Thread
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from vibroimpact.backends import Backend, Cells, Measurement, get_backend
from vibroimpact.backends.base import Counts, Outcome, SharesCells
from vibroimpact.parameters import whole_number
from vibroimpact.request import Request

Result = TypeVar("Result")
Computed = tuple[Outcome, float]

BLOCK = 1 << 20  # cells that threads share at once: some 250 MB
LOOK = 0.1  # seconds between two looks at whether to stop
GRACE = 10.0  # seconds that running tiles are waited for once a sweep is to stop; later ones are given up
THREADS = "vibroimpact"  # how names of threads that compute begin


class GivenUp(Exception):
    """A sweep was stopped before these cells had ended."""


def worker_count(workers: int | None) -> int:
    """Return how many threads to use; None is one a core that this process may run on."""
    if workers is not None:
        return whole_number("workers", workers, 1)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def check_alone(workers: int | None) -> None:
    """Refuse threads here beside a cluster."""
    if workers is not None:
        raise ValueError(f"give either `workers` or `cluster`, not both; or cluster='local:{workers}'")


def run_sweep(
    engine: Backend, cells: Cells, asked: Measurement, workers: int, stop: Event
) -> Iterator[tuple[Counts | slice, Outcome]]:
    """Yield which cells have ended, and their indices, until all have or `stop` is set.

    No cell depends on another, so neither does the sweep depend on `workers`.
    """
    if not isinstance(engine, SharesCells):
        yield from run_tiles(
            lambda part: engine.indices(cells[part], asked),
            tiles(len(cells), workers, engine.smallest_tile, engine.largest_tile),
            workers,
            stop,
        )
        return
    for low in range(0, len(cells), BLOCK):
        work = engine.share(cells[low : low + BLOCK], asked)
        for done, outcome in run_shared(work, workers, stop):
            yield done + low, outcome


def run_here(engine: Backend, cells: Cells, asked: Measurement, stop: Event) -> Outcome:
    """Return the cells' indices, computed by the calling thread.

    Raises
    ------
    GivenUp
        `stop` was set before all had ended.
    """
    parts: Iterator[tuple[Counts | slice, Outcome]]
    if isinstance(engine, SharesCells):
        parts = engine.share(cells, asked)(stop.is_set)
    else:
        whole = tiles(len(cells), 1, engine.largest_tile, engine.largest_tile)
        going = takewhile(lambda part: not stop.is_set(), whole)
        parts = ((part, engine.indices(cells[part], asked)) for part in going)
    outcome: Outcome = {}
    ended = 0
    for which, found in parts:
        for name, values in found.items():
            outcome.setdefault(name, np.empty(len(cells), values.dtype))[which] = values
        ended += len(found["status"])
    if ended < len(cells):
        raise GivenUp
    return outcome


def compute(request: Request, part: tuple[slice, ...], stop: Event | None = None) -> Computed:
    """Return indices, status, impacts and steps of a box of cells, each in its shape, and the seconds it took.

    Raises
    ------
    GivenUp
        `stop` was set before all cells had ended.
    """
    began = perf_counter()
    engine = get_backend(request.backend, time_step=request.time_step)
    result = run_here(engine, request.cells(request.box(part)), request.asked, stop or Event())
    shape = tuple(len(range(*along.indices(size))) for along, size in zip(part, request.shape, strict=True))
    kept = {name: result[name].reshape(shape) for name in (*request.indices, "status", "impacts", "steps")}
    return kept, perf_counter() - began


def run_shared(work: Callable[[Callable[[], bool]], Iterator[Result]], workers: int, stop: Event) -> Iterator[Result]:
    """Yield what the threads' shared work yields, as it comes."""
    handed: SimpleQueue[Result | BaseException | None] = SimpleQueue()

    def run() -> None:
        try:
            for result in work(stop.is_set):
                handed.put(result)
            handed.put(None)
        except BaseException as error:
            handed.put(error)

    threads = [Thread(target=run, name=f"{THREADS}-{number}") for number in range(workers)]
    for thread in threads:
        thread.start()
    try:
        running = workers
        while running:
            result = handed.get()
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
    """Cut `number` cells into ever smaller tiles: large ones keep lanes full, small ones end all workers together."""
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

    What a tile returns cannot depend on the others, so neither can the sweep depend on `workers`. Tiles that still run
    GRACE seconds after `stop` was set, or after the sweep was left, are left to end by themselves, unheard.
    """
    waiting: Iterator[slice] = iter(parts)
    pool = ThreadPoolExecutor(workers, thread_name_prefix=THREADS)
    running: dict[Future[Any], slice] = {}
    deadline = math.inf
    try:
        while time.monotonic() < deadline:
            if stop.is_set():
                running = {future: part for future, part in running.items() if not future.cancel()}
                deadline = min(deadline, time.monotonic() + GRACE)
            room = 0 if stop.is_set() else 2 * workers - len(running)
            running |= {pool.submit(job, part): part for part in islice(waiting, max(room, 0))}
            if not running:
                return
            finished, _ = wait(running, LOOK, return_when=FIRST_COMPLETED)
            for future in finished:
                yield running.pop(future), future.result()
    except BaseException:
        stop.set()
        wait([future for future in running if not future.cancel()], GRACE)
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
