"""The explorer in a notebook: its server runs in a thread, its page is shown in a cell."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

from vibroimpact.explorer import explore as serve
from vibroimpact.explorer import make_server
from vibroimpact.model import Model
from vibroimpact.progress import in_notebook


def explore(model: Model | None = None, *, height: int = 800) -> Any:
    """Open the explorer for a model, below the cell of a notebook or in the browser.

    Parameters
    ----------
    model : ImpactOscillator, ImpactSystem or family, optional
        The model to show first; None means the oscillator of the paper.
    height : int
        Height of the page below a cell, in pixels.

    Returns
    -------
    IPython.display.IFrame or None
        In a notebook, the page. Otherwise None: the browser opens the page, and the call returns after Ctrl-C.

    Raises
    ------
    ValueError
        The model cannot be shown.
    ImportError
        The extra `[web]` is not installed.

    Notes
    -----
    In a notebook, each call starts a server on its own port, in a thread that runs until the kernel ends. It listens
    only on the kernel's machine, so the browser must run on the same machine.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> vi.explore(vi.family(vi.models.bouncing_ball))  # doctest: +SKIP
    """
    if not in_notebook():
        serve(model=model)
        return None
    from IPython.display import IFrame

    return IFrame(address_of(model), width="100%", height=height)


def address_of(model: Model | None) -> str:
    """Start a server in a thread that ends with the process, and return its address."""
    started = threading.Event()
    outcome: list[Any] = []  # the server, kept alive by the list, and its address; or an error

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
