"""What it costs to keep a sweep on disk and to take it up again: `python -m benchmarks.stores [points]`."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import vibroimpact as vi
from benchmarks.effort import Effort
from benchmarks.measure import child_result, peak_memory
from vibroimpact.execution.threads import worker_count

WORKERS = min(2, worker_count(None))
TINY = {"transient_impacts": 0, "sample_impacts": 1}  # next to nothing to compute


def axes(points: int) -> dict[str, Any]:
    return {"omega": np.linspace(5.0 / points, 5.0, points), "mass": np.linspace(0.1, 5.0, points)}


def seconds(job: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    job()
    return time.perf_counter() - begin


def overhead(folder: Path, points: int) -> dict[str, float]:
    """Return the seconds of a map in memory and in a store, in turns, and of taking up the finished store."""
    osc, grid = vi.ImpactOscillator(), axes(points)
    vi.parameter_map(osc, omega=[2.0, 2.8], workers=WORKERS)  # compiles
    plain, stored, again = [], [], []
    for turn in range(3):
        store = folder / f"{points}-{turn}.zarr"
        plain.append(seconds(lambda: vi.parameter_map(osc, workers=WORKERS, **grid)))
        for found in (stored, again):
            found.append(seconds(lambda store=store: vi.parameter_map(osc, workers=WORKERS, store=store, **grid)))
    return {
        "in_memory_s": median(plain),
        "stored_s": median(stored),
        "overhead": median(one / other for one, other in zip(stored, plain, strict=True)) - 1.0,
        "taking_up_s": median(again),
    }


def a_tile(folder: Path, tiles: int) -> float:
    """Return the milliseconds that handing out, writing and noting a tile take."""
    osc, side = vi.ImpactOscillator(), round(tiles**0.5)
    grid = axes(side * 4)
    store = folder / "tiny.zarr"
    bare = seconds(lambda: vi.parameter_map(osc, workers=1, **TINY, **grid))
    return (
        1e3 * (seconds(lambda: vi.parameter_map(osc, workers=1, store=store, tile=16, **TINY, **grid)) - bare) / side**2
    )


def run(points: int) -> dict[str, Any]:
    with TemporaryDirectory() as name:
        folder = Path(name)
        found = {
            "points": points,
            **overhead(folder, points),
            "tile_ms": a_tile(folder, 900),
        }
    return {**found, "peak_memory_mb": peak_memory()}


def measure(effort: Effort) -> dict[str, Any]:
    result: dict[str, Any] = child_result("-m", "benchmarks.stores", str(5 * effort.map_points))
    return result


if __name__ == "__main__":
    print(json.dumps(run(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)))
