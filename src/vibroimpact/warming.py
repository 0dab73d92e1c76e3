"""Compile all kernels beforehand, for an image, a cluster, or a first command that does not wait.

Each family of kernels is compiled in a process of its own, side by side: they share the cache.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

import numpy as np

import vibroimpact as vi
from vibroimpact.execution.threads import worker_count
from vibroimpact.indices import INDICES
from vibroimpact.progress import Report


def one_mass() -> None:
    """Compute what needs all kernels of one mass."""
    osc = vi.ImpactOscillator()
    vi.parameter_map(osc, omega=[1.0, 2.0], indices=tuple(INDICES))
    vi.parameter_map(osc, omega=[1.0, 2.0])
    vi.bifurcation_diagram(osc, omega=np.linspace(1.0, 2.0, 100))
    vi.describe(osc, parameters=["gap"])


def maps_of_systems() -> None:
    """Compute what needs the kernels of maps of systems."""
    vi.parameter_map(vi.models.impact_damper(), omega=[1.0, 2.0])


def motions_of_systems() -> None:
    """Compute what needs the kernels of single motions of systems."""
    gear = vi.models.idle_gear()
    vi.impact_section(gear)
    vi.find_orbit(gear, n_impacts=-1)


FAMILIES: tuple[Callable[[], None], ...] = one_mass, maps_of_systems, motions_of_systems


def warm_up(report: Report) -> None:
    """Compile on this machine, on all its cores."""
    with ThreadPoolExecutor(worker_count(None)) as threads:
        under_way = [threads.submit(_in_a_process, family.__name__) for family in FAMILIES]
        for done, future in enumerate(as_completed(under_way), 1):
            future.result()
            if report(done, len(FAMILIES), None) is False:
                break


def warm_up_cluster(cluster: Any, report: Report) -> None:
    """Compile on one worker of each machine of a cluster."""
    from vibroimpact.execution.cluster import connect

    with connect(cluster) as client:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        one_each = {about["host"]: address for address, about in workers.items()}
        tasks = [
            client.submit(_in_a_process, family.__name__, workers=[address], pure=False)
            for address in one_each.values()
            for family in FAMILIES
        ]
        for done, task in enumerate(tasks, 1):
            task.result()
            report(done, len(tasks), None)


def _in_a_process(family: str) -> None:
    """Compile a family in a process of its own, which says nothing; what it fails with is this one's error."""
    call = f"from vibroimpact import warming; warming.{family}()"
    ended = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, check=False)
    if ended.returncode:
        last = (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[-1]
        raise RuntimeError(f"kernels of {family.replace('_', ' ')} could not be compiled: {last}")
