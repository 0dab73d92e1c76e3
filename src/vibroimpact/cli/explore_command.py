"""The command that opens the explorer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

_Store = Annotated[
    Path | None,
    typer.Argument(metavar="STORE", help="A saved map over two or more parameters, .zarr or .nc, to begin with."),
]
_Port = Annotated[
    int | None,
    typer.Option(
        "--port", metavar="N", help="Where to listen; 0 is any free port. (default: the first free one from 5006)"
    ),
]
_Host = Annotated[
    str,
    typer.Option(
        "--host", metavar="ADDRESS", help="Let others on the network in: listen at this address of the machine."
    ),
]
_NoBrowser = Annotated[bool, typer.Option("--no-browser", help="Print the address, and open nothing.")]


def explore(
    store: _Store = None,
    port: _Port = None,
    no_browser: _NoBrowser = False,
    host: _Host = "127.0.0.1",
) -> None:
    r"""A page in the browser: turn the seven numbers, see the stability map, click a point, watch its motion.

    Needs the extra \[web]. Nothing is loaded from outside; only this machine
    reaches the page unless --host is given. Ctrl-C ends it.

    For example:

      vibroimpact explore
      vibroimpact explore map.zarr --port 8080 --no-browser
    """
    from vibroimpact.cli.request import WrongRequest, asked

    with asked(OSError):
        try:
            from vibroimpact.explorer import explore as serve

            serve(store, port=port, host=host, browser=not no_browser)
        except ImportError as error:
            raise WrongRequest(str(error)) from error
