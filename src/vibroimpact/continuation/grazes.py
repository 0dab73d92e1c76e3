"""Continuation through a graze of a compliant stop, where a contact appears or disappears."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.orbits.cycle import Cycle
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import GRAZE, IMPACT, LET_GO, PUSH_AGAIN, Event

BORN = 0.02  # radians of the fastest rate: half the length of a contact just after a graze
SHORTENED = 10  # halvings of that contact, at most


def losing(cycle: Cycle, unknown: Floats, impact: int) -> tuple[Cycle, Floats] | None:
    """Return a cycle beyond the loss of an impact, and its unknown; None if no impact is left.

    A graze vanishes. Where the gap before an impact vanishes, its stop pushes again, still pressed in; the reverse is
    the birth of an impact.
    """
    others = [at for at in cycle.impacts if at != impact]
    if not others:
        return None
    p, (turned, unknown) = len(cycle.events), cycle.rotated(unknown, others[0])
    at = (impact - others[0]) % p
    stop, kind = turned.events[at]
    instead = () if kind == GRAZE else (Event(stop, PUSH_AGAIN if kind == IMPACT else IMPACT),)
    events = (*turned.events[:at], *instead, *turned.events[at + 1 :])
    return replace(turned, events=events), unknown if instead else np.delete(unknown, at)


class Meeting(NamedTuple):
    """A cycle beyond the meeting of two events, and its unknown; if they vanish, which stop is touched where."""

    cycle: Cycle
    unknown: Floats
    stop: int | None = None
    leg: int = 0
    angle: float = math.nan


def meeting(cycle: Cycle, unknown: Floats) -> Meeting | None:
    """Return a cycle beyond the place where its two closest events meet; None if the motion does not go on.

    Two events of one compliant stop vanish, with a gap within a contact or with a push. Those of two stops change
    places if their order has no effect, as where the impact on a rigid stop does not stop the approach to another one.
    """
    p, at = len(cycle.events), int(np.argmin(np.diff(cycle.angles(unknown))))
    pair = at, (at + 1) % p
    first = next((i for i in cycle.impacts if i not in pair), (at + 2) % p)
    (turned, unknown), at = cycle.rotated(unknown, first), (at - first) % p
    one, other = turned.events[at : at + 2]
    before, after = turned.events[:at], turned.events[at + 2 :]
    if cycle.flow.commute(one.stop, other.stop) or _goes_on(turned, unknown, at):
        swapped = replace(turned, events=(*before, other, one, *after))
        unknown[[at, at + 1]] = unknown[[at + 1, at]]
        return Meeting(*swapped.rotated(unknown, swapped.impacts[0]))
    if one.stop != other.stop or first in pair or first not in cycle.impacts or not cycle.flow.compliant[one.stop]:
        return None
    shorter, angle = replace(turned, events=before + after), 0.5 * float(unknown[at] + unknown[at + 1])
    return Meeting(shorter, np.delete(unknown, [at, at + 1]), one.stop, at - 1, angle)


def _goes_on(cycle: Cycle, unknown: Floats, at: int) -> bool:
    """Whether an impact on a rigid stop and one on a compliant stop meet that is approached before and after it."""
    flow, state, drive = cycle.flow, cycle.states(unknown)[at], cycle.flow.drive(unknown[at])
    one, other = sorted(cycle.events[at : at + 2], key=lambda event: bool(flow.compliant[event.stop]))
    if flow.compliant[one.stop] or not flow.compliant[other.stop] or other.kind != IMPACT:
        return False
    return max(flow.closing(other.stop, x, drive) for x in (state, flow.struck(one.stop, state, drive))) < 0.0


def gaining(bounded: Any, x: Floats, sign: float) -> tuple[Any, Floats, Floats] | None:
    """Return equations in which two events replace a graze in mid-leg, a solution of them, and its tangent.

    A contact begins and ends, the force of a contact ends and begins again, or a stop that is still pressed in pushes
    once more.

    At first the duration grows with the square root of the depth. With a stiff stop the parameter soon turns back, so
    the contact is chosen so short that the parameter still continues in the direction `sign`, if possible. With damping
    the force jumps to c v at the beginning of contact; derivatives jump at the graze, where the parameter may turn
    back.
    """
    (cycle, unknown), at, stop, touch = bounded.solved(x), bounded.impact + 1, bounded.stop, bounded.touch(x)
    flow, pushes = cycle.flow, stop in cycle.phases[at]
    pulls = flow.touching(stop, *cycle.state_at(unknown, at - 1, TURN * touch), cycle.phases[at])[1]
    longest = BORN / max(cycle.fastest, flow.phase(tuple(sorted({*cycle.phases[at], stop}))).fastest)
    born, leaves = None, False
    for again in (PUSH_AGAIN, IMPACT) if pulls and flow.lag(stop) else (IMPACT,):  # pressed in at first, soon free
        kinds = (LET_GO, again) if pushes else (again, LET_GO)
        events = (*cycle.events[:at], *(Event(stop, kind) for kind in kinds), *cycle.events[at:])
        longer = replace(bounded.of_branch, cycle=replace(bounded.cycle, events=events))
        for half in longest * 0.5 ** np.arange(SHORTENED):
            lasting = 2.0 * half if pulls else _lasting(half, float(flow.stiffness[stop]), float(flow.viscosity[stop]))
            pair = touch + np.array([-half, lasting - half]) / TURN
            start = np.concatenate([x[:at], pair, x[at : bounded.size], x[bounded.inner :]])
            row = np.eye(len(start))[at + 1] - np.eye(len(start))[at]
            solution, corrections, jacobian = longer.newton(start, row)
            if corrections:
                born = longer, solution, longer.tangent(solution, row, jacobian)
                leaves = longer.speeds(solution).min() > 0.0
                if leaves and born[2][-1] * sign > 0.0:
                    return born
        if leaves:  # the parameter turns back
            return born
    return born


def _lasting(half: float, k: float, c: float) -> float:
    """Return the time for which a stop pushes that is pressed in for 2 `half`: k (e t - t^2/2) + c (e - t) = 0."""
    lever = k * half - c
    return (lever + math.sqrt(lever * lever + 2.0 * k * c * half)) / k
