"""The motion at a point: its history, portrait, sections, indices and name, from one orbit."""

from __future__ import annotations

import math
import threading
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.plane import TRANSIENT, compute_cells
from vibroimpact.explorer.state import View, granted, stiffness
from vibroimpact.indices import INDICES, shown_spread, spread_scale
from vibroimpact.motion import MotionClass, decide, motion_name
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.sections import record_orbit
from vibroimpact.status import Status

Floats = NDArray[np.float64]
Columns = dict[str, Floats]

HISTORY = 4000  # samples, about
IMPACTS = 800  # on the impact map
LOOKS = 400  # on the Poincaré map
LEAD = 100  # driving periods left out before the Poincaré map
FAINT = 1e-6  # of the largest velocity: slower impacts are not drawn
REMEMBERED = 16  # motions per page


@dataclass(frozen=True)
class Point:
    """What the page shows of a point."""

    osc: ImpactOscillator
    name: str
    sentence: str
    n_periods: int
    settled: bool  # whether the history begins on the settled motion
    indices: dict[str, float]
    history: Columns  # time, displacement, velocity, both sides of every impact
    impacts: Columns  # time, velocity within the history
    rests: Columns  # begin, end of rests at the stop within the history
    impact_map: Columns  # phase, velocity
    poincare: Columns  # displacement, velocity

    @property
    def size(self) -> float:
        """The static deflection or the gap, whichever is larger, in m: a scale for axes."""
        return max(self.osc.amplitude / self.osc.stiffness, abs(self.osc.gap)) or 1.0


def compute_point(view: View, osc: ImpactOscillator | None = None) -> Point:
    """Return what the page shows of the view's point, or of another one that starts from rest.

    The indices take a run of their own, for the engine observes neighbours and near-misses only while it measures. All
    else is read from one recorded orbit; only the impact map of a motion that does not repeat takes more impacts.
    """
    start = view.start if osc is None else None
    osc = osc or view.osc
    cell = compute_cells(osc, view.samples, stiffness(osc), {view.x: [getattr(osc, view.x)]}, start)
    indices = {name: float(cell[name].values[0]) for name in INDICES}
    status = Status(int(cell["status"].values[0]))
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    kind = MotionClass(int(decide(status, view.samples * indices["lyapunov_per_impact"], n, p)))

    slow = max(1.0, osc.natural_frequency / osc.omega)  # free oscillations per driving period
    lead, looks = max(20, int(LEAD / slow)), max(20, int(LOOKS / slow))
    density = min(max(60, math.ceil(24 * slow)), HISTORY)  # samples per period
    orbit = record_orbit(
        osc,
        start=start,
        transient_periods=lead,
        sample_periods=looks,
        samples_per_period=density,
        tolerances=granted(stiffness(osc), lead + looks),
    )
    length = max(2.0, min(40.0, HISTORY / density)) * osc.period
    shown = _settled_part(osc, orbit, length, n, status.has_indices) if view.settled else None
    impact_map = _impact_map(osc, start, orbit, n, repeats=0 < n <= looks or not status.has_indices)
    begin = _hardest(osc, impact_map) if view.settled and status.has_indices else None
    settled = shown is not None or begin is not None
    if shown is None:  # the beginning is wanted, or the orbit was not recorded to its end
        shown = _from_start(osc, begin or start, length, density)
    return Point(
        osc=osc,
        name=motion_name(kind, n, p),
        sentence=sentence(osc, kind, status, indices),
        n_periods=n,
        settled=settled,
        indices=indices,
        history=_history(osc, shown),
        impacts={"time": shown.impact_time, "velocity": shown.impact_velocity},
        rests=shown.rests,
        impact_map=impact_map,
        poincare={name: orbit[name].values[::density] for name in ("displacement", "velocity")},
    )


@dataclass(frozen=True)
class _Part:
    """Part of an orbit: samples, impacts that can be seen, and rests; times in s."""

    time: Floats
    displacement: Floats
    velocity: Floats
    impact_time: Floats
    impact_velocity: Floats
    rests: Columns


