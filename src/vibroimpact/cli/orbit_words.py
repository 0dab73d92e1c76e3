"""Orbits, branches, boundaries, basins and comparisons in words, with units."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.axes import NAMES
from vibroimpact.bundles import unbundle
from vibroimpact.cli.phrases import axis_range, counted, listed, quantity
from vibroimpact.dataset import oscillator_of
from vibroimpact.indices import INDICES, spread_scale, told_spread
from vibroimpact.motion import Motion
from vibroimpact.oscillator import PARAMETERS
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

_IMPACTS = 9  # of a cycle, told at most
_A_LINE = 3


def tell_orbits(dataset: xr.Dataset) -> Iterator[str]:
    """Yield what is known of each orbit that was found."""
    period = oscillator_of(dataset).period
    reasons = json.loads(dataset.attrs["messages"])
    yield dataset.attrs["message"]
    for at, why in enumerate(reasons):
        orbit = dataset.isel(orbit=at)
        stable = "stable" if bool(orbit["stable"]) else "unstable"
        length = int(orbit["n_periods"]) * period
        yield f"{at + 1}. {_name(orbit)}, {stable}, repeats every {length:.6g} s"
        if why:
            yield f"   no motion of the mass: {why}"
        yield from _hits(orbit)
        if float(orbit["stuck_time"]) > 0.0:
            rest, leaves, stuck = (float(orbit[key]) for key in ("stick_phase", "release_phase", "stuck_time"))
            yield f"   at rest at the stop from phase {rest:.6g} to {leaves:.6g}, {stuck:.6g} s a cycle"
        yield f"   multipliers {_multipliers(orbit)}"


def _hits(orbit: xr.Dataset) -> Iterator[str]:
    """Yield the impacts of a cycle, a few a line."""
    rows = orbit["velocity"].values, orbit["phase"].values
    hits = [f"{v:.6g} m/s at phase {phase:.6g}" for v, phase in zip(*rows, strict=True) if math.isfinite(v)]
    told = hits[:_IMPACTS] + [f"and {len(hits) - _IMPACTS} more"] * (len(hits) > _IMPACTS)
    for first in range(0, len(told), _A_LINE):
        comma = "," if first + _A_LINE < len(told) else ""
        yield f"   {'hits at' if first == 0 else '       '} {', '.join(told[first : first + _A_LINE])}{comma}"


def _multipliers(orbit: xr.Dataset) -> str:
    (a, b), (c, d) = ([float(orbit[f"multiplier_{i}_{part}"]) for part in ("real", "imag")] for i in (1, 2))
    if not any((a, b, c, d)):
        return "0 and 0: a rest at the stop erases all memory"
    return f"{a:.6g} ± {abs(b):.6g} i, modulus {math.hypot(a, b):.6g}" if b else f"{a:.6g} and {c:.6g}"


def _name(told: xr.Dataset) -> str:
    """Return the name of an orbit, or of those of a branch or a curve."""
    n, p = (int(told[key] if key in told else told.attrs[key]) for key in ("n_periods", "n_impacts"))
    sticks = p == -1 or float(told.get("stuck_time", 0.0)) > 0.0
    return Motion("sticking" if sticks else "periodic", n, p).name


def tell_branches(dataset: xr.Dataset) -> Iterator[str]:
    """Yield where each branch goes, where it is stable, and its special points."""
    branches = unbundle(dataset)
    for at, branch in enumerate(branches, start=1):
        (parameter,) = _parameters(branch)
        head = f"branch {at} of {len(branches)}, " if len(branches) > 1 else ""
        yield f"{head}{_name(branch)}: {counted(branch.sizes['point'], 'orbit')}, {branch.attrs['message']}"
        stretches = [f"{low:.6g} to {high:.6g}" for low, high in _stable_stretches(branch, parameter)]
        yield f"  stable for {parameter} {listed(stretches)}" if stretches else "  nowhere stable"
        kinds = str(branch["special_kind"].attrs["flag_meanings"]).replace("_", "-").split()
        for i in range(branch.sizes["special"]):
            point = branch.isel(special=i)
            speeds = point["special_velocity"].values
            hits = listed([f"{v:.6g}" for v in speeds[np.isfinite(speeds)][:_IMPACTS]])
            kind = kinds[int(point["special_kind"])].replace("-", " ")
            touch = float(point["special_touch_phase"])
            at_phase = f", touches the stop at phase {touch:.6g}" if math.isfinite(touch) else ""
            value = quantity(parameter, float(point["special_value"]))
            yield f"  {kind} at {parameter} = {value}, hits at {hits} m/s{at_phase}"


def _stable_stretches(branch: xr.Dataset, parameter: str) -> Iterator[tuple[float, float]]:
    """Yield the parameter's ends wherever the mass moves on a stable orbit, up to the special points that end it."""
    good = (branch["stable"].values == 1) & (branch["admissible"].values == 1)
    values, special = branch[parameter].values, branch["special_value"].values
    for stable, run in groupby(range(len(values)), key=lambda i: bool(good[i])):
        rows = list(run)
        if stable and len(rows) > 1:
            first, last = max(rows[0] - 1, 0), min(rows[-1] + 1, len(values) - 1)
            ends = [at for at in (first, last) if values[at] in special]  # stable or not by rounding alone
            part = values[[*rows, *ends]]
            yield float(part.min()), float(part.max())


