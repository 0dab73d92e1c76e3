"""What commands on orbits share: which orbits, which ranges, and what to say where there is nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from vibroimpact.cli.progress import Meter
from vibroimpact.cli.request import WrongRequest, number, numbers

if TYPE_CHECKING:
    from vibroimpact.cli.study import Study
    from vibroimpact.continuation import Branch
    from vibroimpact.orbits import Orbits
    from vibroimpact.oscillator import ImpactOscillator

Range = tuple[float, float]


def name_of(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the periods and impacts of the orbits asked for."""
    return {name: choice(options, name, 1) for name in ("n_periods", "n_impacts")}


def choice(options: Mapping[str, Any], name: str, usual: Any) -> Any:
    """Return the number typed for an option, or the usual one."""
    text = options.get(name)
    return usual if text is None else number(text)


def given(options: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """Return the numbers typed for these options, those left out left out."""
    return {name: number(options[name]) for name in names if options.get(name) is not None}


def near_of(options: Mapping[str, Any]) -> Any:
    """Return phase and velocity of the impact where the search begins."""
    near = options.get("near")
    return None if near is None else numbers("--near", near, 2, "phase,velocity such as 0.25,1.4")


def ranges_of(study: Study, count: int) -> dict[str, Range]:
    """Return the parameters to vary and their ranges."""
    grid = study.grid()
    if len(grid) != count:
        wanted, example = {1: ("one", ""), 2: ("two", " --y mass=0.1:5")}[count]
        told = f"are {', '.join(grid)}" if grid else "are none"
        raise WrongRequest(f"`axes` {told}; allowed is exactly {wanted}; write for example --x omega=0.8:3{example}")
    for name, values in grid.items():
        if len(values) < 2:
            raise WrongRequest(f"`{name}` has one value; allowed is a range; write {name}=from:to")
    return {name: (float(values[0]), float(values[-1])) for name, values in grid.items()}


def check_inside(osc: ImpactOscillator, box: Mapping[str, Range]) -> None:
    """Refuse ranges that do not hold the oscillator whose orbit is followed."""
    for name, (low, high) in box.items():
        value = getattr(osc, name)
        if not low <= value <= high:
            raise WrongRequest(
                f"`{name}` goes from {low:g} to {high:g}, but the orbit is looked for at {value:g}; allowed is a "
                f"range that holds it; widen it, or look elsewhere with -p {name}=..."
            )


def branches_of(
    found: Orbits, parameter: str, span: Range, doublings: int, meter: Meter, step: float = 0.01
) -> list[Branch]:
    """Return the branches of the orbits found, then of those that are born at their period doublings."""
    from vibroimpact.continuation import follow_all

    if found and found[0].n_impacts == -1:
        raise WrongRequest(
            "`--impacts` is -1; allowed here are orbits that never rest at the stop; "
            "follow their end with `vibroimpact boundary --kind end-of-sticking`"
        )
    return follow_all(
        [orbit for orbit in found if orbit.admissible] or found,
        parameter,
        span,
        longest=math.inf,
        most=math.inf,
        doublings=doublings,
        step=step,
        virtual=True,
        amplitude=1e-3,
        progress=meter,
    )


def tell_nothing(message: str, options: Mapping[str, Any]) -> NoReturn:
    """Tell that there is nothing to hand on: a failure only where a file was asked for."""
    if options.get("out") is not None:
        raise Nothing(f"{message}; nothing was written")
    typer.echo(message)
    raise typer.Exit


class Nothing(Exception):
    """What was to be written does not exist."""
