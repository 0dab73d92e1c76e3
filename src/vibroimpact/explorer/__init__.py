"""The explorer and its server: a page with the stability map and the motion at the point clicked.

By default pages are served on loopback only; nothing is loaded from elsewhere.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import ipaddress
import logging
import os
import socket
import sys
import webbrowser
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from vibroimpact.parameters import MissingExtra, invalid, to_install
from vibroimpact.progress import wait_for_others

if TYPE_CHECKING:
    from vibroimpact.explorer.server import Server
    from vibroimpact.explorer.session import Explorer
    from vibroimpact.explorer.state import View
    from vibroimpact.model import Model

__all__ = ["Explorer", "View", "explore"]

PORTS = range(5006, 5026)  # tried in order unless a port is given


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in (homes := {"Explorer": "session", "View": "state"}):
        return getattr(import_module(f"vibroimpact.explorer.{homes[name]}"), name)
    raise AttributeError(f"module 'vibroimpact.explorer' has no attribute {name!r}")


def explore(
    store: str | os.PathLike[str] | None = None,
    *,
    model: Model | None = None,
    name: str = "",
    port: int | None = None,
    host: str = "127.0.0.1",
    browser: bool = True,
) -> None:
    """Serve the explorer until Ctrl-C: a page with the stability map and the motion at the point clicked.

    Parameters
    ----------
    store : path, optional
        A stored sweep over two or more parameters to show first: a `.zarr` folder or an `.nc` file.
    model : ImpactOscillator, ImpactSystem or family, optional
        The model to show first; the default is one mass with one stop. With `store`, the model of the stored sweep,
        which is required if it is your own family.
    name : str
        The name of the model in links; `str(model)` by default.
    port : int, 0 to 65535, optional
        The port to listen on; None means the first free port from 5006, 0 any free port.
    host : str
        The address to listen on. With an address that is not local to this machine, others on the network have access;
        a warning says so.
    browser : bool
        Whether to open the page in the browser.

    Raises
    ------
    ValueError
        `store` or `model` cannot be shown, or `port` is in use or out of range.
    ImportError
        The extra `[web]` is not installed.

    Notes
    -----
    Nothing is loaded from the internet. All pages share the machine's cores; at most 64 pages can be open. See
    docs/guide/explorer.md.
    """
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_serve(browser, store, model=model, name=name, port=port, host=host))


async def _serve(browser: bool, store: str | os.PathLike[str] | None, **options: Any) -> None:
    server, address = make_server(store, **options)
    print(f"Explorer at {address} (stop with Ctrl-C)", flush=True)
    wait_for_others()
    if browser:
        asyncio.get_running_loop().call_later(0.1, webbrowser.open, address)
    try:
        await asyncio.Event().wait()
    finally:
        await server.stop()


def make_server(
    store: str | os.PathLike[str] | None = None,
    *,
    model: Model | None = None,
    name: str = "",
    port: int | None = None,
    host: str = "127.0.0.1",
    framed: bool = False,
) -> tuple[Server, str]:
    """Return a server that listens in the running loop, and its address; notebooks may frame its page if `framed`."""
    if importlib.util.find_spec("tornado") is None:
        raise MissingExtra(f"the explorer needs Tornado, which is not installed; {to_install('web')} installs it")
    from vibroimpact.explorer.address import PRESETS
    from vibroimpact.explorer.models import Find, find_ready_made, open_model
    from vibroimpact.explorer.server import Server, Tabs

    address = check_host(host)
    view, stored = PRESETS[0].view, None
    find: Find = find_ready_made
    if store is not None:
        from vibroimpact.explorer.stored import open_study

        view, stored, find = open_study(store, model, name)
    elif model is not None:
        view, find = open_model(model, name)
    tabs = Tabs(view, stored, find)
    logging.getLogger("tornado.access").setLevel(logging.ERROR)
    fault: OSError | None = None
    for number in _ports(port, address):
        try:
            _check_free(address, number)
            server = Server(tabs, address, number, origins(address, number), framed)
        except OSError as error:
            fault = error
            continue
        outer = socket.gethostname() if address == "0.0.0.0" else address
        return server, f"http://{'localhost' if is_loopback(address) else outer}:{number}/"
    tabs.close()
    ports = f"port {port}" if port is not None else f"ports {PORTS[0]} to {PORTS[-1]}"
    reason = f" ({fault.strerror})" if fault and fault.strerror else ""
    raise ValueError(f"`port`: cannot listen on {ports}{reason}; choose another with --port")


def is_loopback(address: str) -> bool:
    """Whether an address can be reached only from this machine."""
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
    """Return the origins whose scripts may connect to the server: its own pages, under each of its names."""
    names = {"localhost", "127.0.0.1", address}
    if not is_loopback(address):
        names |= {socket.gethostname(), socket.getfqdn()}
        with contextlib.suppress(OSError):
            names |= set(socket.gethostbyname_ex(socket.gethostname())[2])
    return sorted(f"{name}:{port}" for name in names if name != "0.0.0.0")


def _check_free(address: str, port: int) -> None:
    """Raise `OSError` if the server cannot listen on a port; Tornado itself would leave its socket open."""
    with socket.socket() as probe:
        if sys.platform != "win32":
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((address, port))


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
