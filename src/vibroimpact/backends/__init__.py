"""Back ends by name, imported when first asked for."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from importlib import import_module

from vibroimpact.backends.base import Backend, Cells, ImpactWindow, Samples, StroboscopicWindow
from vibroimpact.indices import INDICES

__all__ = ["BACKENDS", "Backend", "Cells", "ImpactWindow", "Samples", "StroboscopicWindow", "check_told", "get_backend"]

# name: module that defines `create(**options) -> Backend`
BACKENDS = {
    "cpu": "vibroimpact.backends.cpu",
    "cuda": "vibroimpact.backends.cuda",
    "reference": "vibroimpact.backends.reference.backend",
    "fixed-step": "vibroimpact.backends.fixed_step",
}


def get_backend(name: str, *, time_step: float | None = None) -> Backend:
    """Return the back end of that name; `time_step` in s is for "fixed-step" alone (default 0.0005)."""
    if name not in BACKENDS:
        close = get_close_matches(str(name), BACKENDS, 1)
        remedy = f"did you mean {close[0]!r}?" if close else "check the spelling"
        raise ValueError(f"`backend` is {name!r}; allowed are {', '.join(BACKENDS)}; {remedy}")
    if time_step is not None and name != "fixed-step":
        raise ValueError(
            f"`time_step` is {time_step!r}; allowed with backend 'fixed-step' only; leave it out for {name!r}"
        )
    options = {} if time_step is None else {"time_step": time_step}
    backend: Backend = import_module(BACKENDS[name]).create(**options)
    return backend


def check_told(indices: Iterable[str], backend: Backend) -> None:
    """Refuse indices that a back end cannot tell."""
    for name in indices:
        if name not in backend.tells:
            told = ", ".join(known for known in INDICES if known in backend.tells)
            raise ValueError(
                f"`indices` holds {name!r}; allowed with backend {backend.name!r} are {told}; choose another backend"
            )
