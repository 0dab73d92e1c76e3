"""The motion at a point: its history, portrait, sections, indices and name, from one orbit; and those that coexist."""

from __future__ import annotations

import math
import threading
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.explorer.plane import TRANSIENT, KeepGoing
from vibroimpact.explorer.state import View, granted, stiffness
from vibroimpact.indices import INDICES, shown_spread, spread_scale
from vibroimpact.motion import MotionClass, decide, motion_name
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.plotting.ticks import quantity
from vibroimpact.sections import measure_orbit
from vibroimpact.status import Status

Floats = NDArray[np.float64]
Columns = dict[str, Floats]
Parts = dict[str, Columns]  # history, impacts and rests of a `Point`

HISTORY = 4000  # samples, about
IMPACTS = 800  # on the impact map
LEAD = 100  # driving periods, or free oscillations where they are longer, left out before the Poincaré map
LOOKS, MOST_LOOKS = 400, 900  # free oscillations recorded after it; driving periods at most: looks on that map
FAINT = 1e-6  # of the largest velocity: slower impacts are not drawn
RECORDED = (
    "time", "displacement", "velocity", "impact_time", "impact_velocity", "stick_time", "release_time",
)  # fmt: skip
REMEMBERED = 16  # motions per page
START_IMPACTS = 2000  # of an initial condition, for which a budget is granted


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

    One run of one orbit is measured and recorded. Only where its record is too short does a second one go on from it.
    """
    start = view.start if osc is None else None
    osc = osc or view.osc
    ratio = osc.omega / osc.natural_frequency
    lead = max(20, int(LEAD * min(ratio, 1.0)))
    looks = max(20, min(int(LOOKS * ratio), MOST_LOOKS))
    density = min(max(60, math.ceil(24 / ratio)), HISTORY)  # samples per period
    found, orbit, section = measure_orbit(
        osc,
        start=start,
        indices=tuple(INDICES),
        transient_impacts=TRANSIENT,
        sample_impacts=view.samples,
        periods=lead + looks,
        samples_per_period=density,
        tolerances=granted(stiffness(osc), TRANSIENT + view.samples),
        patience=granted(stiffness(osc), lead + looks),
    )
    status, indices = Status(int(found.pop("status"))), found
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    kind = MotionClass(int(decide(status, view.samples * indices["lyapunov_per_impact"], n, p)))

    impact_map = _impact_map(osc, start, orbit, n, repeats=0 < n <= looks or not status.has_indices)
    length = max(2.0, min(40.0, HISTORY / density)) * osc.period
    shown, settled = None, view.settled
    if settled:
        shown = _settled(osc, orbit, lead * osc.period, length, n, status.has_indices)
        begin = _hardest(osc, impact_map) if shown is None and status.has_indices else None
        if begin is not None:  # the budget ended the record before a long enough part of it was settled
            shown = _carried_on(osc, begin, length, density)
        settled = shown is not None
    return Point(
        osc=osc,
        name=motion_name(kind, n, p),
        sentence=sentence(osc, kind, status, indices, start, TRANSIENT + view.samples),
        n_periods=n,
        settled=settled,
        indices=indices,
        **(shown or _beginning(osc, start, orbit, length)),
        impact_map=impact_map,
        poincare={name: orbit[name][section + lead * density :: density] for name in ("displacement", "velocity")},
    )


def _settled(osc: ImpactOscillator, orbit: Columns, lead: float, length: float, n: int, hits: bool) -> Parts | None:
    """Return the end of an orbit as if it began in the first period, from a hard impact on.

    Of a cycle that is the hardest one; of a motion that does not repeat, the hardest of the last 64 before the end.
    None where there is too little after the `lead`.
    """
    time, hit_time = orbit["time"], orbit["impact_time"]
    if not len(time) or time[-1] - time[0] < lead + length:
        return None
    begin, settled = float(time[-1]) - length, float(time[0]) + lead
    first = max(settled, begin - n * osc.period) if n else settled
    last = np.flatnonzero((hit_time >= first) & (hit_time <= begin))[::-1]
    last = last if n else last[:64]
    if hits and len(last):
        begin = float(hit_time[last[int(orbit["impact_velocity"][last].argmax())]])
    return _parts(osc, orbit, begin, begin + length, math.floor(begin / osc.period) * osc.period)


def _beginning(osc: ImpactOscillator, start: State | None, orbit: Columns, length: float) -> Parts:
    """Return an orbit from its start on."""
    begin = 0.0 if start is None else start.time
    end = max([begin, *orbit["time"][-1:]])
    return _parts(osc, orbit, begin, min(begin + length, end), start=start)


def _carried_on(osc: ImpactOscillator, begin: State, length: float, density: int) -> Parts:
    """Return what follows an impact, from a run of its own."""
    periods = length / osc.period
    limits = granted(stiffness(osc), math.ceil(periods))
    orbit = vi.simulate(osc, start=begin, periods=periods, samples_per_period=density, tolerances=limits)
    return _beginning(osc, begin, {name: orbit[name].values for name in RECORDED}, length)


def _parts(
    osc: ImpactOscillator,
    orbit: Columns,
    begin: float,
    end: float,
    shift: float = 0.0,
    start: State | None = None,
) -> Parts:
    """Return history, impacts and rests of an orbit between two times in s, which are made earlier by `shift`.

    The history has both sides of every impact that can be seen, and a `start` that lies between samples.
    """
    time, y, v, hit_time, hit_speed, stick, release = (orbit[name] for name in RECORDED)
    within, hit = (time >= begin) & (time <= end), (hit_time >= begin) & (hit_time <= end)
    time, y, v, hit_time, hit_speed = time[within], y[within], v[within], hit_time[hit], hit_speed[hit]
    if start is not None:
        time, y, v = np.append(start.time, time), np.append(start.displacement, y), np.append(start.velocity, v)
    seen = np.flatnonzero(hit_speed > FAINT * float(hit_speed.max(initial=0.0)))[:HISTORY]
    hit_time, hit_speed = hit_time[seen], hit_speed[seen]
    between, stop = _away_from(time, hit_time, 1e-9 * osc.period), np.full(len(hit_time), osc.gap)
    all_time = np.concatenate([time[between], hit_time, hit_time])
    order = np.argsort(all_time, kind="stable")
    left = np.where(np.isnan(release), end, release).clip(max=end)
    rested = (left > begin) & (stick < end)
    return {
        "history": {
            "time": all_time[order] - shift,
            "displacement": np.concatenate([y[between], stop, stop])[order],
            "velocity": np.concatenate([v[between], hit_speed, -osc.restitution * hit_speed])[order],
        },
        "impacts": {"time": hit_time - shift, "velocity": hit_speed},
        "rests": {"begin": stick[rested].clip(min=begin) - shift, "end": left[rested] - shift},
    }


def _hardest(osc: ImpactOscillator, impact_map: Columns) -> State | None:
    """Return the hardest of the last impacts as a state to continue from."""
    velocity, phase = (impact_map[name][:-65:-1] for name in ("velocity", "phase"))
    if not len(velocity):
        return None
    at = int(velocity.argmax())
    return State(osc.gap, float(velocity[at]), float(phase[at]) * osc.period)


def _away_from(time: Floats, events: Floats, width: float) -> NDArray[np.bool_]:
    """Whether instants lie away from all events; a sample at an impact gives way to the impact's two sides."""
    if not len(events):
        return np.ones(len(time), bool)
    after = np.searchsorted(events, time).clip(1, len(events) - 1) if len(events) > 1 else np.zeros(len(time), int)
    nearest = np.minimum(np.abs(events[after] - time), np.abs(events[after - 1] - time))
    return np.asarray(nearest > width)


