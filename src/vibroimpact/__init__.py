"""Oscillators that hit a stop: exact orbits, sections, bifurcation diagrams and stability maps."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact import plotting
    from vibroimpact.diagrams import bifurcation_diagram
    from vibroimpact.options import Tolerances
    from vibroimpact.oscillator import ImpactOscillator, State
    from vibroimpact.sections import impact_section, stroboscopic_section
    from vibroimpact.sweeps import parameter_map
    from vibroimpact.trajectory import simulate

# Names are handed on when first used, so that importing vibroimpact costs nothing.
_HOMES = {
    "ImpactOscillator": "oscillator",
    "State": "oscillator",
    "Tolerances": "options",
    "Status": "status",
    "simulate": "trajectory",
    "impact_section": "sections",
    "stroboscopic_section": "sections",
    "bifurcation_diagram": "diagrams",
    "parameter_map": "sweeps",
    "save": "storage",
    "load": "storage",
}
_MODULES = ("plotting",)

__all__ = [
    "ImpactOscillator",
    "State",
    "Status",
    "Tolerances",
    "bifurcation_diagram",
    "impact_section",
    "load",
    "parameter_map",
    "plotting",
    "save",
    "simulate",
    "stroboscopic_section",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"vibroimpact.{_HOMES[name]}"), name)
    if name in _MODULES:
        return import_module(f"vibroimpact.{name}")
    if name == "__version__":
        from importlib.metadata import version

        return version("vibroimpact")
    raise AttributeError(f"module 'vibroimpact' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
