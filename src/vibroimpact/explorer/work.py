"""Scheduling: threads shared by all pages, the jobs of one page, and the lattices of its plane."""

from __future__ import annotations

import contextlib
import logging
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from itertools import count

from vibroimpact.compiling import clock, compilers
from vibroimpact.execution.threads import worker_count
from vibroimpact.explorer.plane import TRIED, KeepGoing, Plane, bands, sides
from vibroimpact.progress import SWITCH

Job = Callable[[], None]

NICE = 10  # niceness of threads with deferrable work: a tenth of a core while a click needs it
CALM = 1.0  # s without a click before the last thread takes deferrable work
PLANE_SECONDS = 30.0  # s of all threads for one plane, without time in the queue
log = logging.getLogger(__name__)


class Urgency(IntEnum):
    """Priorities of jobs, the most urgent first."""

    CLICK = 0  # motions
    COARSE = 1  # the first lattice of a changed plane
    LINE = 2  # diagrams: each click needs a new one, which would delay the next click
    FINE = 3  # finer lattices
    SEARCH = 4  # searches, which may take many seconds


@dataclass(frozen=True, eq=False)
class _Waiting:
    urgency: Urgency
    number: int
    owner: Hashable
    job: Job


class Pool:
    """Threads that run the jobs of many owners; one extra thread runs only clicks, and one only searches.

    So clicks never wait for planes, nor planes for searches, which may take many seconds. Among equally urgent jobs,
    the owner that has waited longest is served first. What any thread of this process needs compiled, one of full
    priority compiles, as others wait for it.

    Parameters
    ----------
    workers : int, optional
        Number of threads besides those two; None means one per core.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = worker_count(workers)
        self._waiting: list[_Waiting] = []
        self._served: dict[Hashable, int] = {}  # turn at which each owner was last served
        self._numbers = count()
        self._changed = threading.Condition()
        self._open = True
        self._clicked = -math.inf
        self._compiler = ThreadPoolExecutor(1, "explorer-compiler")
        self._compiler.submit(int)  # its thread begins now: it inherits the priority of the one that begins it
        compilers.append(self._compiler)
        self._switch_interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH)
        general = tuple(urgency for urgency in Urgency if urgency < Urgency.SEARCH)
        duties = [general] * self.workers + [(Urgency.CLICK,), (Urgency.SEARCH,)]
        self._threads = [
            threading.Thread(
                target=self._work, args=(duty, number == 0 < self.workers - 1), name=f"explorer-{number}", daemon=True
            )
            for number, duty in enumerate(duties)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, owner: Hashable, urgency: Urgency, job: Job) -> None:
        """Queue a job; the job itself must check whether it is still needed."""
        with self._changed:
            self._waiting.append(_Waiting(urgency, next(self._numbers), owner, job))
            if urgency == Urgency.CLICK:
                self._clicked = time.monotonic()
            self._changed.notify_all()

    def forget(self, owner: Hashable) -> list[Job]:
        """Remove and return all queued jobs of an owner."""
        with self._changed:
            dropped = [waiting.job for waiting in self._waiting if waiting.owner == owner]
            self._waiting = [waiting for waiting in self._waiting if waiting.owner != owner]
            self._served.pop(owner, None)
        return dropped

    @property
    def queued(self) -> int:
        """Number of waiting jobs."""
        with self._changed:
            return len(self._waiting)

    def close(self) -> None:
        """Stop the threads; queued jobs are dropped."""
        with self._changed:
            self._open = False
            self._waiting.clear()
            self._changed.notify_all()
        for thread in self._threads:
            thread.join(5.0)
        compilers.remove(self._compiler)
        sys.setswitchinterval(self._switch_interval)

    def _work(self, duty: tuple[Urgency, ...], yields: bool) -> None:
        if duty != (Urgency.CLICK,):
            _lower_priority()
        while (job := self._next(duty, yields)) is not None:
            try:
                job()
            except Exception:
                log.exception("a job of the explorer failed")
            del job  # the job keeps its page alive, which may be closed before the next job comes

    def _next(self, duty: tuple[Urgency, ...], yields: bool) -> Job | None:
        """Return the next job; while there are clicks, a low-priority thread leaves its core to them."""
        with self._changed:
            while self._open:
                busy = yields and time.monotonic() - self._clicked < CALM
                least = Urgency.COARSE if busy else Urgency.SEARCH
                if ready := [job for job in self._waiting if job.urgency in duty and job.urgency <= least]:
                    best = min(ready, key=self._rank)
                    self._waiting.remove(best)
                    self._served[best.owner] = next(self._numbers)
                    return best.job
                self._changed.wait(CALM if busy else None)
        return None

    def _rank(self, waiting: _Waiting) -> tuple[int, int, int]:
        return waiting.urgency, self._served.get(waiting.owner, -1), waiting.number


def _lower_priority() -> None:
    """Give clicks, the server and local browsers priority over the calling thread."""
    if sys.platform == "linux":  # only on Linux do threads have their own niceness
        with contextlib.suppress(OSError):
            level = os.getpriority(os.PRIO_PROCESS, 0) + NICE
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), level)


class Work:
    """Jobs of one page in the shared pool; a newer job of a kind makes older ones obsolete.

    Parameters
    ----------
    pool : Pool
        The threads.
    failed : callable
        Called with the kind and the exception of a failed job.
    rested : callable
        Called whenever all work is done.
    """

    def __init__(
        self, pool: Pool, failed: Callable[[str, Exception], None], rested: Callable[[], None] = lambda: None
    ) -> None:
        self.pool, self._failed, self._rested = pool, failed, rested
        self.closed = False
        self.lock = threading.RLock()
        self._idle = threading.Condition(self.lock)
        self._stamps: dict[str, int] = {}
        self._running: dict[str, int] = {}
        self._timers: dict[str, threading.Timer] = {}

    def renew(self, kind: str) -> int:
        """Make all work of a kind obsolete; return the stamp of new work."""
        with self.lock:
            self._stamps[kind] = self._stamps.get(kind, 0) + 1
            return self._stamps[kind]

    def wanted(self, kind: str, stamp: int) -> bool:
        """Whether work with this stamp is still current."""
        return self._stamps.get(kind) == stamp and not self.closed

    def submit(self, kind: str, urgency: Urgency, job: Job, stamp: int | None = None) -> None:
        """Queue a job; without a stamp it replaces all jobs of its kind."""
        stamp = self.renew(kind) if stamp is None else stamp
        with self.lock:
            if self.closed:
                return
            self._running[kind] = self._running.get(kind, 0) + 1
            self.pool.submit(self, urgency, partial(self._run, kind, stamp, job))

    def later(self, kind: str, seconds: float, renew: Callable[[], None]) -> None:
        """Call `renew` after a delay; work of the kind is obsolete at once."""
        self.renew(kind)

        def due() -> None:
            with self.lock:
                if self.closed or self._timers.get(kind) is not timer:
                    return
                del self._timers[kind]
                renew()
                if not self.busy:
                    self._rested()

        timer = threading.Timer(seconds, due)
        timer.daemon = True
        with self.lock:
            if kind in self._timers:
                self._timers[kind].cancel()
            self._timers[kind] = timer
            timer.start()

    def close(self) -> None:
        """Drop queued jobs and make running jobs end soon."""
        with self.lock:
            self.closed = True
            for timer in self._timers.values():
                timer.cancel()
            self._timers.clear()
        for job in self.pool.forget(self):
            self._ended(job.args[0])  # type: ignore[attr-defined]

    @property
    def busy(self) -> bool:
        """Whether a job is running, queued or scheduled."""
        with self.lock:
            return bool(self._running or self._timers)

    def wait(self, seconds: float) -> bool:
        """Wait until all work is done; return False on timeout."""
        deadline = time.monotonic() + seconds
        with self._idle:
            while self.busy:
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
            if not self.busy and not self.closed:
                self._rested()
            self._idle.notify_all()


class Clock:
    """Time limit of a search, which also ends if obsolete; `complete` says whether the search was never stopped."""

    def __init__(self, wanted: Callable[[], bool], seconds: float) -> None:
        self._wanted, self._deadline, self.complete = wanted, clock() + seconds, True

    def __call__(self) -> bool:
        """Return whether to continue."""
        self.complete = self.complete and self._wanted() and clock() < self._deadline
        return self.complete


class Refinement:
    """The work on one plane: its lattices, then other initial conditions for cells without impact from rest.

    A later plane of the same page makes it obsolete.

    Parameters
    ----------
    plane : Plane
        The plane to fill.
    work : Work
        The page's jobs.
    tell : callable
        Called with "plane" and the plane whenever a lattice is complete; with "hatch" and the plane at the beginning
        and end of the trial of other initial conditions; with "late" and the plane if its lattices take longer than
        `PLANE_SECONDS`: it then waits for `go_on`.
    """

    def __init__(self, plane: Plane, work: Work, tell: Callable[[str, Plane], None]) -> None:
        self.plane, self._work, self._tell = plane, work, tell
        self._stamp, self._begun = work.renew("plane"), time.monotonic()
        self._spent, self._level = 0.0, 0
        self._unfilled: list[Callable[[KeepGoing], bool]] = []  # parts of a lattice
        self._sides = sides(plane.view)
        self._queue(0)

    @property
    def _hatching(self) -> bool:
        return self._level == len(self._sides)

    def _queue(self, level: int) -> None:
        """Begin the next lattice or, after the last one, the other initial conditions."""
        self._level, view = level, self.plane.view
        if self._hatching:
            self._spent = 0.0
            self._unfilled = [partial(self.plane.try_others, places) for places in self.plane.quiet()]
        else:
            samples = view.samples * (TRIED[-1] if view.worst else 1)
            self._unfilled = [
                partial(self.plane.fill, *part) for part in bands(self._sides[level], samples, self._sides[0])
            ]
        self._submit()

    def _submit(self) -> None:
        if self._hatching and self._unfilled:
            self.plane.tried = None
            self._tell("hatch", self.plane)
        urgency = Urgency.FINE if self._level else Urgency.COARSE
        for job in list(self._unfilled):
            self._work.submit("plane", urgency, partial(self._run, job, self._stamp), self._stamp)

    def go_on(self) -> None:
        """Resume work suspended for lack of time."""
        with self._work.lock:
            if self._work.wanted("plane", self._stamp) or not self._unfilled:
                return
            self._stamp, self._spent = self._work.renew("plane"), 0.0
        self._submit()

    def _run(self, job: Callable[[KeepGoing], bool], stamp: int) -> None:
        """Compute a part; after the last part of a lattice, show the lattice and begin the next."""
        begun, level = clock(), self._level
        keep_going = Clock(
            lambda: self._work.wanted("plane", stamp), PLANE_SECONDS * self._work.pool.workers - self._spent
        )
        try:
            filled = keep_going() and job(keep_going)
        except Exception:
            self._give_up(stamp)  # the other parts would fail, too
            raise
        with self._work.lock:
            self._spent += clock() - begun
            # A job in progress when the plane was suspended and resumed may be done twice.
            if filled and job in self._unfilled:
                self._unfilled.remove(job)
            complete = self._work.wanted("plane", stamp) and not self._unfilled
        if complete and level < len(self._sides):
            self.plane.side, self.plane.seconds = self._sides[level], time.monotonic() - self._begun
            self._tell("plane", self.plane)
            self._queue(level + 1)
        elif complete or (not filled and self._give_up(stamp)):
            self.plane.tried = complete if level == len(self._sides) else None
            self._tell("late" if level < len(self._sides) else "hatch", self.plane)

    def _give_up(self, stamp: int) -> bool:
        """Drop the rest of the plane; return whether it was still current."""
        with self._work.lock:
            wanted = self._work.wanted("plane", stamp)
            if wanted:
                self._work.renew("plane")
            return wanted
