"""A few threads that all open pages share, fairly: clicks first, then the page that waited longest."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import count

from vibroimpact.distributed import worker_count

Job = Callable[[], None]
log = logging.getLogger(__name__)


class Urgency(IntEnum):
    """What is done first."""

    CLICK = 0
    COARSE = 1
    LINE = 2
    FINE = 3
    SEARCH = 4


@dataclass(order=True)
class _Waiting:
    urgency: Urgency
    number: int
    owner: Hashable = field(compare=False)
    job: Job = field(compare=False)


class Pool:
    """Threads that run the jobs of many owners; one more runs nothing but clicks, and one nothing but searches.

    So no click waits for planes, and no plane for searches, which may take many seconds.

    Parameters
    ----------
    workers : int, optional
        Threads besides those two; None is one a core.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = worker_count(workers)
        self._waiting: list[_Waiting] = []
        self._served: dict[Hashable, int] = {}  # when each owner was last served, in turns
        self._numbers = count()
        self._changed = threading.Condition()
        self._open = True
        plain = (Urgency.CLICK, Urgency.COARSE, Urgency.LINE, Urgency.FINE)
        duties = [plain] * self.workers + [(Urgency.CLICK,), (Urgency.SEARCH,)]
        self._threads = [
            threading.Thread(target=self._work, args=(duty,), name=f"explorer-{number}", daemon=True)
            for number, duty in enumerate(duties)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, owner: Hashable, urgency: Urgency, job: Job) -> None:
        """Queue a job; whether it is still wanted, it must ask itself."""
        with self._changed:
            self._waiting.append(_Waiting(urgency, next(self._numbers), owner, job))
            self._changed.notify_all()

    def forget(self, owner: Hashable) -> list[Job]:
        """Drop and return all that an owner has queued."""
        with self._changed:
            dropped = [waiting.job for waiting in self._waiting if waiting.owner == owner]
            self._waiting = [waiting for waiting in self._waiting if waiting.owner != owner]
            self._served.pop(owner, None)
        return dropped

    @property
    def queued(self) -> int:
        """How many jobs wait."""
        with self._changed:
            return len(self._waiting)

    def close(self) -> None:
        """Let the threads end; what is queued is dropped."""
        with self._changed:
            self._open = False
            self._waiting.clear()
            self._changed.notify_all()
        for thread in self._threads:
            thread.join(5.0)

    def _work(self, duty: tuple[Urgency, ...]) -> None:
        while (job := self._next(duty)) is not None:
            try:
                job()
            except Exception:
                log.exception("a job of the explorer failed")
            del job  # it knows its page, which may be gone before the next one comes

    def _next(self, duty: tuple[Urgency, ...]) -> Job | None:
        with self._changed:
            while self._open:
                ready = [waiting for waiting in self._waiting if waiting.urgency in duty]
                if ready:
                    best = min(ready, key=self._rank)
                    self._waiting.remove(best)
                    self._served[best.owner] = next(self._numbers)
                    return best.job
                self._changed.wait()
        return None

    def _rank(self, waiting: _Waiting) -> tuple[int, int, int]:
        return waiting.urgency, self._served.get(waiting.owner, -1), waiting.number
