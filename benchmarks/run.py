"""Measure everything and write it down: `python -m benchmarks.run` (about five minutes), `--quick` (under one)."""

from __future__ import annotations

import argparse
import datetime
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import cluster, contest, growth, maps, startup, stores, systems
from benchmarks.effort import FULL, QUICK, Effort
from benchmarks.measure import ROOT, child_result, machine
from benchmarks.ours import gpu_note
from benchmarks.page import put_into, tables
from benchmarks.problem import frequencies
from benchmarks.targets import judged

GPU = ROOT / "benchmarks" / "results" / "gpu.json"  # of the last machine that had one


def measure(effort: Effort) -> dict[str, Any]:
    begin = time.perf_counter()
    sweep = growth.Sweep(frequencies("spread", effort.cells), effort.impacts)
    sweep()
    result: dict[str, Any] = {
        "date": datetime.date.today().isoformat(),
        "machine": machine(),
        "quick": effort is QUICK,
        "steps_an_impact": sweep.steps_an_impact,
        "contenders": contest.hold(effort),
        "maps": maps.measure(effort),
        "threads": growth.threads(effort),
        "all_indices_over_std": growth.indices(effort),
        "basins_seconds": maps.basins(effort),
        "stores": stores.measure(effort),
        "cluster": cluster.measure(effort),
        "growth": {
            "impacts": growth.impacts(effort),
            "cells": growth.cells(effort),
            "stiffness": growth.stiffness(effort),
        },
        "gpu": json.loads(GPU.read_text()) if gpu_note() else child_result("-m", "benchmarks.gpu"),
        "systems": systems.measure(effort),
        "startup": startup.measure(effort),
    }
    result["targets"] = judged(result)
    result["minutes"] = (time.perf_counter() - begin) / 60
    return result


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Compare the engine with other programs.")
    parser.add_argument("--quick", action="store_true", help="a quick run in under a minute; only prints")
    parser.add_argument("--out", type=Path, help="JSON file for the figures, instead of benchmarks/results/latest.json")
    parser.add_argument("--page", type=Path, help="page for the tables, instead of docs/about/benchmarks.md")
    options = parser.parse_args(arguments)
    result = measure(QUICK if options.quick else FULL)
    text = tables(result)
    print(text)
    out = options.out or (None if options.quick else ROOT / "benchmarks" / "results" / "latest.json")
    page = options.page or (None if options.quick else ROOT / "docs" / "about" / "benchmarks.md")
    if out:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if page:
        put_into(page, text)


if __name__ == "__main__":
    main()
