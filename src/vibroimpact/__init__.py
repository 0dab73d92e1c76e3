"""Oscillators that hit a stop: exact orbits, sections, bifurcation diagrams and stability maps."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact import contact, models, plotting
    from vibroimpact.coexistence import attractors, basins
    from vibroimpact.continuation import (
        boundary_curves,
        continue_boundary,
        continue_orbit,
        response_curve,
        switch_branch,
    )
    from vibroimpact.diagrams import bifurcation_diagram
    from vibroimpact.explorer.notebook import explore
    from vibroimpact.families import family
    from vibroimpact.files import load, save
    from vibroimpact.model import State
    from vibroimpact.model.facets import facet_error, round_obstacle
    from vibroimpact.model.force import Force
    from vibroimpact.model.oscillator import ImpactOscillator
    from vibroimpact.model.stops import Stop
    from vibroimpact.model.system import ImpactSystem
    from vibroimpact.motion.classes import classify
    from vibroimpact.motion.recognition import recognise
    from vibroimpact.motion.statistics import impact_statistics
    from vibroimpact.options import Tolerances
    from vibroimpact.orbits import Orbit, find_orbit
    from vibroimpact.orbits.sticking_end import end_of_sticking
    from vibroimpact.orbits.systems.response import response_of
    from vibroimpact.refinement import to_uniform
    from vibroimpact.sections import impact_map, impact_section, stroboscopic_section
    from vibroimpact.simulation import simulate
    from vibroimpact.status import Status
    from vibroimpact.sweeps import parameter_map, refined_map
    from vibroimpact.verdict.compare import compare
    from vibroimpact.verdict.describe import describe

# Names are handed on when first used, so that importing vibroimpact costs nothing.
_NAMES = {
    "model": "State",
    "model.oscillator": "ImpactOscillator",
    "model.system": "ImpactSystem",
    "model.force": "Force",
    "model.stops": "Stop",
    "model.facets": "facet_error round_obstacle",
    "options": "Tolerances",
    "families": "family",
    "sections": "impact_map impact_section stroboscopic_section",
    "simulation": "simulate",
    "status": "Status",
    "motion.recognition": "recognise",
    "motion.statistics": "impact_statistics",
    "diagrams": "bifurcation_diagram",
    "sweeps": "parameter_map refined_map",
    "refinement": "to_uniform",
    "motion.classes": "classify",
    "orbits": "Orbit find_orbit",
    "orbits.sticking_end": "end_of_sticking",
    "orbits.systems.response": "response_of",
    "continuation": "continue_orbit switch_branch continue_boundary boundary_curves response_curve",
    "coexistence": "attractors basins",
    "verdict": "describe compare",
    "explorer.notebook": "explore",
    "files": "save load",
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = [
    "Force",
    "ImpactOscillator",
    "ImpactSystem",
    "Orbit",
    "State",
    "Status",
    "Stop",
    "Tolerances",
    "attractors",
    "basins",
    "bifurcation_diagram",
    "boundary_curves",
    "classify",
    "compare",
    "contact",
    "continue_boundary",
    "continue_orbit",
    "describe",
    "end_of_sticking",
    "explore",
    "facet_error",
    "family",
    "find_orbit",
    "impact_map",
    "impact_section",
    "impact_statistics",
    "load",
    "models",
    "parameter_map",
    "plotting",
    "recognise",
    "refined_map",
    "response_curve",
    "response_of",
    "round_obstacle",
    "save",
    "simulate",
    "stroboscopic_section",
    "switch_branch",
    "to_uniform",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = globals()[name] = getattr(import_module(f"vibroimpact.{_HOMES[name]}"), name)
        return value
    if name in ("contact", "models", "plotting"):
        return import_module(f"vibroimpact.{name}")
    if name == "__version__":
        from importlib.metadata import version

        return version("vibroimpact")
    raise AttributeError(f"module 'vibroimpact' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
