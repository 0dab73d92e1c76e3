"""What a Dask cluster costs and gains on this machine: two workers over one, and the price of a tile."""

from __future__ import annotations

import json
import time
from functools import partial
from statistics import median
from threading import Event
from typing import Any
from unittest.mock import patch

import numpy as np

import vibroimpact as vi
from benchmarks.effort import Effort
from benchmarks.measure import Job, child_result, interleaved, ratio
from vibroimpact.backends import ImpactWindow, Measurement
from vibroimpact.execution import cluster
from vibroimpact.execution.cluster import Cluster, connect
from vibroimpact.request import Request

WORKERS = (1, 2)
TILES = 400  # that do nothing


def compare(rounds: int, points: int) -> dict[str, Any]:
    """Return times of one map on one and on two workers, in turns, and of tiles that cost nothing but their way."""
    axes = {"omega": np.linspace(5.0 / points, 5.0, points), "mass": np.linspace(0.1, 5.0, points)}

    def draw(client: Any) -> int:
        sweep = vi.parameter_map(vi.ImpactOscillator(), cluster=client, **axes)
        return int(sweep.attrs["impacts_computed"])

    with connect(f"local:{WORKERS[0]}") as one, connect(f"local:{WORKERS[1]}") as two:
        jobs: dict[str, Job] = {"one": partial(draw, one), "two": partial(draw, two)}
        for client, job in zip((one, two), jobs.values(), strict=True):
            client.run(_load)
            job()
        cost = interleaved(jobs, rounds)
        nothing = [_nothing_but_the_way(two) for _ in range(rounds)]
    return {
        "points": points,
        "ns_an_impact": {name: median(values) for name, values in cost.items()},
        "speed_up": ratio(cost["one"], cost["two"]),
        "milliseconds_a_tile": median(nothing),
    }


def _load() -> None:
    """Load the kernels into a worker: a small sweep has too few tiles for every one to get some."""
    vi.parameter_map(vi.ImpactOscillator(), omega=[2.0, 2.8], workers=1)


def _nothing_but_the_way(client: Any) -> float:
    measurement = Measurement(ImpactWindow(100, 5000))
    request = Request(vi.ImpactOscillator(), {"omega": np.linspace(1.0, 2.0, TILES)}, measurement)
    begin = time.perf_counter()
    with patch.object(cluster, "_work", _nothing):
        for _ in Cluster(client).compute(request, [slice(tile, tile + 1) for tile in range(TILES)], Event()):
            pass
    return (time.perf_counter() - begin) / TILES * 1e3


def _nothing(part: slice, shared: object) -> int:
    return part.start


def measure(effort: Effort) -> dict[str, Any]:
    """Measure in a process of its own: workers import the script that starts them."""
    request = [effort.rounds, 2 * effort.map_points]
    result: dict[str, Any] = child_result("-m", "benchmarks.cluster", json.dumps(request))
    return result


if __name__ == "__main__":
    import sys

    print(json.dumps(compare(*json.loads(sys.argv[1]))))
