"""Where the numbers of a cell stand: rows of a table, of a system's modes, stops and harmonics."""

from __future__ import annotations

from collections import namedtuple
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from vibroimpact.kernels.shared.series import SIZE
from vibroimpact.kernels.systems.elements import COLUMNS

SWING = 8  # sums of `swing`
NOTHING, CONTACT, STALLED = 0.0, 1.0, 2.0  # what ended a step; the last: it is at a stop without approaching it


def _sizes(
    n: int, s: int, m: int, flow: int, thorough: bool, compliant: bool, far: bool, free: bool, swinging: bool
) -> dict[str, int]:
    """Return the number of rows of each quantity of a cell, in their order, with `flow` numbers of a mode's flow.

    `eta`, `rate` (eta' in steps), `turn` (sin wt, cos wt, whole periods) are the state; `kind` says how each stop is
    left or held; `age` and `steps` count the steps flown since an event and in all; `held` is the inverse of alpha
    M^-1 alpha^T over the closed stops, and `closed` how many there are; `remote` marks stops that are out of reach
    for `calm` steps; `passed`, `which` and `hit` are how long a step was and what ended it; `deta` and `drate` are a
    deviation, `reference` is the state (eta, rate, sin wt, cos wt) at an impact to which the motion may return, and
    `missed` what the closest near-miss of each stop since the last impact left; `lawless` says that a law of
    restitution failed. Of compliant stops `leaving` says which one has let go and is still pushed in, `engaged`
    counts those and the ones that push, `pace` is the length of a step while they do, as a part of it, and `thrust`,
    `work`, `pushed`, `peak` and `depth` are impulse, energy taken, time, largest force and penetration of the
    contact, `peaked` and `deepest` the times of these two; `drained` is the energy that dampers took; `swing` and
    `strength` are the sums of `swing` over a direction's displacement and the stops' forces. From `fixed` up to
    `constants` they are constant, with what it takes to reach a stop (`barrier` and `growth` of `reach`), the addresses
    of laws of restitution (`law`, 0 where it is a number), the length of a step in s (`tick`), the flows of leaps,
    `halves`, `wholes`, `fars` and those `within` contacts, `flow` numbers a mode, and `lift`, what accelerates the
    clearances. Of far leaps `slow` and `drawn` are the parts of `alpha` and `lift` that slow modes have, and `reach` is
    how far fast ones swing. Of a free centre `neutral` marks the amplitudes and rates that nothing depends on: no
    deviation counts there; `along` is the direction of `swing`. From `pairs` on it is room to work.
    """
    leap = n * flow + 2 + s * (1 + 2 * n)
    return {
        "eta": n, "rate": n, "turn": 3, "kind": s, "age": 1, "steps": 1, "closed": 1, "lawless": 1,
        "deta": n, "drate": n, "reference": (2 * n + 2) * (thorough or swinging), "missed": s * thorough,
        "remote": s, "leaving": s, "engaged": 1, "pace": 1, "thrust": s, "work": s, "pushed": s, "peak": s, "depth": s,
        "peaked": s * compliant, "deepest": s * compliant, "entry": s, "drained": 1,
        "swing": SWING * swinging, "strength": s * swinging, "passed": 1, "which": 1, "hit": 1, "calm": 1,
        "held": s * s, "fixed": 0,
        "square": n, "damping": n * n, "load": n, "force": 2 * m * n, "alpha": s * n, "jump": s * n, "weight": n,
        "gap": s, "motion": 2 * m * s, "restitution": s, "law": s, "tick": 1,
        **dict.fromkeys(COLUMNS, s), "theta": 1, "cut": 1, "speed": 1, "steady": n + 2 * m * n,
        "margin": s, "give": s, "barrier": s, "growth": 1, "slide": n, "sliding": s * n,
        "lift": s * (n + 1 + 2 * m), "halves": leap, "wholes": leap, "fars": leap * far, "slow": s * n * far,
        "drawn": s * (n + 1 + 2 * m) * far, "reach": s * (1 + 2 * n) * far,
        "within": 2 * s * (flow + 3) * (compliant and n == 1), "neutral": 2 * n * free,
        "along": (n + 1 + 2 * m) * swinging, "constants": 0,
        "pairs": 2 * max(m, 1), "flight": n * SIZE, "pull": n * SIZE, "leapt": 2 * n, "apart": 4 * s,
        "stop": s * SIZE, "hold": s * SIZE, "near": max(SIZE, 2 * s),
    }  # fmt: skip


# What the cells of a table are like, as `layout_of` has it, then the first row of each number, and how many there are.
OBSERVED = "thorough", "wary", "forceful", "draining", "swinging"
LIKE = "modes", "stops", "harmonics", "coupled", "moving", "compliant", "rigid", *OBSERVED, "far", "free", "flow"
if TYPE_CHECKING:
    Layout = Any
else:
    Layout = namedtuple("Layout", [*LIKE, *_sizes(1, 1, 1, 1, True, True, True, True, True), "rows"])


def layout_of(shape: Any, far: bool, free: bool, **observed: bool) -> Layout:
    """Return the rows of systems of a shape: so many modes, stops and harmonics.

    `far`: modes of some are so slow that far leaps are worth a trial; `free`: some have a free centre. Observed may be:
    `thorough`: a neighbour of each motion is carried along; `wary`: near-misses are looked for, too; `forceful`:
    impulses, largest forces or what compliant stops take are wanted; `draining`: so is what the dampers take;
    `swinging`: how far the system swings along a direction.
    """
    n, s, m = shape.modes, shape.stops, shape.harmonics
    flow, seen = 2 + 4 * (n if shape.coupled else 1) + 4 * m, dict.fromkeys(OBSERVED, False) | observed
    sizes = _sizes(n, s, m, flow, seen["thorough"], shape.compliant, far, free, seen["swinging"])
    like = vars(shape) | seen | {"far": far, "free": free, "flow": flow}
    return Layout(*(like[name] for name in LIKE), *accumulate(sizes.values(), initial=0))
