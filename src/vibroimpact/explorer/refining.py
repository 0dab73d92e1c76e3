"""A plane computed lattice by lattice, in jobs that all pages' threads share, until it is whole or takes too long."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from vibroimpact.explorer.plane import SIDES, Cells, Plane, bands
from vibroimpact.explorer.pool import Urgency
from vibroimpact.explorer.work import Work

MOST_SECONDS = 30.0  # that all threads may spend on a plane; time in the queue does not count
KIND = "plane"


class Refinement:
    """The work on one plane; a later one of the same page makes it out of date.

    Parameters
    ----------
    plane : Plane
        What is filled.
    work : Work
        The page's jobs.
    show : callable
        Gets the plane whenever a lattice is whole.
    late : callable
        Called once if the time is up.
    """

    def __init__(self, plane: Plane, work: Work, show: Callable[[Plane], None], late: Callable[[], None]) -> None:
        self.plane, self._work, self._show, self._late = plane, work, show, late
        self._stamp, self._begun = work.renew(KIND), time.monotonic()
        self._spent, self._left = 0.0, 0
        self._queue(0)

    @property
    def wanted(self) -> bool:
        """Whether nobody looks at another plane by now."""
        return self._work.wanted(KIND, self._stamp)

    def _queue(self, level: int) -> None:
        parts = bands(SIDES[level], self.plane.view.samples)
        self._left = len(parts)
        urgency = Urgency.COARSE if level == 0 else Urgency.FINE
        for part in parts:
            self._work.submit(KIND, urgency, partial(self._fill, level, part), self._stamp)

    def _fill(self, level: int, part: tuple[Cells, Cells]) -> None:
        """Compute a rectangle; the last one of a lattice shows it and goes on to the next."""
        begun = time.monotonic()
        granted = MOST_SECONDS * self._work.pool.workers - self._spent

        def going() -> bool:
            return self.wanted and time.monotonic() - begun < granted

        try:
            filled = going() and self.plane.fill(*part, going)
        except Exception:
            self._give_up()  # the other rectangles would fail alike
            raise
        with self._work.lock:
            self._spent += time.monotonic() - begun
            self._left -= filled
            whole = self.wanted and not self._left
        if not filled:
            if self._give_up():
                self._late()
        elif whole:
            self.plane.side, self.plane.seconds = SIDES[level], time.monotonic() - self._begun
            self._show(self.plane)
            if level + 1 < len(SIDES):
                self._queue(level + 1)

    def _give_up(self) -> bool:
        """Drop what is left of the plane; return whether it was wanted till now."""
        with self._work.lock:
            wanted = self.wanted
            if wanted:
                self._work.renew(KIND)
            return wanted
