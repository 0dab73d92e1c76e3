"""The motion at a point: its history, portrait, sections, indices and name, from one run; and coexisting motions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.coexistence import Attractor
from vibroimpact.explorer.limits import budget, stiffness, system_of
from vibroimpact.explorer.plane import TRANSIENT, KeepGoing
from vibroimpact.explorer.state import View, written
from vibroimpact.indices import INDICES, shown_spread, spread_scale, with_missing
from vibroimpact.model import Model, State
from vibroimpact.motion import MotionClass, decide, motion_name
from vibroimpact.plotting import views
from vibroimpact.plotting.ticks import quantity
from vibroimpact.sections import measure_orbit
from vibroimpact.status import Status

Floats = NDArray[np.float64]
Columns = dict[str, Floats]
Parts = dict[str, Columns]  # parts of a `Point`: history, impacts and rests

HISTORY = 4000  # approximate number of samples
IMPACTS = 800  # impacts on the impact map
LEAD = 100  # driving periods, or free oscillations if longer, skipped before the Poincaré map
LOOKS, MOST_LOOKS = 400, 900  # free oscillations recorded after that; most driving periods, i.e. points on that map
FAINT = 1e-6  # of the largest velocity: slower impacts are not drawn
RECORDED = (
    "time", "displacement", "velocity", "impact_time", "impact_velocity", "stick_time", "release_time",
)  # fmt: skip
REMEMBERED = 16  # motions per page
START_IMPACTS = 2000  # impacts per initial condition for which a budget is granted


@dataclass(frozen=True)
class Point:
    """The data that the page shows for a point."""

    osc: Model
    system: Any  # the oscillator or system
    shown: views.View
    name: str
    sentence: str
    n_periods: int
    settled: bool  # whether the history begins on the settled motion
    indices: dict[str, float]
    history: Columns  # time, displacement, velocity, both sides of every impact
    impacts: Columns  # time, velocity within the history
    rests: Columns  # begin and end of rests at the stop within the history
    impact_map: Columns  # phase, velocity
    poincare: Columns  # displacement, velocity

    def settles_to(self, attractor: Attractor) -> bool:
        """Whether its motion is an attractor: the name and, for a cycle, the largest velocity are equal."""
        speeds = attractor.max_velocity, self.indices["max_velocity"]
        return self.name == attractor.name and (not self.n_periods or math.isclose(*speeds, rel_tol=1e-6))

    @property
    def size(self) -> float:
        """A length scale of axes in m: for one mass, the larger of static deflection and gap; similarly for systems."""
        return self.system.velocity_scale / self.system.slowest_frequency or 1.0

    def places(self, stops: Any, time: Floats) -> Floats:
        """Return the positions of stops at given times, by name; NaN if they do not act on the displacement shown."""
        places = np.full(len(time), np.nan)
        for wall in self.shown.walls:
            struck = np.flatnonzero(stops == wall.name)
            places[struck] = self.shown.place(wall, time[struck])
        return places


def compute_point(view: View) -> Point:
    """Return the results for the view's point."""
    return motion_at(*view.point_key)


def motion_at(model: Model, start: State | None, settled: bool, samples: int, coordinate: int, stop: int) -> Point:
    """Return the results for a model from an initial condition.

    One run is both measured and recorded. Only if its record is too short, a second run continues from it.
    """
    system = system_of(model)
    shown = views.view_of_page(system, coordinate, stop)
    ratio = system.omega / system.slowest_frequency
    lead = max(20, int(LEAD * min(ratio, 1.0)))
    oscillations = LOOKS if system.forgets else LOOKS // 2  # these take ten times as long
    looks = max(20, min(int(oscillations * ratio), MOST_LOOKS))
    density = min(max(60, math.ceil(24 / ratio)), HISTORY)  # samples per period
    indices, orbit, section = measure_orbit(
        model,
        start=start,
        indices=tuple(INDICES),
        transient_impacts=TRANSIENT,
        sample_impacts=samples,
        periods=lead + looks,
        samples_per_period=density,
        tolerances=budget(stiffness(model), TRANSIENT + samples),
        patience=budget(stiffness(model), lead + looks),
    )
    orbit = _projected(shown, orbit)
    status, indices = Status(int(indices.pop("status"))), with_missing(indices, system)
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    kind = MotionClass(int(decide(status, samples * indices["lyapunov_per_impact"], n, p)))
    origin = "From rest" if start is None else "From the chosen initial condition"

    impact_map = _impact_map(system, start, orbit, n, 0 < n <= looks or not status.has_indices, stop)
    length = max(2.0, min(40.0, HISTORY / density)) * system.period
    parts = None
    if settled:
        parts = _settled(shown, orbit, lead * system.period, length, n, status.has_indices)
        begin = _hardest(system, impact_map) if parts is None and status.has_indices else None
        if begin is not None:  # the record reached its budget before a sufficient part was settled
            parts = _carried_on(shown, begin, length, density)
        settled = parts is not None
    return Point(
        osc=model,
        system=system,
        shown=shown,
        name=motion_name(kind, n, p),
        sentence=f"{origin}: {_settled_motion(system, kind, status, indices, TRANSIENT + samples)}",
        n_periods=n,
        settled=settled,
        indices=indices,
        **(parts or _beginning(shown, start, orbit, length)),
        impact_map=impact_map,
        poincare={name: orbit[name][section + lead * density :: density] for name in ("displacement", "velocity")},
    )