def _part(orbit: xr.Dataset, begin: float, end: float, shift: float = 0.0) -> _Part:
    """Return the part of an orbit between two times, its times made earlier by `shift`."""
    time, hit_time, hit_speed = (orbit[name].values for name in ("time", "impact_time", "impact_velocity"))
    within = (time >= begin) & (time <= end)
    hit = (hit_time >= begin) & (hit_time <= end)
    hit_time, hit_speed = hit_time[hit], hit_speed[hit]
    seen = hit_speed > FAINT * float(hit_speed.max(initial=0.0))
    stick, release = orbit["stick_time"].values, orbit["release_time"].values
    left = np.where(np.isnan(release), end, release).clip(max=end)
    rested = (left > begin) & (stick < end)
    return _Part(
        time=time[within] - shift,
        displacement=orbit["displacement"].values[within],
        velocity=orbit["velocity"].values[within],
        impact_time=hit_time[seen][:HISTORY] - shift,
        impact_velocity=hit_speed[seen][:HISTORY],
        rests={"begin": stick[rested].clip(min=begin) - shift, "end": left[rested] - shift},
    )


def _from_start(osc: ImpactOscillator, start: State | None, length: float, density: int) -> _Part:
    """Return the beginning of the motion."""
    periods = length / osc.period
    limits = granted(stiffness(osc), math.ceil(periods))
    orbit = vi.simulate(osc, start=start, periods=periods, samples_per_period=density, tolerances=limits)
    time = orbit["time"].values
    return _part(orbit, time[0], time[-1]) if len(time) else _part(orbit, 0.0, 0.0)


def _settled_part(osc: ImpactOscillator, orbit: xr.Dataset, length: float, n_periods: int, hits: bool) -> _Part | None:
    """Return the end of an orbit as if it began in the first period, from a hard impact on.

    Of a cycle that is the hardest one; of a motion that does not repeat, the hardest of the last 64 before the end.
    """
    time, hit_time = orbit["time"].values, orbit["impact_time"].values
    if not len(time) or time[-1] - time[0] < length:
        return None
    begin = float(time[-1]) - length
    first = max(float(time[0]), begin - n_periods * osc.period) if n_periods else float(time[0])
    last = np.flatnonzero((hit_time >= first) & (hit_time <= begin))[::-1]
    last = last if n_periods else last[:64]
    if hits and len(last):
        begin = float(hit_time[last[int(orbit["impact_velocity"].values[last].argmax())]])
    return _part(orbit, begin, begin + length, math.floor(begin / osc.period) * osc.period)


def _hardest(osc: ImpactOscillator, impact_map: Columns) -> State | None:
    """Return the hardest of the last impacts as a state to continue from."""
    velocity, phase = (impact_map[name][:-65:-1] for name in ("velocity", "phase"))
    if not len(velocity):
        return None
    at = int(velocity.argmax())
    return State(osc.gap, float(velocity[at]), float(phase[at]) * osc.period)


def _history(osc: ImpactOscillator, part: _Part) -> Columns:
    """Return displacement and velocity over time, with both sides of every impact."""
    hit_time, hit_speed = part.impact_time, part.impact_velocity
    between = _away_from(part.time, hit_time, 1e-9 * osc.period)
    stop = np.full(len(hit_time), osc.gap)
    time = np.concatenate([part.time[between], hit_time, hit_time])
    order = np.argsort(time, kind="stable")
    return {
        "time": time[order],
        "displacement": np.concatenate([part.displacement[between], stop, stop])[order],
        "velocity": np.concatenate([part.velocity[between], hit_speed, -osc.restitution * hit_speed])[order],
    }


def _away_from(time: Floats, events: Floats, width: float) -> NDArray[np.bool_]:
    """Whether instants lie away from all events; a sample at an impact gives way to the impact's two sides."""
    if not len(events):
        return np.ones(len(time), bool)
    after = np.searchsorted(events, time).clip(1, len(events) - 1) if len(events) > 1 else np.zeros(len(time), int)
    nearest = np.minimum(np.abs(events[after] - time), np.abs(events[after - 1] - time))
    return np.asarray(nearest > width)


