"""What a browser reaches: the page, which costs nothing to serve, its scripts, and the websocket that begins work."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import functools
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bokeh.application import Application
from bokeh.core.templates import get_env
from bokeh.protocol.exceptions import ProtocolError
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.views.ws import WSHandler
from bokeh.util.token import generate_jwt_token, generate_session_id, get_session_id
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.netutil import bind_sockets
from tornado.web import ErrorHandler, RequestHandler

from vibroimpact.explorer.address import from_query
from vibroimpact.explorer.controls import EXPORTS, TICKS
from vibroimpact.explorer.models import Find, only_known
from vibroimpact.explorer.page import ROOTS, Page
from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.point import compute_point
from vibroimpact.explorer.state import CHOICES, View
from vibroimpact.explorer.work import Pool

if TYPE_CHECKING:
    from bokeh.protocol.message import Message
    from bokeh.server.session import ServerSession
    from tornado.httputil import HTTPServerRequest

MOST_PAGES = 64
FULL = f"{MOST_PAGES} pages of this explorer are open, and no more may be. Close one, then reload this page."
MOST_BYTES = 1 << 20  # of a message or a request from a browser
SILENT = 10.0  # s after which a connection that asks for nothing is closed
KEEP_ALIVE, UNUSED, CHECK = 15_000, 4_000, 1_000  # ms: of a websocket; until it must have joined; between clean-ups
LEFT = 3.0  # s after which a tab that left has been cleaned up
NOTEBOOKS = "http://localhost:* http://127.0.0.1:* vscode-webview:"  # whose pages these may be
SCRIPTS = ("plots", "motion", "plane", "picture", "rows", "page")
TOKEN = "@token@"  # where it comes in the page
_ASSETS = Path(__file__).parent / "assets"


class Tabs:
    """The open tabs, and the pages that they show.

    Parameters
    ----------
    view : View
        What a tab shows whose address names nothing.
    stored, find : callable, optional
        As for `Explorer`.
    framed : bool
        Whether notebooks of this machine may show the page in a frame.
    """

    def __init__(
        self,
        view: View,
        stored: Callable[[View], Plane | None] | None = None,
        find: Find = only_known,
        framed: bool = False,
    ) -> None:
        self._view, self._stored, self._find, self.framed = view, stored, find, framed
        self._pool = Pool()
        self.open: set[object] = set()  # their websockets
        self._maker = ThreadPoolExecutor(1, thread_name_prefix="explorer-page")  # the server answers meanwhile
        compute_point(view)  # compiles or loads what the first click needs

    async def enter(self, tab: object) -> Page | None:
        """Return a page for a tab that has joined; None if too many are open, or if it has left meanwhile."""
        if len(self.open) >= MOST_PAGES:
            return None
        self.open.add(tab)
        page = await asyncio.wrap_future(self._maker.submit(Page, self._pool))
        if tab in self.open:
            return page
        return None

    def fill(self, page: Page, query: str, session: ServerSession) -> None:
        """Give a page its document, and the view that its address names."""
        view, message = self._view, ""
        if query:
            try:
                view = from_query(query, self._find)
            except ValueError as error:
                message = f"This link cannot be shown: {error}. The default view is shown instead."
        in_turn = functools.partial(IOLoop.current().add_callback, session.with_document_locked)
        page.open(session.document, in_turn, view, message, self._stored, self._find)

    def leave(self, tab: object) -> None:
        """Forget a tab; after the last one give memory back that arrays had."""
        self.open.discard(tab)
        IOLoop.current().call_later(LEFT, self._tidy)

    def _tidy(self) -> None:
        if not self.open and sys.platform == "linux":
            with contextlib.suppress(AttributeError, OSError):  # a C library without it
                ctypes.CDLL(None).malloc_trim(0)

    def close(self) -> None:
        """Let the threads end."""
        self._maker.shutdown(cancel_futures=True)
        self._pool.close()


class Socket(WSHandler):  # type: ignore[misc]
    """The websocket of a tab. Its page is made when the browser speaks, and closed as soon as it leaves."""

    def initialize(self, tabs: Tabs, **context: Any) -> None:
        """Take what the router knows."""
        super().initialize(**context)
        self._tabs = tabs
        self._page: Page | None = None

    async def _async_open(self, token: str) -> None:
        """Join a session of one's own: whoever joins one is sent all that changes in it."""
        if get_session_id(token) in {session.id for session in self.application_context.sessions}:
            self.close(1008, "reload this page")
        else:
            await super()._async_open(token)

    async def on_message(self, fragment: str | bytes) -> None:
        """Take a part of a message, of who has joined."""
        if self.connection is None:
            self.close(1008, "reload this page")
        else:
            await super().on_message(fragment)

    async def _handle(self, message: Message[Any]) -> Any:
        """Answer a message; the first one has to ask for the page."""
        if self._page is not None:
            return await super()._handle(message)
        session = self.connection.session
        if message.msgtype != "PULL-DOC-REQ":
            self.close(1008, "reload this page")
            return None
        self._page = page = await self._tabs.enter(self)
        if page is None:
            await self._schedule(self.connection.error(message, FULL))
            self.close(1013, "too many pages")
            return None
        await session.with_document_locked(self._fill, page, session)
        await self._schedule(await super()._handle(message))
        page.explorer.start()  # not before the browser has the document: what is sent until then would be lost
        return None

    def _fill(self, page: Page, session: ServerSession) -> None:
        """Put a page into the document, which the browser gets as a whole."""
        session.unsubscribe(self.connection)
        self._tabs.fill(page, self.request.query, session)
        session.subscribe(self.connection)

    def on_close(self) -> None:
        """End the work for a tab that was closed."""
        session = None if self.connection is None else self.connection.session
        super().on_close()
        self._tabs.leave(self)
        if self._page is not None:
            self._page.explorer.close()
        if session is not None:
            session.request_expiration()

    def log_exception(self, *error: Any) -> None:
        """Say nothing of a browser that speaks otherwise than the page's script: its websocket is closed."""
        if not isinstance(error[1], ProtocolError):
            super().log_exception(*error)


