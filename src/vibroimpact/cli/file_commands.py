"""The commands that work on files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.cli import options as o


def plot(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A result saved as .zarr or .nc.")],
    figure: o.PlotKind = None,
    index: o.Index = None,
    level: o.Level = None,
    sweep: o.SweepFile = None,
    over: o.OverMap = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Draw a saved result, tell it in words, or save it in another format.

    For example:

      vibroimpact plot map.zarr --index std --level 0.05 --out map.png --size 8x5
      vibroimpact plot diagram.zarr --sweep sweep.zarr --out figure10.svg
      vibroimpact plot map.zarr --kind motion-map --out names.png
      vibroimpact plot curves.zarr --over map.zarr --out plane.png
      vibroimpact plot map.zarr --out map.csv
    """
    from vibroimpact.cli.saved import show

    show(context.params)


def info(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(metavar="STORE", help="A map written tile by tile, as a .zarr.")],
) -> None:
    """How far a stored map is, what it cost and found, and how to go on.

    For example:

      vibroimpact info map.zarr
    """
    from vibroimpact.cli.stored import info as tell

    tell(context.params)


def reproduce(
    context: typer.Context,
    out: o.Folder,
    quick: Annotated[
        bool, typer.Option("--quick", help="Coarse grids: the same report in well under a minute.")
    ] = False,
    level: o.Level = None,
    overwrite: o.Overwrite = False,
) -> None:
    """Every figure and statement of Lee's paper, computed again, as one HTML report.

    For example:

      vibroimpact reproduce --out report --quick
    """
    from vibroimpact.cli.saved import reproduce as compute

    compute(context.params)
