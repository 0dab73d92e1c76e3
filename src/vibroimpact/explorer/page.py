"""A page: views and controls around a session; it computes nothing."""

from __future__ import annotations

import base64
import json
import threading
from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING, Any

from bokeh.models import TextInput

from vibroimpact.explorer.address import to_query
from vibroimpact.explorer.controls import TICKS, Commands, Controls
from vibroimpact.explorer.files import KINDS, export
from vibroimpact.explorer.models import Find, only_known
from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.session import Explorer, Message
from vibroimpact.explorer.state import View
from vibroimpact.explorer.views import LineView, PlaneView, PointView, Update
from vibroimpact.explorer.work import Pool

if TYPE_CHECKING:
    from bokeh.document import Document

ROOTS = ("preset", "buttons", "controls", "mail", "command")  # the elements root_... of the page
RESENT = 8  # messages that are sent again, for a browser that had not connected when they came


class Page:
    """All that one open tab shows; made without a document, in any thread.

    Parameters
    ----------
    pool : Pool
        The threads that compute.
    """

    def __init__(self, pool: Pool) -> None:
        self.explorer = Explorer(View(), pool, self._receive)
        self._inbox: list[Message] = []
        self._lock = threading.Lock()
        self._serial = count()
        self._sent: list[dict[str, Any]] = []
        self.plane, self.point, self.line = PlaneView(), PointView(), LineView()
        self.controls = Controls(self.explorer)
        self.commands = Commands(self.explorer, self.controls, self.export)
        self.mail = TextInput(value="", name="mail")
        self.command = TextInput(value="", name="command")
        self.command.on_change("value", lambda attr, old, new: self.commands.run(new))
        self.view, self.rest = Update("view"), Update("rest")
        self._show: dict[str, Callable[[Any], None]] = {
            "view": self._show_view,
            "plane": self.plane.show_plane,
            "hatch": self.plane.show_hatch,
            "point": self.point.show_point,
            "line": self.line.show,
            "curves": self.plane.show_curves,
            "others": self._show_others,
            "pins": self.point.show_pins,
            "rest": self._show_rest,
        }
        views: tuple[Any, ...] = (self.plane, self.point, self.line)
        updates = [self.view, self.rest, *(update for view in views for update in view.updates.values())]
        self.command.tags = [update.source for update in updates]  # no root holds these, and the script reads them

    def open(
        self,
        doc: Document,
        in_turn: Callable[[Callable[[], None]], None],
        view: View,
        message: str = "",
        stored: Callable[[View], Plane | None] | None = None,
        find: Find = only_known,
    ) -> None:
        """Fill the document of a tab with a view and perhaps a message.

        `in_turn` may be called from any thread, and calls a function when the document may be changed, or never if the
        tab is gone; `stored` and `find` are as for `Explorer`.
        """
        self._in_turn = in_turn
        self.explorer.view, self.explorer.stored, self.explorer.find = view, stored, find
        self.controls.fit(view)
        self._apply([("view", view), *([("message", message)] if message else [])])
        models = (self.controls.preset, self.controls.buttons, self.controls.column, self.mail, self.command)
        with doc.models.freeze():  # else every root looks through all models again
            for name, model in zip(ROOTS, models, strict=True):
                model.name = name
                doc.add_root(model)
        doc.config.reconnect_session = doc.config.notify_connection_status = (
            False  # a tab that left is forgotten; its address holds all that it showed
        )

    def export(self, kind: str) -> None:
        """Make a file of the view and let the browser keep it."""
        if kind not in KINDS:
            return

        def job() -> None:
            try:
                self._receive([("file", export(kind, self.explorer))])
            except (ValueError, OSError) as error:
                self._receive([("message", str(error))])

        self.explorer.run("export", job)

    # ---- what the session answers

    def _receive(self, messages: list[Message]) -> None:
        """Take messages from any thread; the page shows them in its own."""
        with self._lock:
            first = not self._inbox
            self._inbox += messages
        if first:
            self._in_turn(self._read)

    def _read(self) -> None:
        with self._lock:
            messages, self._inbox = self._inbox, []
        if self.explorer.closed:
            return
        latest = {what: number for number, (what, _) in enumerate(messages)}
        self._apply([message for number, message in enumerate(messages) if latest[message[0]] == number])

    def _apply(self, messages: list[Message]) -> None:
        items: list[dict[str, Any]] = []
        for what, content in sorted(
            messages, key=lambda one: one[0] != "point"
        ):  # the motion first: people wait for it
            if what == "message":
                items.append({"message": content})
            elif what == "file":
                encoded = base64.b64encode(content.content).decode()
                items.append({"file": {"name": content.name, "type": content.type, "base64": encoded}})
            else:
                self._show[what](content)
        if items:
            sent = [item for item in self._sent if "file" not in item][-RESENT:]
            self._sent = [*sent, *({"serial": next(self._serial), **item} for item in items)]
            self.mail.value = json.dumps(self._sent)

    def _show_view(self, view: View) -> None:
        self.plane.show_view(view, self.view)
        self.line.show_view(view, self.view)
        self.view.add("address", query=to_query(view))
        self.controls.show_view(view)
        self.view.add("rows", heard=self.commands.last, labels=self.controls.labels(), values=self.controls.rows())
        self.view.add("ticks", **{name: getattr(view, name) for name in TICKS})
        self.view.add("busy", busy=self.explorer.busy)
        self.view.send()

    def _show_rest(self, _: None) -> None:
        self.rest.add("busy", busy=self.explorer.busy)
        self.rest.send()

    def _show_others(self, others: Any) -> None:
        self.point.show_others(others)
        self.controls.show_others(others)
