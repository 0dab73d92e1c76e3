"""What works on files: drawing a saved result, and the report on the paper."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer

from vibroimpact.cli import output
from vibroimpact.cli.progress import Meter
from vibroimpact.cli.request import REFUSALS, Interrupted, asked


def show(options: Mapping[str, Any]) -> None:
    """Draw, export or describe a saved result."""
    from vibroimpact.files import load
    from vibroimpact.report import sentences_of

    output.check_looks(options)
    with asked(OSError):
        dataset = load(options["file"])
        over = output.read(options, "over")
        lines = sentences_of(dataset)
    out: Path | None = options.get("out")
    if out is None:
        for line in lines:
            typer.echo(line)
        return
    output.write(dataset, options, out, over)
    typer.echo(f"wrote {out}")


def reproduce(options: Mapping[str, Any]) -> None:
    """Write the report on the paper into a folder."""
    level = output.level_of(options)
    from vibroimpact.studies.lee import run

    with Meter("report", keeps=False) as meter:
        try:
            with asked(*REFUSALS):
                report = run(
                    options["out"], quick=options["quick"], level=level, overwrite=options["overwrite"], progress=meter
                )
        except KeyboardInterrupt as error:
            raise Interrupted(str(error) or "interrupted") from error
    typer.echo(f"wrote {report} ({meter.seconds:.3g} s)")
