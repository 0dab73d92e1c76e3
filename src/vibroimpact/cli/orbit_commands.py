"""The commands that find orbits, follow them, and judge what they mean for a design."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.cli import options as o


def orbit(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    n_periods: o.OrbitPeriods = None,
    n_impacts: o.OrbitImpacts = None,
    near: o.Near = None,
    out: o.OrbitOut = None,
    overwrite: o.Overwrite = False,
) -> None:
    """Periodic orbits of one name, stable or not: impacts, Floquet multipliers.

    For example:

      vibroimpact orbit -p omega=2.0
      vibroimpact orbit -p omega=0.9 --impacts 2 --out orbit.json
      vibroimpact orbit -p omega=0.1 --impacts -1
    """
    from vibroimpact.cli.follow import orbit as compute

    compute(context.params)


def follow(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    x: o.Span = None,
    n_periods: o.OrbitPeriods = None,
    n_impacts: o.OrbitImpacts = None,
    near: o.Near = None,
    doublings: o.Doublings = None,
    step: o.Step = None,
    workers: o.Workers = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    diagram: o.OverDiagram = False,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Follow the orbits of one name along a parameter, through folds; tell where they change.

    The orbits are looked for at -p; the range holds that value. Ctrl-C keeps
    what is finished.

    For example:

      vibroimpact continue -p omega=2.0 --x omega=0.8:3
      vibroimpact continue -p w=2.6 --x w=2:3 --doublings 2 -o branch.zarr
      vibroimpact continue -p w=2.6 --x w=2:3:400 --diagram --out branch.png
      vibroimpact continue -p w=0.9 --impacts 2 --x gap=-0.5:0.5
    """
    from vibroimpact.cli.follow import follow as compute

    compute(context.params)


def boundary(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    x: o.SpanX = None,
    y: o.SpanY = None,
    kinds: o.Kinds = None,
    periods_list: o.PeriodsList = None,
    n_impacts: o.OrbitImpacts = None,
    near: o.Near = None,
    lines: o.Lines = None,
    step: o.Step = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    over: o.OverMap = None,
    index: o.Index = None,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Exact curves in a plane of two parameters on which motions fold, double, graze or cease to stick.

    Of orbits with one impact all curves that cross a grid of lines are found;
    of others (--impacts) those that the orbit at -p meets along --x.
    Ctrl-C keeps what is finished.

    For example:

      vibroimpact boundary --x omega=0.025:5 --y mass=0.1:5 --out curves.zarr
      vibroimpact boundary --x w=2:3 --y r=0.5:0.9 --kind fold,grazing
      vibroimpact boundary --x w=1:5 --y m=0.1:5 --over map.zarr -o plane.png
      vibroimpact boundary -p w=0.9 --impacts 2 --x w=0.6:1.1 --y r=0.5:0.9
    """
    from vibroimpact.cli.plane import boundary as compute

    compute(context.params)


def basins(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    x: o.StartX = None,
    y: o.StartY = None,
    phase: o.StartPhase = None,
    transient_impacts: o.TransientImpacts = None,
    sample_impacts: o.BasinImpacts = None,
    backend: o.Backend = None,
    chatter: o.Chatter = None,
    workers: o.Workers = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Which attractors coexist, and which starts lead to which.

    Ctrl-C keeps what is finished.

    For example:

      vibroimpact basins -p w=3 --x phase=0:1:400 --y velocity=0:3:400 -o b.png
      vibroimpact basins --x displacement=-3:0:200 --y velocity=-2:2:200
    """
    from vibroimpact.cli.judge import basins as compute

    compute(context.params)


def describe(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    vary: o.Vary = None,
    within: o.Within = None,
    workers: o.Workers = None,
    json: o.Json = False,
) -> None:
    """What it does, how hard it hits, how far it is from doing something else, and what would calm it.

    For example:

      vibroimpact describe -p omega=2.8
      vibroimpact describe study.toml --vary omega,gap --json
    """
    from vibroimpact.cli.judge import describe as compute

    compute(context.params)


def compare(
    context: typer.Context,
    first: Annotated[Path, typer.Argument(metavar="A.toml", help="The study file of one design.")],
    second: Annotated[Path, typer.Argument(metavar="B.toml", help="That of the other.")],
    parameter: o.Parameters = None,
    vary: o.Vary = None,
    within: o.Within = None,
    workers: o.Workers = None,
    json: o.Json = False,
    out: o.CompareOut = None,
    overwrite: o.Overwrite = False,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Two designs side by side: a table of all that is told of each, and their motions as figures.

    -p sets a parameter of both.

    For example:

      vibroimpact compare old.toml new.toml
      vibroimpact compare old.toml new.toml --out both.png
    """
    from vibroimpact.cli.judge import compare as compute

    compute(context.params)
