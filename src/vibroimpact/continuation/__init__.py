"""Branches of periodic orbits along one parameter, and their stability boundaries in two parameters."""

from vibroimpact.continuation.bifurcations import switch_branch
from vibroimpact.continuation.boundary import continue_boundary
from vibroimpact.continuation.branch import continue_orbit
from vibroimpact.continuation.curves import Boundaries, boundary_curves, curves_through
from vibroimpact.continuation.response import ResponseCurve, response_curve
from vibroimpact.continuation.results import BifurcationPoint, Boundary, Branch
from vibroimpact.continuation.windows import follow_all, stable_windows

__all__ = [
    "BifurcationPoint",
    "Boundaries",
    "Boundary",
    "Branch",
    "ResponseCurve",
    "boundary_curves",
    "continue_boundary",
    "continue_orbit",
    "curves_through",
    "follow_all",
    "response_curve",
    "stable_windows",
    "switch_branch",
]
