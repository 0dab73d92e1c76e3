"""What a page has to compute: kinds of work, of each of which only the newest is wanted."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from functools import partial

from vibroimpact.explorer.pool import Job, Pool, Urgency

log = logging.getLogger(__name__)


class Work:
    """Jobs of one page in the shared pool; a newer one of a kind makes the older ones out of date.

    Parameters
    ----------
    pool : Pool
        The threads.
    failed : callable
        Gets the kind and the exception of a job that failed.
    """

    def __init__(self, pool: Pool, failed: Callable[[str, Exception], None]) -> None:
        self.pool, self._failed = pool, failed
        self.closed = False
        self.lock = threading.RLock()
        self._idle = threading.Condition(self.lock)
        self._stamps: dict[str, int] = {}
        self._running: dict[str, int] = {}
        self._timers: dict[str, threading.Timer] = {}

    def renew(self, kind: str) -> int:
        """Make all work of a kind out of date; return the stamp of what comes now."""
        with self.lock:
            self._stamps[kind] = self._stamps.get(kind, 0) + 1
            return self._stamps[kind]

    def wanted(self, kind: str, stamp: int) -> bool:
        """Whether work with this stamp is not out of date."""
        return self._stamps.get(kind) == stamp and not self.closed

    def submit(self, kind: str, urgency: Urgency, job: Job, stamp: int | None = None) -> None:
        """Queue a job; without a stamp it takes the place of all of its kind."""
        stamp = self.renew(kind) if stamp is None else stamp
        with self.lock:
            if self.closed:
                return
            self._running[kind] = self._running.get(kind, 0) + 1
            self.pool.submit(self, urgency, partial(self._run, kind, stamp, job))

    def later(self, kind: str, seconds: float, renew: Callable[[], None]) -> None:
        """Call `renew` after a rest; what there is of the kind is out of date at once."""
        self.renew(kind)

        def due() -> None:
            with self.lock:
                if not self.closed:
                    renew()

        timer = threading.Timer(seconds, due)
        timer.daemon = True
        with self.lock:
            if kind in self._timers:
                self._timers[kind].cancel()
            self._timers[kind] = timer
            timer.start()

    def close(self) -> None:
        """Drop what is queued and let what runs end soon."""
        with self.lock:
            self.closed = True
            for timer in self._timers.values():
                timer.cancel()
        for job in self.pool.forget(self):
            self._ended(job.args[0])  # type: ignore[attr-defined]

    def wait(self, seconds: float) -> bool:
        """Wait until nothing is left to do; return whether that came to pass."""
        deadline = time.monotonic() + seconds
        with self._idle:
            while self._running or any(timer.is_alive() for timer in self._timers.values()):
                self._idle.wait(0.02)
                if time.monotonic() >= deadline:
                    return False
        return True

    def _run(self, kind: str, stamp: int, job: Job) -> None:
        try:
            if self.wanted(kind, stamp):
                job()
        except Exception as error:
            if not isinstance(error, ValueError):
                log.exception("the %s of a page failed", kind)
            self._failed(kind, error)
        finally:
            self._ended(kind)

    def _ended(self, kind: str) -> None:
        with self._idle:
            self._running[kind] -= 1
            if not self._running[kind]:
                del self._running[kind]
            self._idle.notify_all()
