"""Measurements that claims share: public calls on the paper's oscillator, each made once."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.motion import Motion, cycle_length, recognise
from vibroimpact.studies.lee.paper import OSCILLATOR, TIME_STEP, TOP, WINDOW, pair_of
from vibroimpact.studies.lee.scale import Scale

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Window:
    """Impacts that a simulation from rest shows between two times: s, m/s, and phases in [0, 1)."""

    time: Floats
    velocity: Floats
    phase: Floats

    @property
    def hardest(self) -> tuple[float, float]:
        """Largest velocity and its phase; zero and NaN where nothing hits."""
        if not len(self.velocity):
            return 0.0, float("nan")
        at = int(np.argmax(self.velocity))
        return float(self.velocity[at]), float(self.phase[at])


@dataclass(frozen=True)
class Scan:
    """Motions recognised at ascending frequencies, each from rest at the stop."""

    omega: Floats
    motions: tuple[Motion, ...]

    def where(self, has: Callable[[Motion], bool]) -> Flags:
        """Return which frequencies carry such a motion."""
        return np.array([has(motion) for motion in self.motions])

    def between(self, low: float, high: float) -> Scan:
        """Return the part of the scan in [low, high]."""
        kept = (self.omega >= low - 1e-9) & (self.omega <= high + 1e-9)
        return Scan(self.omega[kept], tuple(m for m, keep in zip(self.motions, kept, strict=True) if keep))

    def share(self, has: Callable[[Motion], bool]) -> float:
        """Return the share of frequencies with such a motion."""
        return float(np.mean(self.where(has)))


@dataclass(frozen=True)
class CellSample:
    """Cells taken evenly from a map: its second parameter, Std in m/s, whether the motion repeats, the motion."""

    parameter: Floats
    std: Floats
    stable: Flags
    motions: tuple[Motion, ...]


class Laboratory:
    """Holds the datasets of the figures and makes, once each, the further measurements that claims need.

    Parameters
    ----------
    scale : Scale
        Grids and counts.
    results : mapping of str to xarray.Dataset
        The figures' datasets by key.
    level : float
        Height of a boundary in m/s.
    workers : int, optional
        Threads of a sweep.
    """

    def __init__(
        self, scale: Scale, results: Mapping[str, xr.Dataset], level: float, workers: int | None = None
    ) -> None:
        self.scale, self.results, self.level, self.workers = scale, results, level, workers
        self.section, self.motion, self.scan = cache(self._section), cache(self._motion), cache(self._scan)
        self.window, self.line, self.edge = cache(self._window), cache(self._line), cache(self._edge)
        self.cells, self.restless = cache(self._cells), cache(self._restless)

    def _section(self, start: vi.State | None = None, **changes: float) -> xr.Dataset:
        """Settled impact section of the paper's oscillator with these changes."""
        return vi.impact_section(
            OSCILLATOR.replace(**changes),
            start=start,
            transient_impacts=self.scale.settle_impacts,
            sample_impacts=self.scale.settled_impacts,
        )

    def _motion(self, **changes: float) -> Motion:
        return recognise(self._section(None, **changes))

    def _motions(self, points: Sequence[Mapping[str, float]]) -> tuple[Motion, ...]:
        """Recognise the motions at many parameter points, in threads."""
        with ThreadPoolExecutor(self.workers or os.cpu_count()) as pool:
            return tuple(pool.map(lambda point: self.motion(**point), points))

    def _scan(self, low: float = 0.0, high: float = TOP, step: float | None = None, **changes: float) -> Scan:
        """Motions from rest at every multiple of the step in (low, high]."""
        pace = step or self.scale.scan_step
        first, last = round(low / pace), round(high / pace)
        omega = np.round(np.arange(max(first, 1), last + 1) * pace, 10)
        return Scan(omega, self._motions([{"omega": float(w), **changes} for w in omega]))

    def _cells(self, name: str) -> CellSample:
        """Recognise the motion in every so-many-th cell of a map."""
        sweep = self.results[pair_of(name).key].transpose("omega", name)
        every = max(1, sweep.sizes["omega"] // self.scale.cells_along)
        part = sweep.isel({dim: slice(every // 2, None, every) for dim in sweep.dims})
        grid = [(float(w), float(value)) for w in part["omega"] for value in part[name]]
        motions = self._motions([{"omega": w, name: value} for w, value in grid])
        second = np.array([value for _, value in grid])
        return CellSample(
            second, part["std"].values.ravel(), np.array([repeats(motion) for motion in motions]), motions
        )

    def _edge(self, name: str, inside: float, outside: float, **changes: float) -> float:
        """Return the frequency nearest `outside` at which a motion, followed from `inside`, keeps its name.

        Bisection to 1e-4; each attempt starts from the last impact of the nearest one that kept the name.
        """
        kept = self.section(omega=inside, **changes)
        if recognise(kept).name != name:
            return float("nan")
        while abs(outside - inside) > 1e-4:
            middle = 0.5 * (inside + outside)
            osc = OSCILLATOR.replace(omega=middle, **changes)
            start = vi.State(osc.gap, float(kept["velocity"][-1]), float(kept["phase"][-1]) * osc.period)
            attempt = self._section(start=start, omega=middle, **changes)
            if recognise(attempt).name == name:
                inside, kept = middle, attempt
            else:
                outside = middle
        return inside

    def _window(self, backend: str = "fixed-step", **changes: float) -> Window:
        """Impacts between 100 and 150 s from rest, by the paper's scheme unless another back end is named."""
        osc = OSCILLATOR.replace(**changes)
        options: dict[str, Any] = {"time_step": TIME_STEP} if backend == "fixed-step" else {}
        run = vi.simulate(
            osc, periods=int(np.ceil(WINDOW[1] / osc.period)), samples_per_period=1, backend=backend, **options
        )
        time, velocity = run["impact_time"].values, run["impact_velocity"].values
        kept = (time >= WINDOW[0]) & (time <= WINDOW[1])
        return Window(time[kept], velocity[kept], np.mod(time[kept] / osc.period, 1.0))

    def _restless(self, low: float, high: float) -> str:
        """Say at how many frequencies of an interval the paper's scheme shows no cycle within its window."""
        omega = np.arange(low, high + 1e-9, 0.05)
        seen = [self.window(omega=float(w)) for w in omega]
        without = [not cycle_length(one.velocity, one.phase, tolerance=0.01, longest=12) for one in seen]
        return f"no cycle of up to 12 impacts repeats to 1 % in the window at {np.mean(without):.0%} of the frequencies"

    def _line(self, low: float = 0.0, high: float = TOP, columns: int | None = None, **changes: float) -> xr.Dataset:
        """Indices along w at the map's sampling; the first frequency is one step above `low`."""
        omega = np.linspace(low, high, (columns or self.scale.columns) + 1)[1:]
        return vi.parameter_map(
            OSCILLATOR.replace(**changes),
            omega=omega,
            indices=("std", "mean_velocity", "max_velocity", "impacts_per_period"),
            transient_impacts=self.scale.map_transient,
            sample_impacts=self.scale.map_impacts,
            workers=self.workers,
        )

    def peak(self, near: float, width: float = 0.1, **changes: float) -> tuple[float, float]:
        """Return frequency and height of the largest impact velocity within `width` of a frequency."""
        return highest(self.line(low=near - width, high=near + width, columns=101, **changes))

    def largest(self, **changes: float) -> tuple[float, float]:
        """Return frequency and height of the largest impact velocity over all of w."""
        return highest(self.line(**changes))


def highest(line: xr.Dataset) -> tuple[float, float]:
    """Return frequency and height of the largest impact velocity on a line along w."""
    velocity = line["max_velocity"].values
    at = int(np.nanargmax(velocity))
    return float(line["omega"][at]), float(velocity[at])


def repeats(motion: Motion) -> bool:
    """Whether a motion is stable in the paper's sense: periodic, or sticking in every cycle."""
    return motion.kind in ("periodic", "sticking")


def intervals(omega: Sequence[float] | Floats, flags: Flags, most: int = 4) -> str:
    """Return in words the runs of consecutive frequencies that are flagged, the widest ones if there are many.

    Examples
    --------
    >>> intervals([0.1, 0.2, 0.3, 0.4, 0.5], np.array([True, True, False, False, True]))
    'at w = 0.1 to 0.2, 0.5'
    """
    runs: list[tuple[float, float]] = []
    start: float | None = None
    for index, flag in enumerate(flags):
        if flag and start is None:
            start = float(omega[index])
        if start is not None and (not flag or index == len(flags) - 1):
            runs.append((start, float(omega[index if flag else index - 1])))
            start = None
    widest = sorted(sorted(runs, key=lambda run: run[0] - run[1])[:most])
    said = ", ".join(f"{a:g}" if a == b else f"{a:g} to {b:g}" for a, b in widest)
    if not runs:
        return "at no frequency"
    rest = len(runs) - most
    return f"at w = {said}" + (f" and {rest} narrower interval{'s' if rest > 1 else ''}" if rest > 0 else "")
