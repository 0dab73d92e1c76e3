"""The explorer: a page that shows the stability map, and the motion at the point that is clicked; and its server.

Pages are served on loopback, with nothing loaded from elsewhere.
"""

from __future__ import annotations

import contextlib
import functools
import ipaddress
import logging
import os
import socket
import sys
import webbrowser
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

from vibroimpact.parameters import invalid

if TYPE_CHECKING:
    from bokeh.document import Document
    from bokeh.server.server import Server

    from vibroimpact.explorer.page import ReadyPages
    from vibroimpact.explorer.session import Explorer
    from vibroimpact.explorer.state import View

__all__ = ["Explorer", "View", "explore"]

MOST_PAGES = 64
PORTS = range(5006, 5026)  # tried in turn unless a port is given
MOST_BYTES = 1 << 20  # of a message from a page
KEEP_ALIVE, UNUSED, CHECK = 15_000, 4_000, 2_000  # ms: of a connection; until a closed tab's work stops; between checks
SCRIPTS = ("plots", "motion", "plane", "rows", "page")
_ASSETS = Path(__file__).parent / "assets"


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in (homes := {"Explorer": "session", "View": "state"}):
        return getattr(import_module(f"vibroimpact.explorer.{homes[name]}"), name)
    raise AttributeError(f"module 'vibroimpact.explorer' has no attribute {name!r}")


def explore(
    store: str | os.PathLike[str] | None = None,
    *,
    port: int | None = None,
    host: str = "127.0.0.1",
    browser: bool = True,
) -> None:
    """Serve the explorer until Ctrl-C: a page with the stability map and the motion at the point that is clicked.

    Parameters
    ----------
    store : path, optional
        A stored sweep over two or more parameters to show first: a `.zarr` folder or an `.nc` file.
    port : int, 0 to 65535, optional
        The port to listen on; None is the first free one from 5006, 0 any free one.
    host : str
        The address to listen on. Any address but this machine's own lets others on the network in; a warning says so.
    browser : bool
        Whether to open the page in the browser.

    Raises
    ------
    ValueError
        `store` cannot be shown, or `port` is in use or out of range.
    ImportError
        The extra `[web]` is not installed.

    Notes
    -----
    Nothing is loaded from the internet. Pages share the machine's cores; at most 64 may be open. See docs/explorer.md.
    """
    server, address = make_server(store, port=port, host=host)
    print(f"Explorer at {address} (stop with Ctrl-C)", flush=True)
    if browser:
        server.io_loop.call_later(0.1, lambda: webbrowser.open(address))
    try:
        server.run_until_shutdown()
    except KeyboardInterrupt:
        server.stop()


def make_server(
    store: str | os.PathLike[str] | None = None, *, port: int | None = None, host: str = "127.0.0.1"
) -> tuple[Server, str]:
    """Return a server that listens, and its address; `explore` runs it."""
    try:
        from bokeh.application import Application
        from bokeh.application.handlers.function import FunctionHandler
        from bokeh.server.server import Server
    except ImportError as error:
        raise ImportError(
            "the explorer needs the extra [web]; install it with: pip install 'vibroimpact[web]'"
        ) from error
    from vibroimpact.explorer.address import PRESETS
    from vibroimpact.explorer.page import ReadyPages
    from vibroimpact.explorer.work import Pool

    address = check_host(host)
    view, stored = PRESETS[0].view, None
    if store is not None:
        from vibroimpact.explorer.files import open_study

        view, stored = open_study(store)
    pool = Pool()
    open_pages: set[Document] = set()
    ready = ReadyPages(pool)

    def begin(doc: Document) -> None:
        _begin(doc, view, stored, ready, open_pages)

    logging.getLogger("bokeh").setLevel(logging.ERROR)
    logging.getLogger("tornado.access").setLevel(logging.ERROR)
    fault: OSError | None = None
    for number in _ports(port, address):
        try:
            _try(address, number)
            server = Server(
                {"/": Application(FunctionHandler(begin))},
                port=number,
                address=address,
                allow_websocket_origin=origins(address, number),
                keep_alive_milliseconds=KEEP_ALIVE,
                unused_session_lifetime_milliseconds=UNUSED,
                check_unused_sessions_milliseconds=CHECK,
                websocket_max_message_size=MOST_BYTES,
            )
        except OSError as error:
            fault = error
            continue
        server.start()
        outer = socket.gethostname() if address == "0.0.0.0" else address
        return server, f"http://{'localhost' if is_loopback(address) else outer}:{number}/"
    pool.close()
    tried = f"port {port}" if port is not None else f"ports {PORTS[0]} to {PORTS[-1]}"
    reason = f" ({fault.strerror})" if fault and fault.strerror else ""
    raise ValueError(f"`port`: cannot listen on {tried}{reason}; choose another with --port")


