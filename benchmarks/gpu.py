"""Impacts a second on a GPU, chaotic and periodic cells mixed; prints JSON. Run: `python -m benchmarks.gpu [cells]`."""

from __future__ import annotations

import datetime
import json
import platform
import sys
import time
from typing import Any

import numpy as np

import vibroimpact as vi

ROUNDS = 5
CELLS = 131_072
COUNTS = {"transient_impacts": 100, "sample_impacts": 5000}  # the paper's
# Settled, sticking and chaotic motion lie side by side over these.
SPREAD = {"omega": (0.05, 5.0), "restitution": (0.5, 0.95)}


def axes(cells: int) -> dict[str, np.ndarray]:
    rows = max(round(cells**0.5 / 2), 1)
    numbers = {"omega": max(cells // rows, 1), "restitution": rows}
    return {name: np.linspace(*SPREAD[name], numbers[name]) for name in SPREAD}


def timed(cells: int, backend: str, early_closing: bool) -> tuple[float, Any]:
    begin = time.perf_counter()
    sweep = vi.parameter_map(
        vi.ImpactOscillator(), backend=backend, early_closing=early_closing, **COUNTS, **axes(cells)
    )
    return time.perf_counter() - begin, sweep


def rates(cells: int, backend: str, early_closing: bool) -> dict[str, float]:
    """Return the median over the rounds; `first_s` is the first call, compiling included."""
    first, _ = timed(cells, backend, early_closing)
    times, sweep = [], None
    for _ in range(ROUNDS):
        elapsed, sweep = timed(cells, backend, early_closing)
        times.append(elapsed)
    elapsed = float(np.median(times))
    answered = sweep["status"].size * sum(COUNTS.values())
    return {
        "first_s": first,
        "median_s": elapsed,
        "cells": sweep["status"].size,
        "impacts_computed_per_s": sweep.attrs["impacts_computed"] / elapsed,
        "impacts_answered_per_s": answered / elapsed,  # those known without computing them included
        "steps_per_impact": sweep.attrs["steps_computed"] / max(sweep.attrs["impacts_computed"], 1),
        "share_closed": float((sweep["status"] == vi.Status.CLOSED).mean()),
    }


def main() -> None:
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else CELLS
    report: dict[str, Any] = {"date": datetime.date.today().isoformat(), "python": platform.python_version()}
    try:
        from vibroimpact.backends import get_backend

        get_backend("cuda")
    except ValueError as error:
        report |= {"gpu": None, "why": str(error)}
        print(json.dumps(report, indent=2))
        return
    from numba import cuda

    device = cuda.get_current_device()
    report |= {"gpu": device.name.decode() if isinstance(device.name, bytes) else str(device.name)}
    report["every_impact"] = rates(cells, "cuda", early_closing=False)
    report["early_closing"] = rates(cells, "cuda", early_closing=True)
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
