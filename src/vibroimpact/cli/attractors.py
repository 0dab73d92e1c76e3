"""The command that lists the motions that coexist at one design."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli import output
from vibroimpact.cli import schema as o
from vibroimpact.cli.endings import Interrupted, refusing
from vibroimpact.cli.options import Options, with_options
from vibroimpact.cli.study import study_of
from vibroimpact.progress import Meter, duration
from vibroimpact.showing import plain

if TYPE_CHECKING:
    from vibroimpact.coexistence import Attractor
    from vibroimpact.model import Model


@with_options(o.MODEL, o.TRANSIENT_IMPACTS, o.BASIN_IMPACTS, o.BACKEND, o.TOLERANCE, o.WORKERS, o.JSON)
def attractors(options: Options) -> None:
    """Which motions coexist, and the share of the initial conditions that lead to each.

    The initial conditions are 256 impacts, spread over phases and velocities.
    Ctrl-C keeps what is finished.

    For example:

      vibroimpact attractors -p omega=1.45
      vibroimpact attractors --model impact_damper -p clearance=4mm
      vibroimpact attractors --model two_sided_oscillator --json
    """
    study = study_of(options)
    import vibroimpact

    with Meter("initial conditions", opening=study.announce) as meter, refusing():
        found = vibroimpact.attractors(study.model, progress=meter, **study.arguments("attractors"))
    if options["json"]:
        typer.echo(output.as_json(_content(study.model, found)))
    else:
        from vibroimpact.report import attractor_sentences

        for line in (*attractor_sentences(found, study.model), f"computed in {duration(meter.seconds)}"):
            typer.echo(line)
    if meter.stopped:
        raise Interrupted("interrupted; what was found so far is shown")


def _content(model: Model, found: list[Attractor]) -> dict[str, Any]:
    """Return attractors as plain dictionaries, lists, numbers and text."""
    design = model.at()
    rows = [{"name": each.name, **plain(each), "status": each.status.word} for each in found]
    return {design.kind: plain(design.plain()), "attractors": rows}
