"""Orbits: find them, and follow them along a parameter."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli import output
from vibroimpact.cli.compute import hand_on, keep_finished
from vibroimpact.cli.finding import (
    Range,
    branches_of,
    check_inside,
    choice,
    given,
    name_of,
    near_of,
    ranges_of,
    tell_nothing,
)
from vibroimpact.cli.progress import Meter
from vibroimpact.cli.request import WrongRequest, asked, read_request

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.cli.study import Study

COLUMNS = 400  # of the diagram beneath a branch
BENEATH = {"transient_impacts": 500, "sample_impacts": 100}  # of each, unless the study tells


def orbit(options: Mapping[str, Any]) -> None:
    """Find the orbits of one name."""
    study = read_request(options)
    output.check_looks(options, (".json",))
    began = perf_counter()
    import vibroimpact

    osc = study.make_oscillator()
    with asked():
        found = vibroimpact.find_orbit(osc, **name_of(options), near=near_of(options))
    from vibroimpact.cli.orbit_data import orbits_dataset, orbits_json

    out = options["out"]
    if out is not None and out.suffix.lower() == ".json":
        output.write_json(orbits_json(found, osc), options, out)
        typer.echo(f"wrote {out} ({perf_counter() - began:.2g} s)")
        return
    hand_on(orbits_dataset(found, osc, name_of(options)), options, perf_counter() - began)


def follow(options: Mapping[str, Any]) -> None:
    """Follow the orbits of one name along a parameter."""
    study = read_request(options, axes="span")
    ((parameter, span),) = ranges_of(study, 1).items()
    osc = study.make_oscillator()
    check_inside(osc, {parameter: span})
    output.check(options, "continue_orbit")
    if options["diagram"] and not output.is_figure(options):
        raise WrongRequest("`--diagram` is given without a figure; allowed is it with one; write --out branch.png")
    import vibroimpact
    from vibroimpact.parameters import whole_number

    with Meter("orbits") as meter, asked():
        doublings = whole_number("doublings", choice(options, "doublings", 0), 0)
        found = vibroimpact.find_orbit(osc, **name_of(options), near=near_of(options))
        branches = branches_of(found, parameter, span, doublings, meter, **given(options, "step"))
    if not branches:
        tell_nothing(found.message, options)
    beneath = _diagram(study, parameter, span) if options["diagram"] and not meter.stopped else None
    from vibroimpact.bundles import bundle
    from vibroimpact.dataset import provenance

    arguments = {"parameter": parameter, "range": span, **name_of(options), "doublings": doublings}
    made_by = provenance("continue_orbit", osc, arguments)
    dataset = bundle([branch.dataset for branch in branches], "continue_orbit", made_by)
    if meter.stopped:
        keep_finished(dataset, options, meter.seconds)
    hand_on(dataset, options, meter.seconds, over=beneath)


def _diagram(study: Study, parameter: str, span: Range) -> xr.Dataset:
    """Return the settled motions over the same range."""
    import numpy as np

    import vibroimpact

    asked_for = study.grid()[parameter]
    axis: dict[str, Any] = {parameter: asked_for if len(asked_for) > 2 else np.linspace(*span, COLUMNS)}
    chosen = BENEATH | study.arguments("bifurcation_diagram") | {"section": "impact", "indices": ()}
    with Meter("diagram") as meter, asked():
        return vibroimpact.bifurcation_diagram(study.make_oscillator(), progress=meter, **chosen, **axis)
