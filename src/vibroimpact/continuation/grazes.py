"""Beyond a graze of a compliant stop, where a contact is born or lost and the motion goes on."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.systems.cycle import Cycle
from vibroimpact.orbits.systems.events import IMPACT, LET_GO, PUSH_AGAIN, Event

BORN = 0.02  # radians of the fastest rate: half of a contact just after a graze
SHORTENED = 10  # times that contact is halved at most


def losing(cycle: Cycle, unknown: Floats, graze: int) -> tuple[Cycle, Floats] | None:
    """Return a cycle without one of its events, a graze, and its unknown; None if no impact is left to begin with."""
    others = [at for at in cycle.impacts if at != graze]
    if not others:
        return None
    p, (turned, unknown) = len(cycle.events), cycle.rotated(unknown, others[0])
    at = (graze - others[0]) % p
    return replace(turned, events=turned.events[:at] + turned.events[at + 1 :]), np.delete(unknown, at)


def gaining(
    equations: Any, cycle: Cycle, leg: int, stop: int, x: Floats, sign: float
) -> tuple[Any, Floats, Floats] | None:
    """Return equations with a contact, or a pause of one, in place of a graze in mid-leg, a solution and its tangent.

    At first its duration grows with the square root of the depth. A stiff stop soon turns the parameter back: the
    contact is taken so short that it still goes on in the sense of `sign`, if that is possible. With damping the force
    jumps to c v at its begin, derivatives jump at the graze, and the parameter may turn back there.
    """
    at, touch, rest, flow = leg + 1, float(x[equations.size]), x[equations.size + 1 :], cycle.flow
    pushes = stop in cycle.phases[at]
    kinds = (LET_GO, PUSH_AGAIN if flow.lag(stop) else IMPACT) if pushes else (IMPACT, LET_GO)
    events = (*cycle.events[:at], *(Event(stop, kind) for kind in kinds), *cycle.events[at:])
    longer = replace(equations, cycle=replace(equations.cycle, events=events))
    half = BORN / max(cycle.fastest, flow.phase(tuple(sorted({*cycle.phases[at], stop}))).fastest)
    born = None
    for _ in range(SHORTENED):
        lasting = 2.0 * half if pushes else _lasting(half, float(flow.stiffness[stop]), float(flow.viscosity[stop]))
        pair = touch + np.array([-half, lasting - half]) / TURN
        start = np.concatenate([x[:at], pair, x[at : equations.size], rest])
        row = np.eye(len(start))[at + 1] - np.eye(len(start))[at]
        solution, corrections, jacobian = longer.newton(start, row)
        born = (longer, solution, longer.tangent(solution, row, jacobian)) if corrections else born
        if corrections and born is not None and born[2][-1] * sign > 0.0:
            break
        half *= 0.5
    return born


def _lasting(half: float, k: float, c: float) -> float:
    """Return the time of the push of a stop that would be pressed in for 2 `half`: k (e t - t^2/2) + c (e - t) = 0."""
    lever = k * half - c
    return (lever + math.sqrt(lever * lever + 2.0 * k * c * half)) / k
