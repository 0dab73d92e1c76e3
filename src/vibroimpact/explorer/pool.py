"""A few threads that all open pages share, fairly: clicks first, then the page that waited longest."""

from __future__ import annotations

import contextlib
import logging
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import count

from vibroimpact.execution.threads import worker_count

Job = Callable[[], None]
NICE = 10  # of threads that compute what may wait
CALM = 1.0  # s without a click, before the last thread turns to what may wait
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
        self._clicked = -math.inf
        plain = (Urgency.CLICK, Urgency.COARSE, Urgency.LINE, Urgency.FINE)
        duties = [plain] * self.workers + [(Urgency.CLICK,), (Urgency.SEARCH,)]
        self._threads = [
            threading.Thread(
                target=self._work, args=(duty, number == 0 < self.workers - 1), name=f"explorer-{number}", daemon=True
            )
            for number, duty in enumerate(duties)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, owner: Hashable, urgency: Urgency, job: Job) -> None:
        """Queue a job; whether it is still wanted, it must ask itself."""
        with self._changed:
            self._waiting.append(_Waiting(urgency, next(self._numbers), owner, job))
            if urgency == Urgency.CLICK:
                self._clicked = time.monotonic()
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

    def _work(self, duty: tuple[Urgency, ...], spare: bool) -> None:
        if duty != (Urgency.CLICK,):
            _step_back()
        while (job := self._next(duty, spare)) is not None:
            try:
                job()
            except Exception:
                log.exception("a job of the explorer failed")
            del job  # it knows its page, which may be gone before the next one comes

    def _next(self, duty: tuple[Urgency, ...], spare: bool) -> Job | None:
        """Return what to do next; while people click, a spare thread leaves its core to them and their browsers."""
        with self._changed:
            while self._open:
                busy = spare and time.monotonic() - self._clicked < CALM
                worst = Urgency.COARSE if busy else Urgency.SEARCH
                ready = [waiting for waiting in self._waiting if waiting.urgency in duty and waiting.urgency <= worst]
                if ready:
                    best = min(ready, key=self._rank)
                    self._waiting.remove(best)
                    self._served[best.owner] = next(self._numbers)
                    return best.job
                self._changed.wait(CALM if busy else None)
        return None

    def _rank(self, waiting: _Waiting) -> tuple[int, int, int]:
        return waiting.urgency, self._served.get(waiting.owner, -1), waiting.number


def _step_back() -> None:
    """Let clicks, the server and browsers on this machine have the processor before the calling thread."""
    if sys.platform == "linux":  # elsewhere a thread has no niceness of its own
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICE)
