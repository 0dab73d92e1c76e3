"""Periodic orbits of systems of several coordinates and stops, stable or not."""

from vibroimpact.orbits.systems.orbit import SystemOrbit
from vibroimpact.orbits.systems.search import find

__all__ = ["SystemOrbit", "find"]
