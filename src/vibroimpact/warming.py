"""Compilation of all kernels in advance, for a container image, a cluster, or a first command without a wait.

Processes compile in parallel and share the cache: first the kernels of computations, then all others that this machine
may need.
"""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from typing import Any

import numpy as np

import vibroimpact as vi
from vibroimpact import compiling
from vibroimpact.execution.threads import worker_count
from vibroimpact.indices import INDICES
from vibroimpact.kernels.shared.deferred import compile_part, noted
from vibroimpact.progress import Report


def one_mass() -> None:
    """Run computations that need all kernels of one mass."""
    osc = vi.ImpactOscillator()
    vi.parameter_map(osc, omega=[1.0, 2.0], indices=tuple(INDICES))
    vi.parameter_map(osc, omega=[1.0, 2.0], indices=["rms"])
    vi.parameter_map(osc, omega=[1.0, 2.0])
    vi.bifurcation_diagram(osc, omega=np.linspace(1.0, 2.0, 100))
    vi.describe(osc, parameters=["gap"])


def maps_of_systems() -> None:
    """Run computations that need the kernels of maps of systems."""
    damper = vi.models.impact_damper()
    vi.parameter_map(damper, omega=[1.0, 2.0])
    vi.parameter_map(damper, omega=[1.0, 2.0], indices=["rms"], of=0)


def motions_of_systems() -> None:
    """Run computations that need the kernels of single motions of systems."""
    gear = vi.models.idle_gear()
    vi.impact_section(gear)
    vi.find_orbit(gear, n_impacts=-1)


FAMILIES: tuple[Callable[[], None], ...] = one_mass, maps_of_systems, motions_of_systems


def warm_up(report: Report) -> None:
    """Compile on all cores of this machine."""
    submitted: set[bytes] = set()
    done, fresh = 0, multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(worker_count(None), fresh, _say_nothing) as processes:
        waiting: set[Future[Any]] = {processes.submit(family) for family in FAMILIES}
        while waiting:
            ended, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for task in ended:
                task.result()
            done, new = done + len(ended), set(noted()) - submitted
            submitted |= new
            waiting |= {processes.submit(compile_part, part) for part in new}
            if report(done, done + len(waiting), None) is False:
                processes.shutdown(cancel_futures=True)
                break


def warm_up_cluster(cluster: Any, report: Report) -> None:
    """Compile on one worker of each machine of a cluster."""
    from vibroimpact.execution.cluster import connect

    with connect(cluster) as client:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        one_each = {about["host"]: address for address, about in workers.items()}
        tasks = [client.submit(_warm_up_here, workers=[address], pure=False) for address in one_each.values()]
        for done, task in enumerate(tasks, 1):
            task.result()
            report(done, len(tasks), None)


def _say_nothing() -> None:
    compiling.SILENT = np.inf


def _warm_up_here() -> None:
    """Compile on this machine by a separate command; if that fails, raise its last line."""
    ended = subprocess.run(
        [sys.executable, "-m", "vibroimpact", "warm-up"], capture_output=True, text=True, check=False
    )
    if ended.returncode:
        last = (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[-1]
        raise RuntimeError(f"kernels could not be compiled: {last}")
