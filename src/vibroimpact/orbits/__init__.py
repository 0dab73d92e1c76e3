"""Periodic orbits, stable or not."""

from vibroimpact.orbits.distance import orbit_distance, same_orbit
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.results import Orbits
from vibroimpact.orbits.search import find_orbit

__all__ = ["Orbit", "Orbits", "find_orbit", "orbit_distance", "same_orbit"]
