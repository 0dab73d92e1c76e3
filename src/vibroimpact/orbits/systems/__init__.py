"""Periodic orbits of systems of several coordinates and stops, stable or not."""

from vibroimpact.model.elements import Contact
from vibroimpact.orbits.orbit import Orbit, Rest
from vibroimpact.orbits.systems.orbit import at_first_contact, make_orbit

SystemOrbit = Orbit  # its name before all models had one class of orbits

__all__ = [
    "Contact",
    "Rest",
    "SystemOrbit",
    "at_first_contact",
    "make_orbit",
]
