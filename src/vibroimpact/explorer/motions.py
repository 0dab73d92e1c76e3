"""Motions that were computed already, so that going back to one costs nothing."""

from __future__ import annotations

import threading
from collections.abc import Hashable

from vibroimpact.explorer.point import Point, compute_point
from vibroimpact.explorer.state import View
from vibroimpact.oscillator import ImpactOscillator

MOST = 16  # remembered


class Motions:
    """The last few motions of a page."""

    def __init__(self) -> None:
        self._known: dict[Hashable, Point] = {}
        self._lock = threading.Lock()

    def of(self, view: View, osc: ImpactOscillator | None = None) -> Point:
        """Return the motion at the view's point, or at another one started from rest."""
        key = view.point_key if osc is None else (osc, None, view.settled, view.samples)
        with self._lock:
            known = self._known.get(key)
        if known is None:
            known = compute_point(view, osc)
            with self._lock:
                while len(self._known) >= MOST:
                    del self._known[next(iter(self._known))]
                self._known[key] = known
        return known
