"""Back ends by name, imported on first use."""

from __future__ import annotations

import re
from collections.abc import Iterable
from importlib import import_module
from typing import Any

from vibroimpact.backends.base import (
    Backend,
    ImpactWindow,
    LooksWindow,
    Measurement,
    Samples,
    StroboscopicWindow,
    TimesWindow,
    Window,
)
from vibroimpact.backends.one_mass import OfOneMass
from vibroimpact.cells import Cells
from vibroimpact.indices import ALL, DISPLACEMENTS, EVERY, FORCES, check_indices, without_value
from vibroimpact.model import Model, as_system
from vibroimpact.model.points import observed
from vibroimpact.parameters import choice, unknown

__all__ = [
    "BACKENDS",
    "Backend",
    "Cells",
    "ImpactWindow",
    "LooksWindow",
    "Measurement",
    "OfOneMass",
    "Samples",
    "StroboscopicWindow",
    "TimesWindow",
    "Window",
    "check_known",
    "check_takes",
    "chosen_indices",
    "get_backend",
    "observed_by",
]

# name: module that defines `create(**options) -> Backend`
BACKENDS = {
    "cpu": "vibroimpact.backends.cpu",
    "cuda": "vibroimpact.backends.cuda",
    "reference": "vibroimpact.backends.reference",
    "fixed-step": "vibroimpact.backends.fixed_step",
}


def check_backend(argument: str, name: Any) -> str:
    """Return the name of a back end; raise `ValueError`, listing the names, if it is unknown."""
    if isinstance(name, str) and re.search(r"gpu|nvidia|cuda.", name.lower()):
        raise unknown(f"`{argument}`", name, BACKENDS, meant="cuda")
    return choice(argument, name, BACKENDS)


def get_backend(name: str, *, time_step: float | None = None, elsewhere: bool = False) -> Backend:
    """Return the back end of that name; `time_step` in s is used only by "fixed-step" (default 0.0005).

    With `elsewhere`, for the workers of a cluster, the requirements of the back end are not checked on this machine.
    """
    check_backend("backend", name)
    if time_step is not None and name != "fixed-step":
        raise ValueError(f"`time_step` applies only to back end 'fixed-step'; omit it for {name!r}")
    options = {} if time_step is None else {"time_step": time_step}
    backend: Backend = import_module(BACKENDS[name]).create(**options)
    if not elsewhere:
        backend.check_here()
    return backend


def check_takes(backend: Backend, model: Model) -> None:
    """Raise `ValueError` if a back end does not support a model."""
    if isinstance(backend, OfOneMass):
        backend.check_takes(model.cells({}))


def chosen_indices(indices: Iterable[str], backend: Backend) -> tuple[str, ...]:
    """Return the names of indices, after checking them; "all" are those that a back end computes."""
    names = check_indices(indices)
    if isinstance(indices, str) and indices == ALL:
        names = tuple(name for name in names if _computes(backend, name))
    return names


def _computes(backend: Backend, name: str) -> bool:
    return name in backend.known_indices or (name in FORCES and not isinstance(backend, OfOneMass))


def observed_by(indices: Iterable[str], model: Model, of: Any) -> tuple[float, ...] | int | None:
    """Return the object of indices of displacements: factors of the coordinates, or the number of a stop.

    Raises
    ------
    ValueError
        `of` is none of the model's points, coordinates or stops, or no such index is wanted; or one is named, but not
        what it is of.
    """
    system = as_system(model)
    wanted = [name for name in check_indices(indices) if name in DISPLACEMENTS]
    if of is None and indices == ALL and len(system.mass) > 1:
        return None
    if not wanted:
        if of is not None:
            raise ValueError(f"`of` is for the indices {', '.join(DISPLACEMENTS)}; name one, or leave it out")
        return None
    row, stop = observed(system, of)
    return tuple(row.tolist()) if stop is None else stop


def check_known(indices: Iterable[str], backend: Backend, model: Model) -> None:
    """Raise `ValueError` if a back end does not compute an index, or the model has a value of none."""
    names = tuple(indices)
    reasons = [without_value(name, model) for name in names]
    if names and all(reasons):
        raise ValueError(reasons[0])
    for name, reason in zip(names, reasons, strict=True):
        if not reason and not _computes(backend, name):
            known = ", ".join(index for index in EVERY if _computes(backend, index))
            raise ValueError(f"`backend` {backend.name!r} does not compute the index {name!r}, only {known}")
