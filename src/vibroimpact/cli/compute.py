"""The commands that compute motions, sections, diagrams, maps, basins and verdicts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli import files, output
from vibroimpact.cli import schema as o
from vibroimpact.cli.endings import Interrupted, WrongRequest, refusing
from vibroimpact.cli.options import Option, Options, with_options
from vibroimpact.cli.study import Study, name_of, span_values, study_of
from vibroimpact.cli.times import OWN
from vibroimpact.compiling import before_compiling, clock
from vibroimpact.model import as_system
from vibroimpact.progress import Meter

if TYPE_CHECKING:
    import xarray as xr


INITIAL_CONDITIONS = 200  # along an axis of basins that is not given


@with_options(o.MODEL, o.START, o.DURATION, o.ENGINE, o.FILM_OUT, o.FIGURE, o.POINT, o.SHOWN, o.PICTURE)
def simulate(options: Options) -> None:
    """Compute the motion in time from its initial conditions.

    For example:

      vibroimpact simulate -p omega=2.8 --periods 30
      vibroimpact simulate -p w=0.9 --start -1,0,0 --out orbit.csv
      vibroimpact simulate -p w=0.9 --times 0:20:101 --out orbit.csv
      vibroimpact simulate --piece 0.5s:2N --piece 10s:0 --out pulse.png
      vibroimpact simulate -p w=0.9 --figure phase-portrait --out portrait.png
      vibroimpact simulate -p w=2.8 --periods 8 --out motion.gif
    """
    study = study_of(options)
    if "pieces" in study.settings:
        study = _with_own_load(study)
    _motion("simulate", study, options)
    if options["out"] is None and "pieces" not in study.settings:
        from vibroimpact.report import motion_of

        typer.echo(f"settles to: {motion_of(_call('impact_section', study))}")


def _with_own_load(study: Study) -> Study:
    """Return a study in whose pieces the load of the model stands where it was asked for by name."""
    load = as_system(study.model.at()).force
    pieces = [(seconds, load if force == OWN else force) for seconds, force in study.settings["pieces"]]
    return replace(study, settings=study.settings | {"pieces": pieces})


@with_options(
    o.MODEL, o.START, o.SECTION_KIND, o.IMPACTS, o.PERIODS, o.ENGINE, o.OUT, o.FIGURE, o.POINT, o.SHOWN, o.PICTURE
)
def section(options: Options) -> None:
    """Impact map or Poincare map of the settled motion, and the name of that motion.

    For example:

      vibroimpact section -p omega=0.9
      vibroimpact section -p frequency=0.45 --kind stroboscopic --out poincare.png
    """
    study = study_of(options)
    _motion(f"{study.settings.get('section', 'impact')}_section", study, options)


def _motion(function: str, study: Study, options: Options) -> None:
    output.check(options, function)
    for shown in ("coordinate", "stop"):
        if options[shown] is not None and not output.is_figure(options["out"]):
            raise WrongRequest(f"`--{shown}` needs a figure; add for example --out figure.png")
    began, point, system = clock(), options["point"], None
    if point is not None and function == "impact_section":
        raise WrongRequest("`--point` needs a motion; add --kind stroboscopic, or use `vibroimpact simulate`")
    with refusing():
        if point is not None:
            design = study.model.at()
            system = as_system(design)
            system.row_of(point)
    with refusing(), before_compiling(study.announce):
        dataset = _call(function, study)
        if system is not None:
            dataset = system.at_point(point, dataset)
    output.hand_on(dataset, options, clock() - began)


@with_options(
    o.MODEL, o.START, o.X, o.SECTION, o.COORDINATE, o.DIRECTION, o.INDICES, o.OF, o.IMPACTS, o.PERIODS, o.ENGINE,
    o.WORKERS, o.OUT, o.FIGURE, o.INDEX, o.PICTURE,
)  # fmt: skip
def diagram(options: Options) -> None:
    """Bifurcation diagram: how the settled motion changes with one parameter.

    For example:

      vibroimpact diagram --x omega=0.01:5:1000 --out diagram.png
      vibroimpact diagram --x omega=2:3:400 --direction up --sample-impacts 200
      vibroimpact diagram --x gap=-0.5:0.5:200 -p w=0.9 --section stroboscopic
      vibroimpact diagram --x w=2:3:400 --index std --out std.png
    """
    study = _with_index(options)
    if len(study.axes) != 1:
        got = " and ".join(study.axes) or "none"
        raise WrongRequest(f"a diagram needs exactly one axis, got {got}; for example --x omega=0.025:5:200")
    output.check(options, "bifurcation_diagram", _computed(study), 1)
    _sweep("bifurcation_diagram", "diagram", study, options, **study.typed_axes)


@with_options(
    o.MODEL, o.START, o.STARTS, o.X, o.Y, o.MORE_AXES, o.INDICES, o.OF, o.BY_STOP, o.IMPACTS, o.ENGINE, o.EVERY_IMPACT,
    o.WORKERS, o.CLUSTER, o.TILE, o.REFINE, o.OUT, o.FIGURE, o.INDEX, o.LEVEL, o.PICTURE,
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
      vibroimpact map --x w=1:3:99 --y g=0:3:99 --starts 16 --out worst.png
      vibroimpact map study.toml -p damping=0.02 --workers 4
    """
    needed = output.NEEDS.get(options["figure"] or "", ()) if output.is_figure(options["out"]) else ()
    if needed and options["indices"] is None:  # those the figure is drawn from
        options = options.with_values(indices=",".join(needed))
    study = _with_index(options)
    if not study.axes:
        raise WrongRequest("a map needs an axis; for example --x omega=0.025:5:200")
    if study.settings.get("by_stop") and output.is_figure(options["out"]):
        raise WrongRequest(
            "a figure shows one stop; with --by-stop write data, then `vibroimpact plot FILE --stop NAME`"
        )
    stored = files.is_store(options)
    resumed = stored and files.store_exists(options)
    if not resumed:
        output.check(options, "parameter_map", _computed(study, ("std",)), len(study.axes))
    more = options.given("tile", "refine", "cluster")
    if stored:
        _into_store(study, options, more, resumed=resumed)
    else:
        _sweep("parameter_map", "map", study, options, **study.typed_axes, **more)


