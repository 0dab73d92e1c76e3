"""Where a motion ends along each parameter: its nearest boundary down and up, and the motion beyond.

Where an equation gives the boundary - the orbit's own bifurcations, the end of sticking, or a closed form - it is
solved. Elsewhere one motion is followed along many paths at once, its state carried along, and the step in which its
class changes is bisected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence.measuring import AT_REST, Runner, Start, cells_of
from vibroimpact.continuation.branch import walk
from vibroimpact.continuation.system import system_of
from vibroimpact.motion import MotionClass
from vibroimpact.orbits import Orbit
from vibroimpact.orbits.sticking import end_of_sticking, periods_from_release
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.verdict.present import Present, Range, measure

NOISE = 1e-12  # relative: what is smaller is rounding
STEP = 0.01  # of the range, a period, or the speed: the longest step along a branch
MOST = 800  # orbits times impacts that are solved for along one direction
SCANNED = 60  # values along a path at which a condition is evaluated
PLACES = 36  # values along a path at which a motion is followed
HALVINGS = 12  # of the step in which the class changes
BOUNCY = 0.99  # restitution up to which sticking is followed: chatters grow longer as 1/(1 - r)
BRIEF = ImpactWindow(100, 1500)  # enough for a name, and an exponent to a few per cent
ACROSS = ImpactWindow(1500, 2000)  # close to a boundary motions settle slowly
BOUNDARIES = {  # in words
    "period_doubling": "period doubling",
    "fold": "fold",
    "grazing": "grazing",
    "end_of_sticking": "end of sticking",
    "first_contact": "the motion first touches the stop",
    "lift_off": "the force first lifts the mass off the stop",
    "pressed_for_ever": "the force no longer lifts the mass off the stop",
    "change": "another motion",
    "none": "none",
}


@dataclass(frozen=True)
class Edge:
    """The nearest boundary of a motion along one parameter, downwards or upwards.

    Parameters
    ----------
    parameter : str
        The one that is varied.
    direction : int
        -1 for smaller values, +1 for larger ones.
    kind : str
        "period_doubling", "fold", "grazing", "end_of_sticking", "first_contact" and "lift_off" (of a motion without
        impacts), "pressed_for_ever", "change" (another class of motion, found by bisection), or "none" within the
        range.
    value : float
        The parameter there; NaN for "none".
    change : float
        From the present value to there, signed, relative to the present value, or to `of`.
    of : str
        What the change is relative to, where that is not the present value: "f/k" for a gap smaller than that.
    half_width : float
        0 where `value` solves the boundary's own equation (to some 1e-12); else it lies within this of `value`.
    beyond : str
        The motion just beyond, followed across; empty where none was found.
    beyond_at : float
        The value at which that motion was computed; NaN where it was not.
    searched_to : float
        The end of the range.
    """

    parameter: str
    direction: int
    kind: str
    value: float
    change: float
    of: str
    half_width: float = 0.0
    beyond: str = ""
    beyond_at: float = math.nan
    searched_to: float = math.nan

    @property
    def found(self) -> bool:
        """Whether there is one."""
        return self.kind != "none"

    @property
    def exact(self) -> bool:
        """Whether the value solves the boundary's own equation."""
        return self.found and self.half_width == 0.0

    @property
    def what(self) -> str:
        """The boundary in words, or the motion beyond where that alone is known."""
        return self.beyond if self.kind == "change" and self.beyond else BOUNDARIES[self.kind]

    @property
    def at_once(self) -> bool:
        """Whether the present value lies on the boundary, as far as rounding can tell."""
        return self.exact and abs(self.change) < NOISE

    @property
    def accuracy(self) -> str:
        """`exact`, `to within ...`, or nothing where no boundary was found."""
        return "" if not self.found else "exact" if self.exact else f"to within {self.half_width:.1g}"


