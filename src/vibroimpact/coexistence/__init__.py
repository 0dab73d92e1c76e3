"""Motions that coexist: which attractors an oscillator has, and which starts lead to which."""

from vibroimpact.coexistence.attractor import Attractor
from vibroimpact.coexistence.portrait import basins
from vibroimpact.coexistence.search import attractors

__all__ = ["Attractor", "attractors", "basins"]