def _impact_map(osc: ImpactOscillator, start: State | None, orbit: Columns, n_periods: int, repeats: bool) -> Columns:
    """Return phase and velocity of the impacts after a transient; of a cycle those of the recorded orbit suffice."""
    time = orbit["impact_time"]
    cycle = int(np.searchsorted(time, time[-1] - n_periods * osc.period)) if len(time) else 0
    last = slice(min(TRANSIENT, cycle), TRANSIENT + IMPACTS)  # at least the impacts of one cycle
    found = {name: orbit[f"impact_{name}"][last] for name in ("phase", "velocity")}
    missing = IMPACTS - len(found["phase"])
    if repeats or not missing:
        return found
    # It hits too seldom for the record to hold them all: the orbit goes on from its last impact, which is seen again.
    if len(time):
        phase, speed = (float(orbit[f"impact_{name}"][-1]) for name in ("phase", "velocity"))
        start = State(osc.gap, speed, phase * osc.period)
    more = vi.impact_section(
        osc,
        start=start,
        transient_impacts=1 + max(TRANSIENT - len(time), 0),
        sample_impacts=missing,
        tolerances=granted(stiffness(osc), TRANSIENT + IMPACTS),
    )
    return {name: np.append(values, more[name].values) for name, values in found.items()}


@dataclass(frozen=True)
class Other:
    """A motion that initial conditions lead to: its name, the share of them, its largest velocity, a state on it."""

    name: str
    share: float
    max_velocity: float
    start: State

    def same(self, point: Point) -> bool:
        """Whether this is the motion of a point: of one name, and of a cycle with the same largest velocity."""
        velocity = point.indices["max_velocity"]
        alike = not point.n_periods or math.isclose(self.max_velocity, velocity, rel_tol=1e-6)
        return self.name == point.name and alike


