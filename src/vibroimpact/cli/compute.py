"""Run one public function as asked, and hand its result on."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from vibroimpact.cli import output, stored
from vibroimpact.cli.progress import Meter, speed
from vibroimpact.cli.request import Interrupted, WrongRequest, asked, number, read_request

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.cli.study import Study


def orbit(function: str, options: Mapping[str, Any]) -> None:
    """Compute `simulate` or a section."""
    study = read_request(options)
    output.check(options, function)
    began = perf_counter()
    with asked():
        dataset = _call(function, study)
    hand_on(dataset, options, perf_counter() - began, study)


def section(options: Mapping[str, Any]) -> None:
    """Compute the section that the options or the study ask for."""
    study = read_request(options)
    orbit(f"{study.run.section or 'impact'}_section", options)


def sweep(function: str, options: Mapping[str, Any]) -> None:
    """Compute a diagram or a map, told of while it runs."""
    study = read_request(_with_needed(options))
    axes = study.grid()
    if not axes or (function == "bifurcation_diagram" and len(axes) > 1):
        given = f"are {', '.join(axes)}" if axes else "are none"
        wanted = "exactly one" if function == "bifurcation_diagram" else "one or more"
        raise WrongRequest(f"`axes` {given}; allowed is {wanted}; write for example --x omega=0.025:5:200")
    usual = ("std",) if function == "parameter_map" else ()
    held, chosen = stored.wanted(function, options), study.run.indices or usual
    stored.check_cluster(options)
    stands = held and stored.stands(options)
    if not stands:
        output.check(options, function, chosen, len(axes))
    more: dict[str, Any] = dict(axes)
    if options.get("cluster") is not None:
        more["cluster"] = options["cluster"]
    if options.get("tile") is not None:
        more["tile"] = number(options["tile"])
    if options.get("refine") is not None:
        more["refine"] = number(options["refine"])
    if held:
        _into_store(study, options, more, stands=stands)
        return
    from vibroimpact.execution.threads import GRACE

    with Meter("diagram" if function == "bifurcation_diagram" else "map", patience=GRACE) as meter, asked():
        dataset = _call(function, study, progress=meter, **more)
    if not meter.stopped:
        hand_on(dataset, options, meter.seconds)
        return
    from vibroimpact.status import Status

    keep_finished(dataset, options, meter.seconds, empty=bool((dataset["status"] == Status.INTERRUPTED).all()))


def _into_store(study: Study, options: Mapping[str, Any], more: dict[str, Any], *, stands: bool) -> None:
    from vibroimpact.execution.store import StoreBusy, settle
    from vibroimpact.execution.threads import GRACE

    out = options["out"]
    opening = partial(stored.going_on, out) if stands else None  # told once it is known to be the same study
    with (
        Meter("map", patience=GRACE, settle=settle, opening=opening) as meter,
        stored.making_room(options),
        asked(StoreBusy),
    ):
        _call("parameter_map", study, progress=meter, store=out, **more)
    told = stored.told(out, meter.seconds)
    if meter.stopped:
        raise Interrupted(f"interrupted; {told}; the same command goes on")
    typer.echo(f"wrote {told}")


def _with_needed(options: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the options, with the indices that the figure is drawn from where none are given."""
    needed = output.NEEDS.get(options.get("figure") or "")
    if needed is None or options.get("indices") is not None or not output.is_figure(options):
        return options
    return {**options, "indices": ",".join(needed)}


def _call(function: str, study: Study, **more: Any) -> xr.Dataset:
    import vibroimpact

    dataset: xr.Dataset = getattr(vibroimpact, function)(study.make_oscillator(), **study.arguments(function), **more)
    return dataset


def hand_on(
    dataset: xr.Dataset,
    options: Mapping[str, Any],
    seconds: float,
    study: Study | None = None,
    over: xr.Dataset | None = None,
) -> None:
    """Write the result where it shall go, or tell it in words."""
    out = options.get("out")
    if out is not None:
        output.write(dataset, options, out, over)
        typer.echo(f"wrote {out} ({seconds:.2g} s)")
        return
    from vibroimpact.report import sentences_of

    impacts = speed(int(dataset.attrs.get("impacts_computed", 0)), seconds)
    for line in (*sentences_of(dataset), ", ".join(part for part in (f"computed in {seconds:.2g} s", impacts) if part)):
        typer.echo(line)
    if study is not None and dataset.attrs["function"] == "simulate":
        typer.echo(f"settles to: {sentences_of(_call('impact_section', study))[0]}")


def keep_finished(
    dataset: xr.Dataset | None,
    options: Mapping[str, Any],
    seconds: float,
    *,
    empty: bool = False,
    over: xr.Dataset | None = None,
) -> NoReturn:
    """Hand on what an interrupted command had finished, without replacing anything complete."""
    if empty or dataset is None:
        raise Interrupted("interrupted before anything was finished; nothing was written")
    out: Path | None = options.get("out")
    marked = ", the rest has status interrupted" if "status" in dataset else ""
    told = f"interrupted; what was finished is kept{marked}"
    if out is not None and out.exists():
        told += f"; {out} is as it was"
        out = out.with_name(f"{out.stem}.partial{out.suffix}")
    hand_on(dataset, {**options, "out": out}, seconds, over=over)
    raise Interrupted(told)
