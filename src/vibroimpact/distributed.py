"""Where a sweep runs: its cells in tiles, its tiles in threads."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from threading import Event
from typing import Any, TypeVar

from vibroimpact.options import whole_number

Result = TypeVar("Result")


def worker_count(workers: int | None) -> int:
    """Return how many threads to use; None is one a core that this process may run on."""
    if workers is not None:
        return whole_number("workers", workers, 1)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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

    What a tile returns cannot depend on the others, so neither can the sweep depend on `workers`.
    """
    waiting: Iterator[slice] = iter(parts)
    with ThreadPoolExecutor(workers, thread_name_prefix="vibroimpact") as pool:
        running: dict[Future[Any], slice] = {}
        try:
            while True:
                if stop.is_set():
                    running = {future: part for future, part in running.items() if not future.cancel()}
                room = 0 if stop.is_set() else 2 * workers - len(running)
                running |= {pool.submit(job, part): part for part in islice(waiting, max(room, 0))}
                if not running:
                    return
                finished, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield running.pop(future), future.result()
        finally:
            for future in running:
                future.cancel()
