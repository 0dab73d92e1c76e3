"""The commands that compute motions, sections, diagrams and maps."""

from __future__ import annotations

from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli import Interrupted, WrongRequest, files, output, refusing
from vibroimpact.cli import options as o
from vibroimpact.progress import Meter

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.cli.options import Options
    from vibroimpact.cli.study import Study


@o.with_options(o.MODEL, o.START, o.DURATION, o.ENGINE, o.OUT, o.FIGURE, o.PICTURE)
def simulate(options: Options) -> None:
    """Compute the motion in time from its initial conditions.

    For example:

      vibroimpact simulate -p omega=2.8 --periods 30
      vibroimpact simulate -p w=0.9 --start -1,0,0 --out orbit.csv
      vibroimpact simulate -p w=0.9 --figure phase-portrait --out portrait.png
    """
    study = options.study()
    _motion("simulate", study, options)
    if options["out"] is None:
        from vibroimpact.report import sentences_of

        typer.echo(f"settles to: {sentences_of(_call('impact_section', study))[0]}")


@o.with_options(o.MODEL, o.START, o.SECTION_KIND, o.IMPACTS, o.PERIODS, o.ENGINE, o.OUT, o.PICTURE)
def section(options: Options) -> None:
    """Impact map or Poincare map of the settled motion, and the name of that motion.

    For example:

      vibroimpact section -p omega=0.9
      vibroimpact section -p frequency=0.45 --kind stroboscopic --out poincare.png
    """
    study = options.study()
    _motion(f"{study.given.get('section', 'impact')}_section", study, options)


def _motion(function: str, study: Study, options: Options) -> None:
    output.check(options, function)
    began = perf_counter()
    with refusing():
        dataset = _call(function, study)
    output.hand_on(dataset, options, perf_counter() - began)


@o.with_options(
    o.MODEL, o.START, o.X, o.SECTION, o.DIRECTION, o.INDICES, o.IMPACTS, o.PERIODS, o.ENGINE, o.WORKERS, o.OUT,
    o.INDEX, o.PICTURE,
)  # fmt: skip
def diagram(options: Options) -> None:
    """Bifurcation diagram: how the settled motion changes with one parameter.

    For example:

      vibroimpact diagram --x omega=0.01:5:1000 --out diagram.png
      vibroimpact diagram --x omega=2:3:400 --direction up --sample-impacts 200
      vibroimpact diagram --x gap=-0.5:0.5:200 -p w=0.9 --section stroboscopic
      vibroimpact diagram --x w=2:3:400 --indices std --index std --out std.png
    """
    study = options.study()
    if len(study.axes) != 1:
        raise WrongRequest(f"a diagram needs exactly one axis, got {_listed(study)}; for example --x omega=0.025:5:200")
    output.check(options, "bifurcation_diagram", study.given.get("indices", ()), 1)
    _sweep("bifurcation_diagram", study, options)


@o.with_options(
    o.MODEL, o.START, o.X, o.Y, o.MORE_AXES, o.INDICES, o.IMPACTS, o.ENGINE, o.EVERY_IMPACT, o.WORKERS, o.CLUSTER,
    o.TILE, o.REFINE, o.OUT, o.FIGURE, o.INDEX, o.LEVEL, o.PICTURE,
)  # fmt: skip
def parameter_map(options: Options) -> None:
    """Stability map: an index of the impacts over one, two or more parameters.

    Axes given here replace all axes of the study file. Ctrl-C keeps what is
    finished; a map that goes to a .zarr is written tile by tile, and the same
    command continues an interrupted one.

    For example:

      vibroimpact map --x omega=0.025:5:200 --y mass=0.1:5:200 --out map.zarr
      vibroimpact map --x w=1:3:99 --y r=0.1:0.9:50 --indices max_velocity
      vibroimpact map --x w=1:3:99 --y m=1:2:99 --figure motion-map -o names.png
      vibroimpact map study.toml -p damping=0.02 --workers 4
    """
    needed = output.NEEDS.get(options["figure"] or "", ()) if output.is_figure(options) else ()
    if needed and options["indices"] is None:  # those the figure is drawn from
        options = options.with_values(indices=",".join(needed))
    study = options.study()
    if not study.axes:
        raise WrongRequest("a map needs an axis; for example --x omega=0.025:5:200")
    stored = files.is_store(options)
    resumed = stored and files.store_exists(options)
    if not resumed:
        output.check(options, "parameter_map", study.given.get("indices", ("std",)), len(study.axes))
    more = options.numbers("tile", "refine")
    if options["cluster"] is not None:
        more["cluster"] = options["cluster"]
    if stored:
        _into_store(study, options, more, resumed=resumed)
    else:
        _sweep("parameter_map", study, options, **more)


def _sweep(function: str, study: Study, options: Options, **more: Any) -> None:
    """Compute a diagram or a map in memory, showing its progress."""
    from vibroimpact.execution.threads import GRACE
    from vibroimpact.status import Status

    label = "diagram" if function == "bifurcation_diagram" else "map"
    with Meter(label, patience=GRACE) as meter, refusing():
        dataset = _call(function, study, progress=meter, **study.axes, **more)
    if meter.stopped:
        empty = bool((dataset["status"] == Status.INTERRUPTED).all())
        output.keep_finished(None if empty else dataset, options, meter.seconds)
    output.hand_on(dataset, options, meter.seconds)


def _into_store(study: Study, options: Options, more: dict[str, Any], *, resumed: bool) -> None:
    """Compute a map tile by tile into its store, or the rest of it."""
    from vibroimpact.execution.layout import StoreBusy, settle
    from vibroimpact.execution.threads import GRACE

    out = options["out"]
    opening = partial(files.announce, out) if resumed else None  # once it is known to be of the same study
    with (
        Meter("map", patience=GRACE, settle=settle, opening=opening) as meter,
        files.making_room(options),
        refusing(StoreBusy),
    ):
        _call("parameter_map", study, progress=meter, store=out, **study.axes, **more)
    state = files.state_of(out, meter.seconds)
    if meter.stopped:
        raise Interrupted(f"interrupted; {state}; run the same command again to continue")
    typer.echo(f"wrote {state}")


def _call(function: str, study: Study, **more: Any) -> xr.Dataset:
    import vibroimpact

    dataset: xr.Dataset = getattr(vibroimpact, function)(study.model, **study.arguments(function), **more)
    return dataset


def _listed(study: Study) -> str:
    return " and ".join(study.axes) or "none"