@dataclass(frozen=True)
class Found:
    """What bounds a range in one direction, before one has looked beyond it; `start` is what to carry across."""

    range: Range
    direction: int
    kind: str = "none"
    value: float = math.nan
    half_width: float = 0.0
    start: Start | None = None

    def path(self, number: int) -> list[float]:
        """Return values from beside the present one to the end of the range."""
        return self.range.path(self.direction, number)

    def beyond_at(self) -> float:
        """Return a value a little beyond the boundary, NaN where the range ends first."""
        if self.kind == "none":
            return math.nan
        scale = self.range.scale
        ahead = min(0.02 * abs(self.value - self.range.value) + 1e-6 * scale, 4e-3 * scale) + 2.0 * self.half_width
        value = self.value + self.direction * ahead
        end = self.range.end(self.direction)
        value = min(value, end) if self.direction > 0 else max(value, end)
        return value if (value - self.value) * self.direction > 0.0 else math.nan

    def edge(self, beyond: str, at: float) -> Edge:
        """Return what callers see."""
        change, end = self.range.change(self.value), self.range.end(self.direction)
        what = self.range.name, self.direction, self.kind, self.value, change, self.range.of, self.half_width
        return Edge(*what, beyond, at, end)


def nearest_boundaries(
    present: Present, ranges: Sequence[Range], runner: Runner, done: Callable[[], bool] = lambda: True
) -> tuple[Edge, ...]:
    """Return the nearest boundary of a motion down and up each parameter; `done` is called for each, False stops."""
    found: list[Found | None] = []
    for each in ranges:
        found += [_exact(present, Found(each, direction)) for direction in (-1, 1)]
        if not done():
            return ()
    sides = [Found(each, direction) for each in ranges for direction in (-1, 1)]
    unknown = [side for side, known in zip(sides, found, strict=True) if known is None]
    bisected = iter(_bisected(present, unknown, runner))
    return _with_beyond([known or next(bisected) for known in found], runner)


def _with_beyond(found: Sequence[Found], runner: Runner) -> tuple[Edge, ...]:
    """Return the boundaries as callers see them, with the motion beyond each."""
    values = [boundary.beyond_at() for boundary in found]
    beyond = [i for i, value in enumerate(values) if not math.isnan(value)]
    names: dict[int, str] = {}
    if beyond:
        there = [found[i].range.changed(values[i]) for i in beyond]
        motions = measure(runner, cells_of(there, [found[i].start for i in beyond]), ACROSS)
        decided = (one for one in zip(beyond, motions, strict=True) if one[1].motion_class != MotionClass.UNDECIDED)
        names = {i: motion.name for i, motion in decided}
    return tuple(boundary.edge(names.get(i, ""), values[i]) for i, boundary in enumerate(found))


# Boundaries that are solutions of equations


def _exact(present: Present, side: Found) -> Found | None:
    """Return the boundary, or `none` up to the end of the range; None where no equation gives it."""
    if side.range.only_scales or not side.path(1):
        return side
    osc = present.oscillator
    if present.measured.motion_class == MotionClass.NO_IMPACT and osc.damping > 0.0 and osc.gap > osc.steady_amplitude:
        return _closed_form(side, "first_contact", lambda o: o.gap - o.steady_amplitude)
    if present.measured.motion_class == MotionClass.STUCK_FOREVER and osc.stiffness * osc.gap <= -osc.amplitude:
        return _closed_form(side, "lift_off", lambda o: -o.stiffness * o.gap - o.amplitude)
    if present.orbit is None:
        return None
    if present.orbit.sticks:
        return _end_of_sticking(present, side)
    try:
        return _bifurcation(present.orbit, side)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None  # the branch runs where its equations have no meaning


def _bifurcation(orbit: Orbit, side: Found) -> Found | None:
    """Follow the orbit until it folds, doubles or grazes."""
    system, z = system_of(orbit, (side.range.name,), ((side.range.low, side.range.high),))
    way = None
    for way in walk(system, system.pack(z), STEP, False, side.direction):
        for special in way.special:
            at = special.orbit
            if at.admissible:
                value = special.system.values(special.x)[0]
                hit = 0 if min(at.velocities) > 0.0 else int(np.argmax(at.velocities))
                start = Start(0.0, at.velocities[hit], at.phases[hit])
                return replace(side, kind=special.kind, value=value, start=start)
        if len(way.points) * orbit.n_impacts > MOST:
            return None
    return side if way is not None and way.end == "range" else None


