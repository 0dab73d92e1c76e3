"""How many cells a refined map computes, and how much of it is wrong: the paper's plane beside uniform maps of it.

`python -m benchmarks.refinement` takes 20 minutes on two cores, with `--quick` (513 x 513, 500 impacts) half of one.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.refinement.picture import NAMING, motion_codes

OSC = vi.ImpactOscillator()
TRANSIENT = 100
BLOCKS = ((0.5, 0.25), (0.0625, 0.0625), (0.0, 0.0))  # where they begin, in parts of the plane; each is a quarter wide
TARGETS = {"computed": 0.25, "differs": 0.005}  # of 4097 x 4097 cells
Codes = NDArray[np.uint32]


def codes(sweep: xr.Dataset, impacts: int) -> Codes:
    """Return the motions of a map, one number a cell."""
    return motion_codes({name: sweep[name].values.ravel() for name in (*NAMING, "status")}, impacts)


def sampled(plane: xr.Dataset, number: int, impacts: int) -> tuple[NDArray[np.int64], Codes]:
    """Return cells of the plane drawn at random, and the motions that a uniform map shows there."""
    first, second = (plane[name].values for name in ("omega", "mass"))
    at = np.random.default_rng(1).integers(0, first.size * second.size, number)
    i, j = np.divmod(at, second.size)
    points = {"omega": first[i], "mass": second[j]}
    uniform = vi.parameter_map(OSC, points=points, indices=NAMING, transient_impacts=TRANSIENT, sample_impacts=impacts)
    return at, motion_codes({name: uniform[name].values for name in (*NAMING, "status")}, impacts)


def block(plane: xr.Dataset, corner: tuple[float, float], impacts: int) -> dict[str, float]:
    """Return the share of a quarter of each axis that differs from the uniform map, and the share computed."""
    starts = [int(part * (plane.sizes[name] - 1)) for part, name in zip(corner, ("omega", "mass"), strict=True)]
    side = (plane.sizes["omega"] - 1) // 4
    part = plane.isel(omega=slice(starts[0], starts[0] + side), mass=slice(starts[1], starts[1] + side)).load()
    axes = {name: part[name].values for name in ("omega", "mass")}
    whole = vi.parameter_map(OSC, indices=NAMING, sample_impacts=impacts, **axes)
    told, true = codes(part, impacts), codes(whole, impacts)
    return {"computed": float((part["level"] >= 0).mean()), **_differ(told, true)}


def _differ(told: Codes, true: Codes) -> dict[str, float]:
    return {"differs": float((told != true).mean()), "class differs": float((told % 8 != true % 8).mean())}


def measure(points: int, levels: int, impacts: int, number: int) -> dict[str, Any]:
    """Refine the plane and compare it with uniform maps of its blocks and with cells drawn at random."""
    axes = {"omega": np.linspace(0.025, 5.0, points), "mass": np.linspace(0.1, 5.0, points)}
    begin = time.perf_counter()
    plane = vi.refined_map(OSC, refine=levels, sample_impacts=impacts, progress=True, **axes)
    took = time.perf_counter() - begin
    at, true = sampled(plane, number, impacts)
    told = codes(plane, impacts)[at]
    blocks = {str(corner): block(plane, corner, impacts) for corner in BLOCKS}
    whole = {"computed": float(plane.attrs["fraction_computed"]), **_differ(told, true)}
    return {"cells": int(plane["std"].size), "seconds": took, "plane": whole, "blocks from": blocks}


def main() -> None:
    """Print what was measured, and whether it is good enough."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args()
    size = (65, 3, 500, 20_000) if asked.quick else (257, 4, 5000, 100_000)
    measured = measure(*size)
    for name, row in {"plane": measured["plane"], **measured["blocks from"]}.items():
        print(f"{name:18s}" + "".join(f"{key} {100.0 * value:6.2f} %   " for key, value in row.items()))
    for key, most in ({} if asked.quick else TARGETS).items():
        value = measured["plane"][key]
        print(f"{key}: {100.0 * value:.2f} % (at most {100.0 * most:g} %) {'met' if value <= most else 'MISSED'}")
    print(json.dumps(measured))


if __name__ == "__main__":
    main()
