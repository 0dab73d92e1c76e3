"""A page: views and controls of a session; it computes nothing itself."""

from __future__ import annotations

import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

from vibroimpact import compiling
from vibroimpact.explorer.address import to_query
from vibroimpact.explorer.controls import TICKS, Commands, Controls
from vibroimpact.explorer.files import KINDS, File, export
from vibroimpact.explorer.models import Find, find_ready_made
from vibroimpact.explorer.plane import Stored
from vibroimpact.explorer.session import Explorer, Message
from vibroimpact.explorer.state import View, with_minus
from vibroimpact.explorer.views import Parts, PlaneView, PointView, show_ends, show_line
from vibroimpact.explorer.work import Pool


class Page:
    """The contents of one open tab.

    Parameters
    ----------
    pool : Pool
        The threads that compute.
    tell : callable
        Sends parts of the page to the browser; it is awaited, so that a slow browser gets only the latest of each kind.
    in_turn : callable
        Runs a function in the server's thread; may be called from any thread.
    view : View
        The view shown first.
    stored, find : callable, optional
        As in `Explorer`.
    """

    def __init__(
        self,
        pool: Pool,
        tell: Callable[[Parts], Awaitable[None]],
        in_turn: Callable[[Callable[[], Awaitable[None]]], None],
        view: View,
        stored: Stored | None = None,
        find: Find = find_ready_made,
    ) -> None:
        self.explorer = Explorer(view, pool, self.receive, stored, find)
        self._tell, self._in_turn = tell, in_turn
        self._inbox: list[Message] = []
        self._reading = False
        self._lock = threading.Lock()
        self.plane, self.point = PlaneView(), PointView()
        self.controls = Controls(self.explorer)
        self.commands = Commands(self.explorer, self.controls, self.export)
        self._show: dict[str, Callable[[Any], Parts]] = {
            "view": self._show_view,
            "plane": self.plane.show_plane,
            "hatch": self.plane.show_hatch,
            "late": self.plane.show_late,
            "point": self.point.show_point,
            "line": show_line,
            "curves": self.plane.show_curves,
            "others": lambda others: {**self.point.show_others(others), **self._show_controls()},
            "pins": self.point.show_pins,
            "rest": lambda _: self._show_work(),
            "message": lambda text: {"message": {"text": with_minus(text)}},
            "file": _show_file,
        }
        compiling.watching.append(self._work_changed)

    def close(self) -> None:
        """Stop all work for this page."""
        compiling.watching.remove(self._work_changed)
        self.explorer.close()

    def _work_changed(self) -> None:
        with suppress(RuntimeError):  # the server's loop is closed
            self.receive([("rest", None)])

    def export(self, kind: str) -> None:
        """Create a file of the view and send it to the browser to save."""
        if kind not in KINDS:
            return

        def job() -> None:
            try:
                self.receive([("file", export(kind, self.explorer))])
            except (ValueError, OSError) as error:
                self.receive([("message", str(error))])

        self.explorer.run("export", job)

    def receive(self, messages: list[Message]) -> None:
        """Receive messages of the session in any thread; they are sent to the browser in the server's thread."""
        with self._lock:
            self._inbox += messages
            begin, self._reading = not self._reading, True
        if begin:
            self._in_turn(self._read)

    async def _read(self) -> None:
        try:
            while messages := self._latest():
                for kind, content in messages:
                    if not self.explorer.closed:
                        await self._tell(self._show[kind](content))
        except BaseException:
            self._reading = False  # the next message starts a new reader
            raise

    def _latest(self) -> list[Message]:
        """Return the latest results, the last of each kind and all files, with the motion first: users wait for it."""
        with self._lock:
            messages, self._inbox = self._inbox, []
            self._reading = bool(messages)
        last = {kind: number for number, (kind, _) in enumerate(messages)}
        latest = [
            (kind, content)
            for number, (kind, content) in enumerate(messages)
            if last[kind] == number or kind in ("message", "file")
        ]
        return sorted(latest, key=lambda message: message[0] != "point")

    def _show_view(self, view: View) -> Parts:
        self.point.hertz = view.hertz
        return {
            **self.plane.show_view(view),
            **show_ends(view),
            "address": {"query": to_query(view)},
            **self._show_controls(),
            "ticks": {name: getattr(view, name) for name in TICKS if name != "hertz" or "omega" in view.osc.values},
            "#about": {"html": self.controls.about()},
            **self._show_work(),
        }

    def _show_work(self) -> Parts:
        name = compiling.under_way()
        text = f"compiling {name}, once on this machine" if name else ""
        return {"busy": {"busy": self.explorer.busy, "compiling": text}}

    def _show_controls(self) -> Parts:
        controls, heard = self.controls, self.commands.last
        return {
            "rows": {"heard": heard, "labels": controls.labels(), "values": controls.rows()},
            "menus": {"heard": heard, "menus": controls.menus()},
        }


def _show_file(file: File) -> Parts:
    return {"file": {"name": file.name, "type": file.type, "content": file.content}}
