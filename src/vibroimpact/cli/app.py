"""The sub-commands and their help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.cli import options as o

app = typer.Typer(
    name="vibroimpact",
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        import vibroimpact

        typer.echo(f"vibroimpact {vibroimpact.__version__}")
        raise typer.Exit


def _help(context: typer.Context, wanted: bool) -> None:
    if wanted:
        typer.echo(context.get_help())
        raise typer.Exit


Version = Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Tell the version.")]
Help = Annotated[bool, typer.Option("-h", "--help", callback=_help, is_eager=True, help="Show this page.")]


# A --help of our own: typer's, when absent, is coerced by way of pydantic, whose import takes 0.1 s.
@app.callback(invoke_without_command=True, add_help_option=False)
def root(
    context: typer.Context,
    version: Version = False,
    wanted: Help = False,
) -> None:
    """Impact oscillators: does yours settle, stick or go chaotic, and how hard does it hit.

    Seven numbers describe it, in SI units: mass m, damping c, stiffness k,
    driving amplitude f and frequency w, restitution r and gap g. Commands
    take them as -p NAME=VALUE or from a study file, and tell their result
    in words or write it to --out.

    For example:

      vibroimpact section -p omega=0.9
      vibroimpact diagram --x omega=0.01:5:1000 --out diagram.png
      vibroimpact map --x omega=0.025:5:200 --y m=0.1:5:200 --out map.zarr
      vibroimpact plot map.zarr --out map.png
    """
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command()
def simulate(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    start: o.Start = None,
    periods: o.Periods = None,
    samples_per_period: o.SamplesPerPeriod = None,
    backend: o.Backend = None,
    time_step: o.TimeStep = None,
    chatter: o.Chatter = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    figure: o.Figure = None,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Follow the mass in time from its start.

    For example:

      vibroimpact simulate -p omega=2.8 --periods 30
      vibroimpact simulate -p w=0.9 --start -1,0,0 --out orbit.csv
      vibroimpact simulate -p w=0.9 --figure phase-portrait --out portrait.png
    """
    from vibroimpact.cli.compute import orbit

    orbit("simulate", context.params)


@app.command()
def section(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    start: o.Start = None,
    section: o.SectionKind = None,
    transient_impacts: o.TransientImpacts = None,
    sample_impacts: o.SampleImpacts = None,
    transient_periods: o.TransientPeriods = None,
    sample_periods: o.SamplePeriods = None,
    phase: o.Phase = None,
    backend: o.Backend = None,
    time_step: o.TimeStep = None,
    chatter: o.Chatter = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Impact map or Poincare map of the settled motion, and the name of that motion.

    For example:

      vibroimpact section -p omega=0.9
      vibroimpact section -p frequency=0.45 --kind stroboscopic --out poincare.png
    """
    from vibroimpact.cli.compute import section as compute

    compute(context.params)


@app.command()
def diagram(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    start: o.Start = None,
    x: o.X = None,
    section: o.DiagramSection = None,
    direction: o.Direction = None,
    transient_impacts: o.TransientImpacts = None,
    sample_impacts: o.SampleImpacts = None,
    transient_periods: o.TransientPeriods = None,
    sample_periods: o.SamplePeriods = None,
    phase: o.Phase = None,
    backend: o.Backend = None,
    time_step: o.TimeStep = None,
    chatter: o.Chatter = None,
    workers: o.Workers = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Bifurcation diagram: how the settled motion changes with one parameter.

    For example:

      vibroimpact diagram --x omega=0.01:5:1000 --out diagram.png
      vibroimpact diagram --x omega=2:3:400 --direction up --sample-impacts 200
      vibroimpact diagram --x gap=-0.5:0.5:200 -p w=0.9 --section stroboscopic
    """
    from vibroimpact.cli.compute import sweep

    sweep("bifurcation_diagram", context.params)


@app.command(name="map")
def parameter_map(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    start: o.Start = None,
    x: o.X = None,
    y: o.Y = None,
    axis: o.MoreAxes = None,
    indices: o.Indices = None,
    transient_impacts: o.TransientImpacts = None,
    sample_impacts: o.SampleImpacts = None,
    backend: o.Backend = None,
    time_step: o.TimeStep = None,
    chatter: o.Chatter = None,
    every_impact: o.EveryImpact = False,
    workers: o.Workers = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    figure: o.Figure = None,
    index: o.Index = None,
    level: o.Level = None,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Stability map: an index of the impacts over one, two or more parameters.

    Axes given here take the place of all those in the study file.
    Ctrl-C keeps what is finished.

    For example:

      vibroimpact map --x omega=0.025:5:200 --y mass=0.1:5:200 --out map.zarr
      vibroimpact map --x w=1:3:99 --y r=0.1:0.9:50 --indices max_velocity
      vibroimpact map study.toml -p damping=0.02 --workers 4
    """
    from vibroimpact.cli.compute import sweep

    sweep("parameter_map", context.params)


@app.command()
def plot(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A result saved as .zarr or .nc.")],
    figure: o.PlotKind = None,
    index: o.Index = None,
    level: o.Level = None,
    sweep: o.SweepFile = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Draw a saved result, tell it in words, or save it in another format.

    For example:

      vibroimpact plot map.zarr --index std --level 0.05 --out map.png --size 8x5
      vibroimpact plot diagram.zarr --sweep sweep.zarr --out figure10.svg
      vibroimpact plot map.zarr --out map.csv
    """
    from vibroimpact.cli.saved import show

    show(context.params)


@app.command()
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