def _parameters(part: xr.Dataset) -> list[str]:
    return [str(name) for name, coord in part.coords.items() if coord.dims == ("point",) and name in NAMES]


def tell_boundaries(dataset: xr.Dataset) -> Iterator[str]:
    """Yield each curve, where it goes and how exact it is."""
    curves = unbundle(dataset)
    yield f"{counted(len(curves), 'curve')} in the plane of {listed(_parameters(curves[0]))}"
    meanings = str(dataset["kind"].attrs["flag_meanings"]).split()
    for curve in curves:
        kind = meanings[int(curve["kind"])].replace("_", " ")
        where = ", ".join(axis_range(curve, name) for name in _parameters(curve))
        miss = float(curve["residual"].max())
        size = counted(curve.sizes["point"], "point")
        yield f"  {kind} of {_name(curve)}: {where} ({size}, off by {miss:.0e} at most)"


def tell_basins(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the attractors and their shares of the starts."""
    field = dataset["attractor"]
    axes = [str(dim) for dim in field.dims]
    yield f"{' x '.join(str(dataset.sizes[axis]) for axis in axes)} starts: " + "; ".join(
        axis_range(dataset, axis) for axis in axes
    )
    names = [name.replace("_", " ") for name in str(field.attrs["flag_meanings"]).split()[1:]]
    for name, at in zip(names, range(dataset.sizes["attractor_id"]), strict=True):
        told = dataset.isel(attractor_id=at)
        hardest, exponent = float(told["max_velocity"]), float(told["lyapunov"])
        hits = f", hardest hit {hardest:.4g} m/s" if math.isfinite(hardest) else ""
        rate = f", largest exponent {exponent:.4g} 1/s" if math.isfinite(exponent) else ""
        yield f"  {100 * float(told['share']):.3g} % {name}{hits}{rate}"
    nowhere = field.values < 0
    for code, count in zip(*np.unique(dataset["status"].values[nowhere], return_counts=True), strict=True):
        status = Status(int(code))
        kept = status in (Status.BUDGET, Status.INTERRUPTED)
        why = status.sentence if kept else "neither a cycle nor chaos for sure; raise `sample_impacts`"
        yield f"  {100 * count / field.size:.3g} % undecided: {why}"


def tell_comparison(dataset: xr.Dataset) -> Iterator[str]:
    """Yield a saved comparison: one line a parameter and an index, both designs in it."""
    names = [str(name) for name in dataset["design"].values]
    yield f"{names[0]} and {names[1]}: {' and '.join(map(str, dataset['motion'].values))}"
    for name in (*PARAMETERS, *INDICES):
        scales = [spread_scale(name, float(speed)) for speed in dataset["max_velocity"].values]
        first, second = map(told_spread, dataset[name].values.tolist(), scales)
        yield f"  {dataset[name].attrs['long_name']}: {quantity(name, first, 6)} and {quantity(name, second, 6)}"
        if name == "omega":
            first, second = first / (2.0 * math.pi), second / (2.0 * math.pi)
            yield f"  driving frequency: {quantity('frequency', first, 6)} and {quantity('frequency', second, 6)}"
