"""Motions that coexist: which attractors an oscillator has, and which initial conditions lead to each."""

from vibroimpact.coexistence.attractor import Attractor
from vibroimpact.coexistence.search import attractors, basins

__all__ = ["Attractor", "attractors", "basins"]
