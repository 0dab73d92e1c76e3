"""The commands that compute motions, sections, diagrams and maps."""

from __future__ import annotations

import typer

from vibroimpact.cli import options as o


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


def diagram(
    context: typer.Context,
    study: o.StudyFile = None,
    parameter: o.Parameters = None,
    start: o.Start = None,
    x: o.X = None,
    section: o.DiagramSection = None,
    direction: o.Direction = None,
    indices: o.Indices = None,
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
    index: o.Index = None,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Bifurcation diagram: how the settled motion changes with one parameter.

    For example:

      vibroimpact diagram --x omega=0.01:5:1000 --out diagram.png
      vibroimpact diagram --x omega=2:3:400 --direction up --sample-impacts 200
      vibroimpact diagram --x gap=-0.5:0.5:200 -p w=0.9 --section stroboscopic
      vibroimpact diagram --x w=2:3:400 --indices std --index std --out std.png
    """
    from vibroimpact.cli.compute import sweep

    sweep("bifurcation_diagram", context.params)


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
    cluster: o.Cluster = None,
    tile: o.Tile = None,
    refine: o.Refine = None,
    out: o.Out = None,
    overwrite: o.Overwrite = False,
    figure: o.Figure = None,
    index: o.Index = None,
    level: o.Level = None,
    size: o.Size = None,
    dpi: o.Dpi = None,
) -> None:
    """Stability map: an index of the impacts over one, two or more parameters.

    Axes given here take the place of all those in the study file. Ctrl-C
    keeps what is finished; a map that goes to a .zarr is written tile by
    tile, and the same command goes on where it stopped.

    For example:

      vibroimpact map --x omega=0.025:5:200 --y mass=0.1:5:200 --out map.zarr
      vibroimpact map --x w=1:3:99 --y r=0.1:0.9:50 --indices max_velocity
      vibroimpact map --x w=1:3:99 --y m=1:2:99 --figure motion-map -o names.png
      vibroimpact map study.toml -p damping=0.02 --workers 4
    """
    from vibroimpact.cli.compute import sweep

    sweep("parameter_map", context.params)