def _with_index(options: Options) -> Study:
    """Return the study of a sweep; the index that its figure shows is among those computed."""
    study, index = study_of(options), options["index"]
    from vibroimpact.indices import check_indices

    computed = _computed(study)
    if index is None or index in computed:
        return study
    with refusing():
        return replace(study, settings={**study.settings, "indices": check_indices([*computed, index])})


def _computed(study: Study, usual: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the names of the indices that a study computes."""
    from vibroimpact.indices import ALL, check_indices

    chosen = study.settings.get("indices", usual)
    return check_indices(chosen) if chosen == ALL else tuple(chosen)


@with_options(
    o.MODEL, o.START_X, o.START_Y, o.START_PHASE, o.OTHERS, o.ON_STOP, o.TRANSIENT_IMPACTS, o.BASIN_IMPACTS, o.BACKEND,
    o.TOLERANCE, o.WORKERS, o.OUT, o.PICTURE,
)  # fmt: skip
def basins(options: Options) -> None:
    """Which attractors coexist, and which initial conditions lead to each.

    Ctrl-C keeps what is finished.

    For example:

      vibroimpact basins -p w=3 --x phase=0:1:400 --y velocity=0:3:400 -o b.png
      vibroimpact basins --x displacement=-3:0:200 --y velocity=-2:2:200
      vibroimpact basins --model two_sided_oscillator --stop left -o left.png
    """
    study = study_of(options)
    axes = _initial_conditions(study, options)
    if set(axes) - {"phase", "velocity"} and "phase" in study.settings:
        axes["phase"] = study.settings["phase"]
    elif options["phase"] is not None:
        raise WrongRequest("`--phase` needs an axis of displacement; for impacts write --x phase=0:1:200")
    if options["stop"] is not None:
        axes["stop"] = options["stop"]
    output.check(options, "basins")
    _sweep("basins", "initial conditions", study, options, **axes)


def _initial_conditions(study: Study, options: Options) -> dict[str, Any]:
    """Return the axes of initial conditions, completed by phases or velocities of impacts."""
    import numpy as np

    from vibroimpact.cells import FASTEST
    from vibroimpact.parameters import Parameter

    axes: dict[str, Any] = {}
    with refusing():
        for axis in ("x", "y"):
            for name, span in (options.value(axis) or {}).items():
                if name in axes:
                    raise WrongRequest(f"the axis {name} is given twice; give each coordinate one axis")
                axes[name] = span_values(Parameter(name, name), span, least=2)
    if set(axes) <= {"phase"} or set(axes) == {"velocity"}:
        usual = {"phase": 1.0, "velocity": FASTEST * (study.model.at().velocity_scale or 1.0)}
        for name, high in usual.items():
            axes.setdefault(name, np.linspace(0.0, high, INITIAL_CONDITIONS))
    return axes


def _sweep(function: str, label: str, study: Study, options: Options, **more: Any) -> None:
    """Compute many cells in memory, show the progress, and write or print the finished part."""
    from vibroimpact.execution.threads import GRACE

    patience = None if function == "basins" else GRACE
    with Meter(label, patience=patience, opening=study.announce) as meter, refusing():
        dataset = _call(function, study, progress=meter, **more)
    output.finish(dataset, options, meter)


def _into_store(study: Study, options: Options, more: dict[str, Any], *, resumed: bool) -> None:
    """Compute a map tile by tile into its store, or the rest of it."""
    from vibroimpact.execution.layout import StoreBusy, finish_writing
    from vibroimpact.execution.threads import GRACE

    out, place = options["out"], files.place_for(options)
    exists = resumed or (place != out and place.exists())

    def opening() -> None:  # once it is known to be of the same study
        study.announce()
        if exists:
            files.announce(place)

    with (
        Meter("map", patience=GRACE, finish=finish_writing, opening=opening) as meter,
        files.replacing_store(place, out),
        refusing(StoreBusy),
    ):
        _call("parameter_map", study, progress=meter, store=place, **study.typed_axes, **more)
    if meter.stopped:
        unchanged = f"{out} is unchanged; " if place != out else ""
        state = files.state_of(place, meter.seconds)
        raise Interrupted(f"interrupted; {unchanged}{state}; run the same command again to continue")
    typer.echo(f"wrote {files.state_of(out, meter.seconds)}")


def _call(function: str, study: Study, **more: Any) -> xr.Dataset:
    import vibroimpact

    dataset: xr.Dataset = getattr(vibroimpact, function)(study.model, **study.arguments(function), **more)
    return dataset


# Verdicts


@with_options(o.MODEL, o.SEARCH, o.WORKERS, o.FULL, o.JSON)
def describe(options: Options) -> None:
    """What a design does, how hard it hits, how far it is from another motion, and ways to soften the impacts.

    For example:

      vibroimpact describe -p omega=2.8
      vibroimpact describe -p omega=2.8 --full
      vibroimpact describe study.toml --vary omega,gap --json
    """
    study = study_of(options)
    import vibroimpact

    with Meter("verdict", opening=study.announce) as meter, refusing():
        verdict = vibroimpact.describe(
            study.model,
            units=study.units,
            progress=meter,
            **_search(study, options),
            **study.arguments("describe"),
        )
    if options["json"]:
        typer.echo(output.as_json(verdict.to_dict()))
    elif options["full"]:
        typer.echo(str(verdict))
    else:
        from vibroimpact.verdict.text import short_lines

        typer.echo("\n".join(short_lines(verdict)))
        typer.echo("--full shows the impacts, stability, boundaries, all motions and all advice", err=True)
    if not verdict.complete:
        raise Interrupted("interrupted; what was found so far is shown")


@with_options(
    Option("first", "A.toml", "The study file of one design.", flags=(), required=True),
    Option("second", "B.toml", "The study file of the other design.", flags=(), required=True),
    o.PARAMETERS, o.USER_MODEL, o.SEARCH, o.WORKERS, o.JSON, o.COMPARE_OUT, o.PICTURE,
)  # fmt: skip
def compare(options: Options) -> None:
    """Two designs side by side: a table of their verdicts, and their motions as figures.

    -p sets a parameter of both.

    For example:

      vibroimpact compare old.toml new.toml
      vibroimpact compare old.toml new.toml --out both.png
    """
    paths = [options["first"], options["second"]]
    first, second = (study_of(options, path) for path in paths)
    output.check_looks(options, (*output.FIGURE_ENDINGS, ".json"))
    import vibroimpact

    chosen = second.arguments("compare") | first.arguments("compare")

    def opening() -> None:
        first.announce()
        second.announce()

    with Meter("comparison", opening=opening) as meter, refusing():
        comparison = vibroimpact.compare(
            first.model,
            second.model,
            names=_names(*paths),
            units=first.units | second.units | first.units,
            progress=meter,
            **_search(first, options),
            **chosen,
        )
    typer.echo(output.as_json(comparison.to_dict()) if options["json"] else str(comparison))
    out: Path | None = options["out"]
    if not all(verdict.complete for verdict in comparison.verdicts):
        raise Interrupted("interrupted; what was found so far is shown, and nothing was written")
    if out is not None:
        if out.suffix.lower() == ".json":
            output.write_json(comparison.to_dict(), options, out)
        else:
            output.write(comparison.dataset, options, out)
        typer.echo(f"wrote {out}", err=options["json"])


def _search(study: Study, options: Options) -> dict[str, Any]:
    """Return the parameters that a verdict varies, and their range."""
    chosen = options.given("within")
    if options["vary"] is not None:
        chosen["parameters"] = [name_of(study.model, name) for name in options.value("vary")]
    return chosen


def _names(first: Path, second: Path) -> tuple[str, str]:
    """Return the names of two designs: of their files, or with folders, or with A and B where they are one file."""
    for pair in ((first.stem, second.stem), (str(first), str(second))):
        if pair[0] != pair[1]:
            return pair
    return f"{first.stem} A", f"{second.stem} B"
