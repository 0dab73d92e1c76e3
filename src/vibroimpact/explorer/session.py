"""The session of an open page: user actions on a view, and the work that follows from them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

from vibroimpact.coexistence import Attractor
from vibroimpact.explorer import work
from vibroimpact.explorer.limits import Range, with_axes, with_ranges
from vibroimpact.explorer.models import Find, find_ready_made
from vibroimpact.explorer.plane import Curves, KeepGoing, Line, Plane, Stored, compute_line, find_curves
from vibroimpact.explorer.point import REMEMBERED, Point, find_others, motion_at
from vibroimpact.explorer.state import (
    LETTERS,
    MOST_PINS,
    View,
    quantity_of,
    rounded,
    typed_number,
    values_of,
)
from vibroimpact.explorer.work import Clock, Job, Pool, Refinement, Urgency, Work

Message = tuple[str, Any]
Search = Callable[[View, KeepGoing], Any]

MOST_UNDO = 200  # views of a page that can be brought back
SAME_GESTURE = 1.0  # s: changes of one control within this time are undone together
OTHERS_DELAY = 1.2  # s without a click before the search for coexisting motions starts
LINE_DELAY = 0.15  # s
LINE_SECONDS, SEARCH_SECONDS = 10.0, 20.0  # s after which a diagram and a search are stopped


class Explorer:
    """A changeable view, its results, and its running jobs.

    Parameters
    ----------
    view : View, optional
        The view shown first.
    pool : Pool, optional
        The threads that compute; None creates them.
    listener : callable, optional
        Called with lists of messages that belong together, from any thread: ("view", View), ("plane", Plane), ("hatch",
        Plane), ("point", Point), ("line", Line), ("curves", Curves or None), ("others", list of Attractor), ("pins",
        list of Point), ("late", whether the plane was suspended for lack of time) and ("message", str).
    stored : callable, optional
        Returns the `Plane` of a view from a stored sweep, or None.
    find : callable, optional
        Returns the model of a name in links.

    Notes
    -----
    A change cancels all work that it makes obsolete: a plane, a diagram and the search for coexisting motions within
    about 0.1 s (1 s if single motions take that long), the search for boundaries within 0.5 s. The motion of a click
    runs to its end, in about 20 ms, or seconds at the limits of the parameters. All methods may be called from any
    thread.
    """

    def __init__(
        self,
        view: View | None = None,
        pool: Pool | None = None,
        listener: Callable[[list[Message]], None] | None = None,
        stored: Stored | None = None,
        find: Find = find_ready_made,
    ) -> None:
        self.view, self.find = view or View(), find
        self.plane: Plane | None = None  # of this view: None until its first lattice is complete
        self.point: Point | None = None  # of this view, too
        self.line: Line | None = None
        self.curves: Curves | None = None
        self.others: list[Attractor] = []
        self.pins: list[Point] = []
        self.stored = stored
        self._listener = listener
        self._owns_pool, self._started = pool is None, False
        self._work = Work(pool or Pool(), self._failed, lambda: self._send(("rest", None)))
        self._lock = self._work.lock
        # Returning to one of the last motions costs nothing.
        self._motions: Callable[..., Point] = lru_cache(REMEMBERED)(motion_at)
        self._past: list[View] = []
        self._future: list[View] = []
        self._gesture: tuple[str, float] = ("", 0.0)
        self._refused = False  # whether its message is still shown
        self._refinement: Refinement | None = None  # of this view's plane

    @property
    def closed(self) -> bool:
        """Whether the page is gone."""
        return self._work.closed

    @property
    def busy(self) -> bool:
        """Whether a job is running or scheduled."""
        return not self._started or self._work.busy

    def wait(self, seconds: float = 60.0) -> bool:
        """Wait until all work is done; return False on timeout."""
        return self._work.wait(seconds)

    def start(self) -> None:
        """Compute everything for the first view."""
        with self._lock:
            if self.closed:
                return
            self._started = True
            self._send(("view", self.view))
            self._renew_point()
            self._renew_plane()
            self._renew_pins()
            self._renew_line()
            self._work.later("others", OTHERS_DELAY, self._renew_others)
            if self.view.boundaries:
                self._renew_curves()

    def close(self) -> None:
        """Stop all work for this page."""
        self._work.close()
        if self._owns_pool:
            self._work.pool.close()

    # ---- user actions

    def set(self, gesture: str = "", **changes: Any) -> bool:
        """Change fields of the view by name; a refused change sends a message and changes nothing."""
        return self._show(lambda view: replace(view, **changes), gesture)

    def set_parameter(self, name: str, value: Any) -> bool:
        """Change one parameter, as typed or by its slider; if refused, the view is sent again."""
        changed = self._show(lambda view: _moved(view, {name: typed_number(view.table[name], value)}), name)
        if not changed:
            self.resend()
        return changed

    def resend(self) -> None:
        """Send the view again, to reset a page after a refused change."""
        self._send(("view", self.view))

    def click(self, x: Any, y: Any) -> bool:
        """Select a point of the plane."""
        return self._show(
            lambda view: _moved(view, {view.x: rounded(x, view.x_range), view.y: rounded(y, view.y_range)}), "click"
        )

    def zoom(self, x_range: Range, y_range: Range) -> bool:
        """Show another part of the plane, within the limits of computation."""
        view, message = with_ranges(self.view, x_range, y_range)
        if message:
            self._send(("message", f"Zoomed as far as possible: {message}"))
        changed = self.show(view, "zoom")
        if not changed and message:
            self.resend()
        return changed

    def set_axes(self, x: str, y: str, x_range: Range, y_range: Range) -> bool:
        """Vary other parameters along the plane's axes, within the limits of computation."""
        try:
            view, message = with_axes(self.view, {x: x_range, y: y_range})
        except ValueError as error:
            view, message = self.view, str(error)
        if message:
            self._send(("message", f"Shown as far as possible: {message}"))
        return self.show(view, "axes")

    def follow(self, other: Attractor | None) -> bool:
        """Use a state on another attractor as the initial condition of the point's motion; None means rest."""
        return self.set("start", start=None if other is None else other.start)

    def pin(self) -> bool:
        """Pin the point for comparison; if there are too many pins, the oldest is removed, with a message."""
        view = self.view
        if view.osc in view.pins:
            self._send(("message", f"This point is pinned already, as {LETTERS[view.pins.index(view.osc)]}."))
            return False
        changed = self.set("pin", pins=(*view.pins, view.osc)[-MOST_PINS:])
        if changed and len(view.pins) == MOST_PINS:
            values = values_of(view.pins[0], view.hertz)
            place = ", ".join(quantity_of(view.table[name], values[name]) for name in (view.x, view.y))
            self._send(
                ("message", f"Two points are compared: pin A ({place}) was removed, B is now A, and this point is B.")
            )
        return changed

    def unpin(self) -> bool:
        """Remove all pins."""
        return self.set("pin", pins=())

    def go_on(self) -> None:
        """Resume a plane that was suspended for lack of time."""
        self._send(("late", False))
        if self._refinement is not None:
            self._refinement.go_on()

    def undo(self) -> bool:
        """Return to the previous view."""
        return self._travel(self._past, self._future)

    def redo(self) -> bool:
        """Reverse the last `undo`."""
        return self._travel(self._future, self._past)

    def _show(self, change: Callable[[View], View], gesture: str) -> bool:
        """Show a changed view; send a message if the change is refused."""
        try:
            view = change(self.view)
        except ValueError as error:
            self._refused = True
            self._send(("message", str(error)))
            return False
        if self._refused:
            self._refused = False
            self._send(("message", ""))
        return self.show(view, gesture)

    def show(self, view: View, gesture: str = "") -> bool:
        """Show another view; unchanged parts are not computed again. Return whether anything changed."""
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

    def run(self, kind: str, job: Job) -> None:
        """Queue a job for this page; it replaces a waiting job of the same kind."""
        self._work.submit(kind, Urgency.LINE, job)

    def _travel(self, origin: list[View], goal: list[View]) -> bool:
        with self._lock:
            if not origin or self.closed:
                return False
            goal.append(self.view)
            self._gesture = ("", 0.0)
            self._replace(origin.pop())
        return True

    # ---- resulting work

    def _replace(self, view: View) -> None:
        """Show another view, and compute the parts that differ."""
        before, self.view = self.view, view
        moved, other_plane = view.point_key != before.point_key, view.plane_key != before.plane_key
        if moved:
            self.point = None
        if moved and not other_plane:
            self._renew_point(send_view=True)  # together with the point, so that the page is drawn once
        else:
            self._send(("view", view))
            if moved:
                self._renew_point()
        if other_plane:
            self._renew_plane()
        elif self.plane is not None:
            self.plane.view = view
            if self.plane.stored and view.index != before.index:
                self._renew_plane()  # the stored sweep may not hold this index
            elif (view.index, view.log) != (before.index, before.log):
                self._send(("plane", self.plane))
        if view.pins != before.pins:
            self._renew_pins()
        if view.line_key != before.line_key:
            self._work.later("line", LINE_DELAY, self._renew_line)
        if view.osc != before.osc:
            self.others = []
            self._send(("others", []))
            self._work.later("others", OTHERS_DELAY, self._renew_others)
        if view.boundary_key != before.boundary_key:
            self._work.later("curves", LINE_DELAY, self._renew_curves)

    def _renew_point(self, send_view: bool = False) -> None:
        view = self.view

        def job() -> None:
            point: Point | None = None
            try:
                point = self._motions(*view.point_key)
            finally:
                with self._lock:  # meanwhile the view may have changed, or may have been sent
                    messages: list[Message] = [("view", self.view)] if send_view else []
                    if point is not None and view.point_key == self.view.point_key:  # else a later job sends it
                        self.point = point
                        messages.append(("point", point))
                    self._send(*messages)

        self._work.submit("point", Urgency.CLICK, job)

    def _renew_pins(self) -> None:
        view = self.view

        def job() -> None:
            pins = [self._motions(pin, None, *view.point_key[2:]) for pin in view.pins]
            with self._lock:
                if view.pins != self.view.pins:  # a later job will send it, or has done so
                    return
                self.pins = pins
                self._send(("pins", pins))

        self._work.submit("pins", Urgency.CLICK, job)

    def _renew_plane(self) -> None:
        self.plane = self._refinement = None
        self._send(("late", False))
        stored = self.stored(self.view) if self.stored else None
        if stored is not None:
            self._work.submit("plane", Urgency.COARSE, lambda: self._show_plane("plane", stored))
        else:
            self._refinement = Refinement(Plane.unknown(self.view), self._work, self._show_plane)

    def _show_plane(self, news: str, plane: Plane) -> None:
        """Send the news of a plane: "plane", "hatch", or "late"."""
        limit = f"{work.PLANE_SECONDS:g} s"
        with self._lock:
            if plane.view.plane_key != self.view.plane_key:
                return
            message = ""
            if news == "late":
                message = f"This plane takes more than {limit}: continue it, zoom in, or sample fewer impacts per cell."
            else:
                if news == "plane":
                    plane.view, self.plane = self.view, plane
                elif plane.tried is False:
                    message = f"hatching of cells without impact from rest is incomplete: stopped after {limit}"
                self._send((news, plane))
            if message:
                self._send(("message", message), ("late", True))

    def _renew_line(self) -> None:
        self._search("line", Urgency.LINE, compute_line, "diagram", LINE_SECONDS)

    def _renew_curves(self) -> None:
        self._work.renew("curves")
        self.curves = None
        self._send(("curves", None))
        if self.view.boundaries:
            self._search("curves", Urgency.SEARCH, find_curves, "boundaries", SEARCH_SECONDS)

    def _renew_others(self) -> None:
        self._search("others", Urgency.SEARCH, find_others, "coexisting motions", SEARCH_SECONDS)

    def _search(self, kind: str, urgency: Urgency, search: Search, name: str, seconds: float) -> None:
        """Run a search; store and send its result unless it is obsolete by then."""
        view, stamp = self.view, self._work.renew(kind)

        def job() -> None:
            clock = Clock(lambda: self._work.wanted(kind, stamp), seconds)
            content = search(view, clock)
            with self._lock:
                if not self._work.wanted(kind, stamp):
                    return
                setattr(self, kind, content)
                self._send((kind, content))
                if not clock.complete:
                    self._send(("message", f"{name} incomplete: stopped after {seconds:g} s"))

        self._work.submit(kind, urgency, job, stamp)

    def _failed(self, kind: str, error: Exception) -> None:
        fault = f"The {kind} could not be computed. Change the view, and please report how to reproduce this error."
        self._send(("message", str(error) if isinstance(error, ValueError) else fault))

    def _send(self, *messages: Message) -> None:
        if self._listener is not None and messages and not self.closed:
            self._listener(list(messages))


def _moved(view: View, place: dict[str, float]) -> View:
    """Return the view at another point, with its motion from rest."""
    return replace(view, osc=view.osc.replace(**place), start=None)
