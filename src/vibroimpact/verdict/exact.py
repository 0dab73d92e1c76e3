"""Boundaries that are solutions of equations: the orbit's own bifurcations, or a closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vibroimpact.continuation.arclength import tangent
from vibroimpact.continuation.branch import branch_system, walk
from vibroimpact.continuation.points import special_orbit
from vibroimpact.orbits import Orbit
from vibroimpact.orbits.sticking import end_of_sticking, from_release
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.verdict.edges import Found, steady_start
from vibroimpact.verdict.present import Present
from vibroimpact.verdict.reach import Reach
from vibroimpact.verdict.readings import Start

STEP = 0.01  # of the range, a period, or the speed: the longest step along a branch
MOST = 800  # orbits times impacts that are solved for along one direction
PLACES = 60  # values along a path at which a condition is looked at
BOUNCY = 0.99  # restitution up to which sticking is followed: chatters grow longer as 1/(1 - r)
AT_REST = Start(0.0, 0.0, 0.25)  # at the stop, where the force presses most


def exact_boundary(present: Present, reach: Reach, direction: int) -> Found | None:
    """Return the boundary, or `none` up to the end of the reach; None where no equation tells it."""
    if not reach.path(direction, 1):
        return Found(reach, direction)
    osc, kind = present.oscillator, present.reading.kind
    if reach.name == "amplitude" and osc.gap == 0.0 and osc.amplitude > 0.0:
        return Found(reach, direction)  # the motion only grows in proportion
    if kind == "no_impact" and osc.damping > 0.0 and osc.gap > osc.steady_amplitude:
        return _first_contact(osc, reach, direction)
    if kind == "stuck_forever" and osc.stiffness * osc.gap <= -osc.amplitude:
        return _lift_off(osc, reach, direction)
    if present.orbit is None:
        return None
    if present.orbit.sticks:
        return _end_of_sticking(present.orbit, reach, direction)
    try:
        return _bifurcation(present.orbit, reach, direction)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None  # the branch runs where its equations have no meaning


def _bifurcation(orbit: Orbit, reach: Reach, direction: int) -> Found | None:
    """Follow the orbit until it folds, doubles or grazes."""
    system, x = branch_system(orbit, reach.name, (reach.low, reach.high))
    along = np.zeros(len(x))
    along[-1] = direction
    way = None
    for way in walk(system, x, tangent(system, x, along), STEP, False):
        for special in way.special:
            at = special_orbit(special)
            if at.admissible:
                value = special.system.values(special.x)[0]
                start = Start(0.0, at.velocities[0], at.phases[0]) if min(at.velocities) > 0.0 else _hardest(at)
                return Found(reach, direction, special.kind, value, start=start)
        if len(way.points) * orbit.n_impacts > MOST:
            return None
    return Found(reach, direction) if way is not None and way.end == "range" else None


def _hardest(orbit: Orbit) -> Start:
    i = int(np.argmax(orbit.velocities))
    return Start(0.0, orbit.velocities[i], orbit.phases[i])


def _end_of_sticking(orbit: Orbit, reach: Reach, direction: int) -> Found:
    """Walk outwards until the mass, let go, does not rest again after as many periods; bisect there."""
    osc, n = orbit.oscillator, orbit.n_periods
    if reach.name == "restitution":
        reach = replace(reach, high=min(reach.high, max(BOUNCY, 0.5 * (1.0 + osc.restitution))))
    inside = reach.value
    for outside in reach.path(direction, PLACES):
        stick = from_release(reach.at(osc, outside), n)
        if stick is None or stick.periods != n:
            break
        inside = outside
    else:
        return Found(reach, direction)
    end = end_of_sticking(osc, reach.name, (inside, outside), longest=n)
    if end.outcome == "pressed_for_ever":
        return Found(reach, direction, "pressed_for_ever", end.value, start=AT_REST)
    if end.outcome == "found":
        return Found(reach, direction, "end_of_sticking", end.value, start=AT_REST)
    value = end.value if math.isfinite(end.value) else 0.5 * (inside + outside)
    width = math.ulp(value) if math.isfinite(end.value) else 0.5 * abs(outside - inside)
    return Found(reach, direction, "change", value, width, AT_REST)


def _first_contact(osc: ImpactOscillator, reach: Reach, direction: int) -> Found:
    """Where the amplitude of the motion without a stop reaches the gap: R = g."""
    value = _root(osc, reach, direction, lambda o: o.gap - o.steady_amplitude)
    if math.isnan(value):
        return Found(reach, direction)
    return Found(reach, direction, "first_contact", value, start=steady_start(reach.at(osc, value)))


def _lift_off(osc: ImpactOscillator, reach: Reach, direction: int) -> Found:
    """Where the force reaches the preload: f = -k g."""
    value = _root(osc, reach, direction, lambda o: -o.stiffness * o.gap - o.amplitude)
    if math.isnan(value):
        return Found(reach, direction)
    return Found(reach, direction, "lift_off", value, start=AT_REST)


def _root(osc: ImpactOscillator, reach: Reach, direction: int, margin: Callable[[ImpactOscillator], float]) -> float:
    """Return the first value outwards at which a margin becomes negative; NaN if there is none."""
    inside = reach.value
    for outside in reach.path(direction, 4 * PLACES):
        if margin(reach.at(osc, outside)) < 0.0:
            break
        inside = outside
    else:
        return math.nan
    narrow = 1e-17 * reach.scale
    while abs(outside - inside) > narrow and (middle := 0.5 * (inside + outside)) not in (inside, outside):
        if margin(reach.at(osc, middle)) >= 0.0:
            inside = middle
        else:
            outside = middle
    return inside if abs(inside) > narrow else 0.0
