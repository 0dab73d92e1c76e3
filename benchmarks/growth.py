"""How the cost of an impact changes with threads, impacts, cells and stiffness."""

from __future__ import annotations

from collections.abc import Iterable
from statistics import median
from typing import Any

import numpy as np

import vibroimpact as vi
from benchmarks.effort import Effort
from benchmarks.measure import Cores, Job, interleaved, ratio
from benchmarks.ours import TRANSIENT
from benchmarks.problem import OSCILLATOR, Floats, frequencies
from vibroimpact.execution.threads import worker_count
from vibroimpact.indices import INDICES

STIFFNESSES = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)  # w / w_n


class Sweep:
    """A sweep without closing; called, it runs, and it remembers its counts."""

    def __init__(self, omega: Floats, impacts: int, workers: int = 1, indices: Iterable[str] = ("std",)) -> None:
        self.omega, self.impacts, self.workers, self.indices = omega, impacts, workers, tuple(indices)
        self.steps_an_impact = float("nan")
        self.cores_got: list[float] = []

    def __call__(self) -> int:
        transient = min(TRANSIENT, self.impacts - 1)
        kept = {"transient_impacts": transient, "sample_impacts": self.impacts - transient}
        watch = Cores()
        how = {"workers": self.workers, "early_closing": False, "indices": self.indices}
        seen = vi.parameter_map(OSCILLATOR, omega=self.omega, **how, **kept)
        self.cores_got.append(watch.got())
        impacts = int(seen.attrs["impacts_computed"])
        self.steps_an_impact = seen.attrs["steps_computed"] / impacts
        return impacts


def _table(label: str, sweeps: dict[str, Sweep], values: list[Any], rounds: int) -> list[dict[str, Any]]:
    jobs: dict[str, Job] = dict(sweeps)
    cost = interleaved(jobs, rounds)
    return [
        {label: value, "ns": median(cost[name]), "steps_an_impact": sweep.steps_an_impact}
        for value, (name, sweep) in zip(values, sweeps.items(), strict=True)
    ]


def threads(effort: Effort) -> list[dict[str, Any]]:
    """Return how much faster 1, 2, 4 ... and all cores are than one, and how many cores the system gave them."""
    cores = worker_count(None)
    counts = sorted({1, cores, *(2**i for i in range(cores.bit_length()) if 2**i <= cores)})
    omega = frequencies("spread", effort.cells)
    sweeps = {str(count): Sweep(omega, effort.impacts, count) for count in counts}
    jobs: dict[str, Job] = dict(sweeps)
    cost = interleaved(jobs, effort.rounds)
    return [
        {
            "threads": count,
            "ns": median(cost[str(count)]),
            "speed_up": ratio(cost["1"], cost[str(count)]),
            "cores_got": median(sweeps[str(count)].cores_got),
        }
        for count in counts
    ]


def indices(effort: Effort) -> float:
    """Return how many times as much all indices cost as Std alone, one thread, no closing."""
    omega = frequencies("spread", effort.cells)
    jobs: dict[str, Job] = {
        "std": Sweep(omega, effort.impacts),
        "all": Sweep(omega, effort.impacts, indices=INDICES),
    }
    cost = interleaved(jobs, effort.rounds)
    return ratio(cost["all"], cost["std"])


def impacts(effort: Effort) -> list[dict[str, Any]]:
    values = [effort.impacts // part for part in (64, 16, 4, 1)]
    omega = frequencies("spread", effort.cells // 2)
    return _table("impacts", {str(n): Sweep(omega, n) for n in values}, values, effort.rounds)


def cells(effort: Effort) -> list[dict[str, Any]]:
    values = [n for n in (1, 4, 16, 64, 256, 1024, 2048, 4096, 8192) if n <= effort.largest_sweep]
    sweeps = {str(n): Sweep(frequencies("chaotic", n), max(effort.impacts // 8, 200)) for n in values}
    return _table("cells", sweeps, values, effort.rounds)


def stiffness(effort: Effort) -> list[dict[str, Any]]:
    """Return the cost within 1 % of w over w_n, from a drive that creeps to one that is far too fast to follow."""
    sweeps = {
        str(value): Sweep(value * np.linspace(0.99, 1.01, effort.cells // 8), max(effort.impacts // 8, 200))
        for value in STIFFNESSES
    }
    return _table("omega_over_natural", sweeps, list(STIFFNESSES), min(effort.rounds, 3))
