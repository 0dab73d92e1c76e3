"""The server: the page, which costs nothing to serve; the websocket that starts work, and its messages."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import gc
import json
import math
import sys
import threading
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.netutil import bind_sockets
from tornado.template import Template
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from vibroimpact.explorer.address import from_query
from vibroimpact.explorer.controls import BUTTONS, EXPORTS, MENUS, TICKS
from vibroimpact.explorer.models import Find
from vibroimpact.explorer.page import Page
from vibroimpact.explorer.plane import Stored
from vibroimpact.explorer.point import compute_point
from vibroimpact.explorer.state import CHOICES, View
from vibroimpact.explorer.views import Parts
from vibroimpact.explorer.work import Pool

MOST_PAGES = 64  # open at a time: all share the threads
FULL = f"{MOST_PAGES} pages of this explorer are open, which is the limit. Close one, then reload this page."
MOST_BYTES = 1 << 20  # bytes of a message or a request from a browser
SILENT = 10.0  # s after which an idle connection is closed
PING = 15.0  # s between pings to a browser
TIDY_DELAY = 3.0  # s after which a closed tab has been cleaned up
NOTEBOOKS = "http://localhost:* http://127.0.0.1:* vscode-webview:"  # sites that may frame the page
SCRIPTS = ("plots", "motion", "plane", "picture", "rows", "menus", "page")
ALIGNED = 8  # bytes: a browser reads arrays in place, only at multiples of the item size
_ASSETS = Path(__file__).parent / "assets"


class Tabs:
    """The open tabs and their pages.

    Parameters
    ----------
    view : View
        The view of a tab whose address has no query.
    stored, find : callable
        As in `Explorer`.
    """

    def __init__(self, view: View, stored: Stored | None, find: Find) -> None:
        self._view, self._stored, self._find = view, stored, find
        self._pool = Pool()
        self.open: set[Socket] = set()
        threading.Thread(target=self._get_ready, daemon=True).start()

    def _get_ready(self) -> None:
        """Compile or load the code for the first click while the address is printed and the page opens."""
        with contextlib.suppress(ValueError):  # the page reports errors itself
            compute_point(self._view)

    def enter(self, tab: Socket) -> Page | None:
        """Return the page of a tab, with the view of its address; None if too many are open."""
        if len(self.open) >= MOST_PAGES:
            return None
        self.open.add(tab)
        view, message = self._view, ""
        if tab.request.query:
            try:
                view = from_query(tab.request.query, self._find)
            except ValueError as error:
                message = f"This link cannot be shown: {error}. The default view is shown instead."
        page = Page(self._pool, tab.tell, IOLoop.current().add_callback, view, self._stored, self._find)
        page.explorer.start()
        if message:
            page.receive([("message", message)])
        return page

    def leave(self, tab: Socket) -> None:
        """Remove a tab; after the last one, return free memory to the system."""
        self.open.discard(tab)
        IOLoop.current().call_later(TIDY_DELAY, self._tidy)

    def _tidy(self) -> None:
        if self.open:
            return
        gc.collect()  # pages and sessions refer to each other
        if sys.platform == "linux":
            with contextlib.suppress(AttributeError, OSError):  # the C library does not have it
                ctypes.CDLL(None).malloc_trim(0)

    def close(self) -> None:
        """Stop the threads."""
        self._pool.close()


class Socket(WebSocketHandler):
    """The websocket of a tab; its page is created when it opens and closed when it closes."""

    def initialize(self, tabs: Tabs, hosts: list[str]) -> None:
        """Store the arguments of the router."""
        self._tabs, self._hosts = tabs, hosts
        self._page: Page | None = None

    def check_origin(self, origin: str) -> bool:
        """Whether a page may open the websocket: only this server's own pages may."""
        return urlsplit(origin).netloc.lower() in self._hosts

    async def open(self, *_: str, **__: str) -> None:
        """Start work for a tab, if there is room."""
        self._page = self._tabs.enter(self)
        if self._page is None:
            await self.tell({"message": {"text": FULL}})
            self.close(1013, "too many pages")

    async def tell(self, parts: Parts) -> None:
        """Send parts of the page, unless the browser has disconnected."""
        with contextlib.suppress(WebSocketClosedError):
            await self.write_message(packed(parts), binary=True)

    def on_message(self, message: str | bytes) -> None:
        """Run a command from the page's script."""
        if self._page is not None and isinstance(message, str):
            self._page.commands.run(message)

    def on_close(self) -> None:
        """Stop the work for a closed tab."""
        self._tabs.leave(self)
        if self._page is not None:
            self._page.close()


class PageFile(RequestHandler):
    """The page, one static file for all; nothing is computed or stored for it."""

    def initialize(self, page: str, framed: bool) -> None:
        """Store the file, and whether notebooks on this machine may show it in a frame."""
        self._file, self._frames = page, NOTEBOOKS if framed else "'none'"

    def get(self) -> None:
        """Send the page."""
        self.set_header("Cache-Control", "no-store")
        self.set_header(
            "Content-Security-Policy", f"frame-ancestors {self._frames}"
        )  # otherwise any site could embed it invisibly
        self.set_header("X-Content-Type-Options", "nosniff")
        self.finish(self._file)


