"""Periodic orbits of systems of several coordinates and stops, stable or not."""

from vibroimpact.orbits.systems.closed_form import one_impact
from vibroimpact.orbits.systems.named import settled
from vibroimpact.orbits.systems.orbit import AnyOrbit, SystemOrbit, at_first_contact, make_orbit
from vibroimpact.orbits.systems.search import cycles_of_one_impact, find

__all__ = [
    "AnyOrbit",
    "SystemOrbit",
    "at_first_contact",
    "cycles_of_one_impact",
    "find",
    "make_orbit",
    "one_impact",
    "settled",
]
