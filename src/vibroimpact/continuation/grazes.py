"""Continuation through a graze of a compliant stop, where a contact appears or disappears."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.cycle import Cycle
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import GRAZE, IMPACT, LET_GO, PUSH_AGAIN, Event

BORN = 0.02  # radians of the fastest rate: half the length of a contact just after a graze
SHORTENED = 10  # halvings of that contact, at most


def losing(cycle: Cycle, unknown: Floats, impact: int) -> tuple[Cycle, Floats] | None:
    """Return a cycle beyond the loss of an impact, and its unknown; None if no impact is left.

    A graze vanishes. Where the gap before an impact vanishes, its stop pushes again, still pressed in.
    """
    others = [at for at in cycle.impacts if at != impact]
    if not others:
        return None
    p, (turned, unknown) = len(cycle.events), cycle.rotated(unknown, others[0])
    at = (impact - others[0]) % p
    stop, kind = turned.events[at]
    instead = () if kind == GRAZE else (Event(stop, PUSH_AGAIN),)
    events = (*turned.events[:at], *instead, *turned.events[at + 1 :])
    return replace(turned, events=events), unknown if instead else np.delete(unknown, at)


def gaining(
    equations: Any, cycle: Cycle, leg: int, stop: int, x: Floats, sign: float
) -> tuple[Any, Floats, Floats] | None:
    """Return equations in which a contact, or a gap in one, replaces a graze in mid-leg; a solution, and its tangent.

    At first the duration grows with the square root of the depth. With a stiff stop the parameter soon turns back, so
    the contact is chosen so short that the parameter still continues in the direction `sign`, if possible. With damping
    the force jumps to c v at the beginning of contact; derivatives jump at the graze, where the parameter may turn
    back.
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
    """Return the time for which a stop pushes that is pressed in for 2 `half`: k (e t - t^2/2) + c (e - t) = 0."""
    lever = k * half - c
    return (lever + math.sqrt(lever * lever + 2.0 * k * c * half)) / k