def _projected(shown: views.View, orbit: dict[str, Any]) -> Columns:
    """Return an orbit projected on the displacement shown, with the name of the stop at each impact and rest."""
    names = {f"{event}_stop": views.stops_of(orbit, event, shown.model) for event in ("impact", "stick")}
    y = shown.values(orbit["time"], orbit["displacement"])
    return orbit | names | {"displacement": y, "velocity": shown.values(orbit["time"], orbit["velocity"], rate=True)}


def _settled(shown: views.View, orbit: Columns, lead: float, length: float, n: int, hits: bool) -> Parts | None:
    """Return the end of an orbit, shifted to the first period, beginning with a hard impact.

    For a cycle it begins with the hardest impact; for a motion that does not repeat, with the hardest of the last 64
    impacts. None if too little is left after `lead`.
    """
    time, hit_time, period = orbit["time"], orbit["impact_time"], shown.model.period
    if not len(time) or time[-1] - time[0] < lead + length:
        return None
    begin, settled = float(time[-1]) - length, float(time[0]) + lead
    first = max(settled, begin - n * period) if n else settled
    last = np.flatnonzero((hit_time >= first) & (hit_time <= begin))[::-1]
    last = last if n else last[:64]
    if hits and len(last):
        begin = float(hit_time[last[int(orbit["impact_velocity"][last].argmax())]])
    return _parts(shown, orbit, begin, begin + length, math.floor(begin / period) * period)


def _beginning(shown: views.View, start: State | None, orbit: Columns, length: float) -> Parts:
    """Return the beginning of an orbit."""
    begin = 0.0 if start is None else start.time
    end = max([begin, *orbit["time"][-1:]])
    return _parts(shown, orbit, begin, min(begin + length, end), start=start)


def _carried_on(shown: views.View, begin: State, length: float, density: int) -> Parts:
    """Return the motion after an impact, from a separate run."""
    system, periods = shown.model, length / shown.model.period
    limits = budget(stiffness(system), math.ceil(periods))
    orbit = vi.simulate(system, start=begin, periods=periods, samples_per_period=density, tolerances=limits)
    record = {name: orbit[name].values for name in RECORDED}
    return _beginning(shown, begin, _projected(shown, record), length)


def _parts(
    shown: views.View, orbit: Columns, begin: float, end: float, shift: float = 0.0, start: State | None = None
) -> Parts:
    """Return history, impacts and rests of an orbit between two times in s, shifted earlier by `shift`.

    The history includes both sides of every visible impact, and a `start` between samples.
    """
    time, y, v, hit_time, hit_speed, stick, release = (orbit[name] for name in RECORDED)
    within, hit = (time >= begin) & (time <= end), (hit_time >= begin) & (hit_time <= end)
    time, y, v, hit_time, hit_speed = time[within], y[within], v[within], hit_time[hit], hit_speed[hit]
    if start is not None:
        at = np.array([start.time])
        place, speed = shown.values(at, start.displacement), shown.values(at, start.velocity, rate=True)
        time, y, v = np.append(at, time), np.append(place, y), np.append(speed, v)
    hard = np.flatnonzero(hit_speed > FAINT * float(hit_speed.max(initial=0.0)))[:HISTORY]
    hit_time, hit_speed, struck = hit_time[hard], hit_speed[hard], orbit["impact_stop"][hit][hard]
    between = views.between_impacts(time, hit_time, 1e-9 * shown.model.period)
    sides = [(time[between], y[between], v[between]), *_sides(shown, hit_time, hit_speed, struck)]
    all_time, places, speeds = (np.concatenate(part) for part in zip(*sides, strict=True))
    order = np.argsort(all_time, kind="stable")
    released = np.where(np.isnan(release), end, release).clip(max=end)
    resting = (released > begin) & (stick < end)
    return {
        "history": {"time": all_time[order] - shift, "displacement": places[order], "velocity": speeds[order]},
        "impacts": {"time": hit_time - shift, "velocity": hit_speed, "stop": struck},
        "rests": {
            "begin": stick[resting].clip(min=begin) - shift, "end": released[resting] - shift,
            "stop": orbit["stick_stop"][resting],
        },
    }  # fmt: skip


def _sides(shown: views.View, time: Floats, speed: Floats, stop: Any) -> list[tuple[Floats, Floats, Floats]]:
    """Return time, displacement and velocity just before and after impacts on the walls shown."""
    sides = []
    for wall in shown.walls:
        struck = np.flatnonzero(stop == wall.name)
        place, before, after = shown.sides(wall, time[struck], speed[struck])
        sides.append((time[struck], place, before))
        if wall.element.instantaneous:
            sides.append((time[struck], place, after))
    return sides


