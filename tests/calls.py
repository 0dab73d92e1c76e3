"""Calls of the public functions with what is right in each, and what nothing should fail on but in words."""

import datetime
import inspect
from collections.abc import Callable
from functools import cache

import numpy as np

import vibroimpact as vi
from vibroimpact.indices import INDICES
from vibroimpact.orbits.sticking import find_sticking_orbit

OSC = vi.ImpactOscillator(omega=1.4)
BRIEF = {"sample_impacts": 20, "transient_impacts": 5, "sample_periods": 5, "transient_periods": 2, "periods": 1}
LINE, PLANE = {"omega": [1.0, 1.1]}, {"omega": [1.0, 1.1], "mass": [1.0, 1.2]}
WRONG = ["x", 3, float("nan"), [], {}, object(), 10**400, [1, "a"], b"b", 1j, np.zeros((2, 2))]
ODD = [
    *WRONG,
    *(None, True, False, -1, 0, 1, -0.5, 0.5, 1e300, 5e-324, float("inf"), 2**63, -(10**30), "", "\0", "std", "omega"),
    *([[]] * 3, [None], ["std", "std"], [float("nan"), 1.0], [2.0, 1.0], [1.0, 2.0], (1.0, 2.0), (1, 2, 3), {1: 2}),
    *({"omega": [1.0]}, {"omega": "x"}, {"a": {"b": []}}, set(), frozenset({"std"}), range(3), iter(()), b"\xff"),
    *(np.float32(1.5), np.array(2.0), np.array(["a"]), np.array([]), np.array([1.0, np.nan]), np.datetime64("now")),
    *(datetime.timedelta(days=1), OSC, vi.State(-1.0), vi.Tolerances(), ..., 10**12),
]


@cache
def results():
    """Return a result of each kind that another function takes."""
    few = {"sample_impacts": 20, "transient_impacts": 5}
    (grown,) = vi.find_orbit(OSC.replace(omega=2.63))
    branch = vi.continue_orbit(grown, "omega", (2.63, 2.67))
    doubling = next(point for point in branch.special if point.kind == "period_doubling")
    return {
        "figure": vi.plotting.oscillator_sketch(),
        "doubling": doubling,
        "curve": vi.continue_boundary(doubling, ("omega", "gap"), ((2.6, 2.7), (-0.1, 0.1)), step=0.1),
        "orbit": vi.find_orbit(OSC)[0],
        "motion": vi.simulate(OSC, periods=2),
        "section": vi.impact_section(OSC, **few),
        "statistics": vi.impact_statistics(OSC, **few),
        "strobed": vi.stroboscopic_section(OSC, sample_periods=5, transient_periods=2),
        "diagram": vi.bifurcation_diagram(OSC, **LINE, indices=["std"], **few),
        "line": vi.parameter_map(OSC, **LINE, **few),
        "map": vi.parameter_map(OSC, **PLANE, indices=list(INDICES), **few),
        "refined": vi.parameter_map(OSC, **PLANE, refine=1, **few),
        "points": vi.parameter_map(OSC, points={"omega": [1.0, 1.1], "gap": [0.0, 0.1]}, **few),
        "basins": vi.basins(OSC, phase=[0.0, 0.5], velocity=[0.0, 1.0]),
        "branch": vi.continue_orbit(vi.find_orbit(OSC)[0], "omega", (1.39, 1.41)),
        "compared": vi.compare(OSC, OSC.replace(gap=0.1), parameters=[]).dataset,
    }


