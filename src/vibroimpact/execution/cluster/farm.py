"""Giving work to a Dask cluster whose workers come, go, die and dawdle."""

from __future__ import annotations

import asyncio
import concurrent.futures
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Event
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeVar
from uuid import uuid4

from vibroimpact.execution.cluster.census import Census
from vibroimpact.execution.cluster.parcels import Waiting

if TYPE_CHECKING:
    from distributed import Client, Future

Result = TypeVar("Result")
Task = Callable[[], Result]
Parcel = tuple[int, ...]
Come = tuple[list[Any], float]  # what the tasks of a parcel returned, and the seconds they took
Coming = concurrent.futures.Future[Come | None]

IN_FLIGHT = 3  # parcels a worker thread: one is computed, one waits beside it, one is on its way
ATTEMPTS = 4  # times a task is handed out; each time, Dask itself gives it to up to four workers that die
LOOK = 0.1  # seconds, at most, between two looks at whether to stop, and at the scheduler and its workers


def farm_out(
    client: Client, task: Callable[[int], Task[Result]], numbers: Iterable[int], stop: Event
) -> Generator[tuple[int, Result]]:
    """Yield each number with what its task returned, as they finish, until all have or `stop` is set.

    Parameters
    ----------
    client : dask.distributed.Client
        Where tasks go, a few a worker thread at a time; quick ones several together.
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
    waiting = Waiting(numbers)
    try:
        while waiting or len(field):
            _check_scheduler(client)
            if stop.is_set():
                waiting.clear()
                field.cancel()
            field.hand_out(waiting, task)
            for parcel, come in field.finished():
                if isinstance(come, BaseException):
                    waiting.put_back(parcel)
                    _check_hope(waiting.losses[parcel[0]], come)
                    continue
                results, seconds = come
                waiting.learn(seconds, len(parcel))
                yield from zip(parcel, results, strict=True)
    finally:
        field.clear()


class _Field:
    """The parcels that have been handed out, each with what will come of it."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.name = f"vibroimpact-{uuid4().hex}"
        self.coming: dict[Coming, tuple[Future[Any], Parcel]] = {}
        self.arrived: SimpleQueue[Coming] = SimpleQueue()
        self.census = Census(client)

    def __len__(self) -> int:
        return len(self.coming)

    def hand_out(self, waiting: Waiting, task: Callable[[int], Task[Any]]) -> None:
        """Hand out as much as there is room for."""
        threads = max(self.census.threads(), 1)
        parcels: list[Parcel] = []
        while waiting and len(parcels) + len(self) < IN_FLIGHT * threads:
            parcels.append(waiting.take(threads))
        if not parcels:
            return
        # A key of its own for every attempt: Dask remembers a key by how it ended.
        keys = [(self.name, parcel[0], waiting.losses[parcel[0]]) for parcel in parcels]
        tasks = [tuple(map(task, parcel)) for parcel in parcels]
        for future, parcel in zip(self.client.map(_call, tasks, key=keys, pure=False), parcels, strict=True):
            self._expect(future, parcel)

    def _expect(self, future: Future[Any], parcel: Parcel) -> None:
        # Each by itself: where a worker has died with results, Dask tries for half a minute to reach it.
        loop = self.client.loop.asyncio_loop  # type: ignore[union-attr]
        coming: Coming = asyncio.run_coroutine_threadsafe(_fetch(self.client, future), loop)
        self.coming[coming] = future, parcel
        coming.add_done_callback(self.arrived.put)

    def finished(self) -> Iterator[tuple[Parcel, Come | BaseException]]:
        """Yield parcels with what has come of them by now, or comes in a moment."""
        for come in self._arrivals():
            if come not in self.coming:  # given up
                continue
            future, parcel = self.coming.pop(come)
            if come.cancelled():  # with somebody else's fetching, which Dask had joined to this one
                _check_scheduler(self.client)
                self._expect(future, parcel)
                continue
            yield parcel, come.result() or _error(future)

    def _arrivals(self) -> list[Coming]:
        come = []
        with suppress(Empty):
            come.append(self.arrived.get(timeout=LOOK))
            while True:
                come.append(self.arrived.get_nowait())
        return come

    def cancel(self) -> None:
        """Give up what has not finished."""
        unfinished = {coming: future for coming, (future, _) in self.coming.items() if not future.done()}
        self.coming = {coming: told for coming, told in self.coming.items() if coming not in unfinished}
        for coming in unfinished:
            coming.cancel()
        if unfinished and self.client.status == "running":
            with suppress(Exception):  # the scheduler may be gone, and its work with it
                self.client.cancel(list(unfinished.values()))

    def clear(self) -> None:
        """Give up everything."""
        self.cancel()
        for coming in self.coming:
            coming.cancel()


async def _fetch(client: Client, future: Future[Any]) -> Come | None:
    """Return what a task returned, once it has; None where it failed."""
    while True:
        try:
            results = await client.gather([future], errors="skip", asynchronous=True)
        except Exception as error:
            if client.status == "running" and not isinstance(error, OSError):
                raise
            await asyncio.sleep(LOOK)  # the scheduler is away, for a moment or for good
            continue
        return results[0] if results else None


def _call(tasks: tuple[Task[Any], ...]) -> Come:
    began = perf_counter()
    return [task() for task in tasks], perf_counter() - began


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
