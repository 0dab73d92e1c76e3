"""The command that lists the ready-made machines, or the parameters of one."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator
from typing import Any

import typer

from vibroimpact.cli import output
from vibroimpact.cli import schema as o
from vibroimpact.cli.endings import refusing
from vibroimpact.cli.options import TEXT, Option, Options, with_options
from vibroimpact.showing import aligned

PAGE, PICTURES = "docs/guide/machines.md", "docs/images/machines"  # in the repository


@with_options(Option("name", "NAME", "The machine whose parameters are shown.", flags=(), kind=TEXT), o.JSON)
def models(options: Options) -> None:
    """The ready-made machines, or the parameters of one with units, defaults and ranges.

    For example:

      vibroimpact models
      vibroimpact models impact_damper
      vibroimpact describe --model impact_damper -p clearance=0.004
    """
    from vibroimpact.models import __all__ as names

    if options["name"] is None:
        listed = {name: _summary(name) for name in names}
        lines = aligned(listed.items())
        content: Any = listed
    else:
        with refusing():
            content = _described(options["name"])
        lines = _page(content)
    typer.echo(output.as_json(content) if options["json"] else "\n".join(lines))


def _summary(name: str) -> str:
    """Return the description of a machine in one line, the first of its docstring."""
    from vibroimpact import models as ready

    first = (inspect.getdoc(getattr(ready, name)) or "").partition("\n")[0]
    return first.removeprefix("Return ").rstrip(".")


def _described(name: str) -> dict[str, Any]:
    from vibroimpact.families import ready_made

    family = ready_made(name)
    return {
        "name": name,
        "summary": _summary(name),
        "stops": list(family.at().stop_names),
        "parameters": [
            {
                "name": parameter.name,
                "meaning": parameter.long_name,
                "unit": parameter.unit,
                "default": family.values.get(parameter.name),
                "low": parameter.low if math.isfinite(parameter.low) else None,
                "high": parameter.high if math.isfinite(parameter.high) else None,
                "range": parameter.allowed,
            }
            for parameter in family.parameters.values()
        ],
        "page": f"{PAGE}#{name.replace('_', '-')}",
        "picture": f"{PICTURES}/{name}.png",
    }


def _page(machine: dict[str, Any]) -> Iterator[str]:
    yield f"{machine['name']}: {machine['summary']}"
    yield f"stops: {', '.join(machine['stops'])}"
    yield ""
    rows = [("parameter", "default", "unit", "range", "meaning")]
    for entry in machine["parameters"]:
        default = "" if entry["default"] is None else f"{entry['default']:g}"
        unit = entry["unit"].removesuffix("1") if entry["unit"] == "1" else entry["unit"]
        span = entry["range"].removeprefix("a finite number").strip() or "any"
        rows.append((entry["name"], default, unit, span, entry["meaning"]))
    yield from aligned(rows)
    yield ""
    yield f"described in {machine['page']}, drawn in {machine['picture']}"
    yield f"use it as: vibroimpact describe --model {machine['name']} -p NAME=VALUE"
