"""The engine: lanes on one core and on all, one orbit, the graphics processor; and the paper's scheme."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import vibroimpact as vi
from benchmarks.effort import Effort
from benchmarks.measure import Job
from benchmarks.problem import LOW, LOW_PERIODS, OSCILLATOR, START, Contender, Floats, LowRun, frequencies

TRANSIENT = 100
GPU_CELLS = 32  # times the cells of the others, to fill a graphics processor


def low_orbit(backend: str = "cpu") -> LowRun:
    run = vi.simulate(OSCILLATOR.replace(omega=LOW), start=START, periods=LOW_PERIODS, backend=backend)
    return LowRun(run["impact_velocity"].values, float(run["displacement"].max()))


@dataclass(frozen=True)
class Lanes:
    """`parameter_map`; the impacts asked for are counted, whether computed or known by closing."""

    name: str
    workers: int | None = 1
    early_closing: bool = False
    backend: str = "cpu"
    cells: float = 1.0  # times those of the effort
    note: str = ""

    def sweep(self, omega: Sequence[float] | Floats, **settings: Any) -> Any:
        how = {"workers": self.workers, "early_closing": self.early_closing, "backend": self.backend}
        return vi.parameter_map(OSCILLATOR, omega=omega, **{**how, **settings})

    def velocities(self, omega: float, count: int) -> Floats:
        # One impact kept of a cell is its mean velocity. Of a settled orbit the last one is enough.
        wanted = range(count) if count <= 20 else [count - 1]
        return np.array(
            [
                self.sweep([omega], start=START, transient_impacts=j, sample_impacts=1, indices=["mean_velocity"])[
                    "mean_velocity"
                ].item()
                for j in wanted
            ]
        )

    def low_frequency(self) -> LowRun:
        # Lanes tell no displacement: they stay where the one orbit stays if they hit as it hits.
        orbit = low_orbit()
        kept = {"transient_impacts": 0, "sample_impacts": len(orbit.velocities)}
        names = ["mean_velocity", "max_velocity", "std"]
        seen = self.sweep([LOW], start=START, indices=names, **kept)
        velocities = np.asarray(orbit.velocities)
        expected = [velocities.mean(), velocities.max(), velocities.std()]
        same = np.allclose([seen[name].item() for name in names], expected, rtol=0.0, atol=1e-9)
        return orbit if same else LowRun([], None)

    def job(self, case: str, effort: Effort) -> Job:
        cells = max(int(self.cells * effort.cells), 64)
        omega, sample = frequencies(case, cells), effort.impacts - TRANSIENT

        def run() -> int:
            self.sweep(omega, transient_impacts=TRANSIENT, sample_impacts=sample)
            return cells * effort.impacts

        return run


@dataclass(frozen=True)
class OneOrbit:
    """`impact_section`, or the same by another back end."""

    name: str
    backend: str = "cpu"
    note: str = ""

    @property
    def slow(self) -> bool:
        return self.backend == "fixed-step"

    def velocities(self, omega: float, count: int) -> Floats:
        osc = OSCILLATOR.replace(omega=omega)
        kept = {"transient_impacts": 0, "sample_impacts": count}
        hits = vi.impact_section(osc, start=START, backend=self.backend, **kept)
        return np.asarray(hits["velocity"].values)

    def low_frequency(self) -> LowRun:
        return low_orbit(self.backend)

    def job(self, case: str, effort: Effort) -> Job | None:
        if case == "spread" and self.slow:
            return None  # at low w it counts the false impacts of a rattle
        omega = frequencies(case, effort.spread if case == "spread" else 1)
        each = effort.slow_impacts if self.slow else effort.orbit_impacts // (10 if case == "spread" else 1)

        def run() -> int:
            for w in omega:
                self.velocities(w, each)
            return each * len(omega)

        return run


def contenders() -> list[Contender]:
    """Return every way of ours; the first is what all ratios refer to."""
    cpu: list[Contender] = [
        Lanes("ours, one core"),
        Lanes("ours, one core, early closing", early_closing=True),
        Lanes("ours, all cores", workers=None),
        Lanes("ours, all cores, early closing", workers=None, early_closing=True),
        Lanes("ours, one core, 64 cells", cells=0.0),
        OneOrbit("ours, one orbit"),
        OneOrbit("the paper's scheme", backend="fixed-step"),
    ]
    note = gpu_note()
    gpu: list[Contender] = [
        Lanes(f"ours, GPU{suffix}", backend="cuda", early_closing=closing, cells=GPU_CELLS, note=note)
        for suffix, closing in (("", False), (", early closing", True))
    ]
    return [*cpu[:5], *gpu, *cpu[5:]]


def gpu_note() -> str:
    """Return why the GPU cannot be measured, or nothing."""
    if os.environ.get("NUMBA_ENABLE_CUDASIM", "0") != "0":
        return "no GPU here"  # its simulator answers, and takes hours
    try:
        vi.parameter_map(OSCILLATOR, omega=[2.0, 2.8], sample_impacts=10, backend="cuda")
    except ValueError:  # the back end says what is missing
        return "no GPU here"
    except Exception as error:
        return f"the GPU fails: {type(error).__name__}"
    return ""
