"""One open page without its page: what a person may do with a view."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from vibroimpact.explorer.answers import Answers, Listener
from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.pool import Pool, Urgency
from vibroimpact.explorer.searches import Other
from vibroimpact.explorer.state import MOST_PINS, View, rounded
from vibroimpact.explorer.zoom import typed_number, with_ranges

MOST_UNDO = 200
SAME_GESTURE = 1.0  # s: changes of one control within it are undone together


class Explorer(Answers):
    """A view that can be changed, and what is computed for it, told to a listener as it comes.

    Parameters
    ----------
    view : View, optional
        What is seen first.
    pool : Pool, optional
        The threads that compute; None makes them.
    listener : callable, optional
        Gets lists of what is told together, from any thread: ("view", View), ("plane", Plane), ("point", Point),
        ("line", Line), ("curves", Curves or None), ("others", list of Other), ("pins", list of Point) and
        ("message", str).
    stored : callable, optional
        Given a view, returns a `Plane` taken from a stored study, or None.

    Notes
    -----
    Whatever a change makes out of date is cancelled: a plane, a diagram and the search for coexisting motions within
    some 0.1 s, a second where single motions take so long; the search for boundaries within 0.5 s; a click's own
    motion runs to its end, some 20 ms, seconds at the corners of what is allowed. All methods may be called from any
    thread.
    """

    def __init__(
        self,
        view: View | None = None,
        pool: Pool | None = None,
        listener: Listener | None = None,
        stored: Callable[[View], Plane | None] | None = None,
    ) -> None:
        self._own_pool = pool is None
        super().__init__(view or View(), pool or Pool(), listener, stored)
        self._past: list[View] = []
        self._future: list[View] = []
        self._gesture: tuple[str, float] = ("", 0.0)

    def start(self) -> None:
        """Compute everything for the first view."""
        self._begin()

    def set(self, gesture: str = "", **changes: Any) -> bool:
        """Change parts of the view by their names; tell what is refused, and change nothing then."""
        try:
            return self.show(replace(self.view, **changes), gesture)
        except ValueError as error:
            self._tell("message", str(error))
            return False

    def set_parameter(self, name: str, value: Any) -> bool:
        """Change one of the seven numbers, as typed or slid; where it is not taken, the view is told again."""
        changed = False
        try:
            osc = self.view.osc.replace(**{name: typed_number(name, value)})
        except ValueError as error:
            self._tell("message", str(error))
        else:
            changed = self.set(name, osc=osc, start=None)
        if not changed:
            self._tell("view", self.view)
        return changed

    def click(self, x: Any, y: Any) -> bool:
        """Choose a point of the plane."""
        try:
            view = self.view
            place = {view.x: rounded(x, view.x_range), view.y: rounded(y, view.y_range)}
            osc = view.osc.replace(**place)
        except ValueError as error:
            self._tell("message", str(error))
            return False
        return self.set("click", osc=osc, start=None)

    def zoom(self, x_range: tuple[float, float], y_range: tuple[float, float]) -> bool:
        """Show another part of the plane, as far as it can be computed."""
        view, message = with_ranges(self.view, x_range, y_range)
        if message:
            self._tell("message", f"As far as it goes: {message}")
        changed = self.show(view, "zoom")
        if not changed and message:
            self._tell("view", self.view)
        return changed

    def set_axes(self, x: str, y: str, x_range: tuple[float, float], y_range: tuple[float, float]) -> bool:
        """Lay the plane along other parameters."""
        return self.set("axes", x=x, y=y, x_range=x_range, y_range=y_range)

    def follow(self, other: Other | None) -> bool:
        """Start the point's motion on another attractor; None starts it from rest."""
        return self.set("start", start=None if other is None else other.start)

    def pin(self) -> bool:
        """Keep the point to compare with; of two, the older one goes."""
        pins = tuple(pin for pin in self.view.pins if pin != self.view.osc)
        return self.set("pin", pins=(*pins, self.view.osc)[-MOST_PINS:])

    def unpin(self) -> bool:
        """Drop all pins."""
        return self.set("pin", pins=())

    def undo(self) -> bool:
        """Go back to the view before."""
        return self._travel(self._past, self._future)

    def redo(self) -> bool:
        """Take back what was undone."""
        return self._travel(self._future, self._past)

    def show(self, view: View, gesture: str = "") -> bool:
        """Show another view; what stays as it was is not computed again. Returns whether anything changed."""
        with self._lock:
            if view == self.view or self.closed:
                return False
            now = time.monotonic()
            if not gesture or gesture != self._gesture[0] or now - self._gesture[1] > SAME_GESTURE:
                self._past = [*self._past, self.view][-MOST_UNDO:]
            self._gesture = (gesture if gesture != "click" else "", now)
            self._future.clear()
            self._replace(view)
        return True

    def run(self, kind: str, job: Callable[[], None]) -> None:
        """Run a job for this page in its turn; a second one of its kind takes the place of one that waits."""
        self._work.submit(kind, Urgency.LINE, job)

    def close(self) -> None:
        """Stop all work for this page."""
        self._work.close()
        if self._own_pool:
            self._work.pool.close()

    def _travel(self, origin: list[View], goal: list[View]) -> bool:
        with self._lock:
            if not origin or self.closed:
                return False
            goal.append(self.view)
            self._gesture = ("", 0.0)
            self._replace(origin.pop())
        return True