def calls() -> dict[str, tuple[Callable[..., object], dict[str, object]]]:
    """Return public functions and what is right in a call of each; the rest is left out."""
    made, draw = results(), vi.plotting
    right = {
        vi.ImpactOscillator: {},
        vi.State: {"displacement": -1.0},
        vi.Tolerances: {},
        OSC.replace: {"mass": 1.0},
        vi.simulate: {"osc": OSC},
        vi.impact_section: {"osc": OSC},
        vi.stroboscopic_section: {"osc": OSC},
        vi.impact_map: {"osc": OSC},
        vi.impact_map(OSC): {"phase": 0.1, "velocity": 1.0},
        vi.bifurcation_diagram: {"osc": OSC, **LINE},
        vi.parameter_map: {"osc": OSC, **LINE},
        vi.refined_map: {"osc": OSC, **PLANE, "refine": 1},
        vi.to_uniform: {"plane": made["refined"]},
        vi.attractors: {"osc": OSC, "starts": [vi.State(-1.0)]},
        vi.basins: {"osc": OSC, "phase": [0.0, 0.5], "velocity": [0.0, 1.0]},
        vi.find_orbit: {"osc": OSC},
        find_sticking_orbit: {"osc": OSC.replace(omega=0.5)},
        vi.end_of_sticking: {"osc": OSC.replace(omega=0.5), "parameter": "omega", "between": (0.5, 0.6)},
        vi.describe: {"osc": OSC, "parameters": []},
        vi.compare: {"a": OSC, "b": OSC, "parameters": []},
        vi.classify: {"sweep": made["map"]},
        vi.recognise: {"section": made["section"]},
        vi.continue_orbit: {"orbit": made["orbit"], "parameter": "omega", "range": (1.39, 1.41)},
        vi.boundary_curves: {"osc": OSC, "parameters": ("omega", "gap"), "ranges": ((1.3, 1.4), (0.0, 0.1))},
        vi.save: {"dataset": made["map"], "path": "result.nc"},
        vi.load: {"path": "result.nc"},
        vi.switch_branch: {"point": made["doubling"]},
        vi.continue_boundary: {
            "point": made["doubling"],
            "parameters": ("omega", "gap"),
            "ranges": ((2.64, 2.66), (-0.1, 0.1)),
            "step": 0.1,
        },
        vi.impact_statistics: {"source": made["section"]},
        vi.round_obstacle: {"x": [1.0, 0.0], "y": [0.0, 1.0], "clearance": 1e-3},
        vi.facet_error: {"facets": 16},
        draw.default_kind: {"dataset": made["map"]},
        draw.save_figure: {"figure": made["figure"], "path": "figure.svg"},
        draw.basin_portrait: {"dataset": made["basins"]},
        draw.bifurcation_diagram: {"diagram": made["diagram"]},
        draw.boundaries: {"curves": made["curve"]},
        draw.boundary_lines: {"sweep": made["map"], "index": "std", "level": 0.1},
        draw.branch_diagram: {"branches": made["branch"]},
        draw.comparison_figure: {"designs": made["compared"]},
        draw.diagram_with_index: {"diagram": made["diagram"], "sweep": made["line"]},
        draw.exponent_map: {"sweep": made["map"]},
        draw.impact_histogram: {"statistics": made["statistics"]},
        draw.impact_map: {"section": made["section"]},
        draw.index_contour: {"sweep": made["map"]},
        draw.index_curve: {"sweep": made["line"]},
        draw.index_scatter: {"designs": made["points"]},
        draw.index_surface: {"sweep": made["map"]},
        draw.motion_map: {"sweep": made["map"]},
        draw.oscillator_sketch: {},
        draw.phase_portrait: {"simulation": made["motion"]},
        draw.stroboscopic_map: {"section": made["strobed"]},
        draw.time_history: {"simulation": made["motion"]},
    }
    return {f"{function.__module__}.{function.__qualname__}": (function, given) for function, given in right.items()}


def arguments(function: Callable[..., object]) -> list[str]:
    """Return the names of the arguments that a function takes, two parameters where it takes those of a model."""
    known = inspect.signature(function).parameters.values()
    listed = [each.name for each in known if each.kind not in (each.VAR_KEYWORD, each.VAR_POSITIONAL)]
    return listed + ["omega", "gap"] * any(each.kind == each.VAR_KEYWORD for each in known)
