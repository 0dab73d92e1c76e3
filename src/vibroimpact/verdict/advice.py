"""Ways to soften the impacts: the smallest change of one parameter with a clear benefit, computed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence.measuring import Measured, Runner, Start, cells_of
from vibroimpact.motion import MotionClass
from vibroimpact.verdict.present import Present, Range, measure

PLACES = 36  # values along a path
HALVINGS = 8  # of the step in which the benefit begins
SOFTER = 0.8 * (1.0 + 1e-9)  # of the hardest hit: a clear benefit
NO_HARDER = 1.05  # of the hardest hit: what a regular motion in place of chaos may cost
SCAN, TEST = ImpactWindow(500, 1500), ImpactWindow(1000, 4000)
TRIED = 6  # values beyond the first good one at which advice is tested


@dataclass(frozen=True)
class Advice:
    """A change of one parameter, and the motion that both a start from rest and the present motion then settle to.

    Parameters
    ----------
    parameter, value : str, float
        The parameter to change, and its new value.
    change : float
        The change, signed, relative to the present value, or to `of`.
    of : str
        What it is relative to, where that is not the present value.
    benefit : str
        "no_impact", "no_chaos", or "softer" (the hardest hit at least a fifth lower).
    motion : str
        The new motion, in two or three words.
    max_velocity, before : float
        Its hardest hit and that of the present motion, in m/s.
    """

    parameter: str
    value: float
    change: float
    of: str
    benefit: str
    motion: str
    max_velocity: float
    before: float


def gentler(now: Measured, then: Measured) -> str:
    """Return the benefit of another motion, or nothing if it is not gentler.

    Regular motions are not exchanged for chaos, nor chaos for harder hits.
    """
    if now.hardest == 0.0 or not (then.hardest == 0.0 or then.status.has_indices):
        return ""
    if then.hardest == 0.0:
        return "no_impact"
    wild = now.group[0] == "aperiodic"
    if then.group[0] == "aperiodic" and not wild:
        return ""
    regular = then.group[0] != "aperiodic"
    if now.motion_class == MotionClass.CHAOTIC and regular and then.hardest <= NO_HARDER * now.hardest:
        return "no_chaos"
    return "softer" if then.hardest <= SOFTER * now.hardest else ""


@dataclass
class Search:
    """A path, and the step of it in which the benefit begins."""

    range: Range
    direction: int
    path: list[float]
    inside: float = math.nan
    outside: float = math.nan
    further: list[float] = field(default_factory=list)


def advise(present: Present, ranges: Sequence[Range], runner: Runner) -> tuple[Advice, ...]:
    """Return for each parameter the smallest change to a gentler motion, the smallest of all first."""
    # Hits are compared over equal samples: the present motion goes on in the windows of the changed ones.
    (now,), (known,) = (measure(runner, cells_of([present.model], [present.start]), window) for window in (SCAN, TEST))
    if now.hardest == 0.0 or not now.status.has_indices:
        return ()
    chaotic = present.measured.motion_class == MotionClass.CHAOTIC  # then it stays so as the force grows in proportion
    searches = [
        Search(each, direction, path)
        for each in ranges
        for direction in (-1, 1)
        if (path := each.path(direction, PLACES)) and not (chaotic and each.only_scales)
    ]
    if not searches:
        return ()
    _locate(now, searches, runner)
    good = [search for search in searches if search.further]
    _refine(now, good, runner)
    found = [advice for search in good if (advice := _tested(present.start, known, search, runner))]
    smallest: dict[str, Advice] = {}
    for advice in sorted(found, key=lambda a: abs(a.change)):
        smallest.setdefault(advice.parameter, advice)
    return tuple(smallest.values())


def _locate(now: Measured, searches: Sequence[Search], runner: Runner) -> None:
    """Find along each path the first value with a benefit that its next neighbour has too."""
    there = [search.range.changed(value) for search in searches for value in search.path]
    motions = iter(measure(runner, cells_of(there), SCAN))
    for search in searches:
        good = [bool(gentler(now, next(motions))) for _ in search.path]
        pairs = zip(good, good[1:] + good[-1:], strict=True)
        first = next((j for j, (here, next_) in enumerate(pairs) if here and next_), None)
        if first is not None:
            search.inside = search.path[first - 1] if first else search.range.value
            search.outside = search.path[first]
            search.further = search.path[first : first + TRIED]


def _refine(now: Measured, searches: Sequence[Search], runner: Runner) -> None:
    for _ in range(HALVINGS if searches else 0):
        middles = [search.range.between(search.inside, search.outside, 0.5) for search in searches]
        there = [search.range.changed(value) for search, value in zip(searches, middles, strict=True)]
        motions = measure(runner, cells_of(there), SCAN)
        for search, middle, motion in zip(searches, middles, motions, strict=True):
            if gentler(now, motion):
                search.outside = middle
            else:
                search.inside = middle


def _tested(state: Start | None, now: Measured, search: Search, runner: Runner) -> Advice | None:
    """Return the first rounded value with a benefit both from rest and from the present motion's state."""
    varied = search.range
    values = [_rounded(search.outside, varied, 0)]
    values += [_rounded(value, varied, search.direction) for value in (search.outside, *search.further)]
    there = [varied.changed(value) for value in values]
    from_rest = measure(runner, cells_of(there), TEST)
    carried = measure(runner, cells_of(there, [state] * len(there)), TEST)
    for value, rest, onward in zip(values, from_rest, carried, strict=True):
        if gentler(now, rest) and gentler(now, onward):
            worse = max(rest, onward, key=lambda motion: motion.hardest)
            benefit, change = gentler(now, worse), varied.change(value)
            return Advice(varied.name, value, change, varied.of, benefit, worse.name, worse.hardest, now.hardest)
    return None


def _rounded(value: float, varied: Range, outwards: int) -> float:
    """Return a value whose change has two digits, rounded outwards or (0) to the nearest, inside the varied."""
    step = 10.0 ** math.floor(math.log10(abs(value - varied.value)) - 1.0)
    steps = value / step - outwards * 1e-9
    whole = round(steps) if not outwards else math.ceil(steps) if outwards > 0 else math.floor(steps)
    return min(max(float(f"{whole * step:.12g}"), varied.low), varied.high)
