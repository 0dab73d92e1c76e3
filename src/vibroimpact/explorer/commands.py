"""What the page's script asks for, in a word, what it is about, and the message's serial."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

from vibroimpact.explorer.controls import Controls
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import rounded
from vibroimpact.oscillator import PARAMETERS

NUDGE = 1.0 / 64.0  # of the plane, an arrow key
ZOOM = 0.5


class Commands:
    """Obeys the page's script.

    Parameters
    ----------
    explorer : Explorer
        The session.
    controls : Controls
        They know how far each parameter reaches.
    """

    def __init__(self, explorer: Explorer, controls: Controls) -> None:
        self.heard = -1  # the serial of the last message
        self._explorer, self._controls = explorer, controls
        self._simple: dict[str, Callable[[], Any]] = {
            "undo": explorer.undo,
            "redo": explorer.redo,
            "pin": explorer.pin,
            "unpin": explorer.unpin,
            "home": controls.home,
            "boundaries": lambda: explorer.set(boundaries=not explorer.view.boundaries),
            "log": lambda: explorer.set(log=not explorer.view.log),
            "line": lambda: explorer.set(line="y" if explorer.view.line == "x" else "x"),
            "motion": lambda: explorer.set(index="motion" if explorer.view.index != "motion" else "std"),
            "left": lambda: self._nudge(-1, 0),
            "right": lambda: self._nudge(1, 0),
            "up": lambda: self._nudge(0, 1),
            "down": lambda: self._nudge(0, -1),
            "in": lambda: self._scale(ZOOM),
            "out": lambda: self._scale(1.0 / ZOOM),
        }
        self._placed: dict[str, Callable[..., Any]] = {
            "click": explorer.click,
            "zoom": lambda x0, x1, y0, y1: explorer.zoom((x0, x1), (y0, y1)),
            "along": self._along,
        }
        self._named: dict[str, Callable[[str, str], Any]] = {"slide": self._slide, "type": explorer.set_parameter}

    def obey(self, text: str) -> None:
        """Do what a message asks for; one that the page's own script does not send is left alone."""
        word, *about, serial = text.split(" ") if " " in text else (text, "-1")
        with contextlib.suppress(ValueError, TypeError):
            self.heard = int(serial)
            if word in self._simple:
                self._simple[word]()
            elif word in self._placed:
                self._placed[word](*map(float, about))
            elif word in self._named and about[:1] and about[0] in PARAMETERS:
                self._named[word](about[0], " ".join(about[1:]))

    def _slide(self, name: str, text: str) -> None:
        """Take a slider's place, with no more digits than it tells apart."""
        value, (low, high) = float(text), self._controls.ranges[name]
        low, high = min(low, value), max(high, value)
        self._explorer.set_parameter(name, min(max(rounded(value, (low, high)), low), high))

    def _along(self, value: float) -> None:
        parameter, ends = self._explorer.view.along
        self._explorer.set_parameter(parameter, rounded(value, ends))

    def _nudge(self, right: int, up: int) -> None:
        view = self._explorer.view
        (x0, x1), (y0, y1) = view.x_range, view.y_range
        self._explorer.click(
            view.osc_value("x") + right * NUDGE * (x1 - x0), view.osc_value("y") + up * NUDGE * (y1 - y0)
        )

    def _scale(self, factor: float) -> None:
        """Zoom about the point, or about the middle where the point lies outside."""
        view, ranges = self._explorer.view, []
        for axis in ("x", "y"):
            low, high = getattr(view, f"{axis}_range")
            middle = view.osc_value(axis)
            middle = middle if low <= middle <= high else 0.5 * (low + high)
            ranges.append((middle - factor * (middle - low), middle + factor * (high - middle)))
        self._explorer.zoom(ranges[0], ranges[1])
