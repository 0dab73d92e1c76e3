"""Time jobs side by side, run children, and say on what machine."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any

from vibroimpact.execution.threads import worker_count

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("vibroimpact", "numpy", "numba", "scipy", "xarray", "heyoka", "numba-cuda")

Job = Callable[[], int]  # does some work and returns how many impacts that was


def interleaved(jobs: Mapping[str, Job], rounds: int) -> dict[str, list[float]]:
    """Return nanoseconds an impact, one entry a round.

    In every round each job runs once, so that a machine that slows down slows all of them, and ratios of one round
    keep their meaning.
    """
    cost: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, job in jobs.items():
            begin = time.perf_counter()
            impacts = job()
            cost[name].append((time.perf_counter() - begin) / impacts * 1e9)
    return cost


def ratio(above: list[float], below: list[float]) -> float:
    """Return the median of the ratios within each round."""
    return median(one / other for one, other in zip(above, below, strict=True))


class Cores:
    """How many cores this process has had since; fewer than its threads on a machine that others share."""

    def __init__(self) -> None:
        self.wall, self.used = time.perf_counter(), time.process_time()

    def got(self) -> float:
        return (time.process_time() - self.used) / (time.perf_counter() - self.wall)


def child(*arguments: str, **environment: str) -> tuple[float, str]:
    """Return the seconds and the output of a fresh Python process."""
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    elapsed = time.perf_counter() - begin
    if done.returncode:
        raise RuntimeError(f"`python {' '.join(arguments)}` failed:\n{done.stderr}")
    return elapsed, done.stdout


def child_result(*arguments: str, **environment: str) -> Any:
    """Return what a fresh Python process printed as JSON."""
    return json.loads(child(*arguments, **environment)[1])


def peak_memory() -> float | None:
    """Return the most memory in MB this process ever held; None where the system does not tell."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux counts what the parent held, when it began a process, for the process itself
        (line,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return float(line.split()[1]) / 1e3
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)


def machine() -> dict[str, Any]:
    """Return processor, cores and versions; no name of the host and no path."""
    return {
        "processor": _processor(),
        "cores": worker_count(None),
        "system": platform.system(),
        "python": platform.python_version(),
        "versions": {name: found for name in PACKAGES if (found := _version(name))},
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    told: dict[str, str] = {}
    for line in lines:
        label, _, value = line.partition(":")
        told[label.strip()] = value.strip()
    name, flags = told.get("model name", platform.machine()), told.get("flags", "").split()
    vectors = [label for flag, label in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags]
    return ", ".join([name, *vectors[:1]])