def _end_of_sticking(present: Present, side: Found) -> Found:
    """Walk outwards until the mass, let go, does not rest again after as many periods; bisect there."""
    assert present.orbit is not None
    n, range = present.orbit.n_periods, side.range
    if present.model is present.oscillator and range.name == "restitution":
        range = replace(range, high=min(range.high, max(BOUNCY, 0.5 * (1.0 + range.value))))
    inside = range.value
    for outside in range.path(side.direction, SCANNED):
        if periods_from_release(range.at(outside), n) != n:
            break
        inside = outside
    else:
        return replace(side, range=range)
    end = end_of_sticking(present.model, range.name, (inside, outside), longest=n)
    known = replace(side, range=range, kind="change", value=end.value, start=AT_REST)
    if end.outcome in ("found", "pressed_for_ever"):
        return replace(known, kind="end_of_sticking" if end.outcome == "found" else end.outcome)
    if math.isfinite(end.value):
        return replace(known, half_width=math.ulp(end.value))
    return replace(known, value=0.5 * (inside + outside), half_width=0.5 * abs(outside - inside))


def _closed_form(side: Found, kind: str, margin: Callable[[ImpactOscillator], float]) -> Found:
    """Return the first value outwards at which a margin becomes negative, if there is one.

    The mass first touches the stop where the amplitude of its motion without one reaches the gap, R = g; it is lifted
    off the stop where the force reaches the preload, f = -k g.
    """
    range = side.range
    inside = range.value
    for outside in side.path(4 * SCANNED):
        if margin(range.at(outside)) < 0.0:
            break
        inside = outside
    else:
        return side
    narrow = 1e-17 * range.scale
    while abs(outside - inside) > narrow and (middle := 0.5 * (inside + outside)) not in (inside, outside):
        if margin(range.at(middle)) >= 0.0:
            inside = middle
        else:
            outside = middle
    value, start = inside if abs(inside) > narrow else 0.0, AT_REST
    if kind == "first_contact":
        osc = range.at(value)
        steady = osc.steady_state
        start = Start(max(osc.gap - steady.displacement, 0.0), steady.velocity, 0.0)
    return replace(side, kind=kind, value=value, start=start)


# Boundaries by bisection


@dataclass
class Track:
    """One side of a range, how far the motion was followed, and the step in which it became another."""

    side: Found
    inside: float
    start: Start | None
    ahead: list[float]
    outside: float | None = None

    @property
    def next(self) -> float:
        """The next value outwards, or the middle of the step in which the class changes."""
        return self.ahead[0] if self.outside is None else self.side.range.between(self.inside, self.outside, 0.5)

    def found(self) -> Found:
        """Return where the motion ends."""
        if self.outside is None:
            return self.side
        middle, half = 0.5 * (self.inside + self.outside), 0.5 * abs(self.outside - self.inside)
        return replace(self.side, kind="change", value=middle, half_width=half, start=self.start)


def _bisected(present: Present, sides: Sequence[Found], runner: Runner) -> list[Found]:
    """Return, for each parameter and direction, where the motion that is followed first changes its class."""
    tracks = [Track(side, side.range.value, present.start, side.path(PLACES)) for side in sides]
    while active := [track for track in tracks if track.outside is None and track.ahead]:
        _step(present, active, runner)
        for track in active:
            track.ahead.pop(0)
    changed = [track for track in tracks if track.outside is not None]
    for _ in range(HALVINGS if changed else 0):
        _step(present, changed, runner)
    return [track.found() for track in tracks]


def _step(present: Present, tracks: Sequence[Track], runner: Runner) -> None:
    """Carry each motion to its next value, and see whether it is still the same."""
    values = [track.next for track in tracks]
    there = [track.side.range.changed(value) for track, value in zip(tracks, values, strict=True)]
    cells = cells_of(there, [track.start for track in tracks])
    motions = measure(runner, cells, BRIEF)
    same = [m.group == present.measured.group or m.motion_class == MotionClass.UNDECIDED for m in motions]
    kept = np.flatnonzero(same)
    for i, state in zip(kept.tolist(), runner.follow(cells[kept]), strict=True):
        tracks[i].inside, tracks[i].start = values[i], state
    for track, value, is_same in zip(tracks, values, same, strict=True):
        if not is_same:
            track.outside = value
