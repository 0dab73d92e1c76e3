"""The commands that judge a design: a verdict on one, and two side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli import options as o
from vibroimpact.cli import output
from vibroimpact.cli.errors import Interrupted, refusing
from vibroimpact.progress import Meter

if TYPE_CHECKING:
    from vibroimpact.cli.options import Options
    from vibroimpact.cli.study import Study


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
