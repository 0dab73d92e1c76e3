"""Giving work to a Dask cluster whose workers come, go, die and dawdle."""

from __future__ import annotations

import asyncio
import concurrent.futures
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from threading import Event
from typing import TYPE_CHECKING, Any, TypeVar
from uuid import uuid4

from vibroimpact.cluster.census import Census

if TYPE_CHECKING:
    from distributed import Client, Future

Result = TypeVar("Result")
Coming = concurrent.futures.Future[dict[int, Any]]
Task = Callable[[], Result]

IN_FLIGHT = 3  # tasks a worker thread: one is computed, one waits beside it, one is on its way
ATTEMPTS = 4  # times a task is handed out; each time, Dask itself gives it to up to four workers that die
LOOK = 0.005  # seconds between two looks at what has finished


def farm_out(
    client: Client, task: Callable[[int], Task[Result]], numbers: Iterable[int], stop: Event
) -> Generator[tuple[int, Result]]:
    """Yield each number with what its task returned, as they finish, until all have or `stop` is set.

    Parameters
    ----------
    client : dask.distributed.Client
        Where tasks go, a few a worker thread at a time.
    task : callable
        Makes the task of a number: small when pickled, never returning None, the same however often it is run.
    numbers : iterable of int
        What is to be done.
    stop : Event
        Once it is set nothing more is handed out, and what has not finished is cancelled.

    Yields
    ------
    tuple of int and result
        In the order in which they finish; one that is slow keeps no other waiting.

    Raises
    ------
    RuntimeError
        A task lost its worker too often.
    ConnectionError
        The scheduler has gone.
    Exception
        Whatever a task raised.
    """
    field = _Field(client)
    waiting = deque(numbers)
    losses: Counter[int] = Counter()
    try:
        while waiting or len(field):
            _check_scheduler(client)
            if stop.is_set():
                waiting.clear()
                field.cancel()
            chosen = [waiting.popleft() for _ in range(min(field.room(), len(waiting)))]
            field.hand_out([(number, losses[number], task(number)) for number in chosen])
            for number, result, error in field.finished():
                if error is None:
                    yield number, result
                    continue
                losses[number] += 1
                _check_hope(losses[number], error)
                waiting.append(number)
    finally:
        field.clear()


class _Field:
    """The tasks that have been handed out, and the results on their way back."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.name = f"vibroimpact-{uuid4().hex}"
        self.running: dict[Future[Any], int] = {}
        # Fetched beside the loop: where a worker has died with results, Dask tries for half a minute to reach it.
        self.coming: dict[Coming, dict[Future[Any], int]] = {}
        self.census = Census(client)

    def __len__(self) -> int:
        return len(self.running) + sum(map(len, self.coming.values()))

    def room(self) -> int:
        return max(IN_FLIGHT * max(self.census.threads(), 1) - len(self), 0)

    def hand_out(self, tasks: list[tuple[int, int, Task[Any]]]) -> None:
        if tasks:
            # A key of its own for every attempt: Dask remembers a key by how it ended.
            keys = [(self.name, number, attempt) for number, attempt, _ in tasks]
            futures = self.client.map(_call, [task for *_, task in tasks], key=keys, pure=False)
            self.running |= {future: number for future, (number, *_) in zip(futures, tasks, strict=True)}

    def finished(self) -> Iterator[tuple[int, Any, BaseException | None]]:
        """Yield numbers with result or error: those that have come by now."""
        self._fetch()
        come = [results for results in self.coming if results.done()]
        if not come:
            time.sleep(LOOK)
        for results in come:
            futures = self.coming.pop(results)
            if results.cancelled() or isinstance(results.exception(), OSError):  # the scheduler is away
                self.running |= futures
                time.sleep(LOOK)
                continue
            for place, (future, number) in enumerate(futures.items()):
                result = results.result().get(place)
                yield number, result, _error(future) if result is None else None

    def _fetch(self) -> None:
        ended = {future: number for future, number in self.running.items() if future.done()}
        if ended:
            fetched = self.client.gather(dict(enumerate(ended)), errors="skip", asynchronous=True)
            loop = self.client.loop.asyncio_loop  # type: ignore[union-attr]
            self.coming[asyncio.run_coroutine_threadsafe(fetched, loop)] = ended
            self.running = {future: number for future, number in self.running.items() if future not in ended}

    def cancel(self) -> None:
        """Give up what has not finished."""
        unfinished = [future for future in self.running if not future.done()]
        self.running = {future: number for future, number in self.running.items() if future.done()}
        if unfinished and self.client.status == "running":
            with suppress(Exception):  # the scheduler may be gone, and its work with it
                self.client.cancel(unfinished)

    def clear(self) -> None:
        """Give up everything."""
        for results in self.coming:
            results.cancel()
        self.cancel()


def _call(task: Task[Result]) -> Result:
    return task()


def _error(future: Future[Any]) -> BaseException:
    try:
        future.result()
    except Exception as error:
        return error
    return RuntimeError("a task returned nothing")


def _check_hope(losses: int, error: BaseException) -> None:
    """Raise unless the task was lost with its worker or on the way, and not too often."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm.core import CommClosedError

    if not isinstance(error, (KilledWorker, CancelledError, CommClosedError)):
        raise error
    if losses >= ATTEMPTS:
        raise RuntimeError(
            f"`cluster` has lost a tile with its workers {losses} times ({error}); what a store holds is safe; give "
            "the workers more memory or time, or a new sweep a smaller `tile`, and run the same again"
        ) from error


def _check_scheduler(client: Client) -> None:
    if client.status not in ("running", "connecting"):
        raise ConnectionError(
            "`cluster` has lost its scheduler, which does not answer any more; what a store holds is safe; "
            "start a scheduler and workers, and run the same again"
        )
