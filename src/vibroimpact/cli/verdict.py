"""The commands that judge a design: a verdict on one, two side by side, and what coexists."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli import Interrupted, WrongRequest, output, refusing
from vibroimpact.cli import options as o
from vibroimpact.cli.options import parse_axis
from vibroimpact.progress import Meter

if TYPE_CHECKING:
    from vibroimpact.cli.options import Options
    from vibroimpact.cli.study import Study

INITIAL_CONDITIONS = 200  # along an axis that is not given
FASTEST = 4.0  # times the velocity scale: the hardest impact then


@o.with_options(o.MODEL, o.SEARCH, o.WORKERS, o.JSON)
def describe(options: Options) -> None:
    """What it does, how hard it hits, how far it is from another motion, and ways to soften the impacts.

    For example:

      vibroimpact describe -p omega=2.8
      vibroimpact describe study.toml --vary omega,gap --json
    """
    study = options.study()
    import vibroimpact

    with Meter("verdict") as meter, refusing():
        verdict = vibroimpact.describe(
            study.model, progress=meter, **_search(study, options), **study.arguments("describe")
        )
    typer.echo(output.as_json(verdict.to_dict()) if options["json"] else str(verdict))
    if not verdict.complete:
        raise Interrupted("interrupted; what was found so far is shown")


@o.with_options(
    o.Option("first", "A.toml", "The study file of one design.", flags=(), required=True),
    o.Option("second", "B.toml", "That of the other.", flags=(), required=True),
    o.PARAMETERS, o.USER_MODEL, o.SEARCH, o.WORKERS, o.JSON, o.COMPARE_OUT, o.PICTURE,
)  # fmt: skip
def compare(options: Options) -> None:
    """Two designs side by side: a table of their verdicts, and their motions as figures.

    -p sets a parameter of both.

    For example:

      vibroimpact compare old.toml new.toml
      vibroimpact compare old.toml new.toml --out both.png
    """
    files = [options["first"], options["second"]]
    first, second = (options.study(file) for file in files)
    output.check_looks(options, (*output.FIGURE_ENDINGS, ".json"))
    import vibroimpact

    chosen = second.arguments("compare") | first.arguments("compare")
    with Meter("comparison") as meter, refusing():
        comparison = vibroimpact.compare(
            first.model,
            second.model,
            names=_names(*files),
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
    """Return which parameters a verdict varies, and how far."""
    from vibroimpact.cli.study import name_of

    chosen = options.numbers("within")
    if options["vary"] is not None:
        chosen["parameters"] = [name_of(study.model, name.strip()) for name in options["vary"].split(",")]
    return chosen


def _names(first: Path, second: Path) -> tuple[str, str]:
    """Return the names of two designs: of their files, or with folders, or with A and B where they are one file."""
    for pair in ((first.stem, second.stem), (str(first), str(second))):
        if pair[0] != pair[1]:
            return pair
    return f"{first.stem} A", f"{second.stem} B"


@o.with_options(
    o.MODEL, o.START_X, o.START_Y, o.START_PHASE, o.TRANSIENT_IMPACTS, o.BASIN_IMPACTS, o.BACKEND, o.TOLERANCE,
    o.WORKERS, o.OUT, o.PICTURE,
)  # fmt: skip
def basins(options: Options) -> None:
    """Which attractors coexist, and which initial conditions lead to which.

    Ctrl-C keeps what is finished.

    For example:

      vibroimpact basins -p w=3 --x phase=0:1:400 --y velocity=0:3:400 -o b.png
      vibroimpact basins --x displacement=-3:0:200 --y velocity=-2:2:200
    """
    study = options.study()
    axes = _initial_conditions(study, options)
    if "displacement" in axes and "phase" in study.given:
        axes["phase"] = study.given["phase"]
    elif options["phase"] is not None:
        raise WrongRequest("`--phase` goes with an axis of displacement; for impacts write --x phase=0:1:200")
    output.check(options, "basins")
    import vibroimpact
    from vibroimpact.status import Status

    with Meter("initial conditions") as meter, refusing():
        dataset = vibroimpact.basins(study.model, progress=meter, **study.arguments("basins"), **axes)
    if meter.stopped:
        empty = bool((dataset["status"] == Status.INTERRUPTED).all())
        output.keep_finished(None if empty else dataset, options, meter.seconds)
    output.hand_on(dataset, options, meter.seconds)


def _initial_conditions(study: Study, options: Options) -> dict[str, Any]:
    """Return the axes of initial conditions, completed by phases or velocities of impacts."""
    import numpy as np

    from vibroimpact.cli.study import span_values
    from vibroimpact.parameters import Parameter

    axes: dict[str, Any] = {}
    with refusing():
        for flag, text in (("--x", options["x"]), ("--y", options["y"])):
            for name, span in parse_axis(flag, text, o.GRID, "phase=0:1:200").items() if text else ():
                if name in axes:
                    raise WrongRequest(f"the axis {name} is given twice; give each coordinate one axis")
                axes[name] = span_values(Parameter(name, name), span, least=2)
    if set(axes) <= {"phase"} or set(axes) == {"velocity"}:
        usual = {"phase": 1.0, "velocity": FASTEST * (study.model.at().velocity_scale or 1.0)}
        for name, high in usual.items():
            axes.setdefault(name, np.linspace(0.0, high, INITIAL_CONDITIONS))
    return axes
