"""Where the numbers of a cell stand: rows of a table, of a system's modes, stops and harmonics."""

from __future__ import annotations

from typing import NamedTuple

from vibroimpact.kernels.systems.series import SIZE

# How a stop is left: its clearance begins with no zero, a single one (just struck), a double one (from rest) or a
# triple one (let go); or it is closed, held by a force above zero or by one that begins there. Where a zero has a
# higher order, -x or PASSING + x stands for open or closed on a step up to x in any case.
OPEN, STRUCK, RESTING, RELEASED, CLOSED, BALANCED, PASSING = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0
NOTHING, CONTACT, STALLED = 0.0, 1.0, 2.0  # what ended a step; the last: it is at a stop without approaching it


class Layout(NamedTuple):
    """Rows of each number of a cell; modes, stops and harmonics 1 to H come first.

    `eta`, `rate` (eta' in steps), `turn` (sin wt, cos wt, whole periods) are the state; `kind` says how each stop is
    left or held; `age` and `made` count the steps flown since an event and made in all; `held` is the inverse of alpha
    M^-1 alpha^T over the closed stops, and `closed` how many there are; `deta` and `drate` are a deviation, `known` is
    the state (eta, rate, sin wt, cos wt) at an impact to which the motion may return, and `missed` what the closest
    near-miss of each stop since the last impact left; `lawless` says that a law of restitution failed. Of compliant
    stops `leaving` says which one has let go and is still pushed in, `engaged` counts those and the ones that push,
    `pace` is the length of a step while they do, as a part of it, and `thrust`, `work`, `pushed`, `peak` and `depth`
    are impulse, energy taken, time, largest force and penetration of the contact; `drained` is the energy that dampers
    took. The others up to `constants` are constant, with the addresses of laws of restitution (`law`, 0 where it is a
    number), the length of a step in s (`tick`), the flows of leaps, `halves`, `wholes`, `fars` and those
    `within` contacts, `flow` numbers a mode, and `lift`, what accelerates the clearances. Of far leaps `slow` and
    `drawn` are the parts of `alpha` and `lift` that slow modes have, and `reach` is how far fast ones swing. Of a
    free centre `neutral` marks the amplitudes and rates that nothing depends on: no deviation counts there. From
    `pairs` on it is room to work.
    """

    modes: int
    stops: int
    harmonics: int
    coupled: bool
    moving: bool
    thorough: bool
    wary: bool
    compliant: bool
    rigid: bool
    forceful: bool
    draining: bool
    far: bool
    free: bool
    flow: int
    eta: int
    rate: int
    turn: int
    kind: int
    age: int
    made: int
    closed: int
    held: int
    lawless: int
    deta: int
    drate: int
    known: int
    missed: int
    leaving: int
    engaged: int
    pace: int
    thrust: int
    work: int
    pushed: int
    peak: int
    depth: int
    entry: int
    drained: int
    square: int
    damping: int
    load: int
    force: int
    alpha: int
    jump: int
    weight: int
    gap: int
    motion: int
    restitution: int
    law: int
    tick: int
    spring: int
    dashpot: int
    hard: int
    thick: int
    theta: int
    cut: int
    speed: int
    steady: int
    margin: int
    give: int
    slide: int
    sliding: int
    lift: int
    halves: int
    wholes: int
    fars: int
    slow: int
    drawn: int
    reach: int
    within: int
    neutral: int
    constants: int
    pairs: int
    flight: int
    pull: int
    leapt: int
    apart: int
    stop: int
    hold: int
    near: int
    passed: int
    which: int
    hit: int
    rows: int


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
) -> Layout:
    """Return the rows of systems of that many modes, stops and harmonics.

    `coupled`: damping is not proportional in some of them; `moving`: so is a stop; `thorough`: a neighbour of each
    motion is carried along; `wary`: near-misses are looked for, too; `compliant`, `rigid`: some stops are
    so; `far`: modes of some are so slow that far leaps are worth a trial; `free`: some have a free centre; `forceful`:
    impulses, largest forces or what compliant stops take are asked for; `draining`: so is what the dampers take.
    """
    n, s, m = modes, stops, harmonics
    own = 2 + 4 * (n if coupled else 1) + 4 * m
    leap = n * own + 2 + s * (1 + 2 * n)
    sizes = {
        "eta": n, "rate": n, "turn": 3, "kind": s, "age": 1, "made": 1, "closed": 1, "held": s * s, "lawless": 1,
        "deta": n, "drate": n, "known": (2 * n + 2) * thorough, "missed": s * thorough,
        "leaving": s, "engaged": 1, "pace": 1, "thrust": s, "work": s, "pushed": s, "peak": s, "depth": s, "entry": s,
        "drained": 1,
        "square": n, "damping": n * n, "load": n, "force": 2 * m * n, "alpha": s * n, "jump": s * n, "weight": n,
        "gap": s, "motion": 2 * m * s, "restitution": s, "law": s, "tick": 1,
        "spring": s, "dashpot": s, "hard": s, "thick": s, "theta": 1, "cut": 1, "speed": 1, "steady": n + 2 * m * n,
        "margin": s, "give": s, "slide": n, "sliding": s * n, "lift": s * (n + 1 + 2 * m),
        "halves": leap, "wholes": leap, "fars": leap * far, "slow": s * n * far, "drawn": s * (n + 1 + 2 * m) * far,
        "reach": s * (1 + 2 * n) * far, "within": 2 * s * (own + 3) * (compliant and n == 1),
        "neutral": 2 * n * free, "constants": 0,
        "pairs": 2 * max(m, 1), "flight": n * SIZE, "pull": n * SIZE, "leapt": 2 * n, "apart": 4 * s,
        "stop": s * SIZE, "hold": s * SIZE, "near": SIZE, "passed": 1, "which": 1, "hit": 1, "rows": 0,
    }  # fmt: skip
    places, row = {}, 0
    for name, size in sizes.items():
        places[name] = row
        row += size
    return Layout(
        n, s, m, coupled, moving, thorough, wary, compliant, rigid, forceful, draining, far, free, own, **places
    )
