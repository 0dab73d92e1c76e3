"""The sub-commands and their help."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from vibroimpact.cli.compute import diagram, parameter_map, section, simulate
from vibroimpact.cli.files import explore, info, plot, reproduce
from vibroimpact.cli.orbits import basins, boundary, follow, orbit
from vibroimpact.cli.verdict import compare, describe

app = typer.Typer(
    name="vibroimpact",
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        import vibroimpact

        typer.echo(f"vibroimpact {vibroimpact.__version__}")
        raise typer.Exit


def _help(context: typer.Context, wanted: bool) -> None:
    if wanted:
        typer.echo(context.get_help())
        raise typer.Exit


Version = Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")]
Help = Annotated[bool, typer.Option("-h", "--help", callback=_help, is_eager=True, help="Show this page.")]


# A --help of our own: typer's, when absent, is coerced by way of pydantic, whose import takes 0.1 s.
@app.callback(invoke_without_command=True, add_help_option=False)
def root(
    context: typer.Context,
    version: Version = False,
    wanted: Help = False,
) -> None:
    """Impact oscillators: does yours settle, stick or go chaotic, and how hard does it hit.

    Seven numbers describe it, in SI units: mass m, damping c, stiffness k,
    driving amplitude f and frequency w, restitution r and gap g. Commands
    take them as -p NAME=VALUE or from a study file, and print a summary of
    the result or write it to --out.

    For example:

      vibroimpact section -p omega=0.9
      vibroimpact diagram --x omega=0.01:5:1000 --out diagram.png
      vibroimpact map --x omega=0.025:5:200 --y m=0.1:5:200 --out map.zarr
      vibroimpact plot map.zarr --out map.png
      vibroimpact describe -p omega=2.8
    """
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


_COMMANDS: dict[str, dict[str, Callable[..., None]]] = {
    "Motions and sweeps": {"simulate": simulate, "section": section, "diagram": diagram, "map": parameter_map},
    "Orbits and boundaries": {"orbit": orbit, "continue": follow, "boundary": boundary, "basins": basins},
    "Verdicts": {"describe": describe, "compare": compare},
    "Explorer": {"explore": explore},
    "Files": {"plot": plot, "info": info, "reproduce": reproduce},
}
for panel, commands in _COMMANDS.items():
    for name, command in commands.items():
        app.command(name=name, rich_help_panel=panel)(command)
