"""What to change to calm a motion: the smallest change of one parameter with a clear benefit, computed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from vibroimpact.backends import ImpactWindow
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.verdict.present import Present
from vibroimpact.verdict.reach import Reach
from vibroimpact.verdict.readings import Laboratory, Reading

PLACES = 36  # values along a path
HALVINGS = 8  # of the step in which the benefit begins
SOFTER = 0.8 * (1.0 + 1e-9)  # of the hardest hit: a clear benefit
NO_HARDER = 1.05  # of the hardest hit: what a regular motion in place of chaos may cost
SCANNED, TESTED = ImpactWindow(500, 1500), ImpactWindow(1000, 4000)
TRIED = 6  # values beyond the first good one at which advice is tested


@dataclass(frozen=True)
class Advice:
    """A change of one parameter, and the motion that a start from rest and the present motion both settle to then.

    Parameters
    ----------
    parameter, value : str, float
        What to change, and to what.
    change : float
        The change, signed, as a part of the present value, or of `of`.
    of : str
        What it is a part of, where that is not the present value.
    benefit : str
        "no_impact", "no_chaos", or "softer" (the hardest hit at least a fifth lower).
    motion : str
        The motion then, in two or three words.
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


def gentler(now: Reading, then: Reading) -> str:
    """Return in what another motion is gentler, or nothing.

    Regular motions are not exchanged for chaos, nor chaos for harder hits.
    """
    if now.hardest == 0.0 or not (then.hardest == 0.0 or then.status.has_indices):
        return ""
    if then.hardest == 0.0:
        return "no_impact"
    wild = now.group[0] == "aperiodic"
    if then.group[0] == "aperiodic" and not wild:
        return ""
    if now.kind == "chaotic" and then.group[0] != "aperiodic" and then.hardest <= NO_HARDER * now.hardest:
        return "no_chaos"
    return "softer" if then.hardest <= SOFTER * now.hardest else ""


@dataclass
class Search:
    """A path, and the step of it in which the benefit begins."""

    reach: Reach
    direction: int
    path: list[float]
    inside: float = math.nan
    outside: float = math.nan
    further: list[float] = field(default_factory=list)


def advise(present: Present, reaches: Sequence[Reach], laboratory: Laboratory) -> tuple[Advice, ...]:
    """Return for each parameter the smallest change that calms the motion, the smallest of all first."""
    osc = present.oscillator
    (now,), (known,) = (laboratory.read([osc], [present.state], window) for window in (SCANNED, TESTED))
    if now.hardest == 0.0 or not now.status.has_indices:
        return ()
    searches = [
        Search(reach, direction, path)
        for reach in reaches
        for direction in (-1, 1)
        if (path := reach.path(direction, PLACES)) and not _in_proportion(present, reach)
    ]
    _locate(osc, now, searches, laboratory)
    good = [search for search in searches if search.further]
    _refine(osc, now, good, laboratory)
    found = [advice for search in good if (advice := _tested(present, known, search, laboratory))]
    smallest: dict[str, Advice] = {}
    for advice in sorted(found, key=lambda a: abs(a.change)):
        smallest.setdefault(advice.parameter, advice)
    return tuple(smallest.values())


def _in_proportion(present: Present, reach: Reach) -> bool:
    """Whether a smaller force only makes everything smaller, chaos included: the class never changes at g = 0."""
    return reach.name == "amplitude" and present.oscillator.gap == 0.0 and present.reading.kind == "chaotic"


def _locate(osc: ImpactOscillator, now: Reading, searches: Sequence[Search], laboratory: Laboratory) -> None:
    """Find along each path the first value with a benefit that its next neighbour has too."""
    cells = [(search, value) for search in searches for value in search.path]
    readings = iter(laboratory.read([s.reach.at(osc, value) for s, value in cells], [None] * len(cells), SCANNED))
    for search in searches:
        good = [bool(gentler(now, next(readings))) for _ in search.path]
        pairs = zip(good, good[1:] + good[-1:], strict=True)
        first = next((j for j, (here, next_) in enumerate(pairs) if here and next_), None)
        if first is not None:
            search.inside = search.path[first - 1] if first else search.reach.value
            search.outside = search.path[first]
            search.further = search.path[first : first + TRIED]


def _refine(osc: ImpactOscillator, now: Reading, searches: Sequence[Search], laboratory: Laboratory) -> None:
    for _ in range(HALVINGS if searches else 0):
        middles = [s.reach.between(s.inside, s.outside, 0.5) for s in searches]
        there = [s.reach.at(osc, value) for s, value in zip(searches, middles, strict=True)]
        readings = laboratory.read(there, [None] * len(there), SCANNED)
        for search, middle, reading in zip(searches, middles, readings, strict=True):
            if gentler(now, reading):
                search.outside = middle
            else:
                search.inside = middle


def _tested(present: Present, now: Reading, search: Search, laboratory: Laboratory) -> Advice | None:
    """Return the first rounded value that calms the mass both from rest and from its present motion."""
    reach = search.reach
    values = [_rounded(search.outside, reach, 0)]
    values += [_rounded(value, reach, search.direction) for value in (search.outside, *search.further)]
    there = [reach.at(present.oscillator, value) for value in values]
    from_rest = laboratory.read(there, [None] * len(there), TESTED)
    carried = laboratory.read(there, [present.state] * len(there), TESTED)
    for value, rest, onward in zip(values, from_rest, carried, strict=True):
        benefit = gentler(now, rest)
        if benefit and gentler(now, onward):
            worse = max(rest, onward, key=lambda reading: reading.hardest)
            benefit = gentler(now, worse)
            change, before = reach.change(value), now.hardest
            return Advice(reach.name, value, change, reach.of, benefit, worse.name, worse.hardest, before)
    return None


def _rounded(value: float, reach: Reach, outwards: int) -> float:
    """Return a value whose change has two digits, rounded outwards or (0) to the nearest, inside the reach."""
    step = 10.0 ** math.floor(math.log10(abs(value - reach.value)) - 1.0)
    steps = value / step - outwards * 1e-9
    whole = round(steps) if not outwards else math.ceil(steps) if outwards > 0 else math.floor(steps)
    return min(max(float(f"{whole * step:.12g}"), reach.low), reach.high)
