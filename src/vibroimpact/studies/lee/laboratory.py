"""Measurements for several statements: calls of public functions on the paper's oscillator, each made once."""

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
from vibroimpact.cells import Floats
from vibroimpact.coexistence import Attractor
from vibroimpact.motion import Motion, cycle_name
from vibroimpact.motion.recognition import cycle_length, recognise
from vibroimpact.studies.lee.paper import INDICES, OSCILLATOR, TIME_STEP, TOP, WINDOW, Scale, frequencies, pair_of

Flags = NDArray[np.bool_]
Test = Callable[[Motion], bool]
LISTED = 4  # names or intervals in a sentence, at most


def sticks(motion: Motion) -> bool:
    """Whether the mass comes to rest at the stop in each cycle."""
    return motion.kind == "sticking" and motion.n_periods > 0


def aperiodic(motion: Motion) -> bool:
    """Whether neither the sampled impacts nor the times from one rest to the next ever repeat."""
    if motion.kind == "sticking":
        return motion.n_periods == 0
    return motion.kind in ("chaotic", "undecided") and motion.status != vi.Status.STICKING


def periodic(motion: Motion) -> bool:
    """Whether the motion repeats without sticking."""
    return motion.kind == "periodic"


def repeats(motion: Motion) -> bool:
    """Whether a motion is stable in the paper's sense: periodic, or sticking in every cycle."""
    return periodic(motion) or sticks(motion)


def period_impact(n_periods: int, n_impacts: int) -> Test:
    """Return a test for period-n impact-p motions."""
    name = cycle_name(n_periods, n_impacts)
    return lambda motion: motion.name == name


@dataclass(frozen=True)
class Window:
    """The impacts of a simulation from rest between two times: s, m/s, and phases in [0, 1)."""

    time: Floats
    velocity: Floats
    phase: Floats

    @property
    def hardest(self) -> tuple[float, float]:
        """Largest velocity and its phase; zero and NaN without impacts."""
        if not len(self.velocity):
            return 0.0, float("nan")
        at = int(np.argmax(self.velocity))
        return float(self.velocity[at]), float(self.phase[at])


