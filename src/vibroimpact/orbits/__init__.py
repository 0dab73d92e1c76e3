"""Periodic orbits, stable or not."""

from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.search import Orbits, find_orbit

__all__ = ["Orbit", "Orbits", "find_orbit"]
