"""One open page without its page: a view, what was computed for it, and what still runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import partial
from typing import Any

from vibroimpact.explorer.line import compute_line
from vibroimpact.explorer.plane import SIDES, Plane, bands
from vibroimpact.explorer.point import Point, compute_point
from vibroimpact.explorer.pool import Pool, Urgency
from vibroimpact.explorer.searches import find_curves, find_others
from vibroimpact.explorer.state import MOST_PINS, View, rounded, typed_number, with_ranges
from vibroimpact.explorer.work import Work
from vibroimpact.oscillator import ImpactOscillator

Listener = Callable[[str, Any], None]

MOST_UNDO = 200
SAME_GESTURE = 1.0  # s: changes of one control within it are undone together
MOST_SECONDS = 30.0  # a plane may take
REST = 1.2  # s without a click before coexisting motions are looked for
LINE_REST = 0.15
POINTS = 16  # remembered motions


class Explorer:
    """A view that can be changed, and what is computed for it, told to a listener as it comes.

    Parameters
    ----------
    view : View, optional
        What is seen first.
    pool : Pool, optional
        The threads that compute; None makes them.
    listener : callable, optional
        Gets ("view", View), ("plane", Plane), ("point", Point), ("line", Line), ("curves", Curves or None),
        ("others", list of Other), ("pins", list of Point) and ("message", str), from any thread.
    stored : callable, optional
        Given a view, returns a `Plane` taken from a stored study, or None.

    Notes
    -----
    Whatever a change makes out of date is cancelled within some 20 ms. All methods may be called from any thread.
    """

    def __init__(
        self,
        view: View | None = None,
        pool: Pool | None = None,
        listener: Listener | None = None,
        stored: Callable[[View], Plane | None] | None = None,
    ) -> None:
        self.view = view or View()
        self.plane: Plane | None = None
        self.point: Point | None = None
        self.line: Any = None
        self.curves: Any = None
        self.others: list[Any] = []
        self.pins: list[Point] = []
        self._own_pool = pool is None
        self._work = Work(pool or Pool(), self._failed)
        self._listener, self.stored = listener, stored
        self._past: list[View] = []
        self._future: list[View] = []
        self._gesture: tuple[str, float] = ("", 0.0)
        self._lock = self._work.lock
        self._known: dict[Hashable, Point] = {}

    # ---- what a person does

    def start(self) -> None:
        """Compute everything for the first view."""
        self._tell("view", self.view)
        self._renew_all()

    def set(self, gesture: str = "", **changes: Any) -> bool:
        """Change parts of the view by their names; tell what is refused, and change nothing then."""
        try:
            return self.show(replace(self.view, **changes), gesture)
        except ValueError as error:
            self._tell("message", str(error))
            return False

    def set_parameter(self, name: str, value: Any) -> bool:
        """Change one of the seven numbers, as typed or slid."""
        try:
            osc = self.view.osc.replace(**{name: typed_number(name, value)})
        except ValueError as error:
            self._tell("message", str(error))
            return False
        return self.set(name, osc=osc, start=None)

    def click(self, x: float, y: float) -> bool:
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

    def follow(self, other: Any) -> bool:
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

    @property
    def closed(self) -> bool:
        """Whether the page is gone."""
        return self._work.closed

    def wait(self, seconds: float = 60.0) -> bool:
        """Wait until nothing is left to compute; return whether that came to pass."""
        return self._work.wait(seconds)

    # ---- what follows from it

    def _travel(self, origin: list[View], goal: list[View]) -> bool:
        with self._lock:
            if not origin or self.closed:
                return False
            goal.append(self.view)
            self._gesture = ("", 0.0)
            self._replace(origin.pop())
        return True

    def _replace(self, view: View) -> None:
        before, self.view = self.view, view
        if view.point_key != before.point_key and view.plane_key == before.plane_key:
            self._renew_point(tell_view=True)  # told with the point, so that the page is drawn once
        else:
            self._tell("view", view)
            if view.point_key != before.point_key:
                self._renew_point()
        if view.plane_key != before.plane_key:
            self._renew_plane()
        elif (view.index, view.log) != (before.index, before.log) and self.plane is not None:
            self.plane.view = view
            self._tell("plane", self.plane)
        elif self.plane is not None:
            self.plane.view = view
        if view.pins != before.pins:
            self._renew_pins()
        if view.line_key != before.line_key:
            self._work.later("line", LINE_REST, self._renew_line)
        if view.osc != before.osc:
            self.others = []
            self._tell("others", [])
            self._work.later("others", REST, self._renew_others)
        if view.boundary_key != before.boundary_key:
            self._work.later("curves", LINE_REST, self._renew_curves)

    def _renew_all(self) -> None:
        with self._lock:
            self._renew_point()
            self._renew_plane()
            self._renew_pins()
            self._renew_line()
            self._work.later("others", REST, self._renew_others)
            if self.view.boundaries:
                self._renew_curves()

    def _renew_point(self, tell_view: bool = False) -> None:
        view = self.view

        def job() -> None:
            try:
                point = self._motion(view)
            finally:
                if tell_view:
                    self._tell("view", view)
            with self._lock:
                if _asked(view) != _asked(self.view):  # a later job is on its way, or was quicker
                    return
                self.point = point
            self._tell("point", point)

        self._work.submit("point", Urgency.CLICK, job)

    def _motion(self, view: View, osc: ImpactOscillator | None = None) -> Point:
        key = _asked(view) if osc is None else (osc, None, view.settled, view.samples)
        if key not in self._known:
            while len(self._known) >= POINTS:
                self._known.pop(next(iter(self._known)), None)
            self._known[key] = compute_point(view, osc)
        return self._known[key]

    def _renew_pins(self) -> None:
        view = self.view

        def job() -> None:
            pins = [self._motion(view, pin) for pin in view.pins]
            with self._lock:
                if view.pins != self.view.pins:  # a later job is on its way, or was quicker
                    return
                self.pins = pins
            self._tell("pins", pins)

        self._work.submit("pins", Urgency.CLICK, job)

    def _renew_plane(self) -> None:
        plane = self.stored(self.view) if self.stored else None
        if plane is not None:
            self._work.submit("plane", Urgency.COARSE, lambda: self._show_plane(plane))
            return
        self._refine(Plane.unknown(self.view), 0, self._work.renew("plane"), time.monotonic())

    def _show_plane(self, plane: Plane) -> None:
        plane.view = self.view
        self.plane = plane
        self._tell("plane", plane)

    def _refine(self, plane: Plane, level: int, stamp: int, begun: float) -> None:
        """Queue the rectangles of a level; the last one to end shows the plane and goes on to the next level."""
        urgency = Urgency.COARSE if level == 0 else Urgency.FINE
        parts = bands(SIDES[level])
        left = len(parts)

        def going() -> bool:
            return self._work.wanted("plane", stamp) and time.monotonic() - begun < MOST_SECONDS

        def job(columns: Any, rows: Any) -> None:
            nonlocal left
            if not going() or not plane.fill(columns, rows, going):
                if self._work.wanted("plane", stamp) and not going():
                    self._late()
                return
            with self._lock:
                left -= 1
                last = left == 0 and self._work.wanted("plane", stamp)
            if last:
                plane.side, plane.seconds = SIDES[level], time.monotonic() - begun
                self._show_plane(plane)
                if level + 1 < len(SIDES):
                    self._refine(plane, level + 1, stamp, begun)

        for columns, rows in parts:
            self._work.submit("plane", urgency, partial(job, columns, rows), stamp)

    def _late(self) -> None:
        self._tell(
            "message", f"This plane takes more than {MOST_SECONDS:g} s; zoom in, or sample fewer impacts a cell."
        )

    def _renew_line(self) -> None:
        view, stamp = self.view, self._work.renew("line")

        def job() -> None:
            line = compute_line(view, lambda: self._work.wanted("line", stamp))
            if line is not None:
                self.line = line
                self._tell("line", line)

        self._work.submit("line", Urgency.LINE, job, stamp)

    def _renew_curves(self) -> None:
        view, stamp = self.view, self._work.renew("curves")
        self.curves = None
        self._tell("curves", None)
        if not view.boundaries:
            return

        def job() -> None:
            curves = find_curves(view, lambda: self._work.wanted("curves", stamp))
            if curves is not None:
                self.curves = curves
                self._tell("curves", curves)

        self._work.submit("curves", Urgency.SEARCH, job, stamp)

    def _renew_others(self) -> None:
        view = self.view

        def job() -> None:
            others = find_others(view)
            if self.view.osc == view.osc:
                self.others = others
                self._tell("others", others)

        self._work.submit("others", Urgency.SEARCH, job)

    def _failed(self, kind: str, error: Exception) -> None:
        refused = isinstance(error, ValueError)
        fault = f"The {kind} could not be computed; change the view, or tell us how to reach it."
        self._tell("message", str(error) if refused else fault)

    def _tell(self, what: str, content: Any) -> None:
        if self._listener is not None and not self.closed:
            self._listener(what, content)


def _asked(view: View) -> Hashable:
    """Return what a view asks of its point."""
    return view.osc, view.start, view.settled, view.samples