@dataclass(frozen=True)
class Scan:
    """Motions recognised at ascending frequencies, each from rest at the stop."""

    omega: Floats
    motions: tuple[Motion, ...]

    def where(self, has: Test) -> Flags:
        """Return which frequencies have such a motion."""
        return np.array([has(motion) for motion in self.motions])

    def between(self, low: float | str, high: float | str) -> Scan:
        """Return the part of the scan in [low, high]."""
        within = (self.omega >= float(low) - 1e-9) & (self.omega <= float(high) + 1e-9)
        return Scan(self.omega[within], tuple(m for m, keep in zip(self.motions, within, strict=True) if keep))

    def share(self, has: Test) -> float:
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
    """Holds the datasets of the figures, and makes each further measurement that statements need once.

    Parameters
    ----------
    scale : Scale
        Grids and counts.
    results : mapping of str to xarray.Dataset
        The figures' datasets by key.
    level : float
        Height of a boundary in m/s.
    workers : int or None
        Threads of a sweep; None means one per core.
    """

    def __init__(self, scale: Scale, results: Mapping[str, xr.Dataset], level: float, workers: int | None) -> None:
        self.scale, self.results, self.level, self.workers = scale, results, level, workers
        self.section, self.motion, self.scan = cache(self._section), cache(self._motion), cache(self._scan)
        self.window, self.line, self.edge = cache(self._window), cache(self._line), cache(self._edge)
        self.coexisting = cache(self._coexisting)
        self.cells, self.unsettled = cache(self._cells), cache(self._unsettled)

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

    def _coexisting(self, omega: float) -> list[Attractor]:
        """Attractors of the paper's oscillator at a frequency, from 256 initial conditions."""
        return list(vi.attractors(OSCILLATOR.replace(omega=omega), workers=self.workers))

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

    def variant(self, **changes: float) -> Scan:
        """Motions along w at parameters other than the paper's."""
        return self.scan(step=self.scale.variant_step, **changes)

    def _cells(self, name: str) -> CellSample:
        """Recognise the motion in evenly spaced cells of a map."""
        sweep = self.results[pair_of(name).key].transpose("omega", name)
        every = max(1, sweep.sizes["omega"] // self.scale.cells_along)
        part = sweep.isel({dim: slice(every // 2, None, every) for dim in sweep.dims})
        grid = [(float(w), float(value)) for w in part["omega"] for value in part[name]]
        motions = self._motions([{"omega": w, name: value} for w, value in grid])
        second, stable = np.array([value for _, value in grid]), np.array([repeats(motion) for motion in motions])
        return CellSample(second, part["std"].values.ravel(), stable, motions)

    def _edge(self, name: str, inside: float, outside: float, **changes: float) -> float:
        """Return the frequency nearest `outside` at which a motion, followed from `inside`, keeps its name.

        Bisection to 1e-4; each attempt starts from the last impact of the nearest one that kept the name.
        """
        settled = self.section(omega=inside, **changes)
        if recognise(settled).name != name:
            return float("nan")
        while abs(outside - inside) > 1e-4:
            middle = 0.5 * (inside + outside)
            osc = OSCILLATOR.replace(omega=middle, **changes)
            start = vi.State(osc.gap, float(settled["velocity"][-1]), float(settled["phase"][-1]) * osc.period)
            attempt = self._section(start=start, omega=middle, **changes)
            if recognise(attempt).name == name:
                inside, settled = middle, attempt
            else:
                outside = middle
        return inside

    def _window(self, backend: str = "fixed-step", **changes: float) -> Window:
        """Impacts between 100 and 150 s from rest, by the paper's scheme unless another back end is given."""
        osc = OSCILLATOR.replace(**changes)
        options: dict[str, Any] = {"time_step": TIME_STEP} if backend == "fixed-step" else {}
        run = vi.simulate(
            osc, periods=int(np.ceil(WINDOW[1] / osc.period)), samples_per_period=1, backend=backend, **options
        )
        time, velocity = run["impact_time"].values, run["impact_velocity"].values
        within = (time >= WINDOW[0]) & (time <= WINDOW[1])
        return Window(time[within], velocity[within], np.mod(time[within] / osc.period, 1.0))

    def _unsettled(self, low: float, high: float) -> str:
        """Return, as text, the share of frequencies at which the paper's scheme shows no cycle within its window."""
        omega = np.arange(low, high + 1e-9, 0.05)
        windows = [self.window(omega=float(w)) for w in omega]
        without = [not cycle_length(one.velocity, one.phase, tolerance=0.01, longest=12) for one in windows]
        return f"no cycle of up to 12 impacts repeats to 1 % in the window at {np.mean(without):.0%} of the frequencies"

    def _line(self, low: float = 0.0, high: float = TOP, columns: int | None = None, **changes: float) -> xr.Dataset:
        """Indices along w at the map's sampling; the first frequency is one step above `low`."""
        return vi.parameter_map(
            OSCILLATOR.replace(**changes),
            omega=frequencies(columns or self.scale.columns, low, high),
            indices=INDICES,
            transient_impacts=self.scale.map_transient,
            sample_impacts=self.scale.map_impacts,
            workers=self.workers,
        )

    def peak(self, near: float, width: float = 0.1, **changes: float) -> tuple[float, float]:
        """Return frequency and height of the largest impact velocity within `width` of a frequency."""
        return highest(self.line(low=near - width, high=near + width, columns=101, **changes))

    def first_resonance(self, **changes: float) -> tuple[float, float]:
        """Return frequency and height of the largest impact velocity near 2 w_n."""
        return self.peak(2 * OSCILLATOR.replace(**changes).natural_frequency, **changes)

    def largest(self, **changes: float) -> tuple[float, float]:
        """Return frequency and height of the largest impact velocity over all of w."""
        return highest(self.line(**changes))

    def distinct_looks(self, omega: float) -> int:
        """Return the number of points of a settled Poincare map that differ by more than 1e-6 V."""
        osc = OSCILLATOR.replace(omega=omega)
        looks = vi.stroboscopic_section(osc, transient_periods=self.scale.settle_impacts, sample_periods=64)
        points = np.stack([looks["displacement"].values * osc.natural_frequency, looks["velocity"].values], axis=1)
        differ = np.abs(points[:, None] - points[None]).max(axis=2) > 1e-6 * osc.velocity_scale
        return int(np.sum(~np.tril(~differ, -1).any(axis=1)))


def highest(line: xr.Dataset) -> tuple[float, float]:
    """Return frequency and height of the largest impact velocity on a line along w."""
    velocity = line["max_velocity"].values
    at = int(np.nanargmax(velocity))
    return float(line["omega"][at]), float(velocity[at])


def commonest(motions: tuple[Motion, ...], flags: Flags) -> str:
    """Return the names of the commonest flagged motions and how often each occurs."""
    names = [motion.name for motion, has in zip(motions, flags, strict=True) if has]
    ranked = sorted(set(names), key=lambda name: (-names.count(name), name))[:LISTED]
    return ", ".join(f"{name} {names.count(name)}x" for name in ranked) or "none"


def intervals(omega: Sequence[float] | Floats, flags: Flags) -> str:
    """Return the runs of consecutive flagged frequencies as text; if there are many, only the widest ones.

    Examples
    --------
    >>> intervals([0.1, 0.2, 0.3, 0.4, 0.5], np.array([True, True, False, False, True]))
    'at w = 0.1 to 0.2, 0.5'
    """
    ends = np.flatnonzero(np.diff(np.pad(np.asarray(flags, dtype=int), 1)))
    runs = [(float(omega[first]), float(omega[end - 1])) for first, end in zip(ends[::2], ends[1::2], strict=True)]
    if not runs:
        return "at no frequency"
    widest = sorted(sorted(runs, key=lambda run: run[0] - run[1])[:LISTED])
    shown = ", ".join(f"{a:g}" if a == b else f"{a:g} to {b:g}" for a, b in widest)
    rest = len(runs) - LISTED
    return f"at w = {shown}" + (f" and {rest} narrower interval{'s' if rest > 1 else ''}" if rest > 0 else "")