def _begin(doc: Document, view: View, stored: Any, ready: ReadyPages, open_pages: set[Document]) -> None:
    """Fill the document of a tab that was just opened."""
    from vibroimpact.explorer.address import from_query
    from vibroimpact.explorer.state import NAMES, parameter_label

    doc.title = "vibroimpact explorer"
    if len(open_pages) >= MOST_PAGES:
        doc.template = _template("full.html")
        return
    open_pages.add(doc)
    doc.on_session_destroyed(lambda context: open_pages.discard(doc))
    message = ""
    request: Any = doc.session_context.request if doc.session_context is not None else None
    if request is not None and request.arguments:
        try:
            view = from_query(
                urlencode([(k, v.decode("utf-8", "replace")) for k, vs in request.arguments.items() for v in vs])
            )
        except ValueError as error:
            message = f"This link cannot be shown: {error}. The default view is shown instead."
    doc.template = _template("page.html")
    doc.template_variables.update(
        page_css=_asset("page.css"),
        help_html=_asset("help.html"),
        parameters=[(name, parameter_label(name)) for name in NAMES],
        bokeh_version=version("bokeh"),
        **{f"{name}_js": _asset(f"{name}.js") for name in SCRIPTS},
    )
    ready.take().open(doc, view, message, stored)


@functools.cache
def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")


@functools.cache
def _template(name: str) -> Any:
    from bokeh.core.templates import get_env

    return get_env().from_string(_asset(name))


def is_loopback(address: str) -> bool:
    """Whether only this machine reaches an address."""
    return ipaddress.ip_address(address).is_loopback


def check_host(host: str) -> str:
    """Return the address to listen on; warn if others can reach it."""
    try:
        address = "127.0.0.1" if host == "localhost" else str(ipaddress.ip_address(socket.gethostbyname(host)))
    except (OSError, ValueError) as error:
        raise invalid("host", host, "a host name or an IPv4 address", "omit it to serve this machine only") from error
    if not is_loopback(address):
        print(
            f"Warning: with --host {host} anyone who reaches this machine on the network can open the explorer and use "
            "its processors; there is no password",
            file=sys.stderr,
            flush=True,
        )
    return address


def origins(address: str, port: int) -> list[str]:
    """Return the pages whose scripts may talk to the server: its own, under each of its names."""
    names = {"localhost", "127.0.0.1", address}
    if not is_loopback(address):
        names |= {socket.gethostname(), socket.getfqdn()}
        with contextlib.suppress(OSError):
            names |= set(socket.gethostbyname_ex(socket.gethostname())[2])
    return sorted(f"{name}:{port}" for name in names if name != "0.0.0.0")


def _try(address: str, port: int) -> None:
    """Raise `OSError` if the server cannot listen on a port."""
    with socket.socket() as tried:
        if sys.platform != "win32":
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        tried.bind((address, port))


def _ports(port: int | None, address: str) -> Iterable[int]:
    if port is None:
        return PORTS
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
        raise invalid("port", port, "a whole number from 0 to 65535", "5006 is usual")
    if port == 0:
        with socket.socket() as free:
            free.bind((address, 0))
            return (free.getsockname()[1],)
    return (port,)
