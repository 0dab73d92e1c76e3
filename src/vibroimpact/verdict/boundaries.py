"""Where a motion ends along each parameter: its nearest boundary down and up, and the motion beyond.

Where an equation gives the boundary - the orbit's own bifurcations, the end of sticking, or a closed form - it is
solved. Elsewhere one motion is followed along many paths at once, its state carried along (`carried`). A motion without
impacts has further edges, beyond which others hit (`onsets`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence.measuring import AT_REST, Runner, Start, cells_of
from vibroimpact.motion import MotionClass
from vibroimpact.orbits.sticking import end_of_sticking, periods_from_release
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.status import Status
from vibroimpact.verdict.branches import Branch, Branches
from vibroimpact.verdict.carried import SECTIONS, UNSURE, Track, carry
from vibroimpact.verdict.onsets import Onset, Side, from_rest, from_some
from vibroimpact.verdict.present import CROWDED, Coexisting, Present, Range, measure

NOISE = 1e-12  # relative: what is smaller is rounding
MOST = 800  # orbits times impacts that are solved for along one direction
GOLDEN, GOLDEN_SHARE = 60, 0.5 * (math.sqrt(5.0) - 1.0)  # steps of a golden section, to 3e-13 of its beginning
SCANNED = 60  # values along a path at which a condition is evaluated
CLOSER = 32  # times that the first of them is halved: cycles of many periods may end within 1e-12
BOUNCY = 0.99  # restitution up to which sticking is followed: chatters grow longer as 1/(1 - r)
ACROSS = ImpactWindow(1500, 2000)  # close to a boundary motions settle slowly
BOUNDARIES = {  # in words
    "period_doubling": "period doubling",
    "period_halving": "period halving",
    "fold": "fold",
    "grazing": "grazing",
    "end_of_sticking": "end of sticking",
    "first_contact": "the motion first touches the stop",
    "lift_off": "the force first lifts the mass off the stop",
    "pressed_for_ever": "the force no longer lifts the mass off the stop",
    "change": "another motion",
    "none": "none",
    "neimark_sacker": "Neimark-Sacker point",
    "pitchfork": "pitchfork",
    "impacts_merge": "two stops are struck at once",
}
ONSETS = {  # of others, beside a motion without impacts
    "from_some": "lasting impacts from some initial conditions",
    "strikes": "passing impacts from rest",
    "from_rest": "lasting impacts from rest",
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
        "period_doubling", "period_halving" (the orbit ends where it was born, at a period doubling of another),
        "fold", "grazing", "neimark_sacker", "pitchfork" and "impacts_merge" (of systems), "end_of_sticking",
        "first_contact" and "lift_off" (of a motion without impacts), "pressed_for_ever", "change" (another class of
        motion, found by bisection), or "none" within the range.
    value : float
        The parameter there; NaN for "none".
    change : float
        From the present value to there, signed, relative to the present value, or to `of`.
    of : str
        What the change is relative to, where that is not the present value: "f/k" for a gap smaller than that, "the
        static deflection" of a system for one that is 0, "critical damping"; of a family's parameter at 0 a number.
    half_width : float
        0 where `value` solves the boundary's own equation (to some 1e-11); else it lies within this of `value`.
    beyond : str
        The motion just beyond, followed across; empty where none was found.
    beyond_at : float
        The value at which that motion was computed; NaN where it was not.
    searched_to : float
        The end of the range, or as far as the motion could be followed; NaN where none was sought, as it is undecided.
    spacing : float
        The widest step between the values at which the motion was looked at, in the unit of `change`: narrower windows
        of another motion may have been passed over. 0 where the boundary's own equation was followed.
    strikes, from_rest, from_some : Onset or None
        Of a motion without impacts, from where on a start from rest strikes the stop, if only in passing; from where on
        it settles to impacts; and from where on some initial condition does. None where none was found, and for motions
        that hit.
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
    spacing: float = 0.0
    strikes: Onset | None = None
    from_rest: Onset | None = None
    from_some: Onset | None = None

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
    spacing: float = 0.0
    reached: float | None = None
    beyond: str = ""
    outside: float = math.nan
    onsets: tuple[Onset | None, ...] = (None, None, None)

    @property
    def end(self) -> float:
        """The end of the range."""
        return self.range.end(self.direction)

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
        value = min(value, self.end) if self.direction > 0 else max(value, self.end)
        return value if (value - self.value) * self.direction > 0.0 else math.nan

    def edge(self, beyond: str, at: float) -> Edge:
        """Return the boundary as callers see it."""
        change, end = self.range.change(self.value), self.end if self.reached is None else self.reached
        what = self.range.name, self.direction, self.kind, self.value, change, self.range.of, self.half_width
        return Edge(*what, beyond, at, end, self.spacing, *self.onsets)


def nearest_boundaries(
    present: Present,
    ranges: Sequence[Range],
    runner: Runner,
    done: Callable[[], bool] = lambda: True,
    coexisting: Sequence[Coexisting] = (),
    branches: Branches | None = None,
) -> tuple[Edge, ...]:
    """Return the nearest boundary of a motion down and up each parameter; `done` is called for each, False stops.

    Where motions that hit coexist with one that does not, some initial conditions settle to impacts here already.
    """
    found: list[Found | None] = []
    branches = Branches() if branches is None else branches
    for each in ranges:
        found += [_exact(present, Found(each, direction), branches) for direction in (-1, 1)]
        if not done():
            return ()
    sides = [Found(each, direction) for each in ranges for direction in (-1, 1)]
    unknown = [side for side, known in zip(sides, found, strict=True) if known is None]
    bisected = iter(_bisected(present, unknown, runner))
    whole = [known or next(bisected) for known in found]
    if present.measured.motion_class in (MotionClass.NO_IMPACT, MotionClass.STUCK_FOREVER):
        whole = _with_onsets(present, whole, runner, any(motion.max_velocity > 0.0 for motion in coexisting))
    return _with_beyond(whole, present.measured.group, runner)


def _with_onsets(present: Present, found: Sequence[Found], runner: Runner, here: bool) -> list[Found]:
    """Return the boundaries of a motion without impacts, and from where on others hit; `here`: some do already."""
    if present.final.ends:
        return list(found)  # rounding decides how long impacts last, here and all around
    # Without a force no impacts last, and without damping passing ones have no end.
    driven = [one.end != one.range.value and one.range.at(one.end).amplitude > 0.0 for one in found]
    open_ = [i for i, is_driven in enumerate(driven) if is_driven and present.oscillator.damping > 0.0]
    ways = [
        Side(found[i].range, found[i].direction, found[i].value, found[i].beyond_at(), found[i].start) for i in open_
    ]
    here_already = [way.onset(way.range.value, 0.0, 0.0) for way in ways]
    if present.measured.motion_class == MotionClass.STUCK_FOREVER:  # at rest at the stop is where it is
        rest = [way.onset(way.value, 0.0, 0.0, way.start) if math.isfinite(way.value) else None for way in ways]
        passing: Sequence[Onset | None] = rest
    else:
        rest = from_rest(ways, runner)
        strikes = present.measured.status != Status.NO_IMPACT
        passing = here_already if strikes else from_rest(ways, runner, lasting=False)
    some: Sequence[Onset | None] = here_already if here else from_some(ways, rest, runner)
    whole = list(found)
    for i, *others in zip(open_, passing, rest, some, strict=True):
        whole[i] = replace(found[i], onsets=tuple(others))
    return whole


def _with_beyond(found: Sequence[Found], group: tuple[str, int, int], runner: Runner) -> tuple[Edge, ...]:
    """Return the boundaries as callers see them, with the motion a little beyond each, or else right beyond it."""
    values = [boundary.beyond_at() for boundary in found]
    beyond = [i for i, value in enumerate(values) if not math.isnan(value)]
    there = [found[i].range.changed(values[i]) for i in beyond]
    motions = measure(runner, cells_of(there, [found[i].start for i in beyond]), ACROSS) if beyond else []
    edges = [
        boundary.edge(boundary.beyond, value if math.isnan(boundary.outside) else boundary.outside)
        for boundary, value in zip(found, values, strict=True)
    ]
    for i, motion in zip(beyond, motions, strict=True):
        if motion.motion_class not in UNSURE and (found[i].half_width == 0.0 or motion.group != group):
            edges[i] = found[i].edge(motion.name, values[i])
    return tuple(edges)


# Boundaries that are solutions of equations


def _exact(present: Present, side: Found, branches: Branches) -> Found | None:
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
        return bifurcation(branches.of(present.orbit, side.range, side.direction), side)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None  # the branch runs where its equations have no meaning


def _start_of(orbit: Any) -> Start:
    """Return an impact of an orbit, no graze if it has another, as what to carry across a boundary."""
    hit = 0 if min(orbit.velocities) > 0.0 else int(np.argmax(orbit.velocities))
    return Start(0.0, orbit.velocities[hit], orbit.phases[hit])


def bifurcation(branch: Branch, side: Found) -> Found | None:
    """Follow the branch of an orbit until it folds, doubles, grazes or strikes two stops at once."""
    while branch.goes_on(MOST):
        way = branch.way
        for special in way.special if way else []:
            at = special.orbit
            if at.admissible:
                kind = "period_halving" if at.n_periods < branch.orbit.n_periods else special.kind
                return replace(side, kind=kind, value=special.value, start=_start_of(at))
    way = branch.way
    if way is not None and way.end == "impacts_merge":
        last = way.points[-1]
        return replace(side, kind=way.end, value=last.value, start=_start_of(last.orbit))
    return side if way is not None and way.end == "range" else None


def _end_of_sticking(present: Present, side: Found) -> Found:
    """Walk outwards until the mass, let go, does not rest again after as many periods; bisect there."""
    assert present.orbit is not None
    n, varied = present.orbit.n_periods, side.range
    if present.model is present.oscillator and varied.name == "restitution":
        varied = replace(varied, high=min(varied.high, max(BOUNCY, 0.5 * (1.0 + varied.value))))
    path = varied.path(side.direction, SCANNED)
    near = [varied.between(varied.value, path[0], 0.5**k) for k in range(CLOSER, 0, -1)] if path else []
    values = [varied.value, *near, *path]
    widest = 0.0
    for _ in range(3):  # the steps, then the first in which it ends in finer ones: cycles may come and go within
        ended = next((i for i, value in enumerate(values) if i and periods_from_release(varied.at(value), n) != n), 0)
        changes = [varied.change(value) for value in values[: (ended or len(values)) + (ended > 0)]]
        widest = widest or max((abs(b - a) for a, b in pairwise(changes)), default=0.0)
        if not ended:
            return replace(side, range=varied, spacing=widest)
        inside, outside = values[ended - 1], values[ended]
        values = [varied.between(inside, outside, j / SECTIONS) for j in range(SECTIONS)] + [outside]
    end = end_of_sticking(present.model, varied.name, (inside, outside), longest=n)
    known = replace(side, range=varied, kind="change", value=end.value, start=AT_REST, spacing=widest)
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

    def there(value: float) -> float:
        return margin(range.at(value))

    inside, outside = _first_negative(there, [range.value, *side.path(SCANNED)])
    if math.isnan(outside):
        return side
    narrow = 1e-17 * range.scale
    while abs(outside - inside) > narrow and (middle := 0.5 * (inside + outside)) not in (inside, outside):
        if there(middle) >= 0.0:
            inside = middle
        else:
            outside = middle
    value, start = inside if abs(inside) > narrow else 0.0, AT_REST
    if kind == "first_contact":
        osc = range.at(value)
        steady = osc.steady_state
        start = Start(max(osc.gap - steady.displacement, 0.0), steady.velocity, 0.0)
    return replace(side, kind=kind, value=value, start=start)


def _first_negative(margin: Callable[[float], float], values: Sequence[float]) -> tuple[float, float]:
    """Return neighbouring values between which a margin first becomes negative, NaN for the second if it does not.

    A resonance may be narrower than a step: wherever the margin has a minimum, that is found by golden section.
    """
    known = [margin(value) for value in values]
    for i in range(1, len(values)):
        if known[i] < 0.0:
            return values[i - 1], values[i]
        if i + 1 < len(values) and known[i - 1] > known[i] <= known[i + 1]:
            low, high = values[i - 1], values[i + 1]
            for _ in range(GOLDEN):
                cuts = high - GOLDEN_SHARE * (high - low), low + GOLDEN_SHARE * (high - low)
                seen = [margin(cut) for cut in cuts]
                if min(seen) < 0.0:
                    return values[i - 1], cuts[int(seen[1] < seen[0])]
                low, high = (low, cuts[1]) if seen[0] < seen[1] else (cuts[0], high)
    return values[-1], math.nan


# Boundaries by bisection


def _bisected(present: Present, sides: Sequence[Found], runner: Runner) -> list[Found]:
    """Return, for each parameter and direction, where the motion that is followed first changes its class.

    What an undecided motion ends as is not known, and so not where it ends.
    """
    if present.measured.motion_class in UNSURE:
        return [replace(side, reached=math.nan) for side in sides]
    group = present.measured.group
    tracks = [
        Track(side.range, side.range.value, side.end, lambda motion: motion.group == group, present.start, CROWDED)
        for side in sides
    ]
    carry(tracks, runner)
    return [_ended(side, track) for side, track in zip(sides, tracks, strict=True)]


def _ended(side: Found, track: Track) -> Found:
    """Return the end of a motion that was carried along."""
    if track.beyond is None:
        return replace(side, spacing=track.widest, reached=track.inside)
    inside, outside = track.inside, track.outside
    middle, half = 0.5 * (inside + outside), 0.5 * abs(outside - inside)
    there = track.beyond.name if track.beyond.motion_class != MotionClass.UNDECIDED else ""
    known = replace(side, kind="change", value=middle, half_width=half, spacing=track.widest, start=track.start)
    return replace(known, beyond=there, outside=outside)