def _impact_map(
    osc: ImpactOscillator, start: State | None, orbit: xr.Dataset, n_periods: int, repeats: bool
) -> Columns:
    """Return phase and velocity of the impacts after a transient; of a cycle those of the recorded orbit suffice."""
    if repeats:
        time = orbit["impact_time"].values
        cycle = int(np.searchsorted(time, time[-1] - n_periods * osc.period)) if len(time) else 0
        last = slice(min(TRANSIENT, cycle), TRANSIENT + IMPACTS)  # at least the impacts of one cycle
        return {"phase": orbit["impact_phase"].values[last], "velocity": orbit["impact_velocity"].values[last]}
    limits = granted(stiffness(osc), TRANSIENT + IMPACTS)
    hits = vi.impact_section(
        osc, start=start, transient_impacts=TRANSIENT, sample_impacts=IMPACTS, tolerances=limits
    )  # fmt: skip
    return {name: hits[name].values for name in ("phase", "velocity")}


class Motions:
    """The last few motions of a page, so that going back to one costs nothing."""

    def __init__(self) -> None:
        self._known: dict[Hashable, Point] = {}
        self._lock = threading.Lock()

    def of(self, view: View, osc: ImpactOscillator | None = None) -> Point:
        """Return the motion at the view's point, or at another one that starts from rest."""
        key = view.point_key if osc is None else (osc, None, view.settled, view.samples)
        with self._lock:
            known = self._known.get(key)
        if known is None:
            known = compute_point(view, osc)
            with self._lock:
                while len(self._known) >= REMEMBERED:
                    del self._known[next(iter(self._known))]
                self._known[key] = known
        return known


def sentence(osc: ImpactOscillator, kind: MotionClass, status: Status, indices: dict[str, float]) -> str:
    """Return the motion in a sentence."""
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    name, peak = motion_name(kind, n, p), f"largest impact velocity {indices['max_velocity']:.3g} m/s"
    often = "once per period" if n <= 1 else f"once in {n} periods"
    if kind == MotionClass.PERIODIC:
        growth = indices["lyapunov"] * osc.period
        decays = f"; perturbations halve in {_periods(-math.log(2.0) / growth)}" if -1e3 < growth < 0.0 else ""
        return f"{name}, stable, {peak} {often}{decays}."
    if kind == MotionClass.STICKING and not n:
        return f"{name}, {peak}; its period is not resolved in double precision."
    if kind == MotionClass.STICKING:
        rest = 100.0 * indices["stick_fraction"]
        return f"{name}, stable, {peak} {often}; at rest at the stop {rest:.3g} % of the time."
    if kind == MotionClass.CHAOTIC:
        doubling = math.log(2.0) / (indices["lyapunov"] * osc.period)
        return f"{name}, {peak}; perturbations double in {_periods(doubling)}."
    if kind.stored == MotionClass.NO_IMPACT:
        reach = osc.steady_amplitude
        free = f" The amplitude is {reach:.3g} m, the gap {osc.gap:.3g} m." if reach < osc.gap else ""
        return f"{status.sentence[0].upper()}{status.sentence[1:].split(';')[0]}.{free}"
    known = f", {peak}" if math.isfinite(indices["max_velocity"]) else ""
    reason = "no cycle was found, and chaos is not certain" if status.has_indices else status.sentence.split(";")[0]
    return f"Undecided{known}: {reason}; sample more impacts."


def _periods(value: float) -> str:
    return f"{value:.2g} period" + ("" if value == 1.0 else "s")


def index_text(index: str, value: float) -> str:
    """Return the value of an index as a table shows it."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "−∞" if value < 0.0 else "none"
    if index == "n_impacts" and value == -1.0:
        return "∞ (chatter)"
    if index in ("n_periods", "n_impacts") and value == 0.0:
        return "no cycle"
    return f"{value:.5g}".replace("-", "−")


def index_rows(point: Point) -> list[tuple[str, str, str]]:
    """Return long name, value and unit of every index."""
    rows = []
    for name, value in point.indices.items():
        index, scale = INDICES[name], spread_scale(name, point.osc.velocity_scale)
        rows.append((index.long_name, index_text(name, shown_spread(value, scale)), _plain(index.units)))
    return rows


def _plain(units: str) -> str:
    return "" if units == "1" else units