def _hardest(system: Any, impact_map: Columns) -> State | None:
    """Return the hardest of the last impacts of one mass as a state from which to continue."""
    velocity, phase = (impact_map[name][:-65:-1] for name in ("velocity", "phase"))
    if not len(velocity) or not system.forgets:
        return None
    at = int(velocity.argmax())
    return State(system.stops[0].gap, float(velocity[at]), float(phase[at]) * system.period)


def _impact_map(system: Any, start: State | None, orbit: Columns, n_periods: int, repeats: bool, stop: int) -> Columns:
    """Return phase and velocity of the impacts after a transient; for a cycle those of the recorded orbit suffice.

    If impacts do not determine the whole state, they are those recorded at one stop (counted from 1) or at all (0).
    """
    if not system.forgets:
        struck = orbit["impact_stop"][TRANSIENT:]
        at = np.flatnonzero(struck == system.stop_names[stop - 1]) if stop else np.arange(len(struck))
        return {name: orbit[f"impact_{name}"][TRANSIENT:][at[:IMPACTS]] for name in ("phase", "velocity")}
    time = orbit["impact_time"]
    cycle = int(np.searchsorted(time, time[-1] - n_periods * system.period)) if len(time) else 0
    last = slice(min(TRANSIENT, cycle), TRANSIENT + IMPACTS)  # at least the impacts of one cycle
    hits = {name: orbit[f"impact_{name}"][last] for name in ("phase", "velocity")}
    missing = IMPACTS - len(hits["phase"])
    if repeats or not missing:
        return hits
    # Impacts are too rare to fill the record: the orbit is continued from its last impact, which is recorded again.
    if len(time):
        phase, speed = (float(orbit[f"impact_{name}"][-1]) for name in ("phase", "velocity"))
        start = State(system.stops[0].gap, speed, phase * system.period)
    more = vi.impact_section(
        system,
        start=start,
        transient_impacts=1 + max(TRANSIENT - len(time), 0),
        sample_impacts=missing,
        tolerances=budget(stiffness(system), TRANSIENT + IMPACTS),
    )
    return {name: np.append(values, more[name].values) for name, values in hits.items()}


def find_others(view: View, keep_going: KeepGoing) -> list[Attractor]:
    """Return the motions reached from initial conditions at the view's point, computed until time is up.

    The motion with the largest share of the initial conditions comes first.
    """
    limits = budget(stiffness(view.osc), START_IMPACTS)
    return vi.attractors(view.osc, tolerances=limits, workers=1, progress=lambda *progress: keep_going())


def _settled_motion(system: Any, kind: MotionClass, status: Status, indices: dict[str, float], impacts: int) -> str:
    """Return a sentence on the settled motion, determined from at most a given number of impacts."""
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    name, peak = motion_name(kind, n, p), f"largest impact velocity {quantity(indices['max_velocity'], 'm/s', 3)}"
    often = "once per period" if n <= 1 else f"once in {n} periods"
    if kind == MotionClass.PERIODIC:
        growth = indices["lyapunov"] * system.period
        decays = f"; perturbations halve in {_periods(-math.log(2.0) / growth)}" if -1e3 < growth < 0.0 else ""
        return f"{name}, stable, {peak} {often}{decays}."
    if kind == MotionClass.STICKING and not n:
        return f"{name}, {peak}; its period is not resolved in double precision."
    if kind == MotionClass.STICKING:
        rest = 100.0 * indices["stick_fraction"]
        return f"{name}, stable, {peak} {often}; at rest at the stop {rest:.3g} % of the time."
    if kind == MotionClass.CHAOTIC:
        doubling = math.log(2.0) / indices["lyapunov"]
        span = _periods(doubling / system.period) if system.periodic else f"{doubling:.2g} s"
        return f"{name} over {impacts} impacts, {peak}; perturbations double in {span}."
    if kind.stored == MotionClass.NO_IMPACT:
        words = "no impact" if status == Status.NO_IMPACT else status.sentence.split(";")[0]
        swings = ""
        if system.stops and system.steady_amplitude < system.stops[0].gap:
            reach, gap = (quantity(length, "m", 3) for length in (system.steady_amplitude, system.stops[0].gap))
            swings = f"; the steady amplitude of {reach} is smaller than the gap of {gap}"
        return f"{words}{swings}."
    hardest = f", {peak}" if math.isfinite(indices["max_velocity"]) else ""
    reason = f"no cycle in {impacts} impacts, and chaos is not certain" if status.has_indices else status.sentence
    return f"undecided{hardest}: {reason.split(';')[0]}; sample more impacts."


def _periods(value: float) -> str:
    return f"{value:.2g} period" + ("" if value == 1.0 else "s")


def index_text(point: Point, index: str, digits: int) -> str:
    """Return the value of an index as text for a table; empty for a motion without impacts."""
    if not math.isfinite(point.indices["max_velocity"]):
        return "–"
    value = shown_spread(point.indices[index], spread_scale(index, point.system.velocity_scale))
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "−∞" if value < 0.0 else "none"
    if index == "n_impacts" and value == -1.0:
        return "∞ (chatter)"
    if index in ("n_periods", "n_impacts") and value == 0.0:
        return "no cycle"
    return written(value, digits)
