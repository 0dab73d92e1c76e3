"""Times, initial conditions and loads in pieces of a request, in SI units or in others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroimpact.cli.endings import WrongRequest
from vibroimpact.cli.options import number, numbers
from vibroimpact.model.units import without_unit
from vibroimpact.parameters import Parameter, invalid, real_number, several, whole_number

ALLOWED = "a list of times in s, or { from, to, points }"
PIECES = 'a list such as [["4ms", "50N"], ["1s", "model"]]'
MOST = 10_000_000  # times, or points of an axis; a typing error asks for more
ENDS = "from", "to", "points"  # of times and axes
OWN = "model"  # a piece with the load of the model


def read_times(text: str) -> dict[str, Any]:
    """Return the entry of times that are typed as `T,T,...` or as `FROM:TO:POINTS`."""
    parts = text.split(":")
    if len(parts) == 1:
        return {"times": [number(part.strip()) for part in text.split(",")]}
    if len(parts) != len(ENDS):
        raise WrongRequest(f"`--times` must be T,T,... or FROM:TO:POINTS such as 0:2s:101, got {text!r}")
    return {"times": dict(zip(ENDS, (number(part.strip()) for part in parts), strict=True))}


def check_times(name: str, value: Any) -> Any:
    """Return times in s, one by one or evenly spaced with both ends."""
    import numpy as np

    value = without_unit(Parameter(name, "time", "s"), value)
    if not isinstance(value, Mapping):
        return [real_number(f"{name}[{at}]", each) for at, each in enumerate(several(name, value, ALLOWED))]
    if {*value} != {*ENDS}:
        raise invalid(name, dict(value), ALLOWED)
    low, high = (real_number(f"{name}.{end}", value[end]) for end in ENDS[:2])
    return np.linspace(low, high, whole_number(f"{name}.points", value["points"], 2, MOST))


def check_duration(name: str, value: Any) -> float:
    """Return a duration in s."""
    duration = Parameter(name, "duration", "s", low=0.0, closed=False)
    return duration.check(without_unit(duration, value))


def read_pieces(texts: list[str]) -> list[list[Any]]:
    """Return the durations and forces of pieces that are each typed as `TIME:FORCE`, in order."""
    pieces = []
    for text in texts:
        duration, sign, force = (part.strip() for part in text.partition(":"))
        if not (duration and sign and force):
            raise WrongRequest(f"`--piece` must be TIME:FORCE such as 4ms:50N, or 1s:{OWN}, got {text!r}")
        pieces.append([number(duration), *(number(part.strip()) for part in force.split(","))])
    return pieces


def check_pieces(name: str, value: Any) -> list[tuple[float, Any]]:
    """Return pieces as pairs of a duration in s and a `Force`, or the word for the load of the model."""
    from vibroimpact.model.force import Force

    pieces: list[tuple[float, Any]] = []
    for at, piece in enumerate(several(name, value, PIECES)):
        if not isinstance(piece, (list, tuple)) or len(piece) < 2:
            raise invalid(f"{name}[{at}]", piece, PIECES)
        seconds = check_duration(f"{name}[{at}] duration", piece[0])
        if list(piece[1:]) == [OWN]:
            pieces.append((seconds, OWN))
            continue
        force = Parameter(f"{name}[{at}] force", "force", "N", hint=f"give a force in N, or {OWN}")
        loads = [force.check(without_unit(force, each)) for each in piece[1:]]
        pieces.append((seconds, Force(constant=loads if len(loads) > 1 else loads[0])))
    return pieces


def read_start(text: str) -> dict[str, Any]:
    """Return the entries of an initial condition that is typed as `Y,V,T`, or as `Q,Q:V,V:T` for systems."""
    if ":" in text:  # of a system: coordinates, their velocities, time
        groups = [numbers("--start", part, "Q,Q:V,V:T with a number for each coordinate") for part in text.split(":")]
        if len(groups) > 3 or len(groups[2:]) != sum(len(group) == 1 for group in groups[2:]):
            raise WrongRequest(f"`--start` must be Q,Q:V,V:T such as 0.1,0:0,0:0, got {text!r}")
        named = dict(zip(("displacement", "velocity"), map(list, groups), strict=False))
        return named | ({"time": groups[2][0]} if groups[2:] else {})
    parts = numbers("--start", text, "up to three numbers Y,V,T such as -1,0,0")
    if len(parts) > 3:
        raise WrongRequest(f"`--start` must be up to three numbers Y,V,T such as -1,0,0, got {text!r}")
    return dict(zip(("displacement", "velocity", "time"), parts, strict=False))


def check_coordinates(name: str, value: Any) -> Any:
    """Return a number, or several for the coordinates of a system."""
    if isinstance(value, (list, tuple)):
        return [check_coordinates(name, each) for each in value]
    return real_number(name, value, hint="write it without a unit" if isinstance(value, str) else "")
