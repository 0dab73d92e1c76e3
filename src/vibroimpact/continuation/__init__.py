"""Branches of periodic orbits along a parameter, and their boundaries in two."""

from vibroimpact.continuation.boundary import continue_boundary
from vibroimpact.continuation.branch import continue_orbit
from vibroimpact.continuation.curves import boundary_curves
from vibroimpact.continuation.results import BifurcationPoint, Boundary, Branch
from vibroimpact.continuation.switching import switch_branch

__all__ = [
    "BifurcationPoint",
    "Boundary",
    "Branch",
    "boundary_curves",
    "continue_boundary",
    "continue_orbit",
    "switch_branch",
]
