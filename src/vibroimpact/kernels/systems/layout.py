"""Where the numbers of a cell stand: rows of a table, of a system's modes, stops and harmonics."""

from __future__ import annotations

from collections import namedtuple
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from vibroimpact.kernels.shared.series import SIZE
from vibroimpact.kernels.systems.elements import COLUMNS

# How a stop is left: its clearance begins with no zero, a single one (just struck), a double one (from rest) or a
# triple one (let go); or it is closed, held by a force above zero or by one that begins there. Where a zero has a
# higher order, -x or PASSING + x stands for open or closed on a step up to x in any case.
OPEN, STRUCK, RESTING, RELEASED, CLOSED, BALANCED, PASSING = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0
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
LIKE = "modes stops harmonics coupled moving thorough wary compliant rigid forceful draining swinging far free flow"
if TYPE_CHECKING:
    Layout = Any
else:
    Layout = namedtuple("Layout", [*LIKE.split(), *_sizes(1, 1, 1, 1, True, True, True, True, True), "rows"])


def layout_of(
    modes: int,
    stops: int,
    harmonics: int,
    coupled: bool,
    moving: bool,
    compliant: bool = False,
    rigid: bool = True,
    far: bool = False,
    free: bool = False,
    forceful: bool = False,
    thorough: bool = False,
    wary: bool = False,
    draining: bool = False,
    swinging: bool = False,
) -> Layout:
    """Return the rows of systems of that many modes, stops and harmonics.

    `coupled`: damping is not proportional in some of them; `moving`: so is a stop; `thorough`: a neighbour of each
    motion is carried along; `wary`: near-misses are looked for, too; `compliant`, `rigid`: some stops are
    so; `far`: modes of some are so slow that far leaps are worth a trial; `free`: some have a free centre; `forceful`:
    impulses, largest forces or what compliant stops take are wanted; `draining`: so is what the dampers take;
    `swinging`: how far the system swings along a direction.
    """
    flow = 2 + 4 * (modes if coupled else 1) + 4 * harmonics
    like = (
        modes,
        stops,
        harmonics,
        coupled,
        moving,
        thorough,
        wary,
        compliant,
        rigid,
        forceful,
        draining,
        swinging,
        far,
        free,
    )
    sizes = _sizes(modes, stops, harmonics, flow, thorough, compliant, far, free, swinging)
    return Layout(*like, flow, *accumulate(sizes.values(), initial=0))
