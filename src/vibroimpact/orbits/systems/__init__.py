"""Periodic orbits of systems of several coordinates and stops, stable or not."""

from vibroimpact.orbits.systems.orbit import AnyOrbit, SystemOrbit
from vibroimpact.orbits.systems.search import find

__all__ = ["AnyOrbit", "SystemOrbit", "find"]
