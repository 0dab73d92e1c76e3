"""The paper's five maps, in a process of their own; it holds no more than a user's process would."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np

import vibroimpact as vi
from benchmarks.effort import Effort
from benchmarks.measure import Cores, child_result, peak_memory
from vibroimpact.execution.threads import worker_count

WORKERS = min(2, worker_count(None))
Axis = tuple[str, float, float]  # name, first and last value


def draw(axis: Axis, top: float, points: int, early_closing: bool) -> dict[str, Any]:
    name, low, high = axis
    axes = {"omega": np.linspace(top / points, top, points), name: np.linspace(low, high, points)}
    begin = time.perf_counter()
    sweep = vi.parameter_map(vi.ImpactOscillator(), workers=WORKERS, early_closing=early_closing, **axes)
    elapsed = time.perf_counter() - begin
    counts = {name: int(sweep.attrs[name]) for name in ("impacts_computed", "steps_computed")}
    return {"map": f"omega, {name}", "early_closing": early_closing, "seconds": elapsed, **counts}


def draw_all(points: int, top: float, second_axes: list[Axis]) -> dict[str, Any]:
    """Return time and counts of the five maps, of the first without closing, and the most memory ever held."""
    vi.parameter_map(vi.ImpactOscillator(), omega=[2.0, 2.8], workers=WORKERS)  # compiles
    watch = Cores()
    closing = [draw(axis, top, points, True) for axis in second_axes]
    cores_got = watch.got()
    return {
        "points": points,
        "cores": WORKERS,
        "cores_got": cores_got,
        "maps": closing,
        "without_closing": draw(second_axes[0], top, points, False),
        "total_seconds": sum(drawn["seconds"] for drawn in closing),
        "total_impacts": sum(drawn["impacts_computed"] for drawn in closing),
        "total_steps": sum(drawn["steps_computed"] for drawn in closing),
        "peak_memory_mb": peak_memory(),
    }


def basins(effort: Effort) -> float:
    """Return the seconds of a basin portrait at w = 3, twice as fine as the maps, on two cores."""
    points = 2 * effort.map_points
    axes = {"phase": np.linspace(0, 1, points), "velocity": np.linspace(0, 3, points)}
    osc = vi.ImpactOscillator(omega=3.0)
    vi.basins(osc, phase=[0.1, 0.2], velocity=[1.0, 2.0], workers=WORKERS)  # compiles
    begin = time.perf_counter()
    vi.basins(osc, workers=WORKERS, **axes)
    return time.perf_counter() - begin


def measure(effort: Effort) -> dict[str, Any]:
    from vibroimpact.studies.lee.paper import PAIRS, TOP  # brings matplotlib, which the child is spared

    request = [effort.map_points, TOP, [(pair.name, pair.low, pair.high) for pair in PAIRS]]
    result: dict[str, Any] = child_result("-m", "benchmarks.maps", json.dumps(request))
    return result


if __name__ == "__main__":
    print(json.dumps(draw_all(*json.loads(sys.argv[1]))))
