"""The motion at a point: its history, portrait, maps, numbers and name."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.limits import granted, stiffness
from vibroimpact.explorer.plane import TRANSIENT
from vibroimpact.explorer.state import View
from vibroimpact.indices import INDICES, spread_scale, told_spread
from vibroimpact.motion import MotionClass, motion_name
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.status import Status

Floats = NDArray[np.float64]

HISTORY = 4000  # samples, about
IMPACTS = 800  # on the impact map
LOOKS = 400  # on the Poincare map
LEAD = 100  # driving periods left out before the Poincare map


@dataclass(frozen=True)
class Point:
    """What is told of a point."""

    osc: ImpactOscillator
    name: str
    sentence: str
    kind: MotionClass
    n_periods: int
    settled: bool  # whether the history begins on the settled motion
    indices: dict[str, float]
    history: dict[str, Floats]  # time, displacement, velocity, both sides of every impact
    impacts: dict[str, Floats]  # time, velocity within the history
    rests: dict[str, Floats]  # begin, end of rests at the stop within the history
    impact_map: dict[str, Floats]  # phase, velocity
    poincare: dict[str, Floats]  # displacement, velocity


def compute_point(view: View, osc: ImpactOscillator | None = None) -> Point:
    """Return what is told of the view's point, or of another one started in the same way."""
    start = view.start if osc is None else None
    osc = osc or view.osc
    slow = max(1.0, osc.natural_frequency / osc.omega)  # free oscillations a driving period
    stiff = stiffness(osc)
    hits = vi.impact_section(
        osc,
        start=start,
        transient_impacts=TRANSIENT,
        sample_impacts=IMPACTS,
        tolerances=granted(stiff, TRANSIENT + IMPACTS),
    )
    looks = vi.stroboscopic_section(
        osc,
        start=start,
        transient_periods=max(20, int(LEAD / slow)),
        sample_periods=max(20, int(LOOKS / slow)),
        tolerances=granted(stiff, LEAD + LOOKS),
    )
    one = vi.parameter_map(
        osc, indices=tuple(INDICES), start=start, transient_impacts=TRANSIENT, sample_impacts=view.samples,
        tolerances=granted(stiff, TRANSIENT + view.samples), workers=1, omega=[osc.omega],
    )  # fmt: skip
    indices = {name: float(one[name][0]) for name in INDICES}
    status = Status(int(one["status"][0]))
    kind = MotionClass(int(vi.classify(one)["motion"][0]))
    begin = _settled(osc, hits, looks) if view.settled else start
    history, impacts, rests = _history(osc, begin, slow)
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    return Point(
        osc=osc,
        name=motion_name(kind, n, p),
        sentence=sentence(osc, kind, status, indices),
        kind=kind,
        n_periods=n,
        settled=view.settled and begin is not None,
        indices=indices,
        history=history,
        impacts=impacts,
        rests=rests,
        impact_map={name: hits[name].values for name in ("phase", "velocity")},
        poincare={name: looks[name].values for name in ("displacement", "velocity")},
    )


def _settled(osc: ImpactOscillator, hits: xr.Dataset, looks: xr.Dataset) -> State | None:
    """Return a state on the settled motion: its hardest of the last hits, else where it was last looked at."""
    velocities = hits["velocity"].values
    filled = Status(int(hits["status"])).has_indices
    if filled and len(velocities):
        last = len(velocities) - 1 - int(velocities[:-65:-1].argmax())
        return State(osc.gap, float(velocities[last]), float(hits["phase"][last]) * osc.period)
    if not filled and looks.sizes["period"]:
        return State(min(float(looks["displacement"][-1]), osc.gap), float(looks["velocity"][-1]), 0.0)
    return None


