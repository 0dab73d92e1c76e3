"""The explorer from a notebook: its server in a thread, its page in a cell."""

from __future__ import annotations

import asyncio
import sys
import threading
from typing import Any

from vibroimpact.explorer import explore as serve
from vibroimpact.explorer import make_server
from vibroimpact.model import Model


def explore(model: Model | None = None, *, height: int = 800) -> Any:
    """Open the explorer on a model: below the cell of a notebook, or in the browser.

    Parameters
    ----------
    model : ImpactOscillator, ImpactSystem or family, optional
        What to show first; None is the oscillator of the paper.
    height : int
        Of the page below a cell, in pixels.

    Returns
    -------
    IPython.display.IFrame or None
        The page, in a notebook. Elsewhere the browser opens it, and the call returns after Ctrl-C.

    Raises
    ------
    ValueError
        The model cannot be shown.
    ImportError
        The extra `[web]` is not installed.

    Notes
    -----
    In a notebook the server runs in a thread until the kernel ends; each call starts one, at a port of its own. It
    listens on the kernel's machine alone, so that the browser has to run there, too.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> vi.explore(vi.family(vi.models.bouncing_ball))  # doctest: +SKIP
    """
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if not hasattr(shell, "kernel"):
        serve(model=model)
        return None
    from IPython.display import IFrame

    return IFrame(address_of(model), width="100%", height=height)


def address_of(model: Model | None) -> str:
    """Start a server in a thread that ends with the process, and return its address."""
    started = threading.Event()
    outcome: list[Any] = []  # the server, which lives as long as the list, and its address; or an error

    async def run() -> None:
        try:
            outcome.extend(make_server(model=model, port=0, framed=True))
        except Exception as error:
            outcome.append(error)
            return
        finally:
            started.set()
        await asyncio.Event().wait()

    threading.Thread(target=lambda: asyncio.run(run()), name="explorer-server", daemon=True).start()
    started.wait()
    if isinstance(outcome[-1], Exception):
        raise outcome[-1]
    return str(outcome[-1])
