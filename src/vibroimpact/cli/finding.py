"""What commands on orbits share: which orbits, which ranges, and what to say where there is nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from vibroimpact.cli.progress import Meter
from vibroimpact.cli.request import WrongRequest, number, numbers

if TYPE_CHECKING:
    from vibroimpact.cli.study import Study
    from vibroimpact.continuation import Branch
    from vibroimpact.orbits import Orbit, Orbits
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
    found: Orbits, parameter: str, span: Range, doublings: int, meter: Meter, **step: Any
) -> Iterator[Branch]:
    """Yield the branches of the orbits found, then of those that period doublings give birth to."""
    import vibroimpact

    if found and found[0].n_impacts == -1:
        raise WrongRequest(
            "`--impacts` is -1; allowed here are orbits that never rest at the stop; "
            "follow their end with `vibroimpact boundary --kind end-of-sticking`"
        )
    orbits: list[Orbit] = [orbit for orbit in found if orbit.admissible] or list(found)
    for times in range(doublings + 1):
        branches: list[Branch] = []
        for orbit in orbits:
            if any(_holds(branch, orbit) for branch in branches):
                continue
            branch = vibroimpact.continue_orbit(orbit, parameter, span, progress=meter, **step)
            branches.append(branch)
            yield branch
            if meter.stopped:
                return
        orbits = list(_doubled(branches, parameter, span)) if times < doublings else []


def _holds(branch: Branch, orbit: Orbit) -> bool:
    """Return whether an orbit lies on a branch: between two of its points, with velocity and phase between theirs."""
    import numpy as np

    rows = np.column_stack([branch.values, [(q.velocities[0], q.phases[0]) for q in branch.orbits]])
    here = np.array([getattr(orbit.oscillator, branch.parameter), orbit.velocities[0], orbit.phases[0]])
    low, high = np.minimum(rows[:-1], rows[1:]), np.maximum(rows[:-1], rows[1:])
    slack = 0.1 * (high - low) + 1e-6 * np.abs(high)
    return bool(((low - slack <= here) & (here <= high + slack)).all(axis=1).any())


def _doubled(branches: list[Branch], parameter: str, span: Range) -> Iterator[Orbit]:
    """Yield an orbit of each doubled branch that is born on these branches inside the range."""
    import vibroimpact

    for branch in branches:
        name = branch.orbits[0].n_periods, branch.orbits[0].n_impacts
        for point in branch.special:
            born_here = (point.orbit.n_periods, point.orbit.n_impacts) == name  # not where this branch itself was born
            if point.kind != "period_doubling" or not born_here:
                continue
            try:
                orbit = vibroimpact.switch_branch(point, amplitude=1e-3)
            except ValueError:
                continue  # the doubled branch could not be reached: its parent tells of the doubling
            if span[0] <= getattr(orbit.oscillator, parameter) <= span[1]:
                yield orbit


def tell_nothing(message: str, options: Mapping[str, Any]) -> NoReturn:
    """Tell that there is nothing to hand on: a failure only where a file was asked for."""
    if options.get("out") is not None:
        raise Nothing(f"{message}; nothing was written")
    typer.echo(message)
    raise typer.Exit


class Nothing(Exception):
    """What was to be written does not exist."""