def find_others(view: View, keep_going: KeepGoing) -> list[Other]:
    """Return the motions that initial conditions at the view's point lead to, as far as time is left.

    The one with the largest share of the initial conditions comes first.
    """
    budget = granted(stiffness(view.osc), START_IMPACTS)
    found = vi.attractors(view.osc, tolerances=budget, workers=1, progress=lambda *progress: keep_going())
    return [Other(motion.name, motion.share, motion.max_velocity, motion.start) for motion in found]


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


def sentence(
    osc: ImpactOscillator,
    kind: MotionClass,
    status: Status,
    indices: dict[str, float],
    start: State | None = None,
    impacts: int = TRANSIENT,
) -> str:
    """Return the motion in a sentence: from which initial condition, and what was seen in so many impacts at most."""
    origin = "From rest" if start is None else "From the chosen initial condition"
    return f"{origin}: {_settled_motion(osc, kind, status, indices, impacts)}"


def _settled_motion(
    osc: ImpactOscillator, kind: MotionClass, status: Status, indices: dict[str, float], impacts: int
) -> str:
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    name, peak = motion_name(kind, n, p), f"largest impact velocity {quantity(indices['max_velocity'], 'm/s', 3)}"
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
        return f"{name} over {impacts} impacts, {peak}; perturbations double in {_periods(doubling)}."
    if kind.stored == MotionClass.NO_IMPACT:
        words = "no impact" if status == Status.NO_IMPACT else status.sentence.split(";")[0]
        reach, gap = (quantity(length, "m", 3) for length in (osc.steady_amplitude, osc.gap))
        swings = f"; the steady swing of {reach} stays short of the gap of {gap}"
        return f"{words}{swings if osc.steady_amplitude < osc.gap else ''}."
    known = f", {peak}" if math.isfinite(indices["max_velocity"]) else ""
    reason = f"no cycle in {impacts} impacts, and chaos is not certain" if status.has_indices else status.sentence
    return f"undecided{known}: {reason.split(';')[0]}; sample more impacts."


def _periods(value: float) -> str:
    return f"{value:.2g} period" + ("" if value == 1.0 else "s")


def index_text(index: str, value: float) -> str:
    """Return the value of an index as a table shows it; n and p of a motion without impacts are NaN."""
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
    hits = math.isfinite(point.indices["max_velocity"])
    for name, value in point.indices.items():
        value = value if hits else math.nan
        index, scale = INDICES[name], spread_scale(name, point.osc.velocity_scale)
        rows.append((index.long_name, index_text(name, shown_spread(value, scale)), plain(index.units)))
    return rows


def plain(units: str) -> str:
    """Return a unit; "" for a pure number."""
    return "" if units == "1" else units
