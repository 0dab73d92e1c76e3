"""What follows from a view: what has to be computed, what of it is known by now, and who is told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vibroimpact.explorer import line, refining, searches
from vibroimpact.explorer.line import Line, compute_line
from vibroimpact.explorer.motions import Motions
from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.point import Point
from vibroimpact.explorer.pool import Pool, Urgency
from vibroimpact.explorer.refining import Refinement
from vibroimpact.explorer.searches import Curves, Other, find_curves, find_others
from vibroimpact.explorer.state import View
from vibroimpact.explorer.work import Work

Told = tuple[str, Any]
Listener = Callable[[list[Told]], None]

REST = 1.2  # s without a click before coexisting motions are looked for
LINE_REST = 0.15


class Answers:
    """A view, what was computed for it, and what still runs; what a change makes out of date is cancelled.

    Parameters
    ----------
    view : View
        What is seen first.
    pool : Pool
        The threads that compute.
    listener : callable, optional
        Gets what is told, from any thread; see `Explorer`.
    stored : callable, optional
        Given a view, returns a `Plane` taken from a stored study, or None.
    """

    def __init__(
        self, view: View, pool: Pool, listener: Listener | None, stored: Callable[[View], Plane | None] | None
    ) -> None:
        self.view = view
        self.plane: Plane | None = None  # of this view: None until its first lattice is whole
        self.point: Point | None = None  # of this view, too
        self.line: Line | None = None
        self.curves: Curves | None = None
        self.others: list[Other] = []
        self.pins: list[Point] = []
        self.stored = stored
        self._listener = listener
        self._work = Work(pool, self._failed)
        self._lock = self._work.lock
        self._motions = Motions()

    @property
    def closed(self) -> bool:
        """Whether the page is gone."""
        return self._work.closed

    def wait(self, seconds: float = 60.0) -> bool:
        """Wait until nothing is left to compute; return whether that came to pass."""
        return self._work.wait(seconds)

    def _begin(self) -> None:
        """Compute everything for the first view."""
        with self._lock:
            self._tell("view", self.view)
            self._renew_point()
            self._renew_plane()
            self._renew_pins()
            self._renew_line()
            self._work.later("others", REST, self._renew_others)
            if self.view.boundaries:
                self._renew_curves()

    def _replace(self, view: View) -> None:
        """Show another view, and compute what is different in it."""
        before, self.view = self.view, view
        moved, other_plane = view.point_key != before.point_key, view.plane_key != before.plane_key
        if moved:
            self.point = None
        if moved and not other_plane:
            self._renew_point(tell_view=True)  # told with the point, so that the page is drawn once
        else:
            self._tell("view", view)
            if moved:
                self._renew_point()
        if other_plane:
            self._renew_plane()
        elif self.plane is not None:
            self.plane.view = view
            if self.plane.stored and view.index != before.index:
                self._renew_plane()  # the study may not tell this one
            elif (view.index, view.log) != (before.index, before.log):
                self._tell("plane", self.plane)
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

    def _renew_point(self, tell_view: bool = False) -> None:
        view = self.view

        def job() -> None:
            point: Point | None = None
            try:
                point = self._motions.of(view)
            finally:
                with self._lock:  # the view as it is by now: whoever changed it meanwhile may have told it already
                    told: list[Told] = [("view", self.view)] if tell_view else []
                    if point is not None and view.point_key == self.view.point_key:  # else a later job is on its way
                        self.point = point
                        told.append(("point", point))
                    self._tell_together(told)

        self._work.submit("point", Urgency.CLICK, job)

    def _renew_pins(self) -> None:
        view = self.view

        def job() -> None:
            pins = [self._motions.of(view, pin) for pin in view.pins]
            with self._lock:
                if view.pins != self.view.pins:  # a later job is on its way, or was quicker
                    return
                self.pins = pins
                self._tell("pins", pins)

        self._work.submit("pins", Urgency.CLICK, job)

    def _renew_plane(self) -> None:
        self.plane = None
        known = self.stored(self.view) if self.stored else None
        if known is not None:
            self._work.submit("plane", Urgency.COARSE, lambda: self._show_plane(known))
        else:
            Refinement(Plane.unknown(self.view), self._work, self._show_plane, self._late)

    def _show_plane(self, plane: Plane) -> None:
        with self._lock:
            if plane.view.plane_key != self.view.plane_key:
                return
            plane.view = self.view
            self.plane = plane
            self._tell("plane", plane)

    def _late(self) -> None:
        limit = f"{refining.MOST_SECONDS:g} s"
        self._tell("message", f"This plane takes more than {limit}; zoom in, or sample fewer impacts a cell.")

    def _renew_line(self) -> None:
        view, stamp = self.view, self._work.renew("line")

        def job() -> None:
            found = compute_line(view, lambda: self._work.wanted("line", stamp))
            if found is not None:
                self._answer("line", stamp, found, "" if found.complete else f"diagram {_cut(line.MOST_SECONDS)}")

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
                self._answer(
                    "curves", stamp, curves, "" if curves.complete else f"boundaries {_cut(searches.MOST_SECONDS)}"
                )

        self._work.submit("curves", Urgency.SEARCH, job, stamp)

    def _renew_others(self) -> None:
        view, stamp = self.view, self._work.renew("others")

        def job() -> None:
            found = find_others(view, lambda: self._work.wanted("others", stamp))
            if found is not None:
                others, complete = found
                message = "" if complete else f"coexisting motions {_cut(searches.MOST_SECONDS)}"
                self._answer("others", stamp, others, message)

        self._work.submit("others", Urgency.SEARCH, job, stamp)

    def _answer(self, kind: str, stamp: int, content: Any, message: str) -> None:
        """Keep and tell what was computed, unless it is out of date by now; `message` says where it was cut short."""
        with self._lock:
            if not self._work.wanted(kind, stamp):
                return
            setattr(self, kind, content)
            self._tell(kind, content)
            if message:
                self._tell("message", message)

    def _failed(self, kind: str, error: Exception) -> None:
        refused = isinstance(error, ValueError)
        fault = f"The {kind} could not be computed; change the view, or tell us how to reach it."
        self._tell("message", str(error) if refused else fault)

    def _tell(self, what: str, content: Any) -> None:
        self._tell_together([(what, content)])

    def _tell_together(self, told: list[Told]) -> None:
        if self._listener is not None and told and not self.closed:
            self._listener(told)


def _cut(seconds: float) -> str:
    return f"incomplete: stopped after {seconds:g} s"
