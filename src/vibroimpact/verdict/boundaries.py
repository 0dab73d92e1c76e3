"""The values of each parameter at which a motion ends: its nearest boundaries below and above, and the motions beyond.

If an equation gives the boundary (a bifurcation of the orbit, the end of sticking, or a closed form), it is solved.
Otherwise, if phase and velocity of an impact are the whole state, the motion is followed along many paths at once, and
its state is carried along (`carried`). A motion without impacts has further edges, beyond which other motions hit
(`onsets`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence.final import irregular, rests
from vibroimpact.coexistence.measuring import AT_REST, Runner, Start, cells_of
from vibroimpact.motion import MotionClass
from vibroimpact.orbits.sticking import periods_from_release
from vibroimpact.orbits.sticking_end import end_of_sticking
from vibroimpact.status import Status
from vibroimpact.verdict.branches import Branches, LazyBranch
from vibroimpact.verdict.carried import SECTIONS, UNSURE, Track, carry
from vibroimpact.verdict.edges import Edge, Side
from vibroimpact.verdict.onsets import onset_from_rest, onset_from_some
from vibroimpact.verdict.present import Coexisting, Present
from vibroimpact.verdict.ranges import CROWDED, Range
from vibroimpact.verdict.searches import Search, together

GOLDEN, GOLDEN_SHARE = 60, 0.5 * (math.sqrt(5.0) - 1.0)  # steps of a golden section, to 3e-13 of its beginning
SCANNED = 60  # values along a path at which a condition is evaluated
CLOSER = 32  # times that the first of them is halved: cycles of many periods may end within 1e-12
BOUNCY = 0.99  # restitution up to which sticking is followed: chatters grow longer as 1/(1 - r)
ACROSS = ImpactWindow(1500, 2000)  # close to a boundary motions settle slowly


def nearest_boundaries(
    present: Present,
    ranges: Sequence[Range],
    runner: Runner,
    branches: Branches,
    coexisting: Sequence[Coexisting] = (),
    going: Callable[[], None] = lambda: None,
) -> tuple[Edge, ...]:
    """Return the nearest boundaries of a motion below and above each parameter; `going` is called for each.

    If motions that hit coexist with one that does not, some initial conditions already settle to impacts at the present
    value. If the state is more than an impact, only bifurcations are sought, and not the motions beyond them.
    """
    solved: list[tuple[Side, Side | None]] = []
    for varied in ranges:
        sides = Side(varied, -1), Side(varied, 1)
        solved += [(side, _exact(present, side, branches)) for side in sides]
        going()
    if not present.oscillator.forgets:  # no motion can be carried along by its impacts
        return tuple((exact or replace(side, reached=math.nan)).edge() for side, exact in solved)
    bisected = iter(_bisected(present, [side for side, exact in solved if exact is None], runner))
    bounded = [exact or next(bisected) for _, exact in solved]
    # Else rounding decides how long impacts last, at the present value and all around, or passing ones have no end.
    decided = not present.final.ends and present.oscillator.damping > 0.0
    if present.measured.motion_class in (MotionClass.NO_IMPACT, MotionClass.STUCK_FOREVER) and decided:
        hit_already = any(motion.max_velocity > 0.0 for motion in coexisting)
        bounded = together([_with_onsets(present, side, hit_already) for side in bounded], runner)
    return _with_beyond(bounded, present.measured.group, runner)


def _with_onsets(present: Present, side: Side, hit_already: bool) -> Search[Side]:
    """Return a boundary of a motion without impacts, and the values beyond which others hit; these need a force."""
    if not side.has_room or side.range.at(side.end).amplitude == 0.0:
        return side
    at_present = side.onset(side.range.value)
    if present.measured.motion_class == MotionClass.STUCK_FOREVER:  # at rest at the stop is where it is
        from_rest = side.onset(side.value, start=side.start) if math.isfinite(side.value) else None
        strikes = from_rest
    else:
        from_rest = yield from onset_from_rest(side)
        strikes_already = present.measured.status != Status.NO_IMPACT
        strikes = at_present if strikes_already else (yield from onset_from_rest(side, lasting=False))
    from_some = at_present if hit_already else (yield from onset_from_some(side, from_rest))
    return replace(side, onsets=(strikes, from_rest, from_some))


def _with_beyond(sides: Sequence[Side], group: tuple[str, int, int], runner: Runner) -> tuple[Edge, ...]:
    """Return the boundaries as callers receive them, with the motion a little beyond each, or else just beyond it."""
    values = [side.beyond_at() for side in sides]
    beyond = [i for i, value in enumerate(values) if not math.isnan(value)]
    designs = [sides[i].range.at(values[i]) for i in beyond]
    motions = runner.glance(cells_of(designs, [sides[i].start for i in beyond]), ACROSS) if beyond else []
    edges = [
        side.edge(side.beyond, value if math.isnan(side.outside) else side.outside)
        for side, value in zip(sides, values, strict=True)
    ]
    for i, motion in zip(beyond, motions, strict=True):
        if motion.motion_class not in UNSURE and (sides[i].half_width == 0.0 or motion.group != group):
            edges[i] = sides[i].edge(motion.name, values[i])
    return tuple(edges)


# Boundaries that are solutions of equations


def _exact(present: Present, side: Side, branches: Branches) -> Side | None:
    """Return the boundary, or `none` up to the end of the range; None if no equation gives it."""
    if side.range.only_scales or not side.has_room:
        return side
    if present.orbit is None:
        return _of_quiet_motion(present, side) if present.oscillator.forgets else None
    if present.orbit.sticks:
        return _end_of_sticking(present, side)
    try:
        return _bifurcation(branches.of(present.orbit, side.range, side.direction), side)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None  # the branch runs where its equations have no meaning


def _start_of(orbit: Any) -> Start:
    """Return an impact of an orbit (not a graze, if possible), as the state to carry across a boundary."""
    hit = 0 if min(orbit.velocities) > 0.0 else int(np.argmax(orbit.velocities))
    return Start(0.0, orbit.velocities[hit], orbit.phases[hit])


def _bifurcation(branch: LazyBranch, side: Side) -> Side | None:
    """Follow the branch of an orbit until it folds, doubles, grazes or strikes two stops at once."""
    while branch.goes_on():
        for special in branch.way.special if branch.way else []:
            orbit = special.orbit
            if orbit.admissible:
                kind = "period_halving" if orbit.n_periods < branch.orbit.n_periods else special.kind
                return replace(side, kind=kind, value=special.value, start=_start_of(orbit))
    way = branch.way
    if way is not None and way.end == "impacts_merge":
        last = way.points[-1]
        return replace(side, kind=way.end, value=last.value, start=_start_of(last.orbit))
    return side if way is not None and way.end == "range" else None


def _end_of_sticking(present: Present, side: Side) -> Side:
    """Move outwards until the released mass does not rest again after as many periods; then bisect."""
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
        widest = widest or varied.widest_step(values[: (ended or len(values)) + (ended > 0)])
        if not ended:
            return replace(side, range=varied, spacing=widest)
        inside, outside = values[ended - 1], values[ended]
        values = varied.cut(inside, outside, SECTIONS)
    end = end_of_sticking(present.model, varied.name, (inside, outside), longest=n)
    change = replace(side, range=varied, kind="change", value=end.value, start=AT_REST, spacing=widest)
    if end.outcome in ("found", "pressed_for_ever"):
        return replace(change, kind="end_of_sticking" if end.outcome == "found" else end.outcome)
    if math.isfinite(end.value):
        return replace(change, half_width=math.ulp(end.value))
    return replace(change, value=0.5 * (inside + outside), half_width=0.5 * abs(outside - inside))


def _of_quiet_motion(present: Present, side: Side) -> Side | None:
    """Return the value at which one mass that does not hit touches the stop or lifts off it; None for other motions."""
    osc, kind = present.oscillator, present.measured.motion_class
    if kind == MotionClass.NO_IMPACT and osc.damping > 0.0 and osc.gap > osc.steady_amplitude:
        return _closed_form(side, "first_contact", lambda o: o.gap - o.steady_amplitude)
    if kind == MotionClass.STUCK_FOREVER and osc.stiffness * osc.gap <= -osc.amplitude:
        return _closed_form(side, "lift_off", lambda o: -o.stiffness * o.gap - o.amplitude)
    return None


def _closed_form(side: Side, kind: str, margin: Callable[[Any], float]) -> Side:
    """Return the first value outwards at which a margin becomes negative, if there is one.

    The mass first touches the stop when the amplitude of its motion without a stop reaches the gap, R = g; it lifts off
    the stop when the force reaches the preload, f = -k g.
    """
    varied = side.range

    def margin_at(value: float) -> float:
        return margin(varied.at(value))

    inside, outside = _first_negative(margin_at, [varied.value, *varied.path(side.direction, SCANNED)])
    if math.isnan(outside):
        return side
    narrow = 1e-17 * varied.scale
    while abs(outside - inside) > narrow and (middle := 0.5 * (inside + outside)) not in (inside, outside):
        if margin_at(middle) >= 0.0:
            inside = middle
        else:
            outside = middle
    value, start = inside if abs(inside) > narrow else 0.0, AT_REST
    if kind == "first_contact":
        osc = varied.at(value)
        steady = osc.steady_state
        start = Start(max(osc.gap - steady.displacement, 0.0), steady.velocity, 0.0)
    return replace(side, kind=kind, value=value, start=start)


def _first_negative(margin: Callable[[float], float], values: Sequence[float]) -> tuple[float, float]:
    """Return neighbouring values between which a margin first becomes negative, NaN for the second if it does not.

    A resonance may be narrower than a step, so every minimum of the margin is found by golden section.
    """
    margins = [margin(value) for value in values]
    for i in range(1, len(values)):
        if margins[i] < 0.0:
            return values[i - 1], values[i]
        if i + 1 < len(values) and margins[i - 1] > margins[i] <= margins[i + 1]:
            low, high = values[i - 1], values[i + 1]
            for _ in range(GOLDEN):
                cuts = high - GOLDEN_SHARE * (high - low), low + GOLDEN_SHARE * (high - low)
                first, second = (margin(cut) for cut in cuts)
                if min(first, second) < 0.0:
                    return values[i - 1], cuts[int(second < first)]
                low, high = (low, cuts[1]) if first < second else (cuts[0], high)
    return values[-1], math.nan


# Boundaries by bisection


def _bisected(present: Present, sides: Sequence[Side], runner: Runner) -> list[Side]:
    """Return, for each parameter and direction, the value at which the motion that is followed first changes its class.

    For an undecided motion, neither its final kind nor its end is known, nor for one whose rests rounding decides.
    """
    motion = present.measured
    if motion.motion_class in UNSURE or (irregular(motion) and rests(motion)):
        return [replace(side, reached=math.nan) for side in sides]
    tracks = [
        Track(side.range, side.range.value, side.end, lambda other: other.group == motion.group, present.start, CROWDED)
        for side in sides
    ]
    together([carry(track) for track in tracks], runner)
    return [_ended(side, track) for side, track in zip(sides, tracks, strict=True)]


def _ended(side: Side, track: Track) -> Side:
    """Return the end of a motion that was carried along."""
    if track.beyond is None:
        return replace(side, spacing=track.widest, reached=track.inside)
    inside, outside = track.inside, track.outside
    middle, half = 0.5 * (inside + outside), 0.5 * abs(outside - inside)
    beyond = track.beyond.name if track.beyond.motion_class != MotionClass.UNDECIDED else ""
    change = replace(side, kind="change", value=middle, half_width=half, spacing=track.widest, start=track.start)
    return replace(change, beyond=beyond, outside=outside)