def _history(osc: ImpactOscillator, begin: State | None, slow: float) -> tuple[dict[str, Floats], ...]:
    """Return displacement and velocity over time, with both sides of every impact, and the rests at the stop."""
    density = min(max(60, math.ceil(24 * slow)), HISTORY)
    periods = max(2.0, min(40.0, HISTORY / density))
    limits = granted(stiffness(osc), math.ceil(periods))
    seen = vi.simulate(osc, start=begin, periods=periods, samples_per_period=density, tolerances=limits)
    hit_time, hit_speed = seen["impact_time"].values, seen["impact_velocity"].values
    kept = hit_speed > 1e-6 * float(hit_speed.max(initial=0.0))
    hit_time, hit_speed = hit_time[kept][:HISTORY], hit_speed[kept][:HISTORY]
    apart = _apart(seen["time"].values, hit_time, 1e-9 * osc.period)
    time = np.concatenate([seen["time"].values[apart], hit_time, hit_time])
    order = np.argsort(time, kind="stable")
    stop = np.full(len(hit_time), osc.gap)
    displacement = np.concatenate([seen["displacement"].values[apart], stop, stop])[order]
    velocity = np.concatenate([seen["velocity"].values[apart], hit_speed, -osc.restitution * hit_speed])[order]
    end = float(seen["time"][-1]) if seen.sizes["time"] else 0.0
    release = seen["release_time"].values
    rests = {"begin": seen["stick_time"].values, "end": np.where(np.isnan(release), end, release)}
    history = {"time": time[order], "displacement": displacement, "velocity": velocity}
    return history, {"time": hit_time, "velocity": hit_speed}, rests


def _apart(time: Floats, events: Floats, width: float) -> NDArray[np.bool_]:
    """Whether instants are no events: what is seen at an impact is told by its two sides."""
    if not len(events):
        return np.ones(len(time), bool)
    after = np.searchsorted(events, time).clip(1, len(events) - 1) if len(events) > 1 else np.zeros(len(time), int)
    nearest = np.minimum(np.abs(events[after] - time), np.abs(events[after - 1] - time))
    return np.asarray(nearest > width)


def sentence(osc: ImpactOscillator, kind: MotionClass, status: Status, indices: dict[str, float]) -> str:
    """Return the motion in a sentence."""
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    hardest = f"hits hardest at {indices['max_velocity']:.3g} m/s"
    often = "once a period" if n <= 1 else f"once in {n} periods"
    if kind == MotionClass.PERIODIC:
        growth = indices["lyapunov"] * osc.period
        calms = f"; disturbances halve in {_periods(-math.log(2.0) / growth)}" if -1e3 < growth < 0.0 else ""
        return f"{motion_name(kind, n, p)}, stable, {hardest} {often}{calms}."
    if kind == MotionClass.STICKING and not n:
        return f"Irregular with rests, {hardest}: it rests at the stop so seldom that rounding decides when."
    if kind == MotionClass.STICKING:
        rest = 100.0 * indices["stick_fraction"]
        resting = f"then comes to rest at the stop, {rest:.3g} % of the time"
        return f"{motion_name(kind, n, p)}, stable, {hardest} {often}, {resting}."
    if kind == MotionClass.CHAOTIC:
        doubling = math.log(2.0) / (indices["lyapunov"] * osc.period)
        return f"Chaotic, the impacts never repeat, {hardest}; disturbances double in {_periods(doubling)}."
    if kind == MotionClass.NO_IMPACT:
        reach = osc.steady_amplitude
        swings = f" It swings by {reach:.3g} m before a stop at {osc.gap:.3g} m." if reach < osc.gap else ""
        return f"{status.sentence[0].upper()}{status.sentence[1:].split(';')[0]}.{swings}"
    told = f", {hardest}" if math.isfinite(indices["max_velocity"]) else ""
    reason = status.sentence.split(";")[0] if not status.has_indices else "no cycle was found, and chaos is not certain"
    return f"Undecided{told}: {reason}; sample more impacts."


def _periods(value: float) -> str:
    return f"{value:.2g} period" + ("" if value == 1.0 else "s")


def words(index: str, value: float) -> str:
    """Return the value of an index as a table shows it."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "−∞" if value < 0.0 else "none"
    if index == "n_impacts" and value == -1.0:
        return "∞ (chatter)"
    if index in ("n_periods", "n_impacts") and value == 0.0:
        return "no cycle"
    text: str = f"{value:.5g}"
    return text.replace("-", "−")


def fields(point: Point) -> list[tuple[str, str, str, str]]:
    """Return symbol, long name, value and unit of every index."""
    rows: list[tuple[str, str, str, str]] = []
    for name, value in point.indices.items():
        index: Any = INDICES[name]
        told = words(name, told_spread(value, spread_scale(name, point.osc.velocity_scale)))
        rows.append((index.symbol, index.long_name, told, "" if index.units == "1" else index.units))
    return rows