class PageFile(RequestHandler):
    """The page: the same file for all, but for the token of the session that its websocket may begin."""

    def initialize(self, parts: tuple[str, str], framed: bool) -> None:
        """Take the file, without the token, and whether notebooks may frame it."""
        self._parts, self._frames = parts, NOTEBOOKS if framed else "'none'"

    def get(self) -> None:
        """Hand it out; nothing is computed or kept for it."""
        before, after = self._parts
        self.set_header("Cache-Control", "no-store")
        self.set_header(
            "Content-Security-Policy", f"frame-ancestors {self._frames}"
        )  # else any site could open it unseen
        self.set_header("X-Content-Type-Options", "nosniff")
        self.finish(f"{before}{generate_jwt_token(generate_session_id())}{after}")

    def compute_etag(self) -> None:
        """Return no tag: no two pages are the same."""


class Refused(RequestHandler):
    """The answer to a Host that is not this machine's: a page of another site that says it were from here."""

    def initialize(self, hosts: list[str]) -> None:
        """Take the names of this machine."""
        self._hosts = hosts

    def prepare(self) -> None:
        """Refuse whatever is requested."""
        self.set_status(421)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"This explorer is reached at {' or '.join(f'http://{host}/' for host in self._hosts)} only.\n")


class Router(BokehTornado):  # type: ignore[misc]
    """Leads requests for the page, its websocket and Bokeh's scripts to who answers; nothing else is reached.

    Parameters
    ----------
    tabs : Tabs
        Who opens pages.
    hosts : list of str
        Names and port of this machine, as browsers name them; pages of others may not open the websocket.
    **options
        Of `BokehTornado`.
    """

    def __init__(self, tabs: Tabs, hosts: list[str], **options: Any) -> None:
        super().__init__(Application(), extra_websocket_origins=hosts, **options)
        self._hosts, self.tabs, self._parts = hosts, tabs, page_file()

    def find_handler(self, request: HTTPServerRequest, **options: Any) -> Any:
        """Return who answers a request."""
        answer = functools.partial(self.get_handler_delegate, request)
        if request.host.lower() not in self._hosts:
            return answer(Refused, {"hosts": self._hosts})
        if request.path == "/":
            return answer(PageFile, {"parts": self._parts, "framed": self.tabs.framed})
        if request.path == "/ws":
            context = self.applications["/"]
            return answer(Socket, {"application_context": context, "bokeh_websocket_path": "/ws", "tabs": self.tabs})
        if request.path.startswith("/static/js/"):
            return super().find_handler(request, **options)
        return answer(ErrorHandler, {"status_code": 404})


def listen(tabs: Tabs, address: str, port: int, hosts: list[str]) -> BaseServer:
    """Return a server that listens.

    Raises
    ------
    OSError
        It cannot listen there.
    """
    sockets = bind_sockets(port, address)
    router = Router(
        tabs,
        hosts,
        keep_alive_milliseconds=KEEP_ALIVE,
        unused_session_lifetime_milliseconds=UNUSED,
        check_unused_sessions_milliseconds=CHECK,
        websocket_max_message_size_bytes=MOST_BYTES,
    )
    http = HTTPServer(router, idle_connection_timeout=SILENT, body_timeout=SILENT, max_body_size=MOST_BYTES)
    http.add_sockets(sockets)
    server = BaseServer(IOLoop.current(), router, http)
    server.start()
    return server


def page_file() -> tuple[str, str]:
    """Return what comes before and after the token in the page."""
    variables = {f"{name}_js": _asset(f"{name}.js") for name in SCRIPTS}
    page = (
        get_env()
        .from_string(_asset("page.html"))
        .render(
            page_css=_asset("page.css"),
            help_html=_asset("help.html"),
            exports=EXPORTS,
            ticks=[(name, CHOICES[name].label) for name in TICKS],
            bokeh_version=version("bokeh"),
            roots=list(ROOTS),
            token=TOKEN,
            **variables,
        )
    )
    before, _, after = page.partition(TOKEN)
    return before, after


def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")
