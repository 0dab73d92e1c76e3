"""Basins, verdicts and comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli import output
from vibroimpact.cli.compute import hand_on, keep_finished
from vibroimpact.cli.progress import Meter
from vibroimpact.cli.request import Interrupted, WrongRequest, asked, number, read_request, start_axes

if TYPE_CHECKING:
    from vibroimpact.cli.study import Study
    from vibroimpact.oscillator import ImpactOscillator

STARTS = 200  # along an axis that is not given
FASTEST = 4.0  # of V: the hardest impact then


def basins(options: Mapping[str, Any]) -> None:
    """Compute which start leads to which attractor."""
    study = read_request(options, axes="starts")
    axes = _starts(study.make_oscillator(), start_axes(options))
    if "displacement" in axes:
        axes |= {} if study.sampling.phase is None else {"phase": study.sampling.phase}
    elif options["phase"] is not None:
        raise WrongRequest(
            "`--phase` is given for impacts; allowed is it with displacement; --x phase=0:1:200 spans all"
        )
    output.check(options, "basins")
    import vibroimpact
    from vibroimpact.status import Status

    with Meter("starts") as meter, asked():
        dataset = vibroimpact.basins(study.make_oscillator(), progress=meter, **study.arguments("basins"), **axes)
    if meter.stopped:
        empty = bool((dataset["status"] == Status.INTERRUPTED).all())
        keep_finished(dataset, options, meter.seconds, empty=empty)
    hand_on(dataset, options, meter.seconds)


def _starts(osc: ImpactOscillator, axes: dict[str, Any]) -> dict[str, Any]:
    """Return the axes given, completed by phases or velocities of impacts."""
    if set(axes) <= {"phase"} or set(axes) == {"velocity"}:
        usual = {"phase": 1.0, "velocity": FASTEST * (osc.velocity_scale or 1.0)}
        for name, high in usual.items():
            axes.setdefault(name, [high * at / (STARTS - 1) for at in range(STARTS)])
    return axes


def describe(options: Mapping[str, Any]) -> None:
    """Tell a verdict."""
    study = read_request(options)
    import vibroimpact

    with Meter("verdict") as meter, asked():
        verdict = vibroimpact.describe(
            study.make_oscillator(), progress=meter, **_search(options), **study.arguments("describe")
        )
    typer.echo(output.as_json(verdict.to_dict()) if options["json"] else str(verdict))
    if not verdict.complete:
        raise Interrupted("interrupted; what was found until then is told")


def compare(options: Mapping[str, Any]) -> None:
    """Tell two designs side by side, and draw or save them."""
    files = [Path(options[key]) for key in ("first", "second")]
    studies: list[Study] = [read_request({**options, "study": file}) for file in files]
    output.check_looks(options, (*output.FIGURE_ENDINGS, ".json"))
    import vibroimpact

    first, second = (study.make_oscillator() for study in studies)
    chosen = studies[1].arguments("compare") | studies[0].arguments("compare")
    with Meter("comparison") as meter, asked():
        comparison = vibroimpact.compare(
            first, second, names=_names(*files), progress=meter, **_search(options), **chosen
        )
    typer.echo(output.as_json(comparison.to_dict()) if options["json"] else str(comparison))
    out: Path | None = options["out"]
    complete = all(verdict.complete for verdict in comparison.verdicts)
    if out is not None and complete:
        if out.suffix.lower() == ".json":
            output.write_json(comparison.to_dict(), options, out)
        else:
            output.write(comparison.dataset, options, out)
        typer.echo(f"wrote {out}", err=options["json"])
    if not complete:
        raise Interrupted("interrupted; what was found until then is told, and nothing was written")


def _search(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return which parameters a verdict varies, and how far."""
    from vibroimpact.dataset import SYMBOLS

    chosen: dict[str, Any] = {}
    if options["vary"] is not None:
        typed = [name.strip() for name in options["vary"].split(",")]
        chosen["parameters"] = [SYMBOLS.get(name, name) for name in typed]
    if options["within"] is not None:
        chosen["within"] = number(options["within"])
    return chosen


def _names(first: Path, second: Path) -> tuple[str, str]:
    """Return what two designs are called: their files, told apart by folders, or by A and B where they are one."""
    for pair in ((first.stem, second.stem), (str(first), str(second))):
        if pair[0] != pair[1]:
            return pair
    return f"{first.stem} A", f"{second.stem} B"
