"""The commands that work on files, and the one that opens the explorer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from vibroimpact.cli import options as o
from vibroimpact.cli import output, stores
from vibroimpact.cli.errors import REFUSALS, Interrupted, WrongRequest, refusing
from vibroimpact.progress import Meter

if TYPE_CHECKING:
    from vibroimpact.cli.options import Options


@o.with_options(
    o.Option("file", "FILE", "A result saved as .zarr or .nc.", flags=(), required=True),
    o.FIGURE_KIND, o.INDEX, o.LEVEL, o.SWEEP_FILE, o.OVER, o.OUT, o.PICTURE,
)  # fmt: skip
def plot(options: Options) -> None:
    """Draw a saved result, summarise it as text, or save it in another format.

    For example:

      vibroimpact plot map.zarr --index std --level 0.05 --out map.png --size 8x5
      vibroimpact plot diagram.zarr --sweep sweep.zarr --out figure10.svg
      vibroimpact plot map.zarr --kind motion-map --out names.png
      vibroimpact plot curves.zarr --over map.zarr --out plane.png
      vibroimpact plot map.zarr --out map.csv
    """
    output.check_looks(options)
    from vibroimpact.files import load
    from vibroimpact.report import sentences_of

    with refusing(OSError):
        dataset = load(options["file"])
        over = output.read(options, "over")
        lines = sentences_of(dataset)
    if options["out"] is None:
        typer.echo("\n".join(lines))
        return
    output.write(dataset, options, options["out"], over)
    typer.echo(f"wrote {options['out']}")


@o.with_options(o.Option("file", "STORE", "A map written tile by tile, as a .zarr.", flags=(), required=True))
def info(options: Options) -> None:
    """Progress of a stored map, what it cost and found, and how to continue it.

    For example:

      vibroimpact info map.zarr
    """
    typer.echo("\n".join(stores.sentences_of_store(options["file"])))


@o.with_options(
    o.FOLDER,
    o.Option("quick", "", "Coarse grids: the same report in well under a minute.", kind=o.FLAG),
    o.LEVEL, o.OVERWRITE,
)  # fmt: skip
def reproduce(options: Options) -> None:
    """Every figure and statement of Lee's paper, computed again, as one HTML report.

    For example:

      vibroimpact reproduce --out report --quick
    """
    level = output.level_of(options)
    from vibroimpact.studies.lee import run

    with Meter("report", keeps=False) as meter:
        try:
            with refusing(*REFUSALS):
                report = run(
                    options["out"], quick=options["quick"], level=level, overwrite=options["overwrite"], progress=meter
                )
        except KeyboardInterrupt as error:
            raise Interrupted(str(error) or "interrupted") from error
    typer.echo(f"wrote {report} ({meter.seconds:.3g} s)")


@o.with_options(
    o.Option(
        "store", "STORE", "A saved map over two or more parameters, .zarr or .nc, to open.", flags=(), kind=o.PATH
    ),
    o.Option("port", "N", "Port to listen on; 0 is any free port. (default: the first free one from 5006)"),
    o.Option("no_browser", "", "Print the address, and open nothing.", kind=o.FLAG),
    o.Option("host", "ADDRESS", "Address to listen on, for access from the network. (default: 127.0.0.1)"),
)  # fmt: skip
def explore(options: Options) -> None:
    r"""A page in the browser: turn the parameters, see the stability map, click a point, watch its motion.

    Needs the extra \[web]. Nothing is loaded from outside; only this machine
    reaches the page unless --host is given. Ctrl-C ends it.

    For example:

      vibroimpact explore
      vibroimpact explore map.zarr --port 8080 --no-browser
    """
    with refusing(OSError):
        try:
            from vibroimpact.explorer import explore as serve

            serve(
                options["store"],
                port=options.number("port"),
                host=options["host"] or "127.0.0.1",
                browser=not options["no_browser"],
            )
        except ImportError as error:
            raise WrongRequest(str(error)) from error
