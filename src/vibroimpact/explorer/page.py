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
from vibroimpact.explorer.answers import Told
from vibroimpact.explorer.commands import Commands
from vibroimpact.explorer.controls import Controls
from vibroimpact.explorer.export import KINDS, export
from vibroimpact.explorer.line_view import LineView
from vibroimpact.explorer.parcel import Parcel
from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.plane_view import PlaneView
from vibroimpact.explorer.point_view import PointView
from vibroimpact.explorer.pool import Pool
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import View

if TYPE_CHECKING:
    from bokeh.document import Document

RESENT = 8  # letters that are sent again, for a browser that was not there yet when they came


class Page:
    """All that one open tab shows; made ahead, without a document, so that a tab need not wait for it.

    Parameters
    ----------
    pool : Pool
        The threads that compute.
    """

    def __init__(self, pool: Pool) -> None:
        view = View()
        self.explorer = Explorer(view, pool, self._hear)
        self._inbox: list[Told] = []
        self._lock = threading.Lock()
        self._serial = count()
        self._sent: list[dict[str, Any]] = []
        self.plane, self.point, self.line = PlaneView(), PointView(), LineView()
        self.controls = Controls(self.explorer, self.export)
        self.commands = Commands(self.explorer, self.controls)
        self.mail = TextInput(value="", name="mail")
        self.command = TextInput(value="", name="command")
        self.command.on_change("value", lambda attr, old, new: self.commands.obey(new))
        # no root shows these, and the script in the page reads them
        self.view = Parcel("view")
        views: tuple[Any, ...] = (self.plane, self.point, self.line)
        parcels = [self.view, *(parcel for view in views for parcel in view.parcels.values())]
        self.command.tags = [parcel.source for parcel in parcels]

    def open(
        self, doc: Document, view: View, complaint: str = "", stored: Callable[[View], Plane | None] | None = None
    ) -> None:
        """Fill the document of a tab with a view, say what there is to complain of, and begin to compute.

        `stored` is as for `Explorer`.
        """
        self.doc = doc
        self.explorer.view, self.explorer.stored = view, stored
        self.controls.fit(view)
        self._apply([("view", view), *([("message", complaint)] if complaint else [])])
        self.doc.on_session_destroyed(lambda context: self.explorer.close())
        roots = {
            "preset": self.controls.preset, "buttons": self.controls.buttons, "controls": self.controls.column,
            "mail": self.mail, "command": self.command,
        }  # fmt: skip
        with doc.models.freeze():  # else every root looks through all models again
            for name, model in roots.items():
                model.name = name
                doc.add_root(model)
        # Not before the session stands: what threads tell until then would be lost.
        doc.add_next_tick_callback(self.explorer.start)

    def export(self, kind: str) -> None:
        """Make a file of the view and let the browser keep it."""
        if kind not in KINDS:
            return

        def job() -> None:
            try:
                self._hear([("file", export(kind, self.explorer))])
            except (ValueError, OSError) as error:
                self._hear([("message", str(error))])

        self.explorer.run("export", job)

    # ---- what the session answers

    def _hear(self, told: list[Told]) -> None:
        """Take messages from any thread; the page shows them when it is its turn."""
        with self._lock:
            first = not self._inbox
            self._inbox += told
        if first:
            try:
                self.doc.add_next_tick_callback(self._read)
            except RuntimeError:  # the tab was closed meanwhile
                self.explorer.close()

    def _read(self) -> None:
        with self._lock:
            told, self._inbox = self._inbox, []
        latest = {what: number for number, (what, _) in enumerate(told)}
        self._apply([(what, content) for number, (what, content) in enumerate(told) if latest[what] == number])

    def _apply(self, told: list[Told]) -> None:
        letters: list[dict[str, Any]] = []
        for what, content in sorted(told, key=lambda one: one[0] != "point"):  # the motion first: eyes wait for it
            if what == "view":
                self.plane.show_view(content, self.view)
                self.line.show_view(content, self.view)
                self.view.pack("address", query=to_query(content))
                self.controls.show_view(content)
                self.view.pack("rows", heard=self.commands.heard, values=self.controls.rows())
                self.view.send()
            elif what == "plane":
                self.plane.show_plane(content)
            elif what == "point":
                self.point.show_point(content)
            elif what == "line":
                self.line.show(content)
            elif what == "curves":
                self.plane.show_curves(content)
            elif what == "others":
                self.point.show_others(content)
                self.controls.show_others(content)
            elif what == "pins":
                self.point.show_pins(content)
            elif what == "message":
                letters.append({"message": content})
            elif what == "file":
                encoded = base64.b64encode(content.content).decode()
                letters.append({"file": {"name": content.name, "type": content.type, "base64": encoded}})
        if letters:
            sent = [letter for letter in self._sent if "file" not in letter][-RESENT:]
            self._sent = [*sent, *({"serial": next(self._serial), **letter} for letter in letters)]
            self.mail.value = json.dumps(self._sent)