class Refused(RequestHandler):
    """The answer to requests with a foreign Host header: a page of another site poses as local (DNS rebinding)."""

    def initialize(self, hosts: list[str]) -> None:
        """Store the names of this machine."""
        self._hosts = hosts

    def prepare(self) -> None:
        """Refuse the request."""
        self.set_status(421)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"This explorer is reached at {' or '.join(f'http://{host}/' for host in self._hosts)} only.\n")


class Router(Application):
    """Routes requests for the page and its websocket to their handlers; there are no other paths.

    Parameters
    ----------
    tabs : Tabs
        The open tabs.
    hosts : list of str
        Names and port of this machine, as browsers send them; pages from other hosts may not open the websocket.
    framed : bool
        Whether notebooks on this machine may show the page in a frame.
    """

    def __init__(self, tabs: Tabs, hosts: list[str], framed: bool) -> None:
        self._hosts = hosts
        super().__init__(
            [("/", PageFile, {"page": page_file(), "framed": framed}), ("/ws", Socket, {"tabs": tabs, "hosts": hosts})],
            websocket_ping_interval=PING,
            websocket_max_message_size=MOST_BYTES,
        )

    def find_handler(self, request: HTTPServerRequest, **options: Any) -> Any:
        """Return the handler of a request."""
        if request.host.lower() not in self._hosts:
            return self.get_handler_delegate(request, Refused, {"hosts": self._hosts})
        return super().find_handler(request, **options)


class Server:
    """A server listening in the running event loop.

    Parameters
    ----------
    tabs : Tabs
        The open tabs.
    address : str
        Where it listens.
    port : int
        Where it listens.
    hosts, framed
        As for `Router`.

    Raises
    ------
    OSError
        The server cannot listen there.
    """

    def __init__(self, tabs: Tabs, address: str, port: int, hosts: list[str], framed: bool) -> None:
        sockets = bind_sockets(port, address)
        self.tabs, self.port = tabs, port
        router = Router(tabs, hosts, framed)
        self._http = HTTPServer(router, idle_connection_timeout=SILENT, body_timeout=SILENT, max_body_size=MOST_BYTES)
        self._http.add_sockets(sockets)

    async def stop(self) -> None:
        """Close all connections and stop the threads."""
        self._http.stop()
        await self._http.close_all_connections()
        self.tabs.close()


@functools.cache
def page_file() -> str:
    """Return the page, with its styles and scripts."""
    menus = [("x", "x axis"), ("y", "y axis"), *((name, CHOICES[name].label) for name in MENUS)]
    page = Template(_asset("page.html"), autoescape="xhtml_escape", whitespace="all").generate(
        page_css=_asset("page.css"),
        help_html=_asset("help.html"),
        scripts=[_asset(f"{name}.js") for name in SCRIPTS],
        exports=EXPORTS,
        buttons=BUTTONS,
        menus=[*menus, ("start", "initial condition")],
        ticks=[(name, CHOICES[name].label) for name in TICKS],
    )
    return page.decode()


def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")


def packed(parts: dict[str, dict[str, Any]]) -> bytes:
    """Return parts of the page as one websocket message: their text, then their arrays in binary form.

    Notes
    -----
    The first four bytes, little-endian, give the length of the text (JSON), which is padded with spaces. The text maps
    names to contents; ``{"array": [type, place, length]}`` refers to an array of numbers at that place, counted from
    the end of the text. NaN, which JSON does not have, becomes null.
    """
    arrays: list[bytes] = []
    place = 0

    def plain(content: Any) -> Any:
        nonlocal place
        if isinstance(content, bytes):
            content = np.frombuffer(content, np.uint8)
        if isinstance(content, np.ndarray):
            numbers = content.astype(content.dtype.newbyteorder("<"), copy=False).tobytes()
            entry = {"array": [content.dtype.name, place, content.size]}
            arrays.append(numbers.ljust(_aligned(len(numbers)), b"\0"))
            place += len(arrays[-1])
            return entry
        if isinstance(content, np.generic):
            content = content.item()
        if isinstance(content, dict):
            return {key: plain(part) for key, part in content.items()}
        if isinstance(content, (list, tuple)):
            return [plain(part) for part in content]
        return None if isinstance(content, float) and not math.isfinite(content) else content

    text = json.dumps([[name, plain(content)] for name, content in parts.items()], ensure_ascii=False).encode()
    text = text.ljust(_aligned(4 + len(text)) - 4)
    return b"".join([len(text).to_bytes(4, "little"), text, *arrays])


def _aligned(length: int) -> int:
    return -(-length // ALIGNED) * ALIGNED
