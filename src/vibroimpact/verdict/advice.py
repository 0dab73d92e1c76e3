"""Ways to soften the impacts: the smallest change of one parameter with a clear benefit, from every initial condition.

A change is found with a few initial conditions and judged by many: 256 spread over the impact surface, the known orbits
of one impact there, and the present motions, changed at 128 instants of each cycle. One from which the mass would then
hit harder than what is to be softened is enough to reject it, and the next value is tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow, StroboscopicWindow
from vibroimpact.cells import Floats, cells_at
from vibroimpact.coexistence.measuring import Measured, Runner, carried, copies, orbit_cells, spread_cells
from vibroimpact.motion import MotionClass
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.system import ImpactSystem
from vibroimpact.system_cells import SystemCells
from vibroimpact.verdict.present import Coexisting, Present, Range, measure

PLACES = 36  # values along a path
HALVINGS = 8  # of the step in which the benefit begins
SOFTER = 0.8 * (1.0 + 1e-9)  # of the hardest hit: a clear benefit
SCOUTS = 6  # spread initial conditions with which a value is found
INSTANTS = 128  # of each present cycle at which the change is made
SCAN, TEST = ImpactWindow(500, 1500), ImpactWindow(1000, 2000)
TRIED = 6  # values beyond the first good one at which advice is tested
FEW = 8  # one in so many initial conditions is asked first: these reject most of what is rejected


@dataclass(frozen=True)
class Advice:
    """A change of one parameter that softens the impacts, from every initial condition that was tried.

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
        The motion there that hits hardest, in two or three words.
    max_velocity, before : float
        Its hardest hit and that of the hardest present motion, in m/s.
    tried : int
        Initial conditions from which no hit is harder than `max_velocity`; 0 where all hits are proportional to the
        parameter, and none had to be tried.
    """

    parameter: str
    value: float
    change: float
    of: str
    benefit: str
    motion: str
    max_velocity: float
    before: float
    tried: int


@dataclass(frozen=True)
class Target:
    """What is to be softened: the hardest hits of the present motions; whether any never repeats; whether these are
    chaos.
    """

    hardest: float
    irregular: bool
    chaotic: bool

    @classmethod
    def of(cls, motions: Sequence[Coexisting]) -> Target:
        """Return the target among motions that coexist."""
        worst = max(motions, key=lambda motion: motion.max_velocity)
        chaotic = worst.name == MotionClass.CHAOTIC.word
        return cls(worst.max_velocity, not all(motion.repeats for motion in motions), chaotic)

    def benefit(self, then: Iterable[Measured]) -> str:
        """Return the benefit of a change after which these are the motions, or nothing.

        Regular motions are not exchanged for chaos, nor chaos for harder hits. Rests that do not repeat are no chaos:
        rounding may decide when they come.
        """
        motions = list(then)
        hardest = max(map(hit, motions))
        if hardest == 0.0:
            return "no_impact"
        irregular = [motion for motion in motions if motion.group[0] == "aperiodic"]
        if not self.irregular and any(motion.motion_class != MotionClass.STICKING for motion in irregular):
            return ""
        if hardest <= SOFTER * self.hardest:
            return "softer"
        return "no_chaos" if self.chaotic and not irregular and hardest <= self.hardest else ""


def hit(motion: Measured) -> float:
    """Return the hardest hit of a motion, infinity where it could not be followed."""
    known = motion.hardest == 0.0 or motion.status.has_indices
    return motion.hardest if known and not math.isnan(motion.hardest) else math.inf


@dataclass
class Search:
    """A path, the benefits looked for, and the step of it in which they begin."""

    range: Range
    direction: int
    path: list[float]
    wanted: tuple[str, ...]
    inside: float = math.nan
    outside: float = math.nan
    values: list[float] = field(default_factory=list)

    def begins(self, good: Sequence[bool]) -> None:
        """Note the first value with a benefit that its next neighbour has too, and those beyond it."""
        pairs = zip(good, [*good[1:], good[-1]], strict=True)
        first = next((j for j, (here, beyond) in enumerate(pairs) if here and beyond), None)
        if first is not None:
            self.inside = self.path[first - 1] if first else self.range.value
            self.outside = self.path[first]
            self.values = self.path[first : first + TRIED]

    def candidates(self) -> list[float]:
        """Return rounded values, the smallest change first."""
        near = [_rounded(self.outside, self.range, 0)]
        return near + [_rounded(value, self.range, self.direction) for value in (self.outside, *self.values)]


@dataclass(frozen=True)
class Cycle:
    """States of a present motion through its cycle: displacements in m, velocities in m/s, driving phases."""

    displacement: Floats
    velocity: Floats
    phase: Floats

    def cells(self, design: Any, every: int = 1) -> Cells:
        """Return the states as cells of a changed design; where a stop has moved past the mass, it is there."""
        y, v, phase = (column[::every] for column in (self.displacement, self.velocity, self.phase))
        if not isinstance(design, ImpactOscillator):
            return copies(design, len(phase)).carried(y, v, phase)
        clear = y <= design.gap
        return cells_at(design, np.where(clear, design.gap - y, 0.0), np.where(clear, v, np.minimum(v, 0.0)), phase)


def _at_rest(design: Any) -> Any:
    return design if isinstance(design, SystemCells) else design.cells({})


def present_cycles(osc: Any, motions: Sequence[Coexisting], runner: Runner) -> list[Cycle]:
    """Return the states of each motion at instants spread evenly over its cycle, or over 16 periods of chaos."""
    found = []
    for motion in motions:
        periods = min(motion.n_periods or 16, INSTANTS)
        often = math.ceil(INSTANTS / periods)
        window = StroboscopicWindow(0, periods * often, None, often)
        (seen,) = runner.samples(carried(osc, motion.start), window)
        y = np.minimum(seen.look_displacement, osc.gap if isinstance(osc, ImpactOscillator) else math.inf)
        found.append(Cycle(y, seen.look_velocity, seen.look_phase))
    return found


@dataclass(frozen=True)
class Judge:
    """Which benefit changes have, from initial conditions that depend on the design."""

    target: Target
    runner: Runner
    cycles: Sequence[Cycle]

    def glance(self, designs: Sequence[Any]) -> list[str]:
        """Return the benefit of each design from rest, the present motions, and, if that holds, some spread impacts."""
        if designs and isinstance(designs[0], ImpactSystem):
            cells = SystemCells.of_systems(designs)  # of one shape; they know all that initial conditions need
            designs = [cells[at : at + 1] for at in range(len(designs))]
        return self._benefits(
            designs,
            lambda design: [_at_rest(design), *(cycle.cells(design, INSTANTS) for cycle in self.cycles)],
            lambda design: [spread_cells(design, SCOUTS)],
        )

    def _benefits(self, designs: Sequence[Any], *stages: Callable[[Any], list[Cells]]) -> list[str]:
        motions: list[list[Measured]] = [[] for _ in designs]
        benefits = [""] * len(designs)
        left = list(range(len(designs)))
        for stage in stages:
            cells = [Cells.join(stage(designs[at])) for at in left]
            found = iter(measure(self.runner, Cells.join(cells), SCAN) if cells else ())
            for at, part in zip(left, cells, strict=True):
                motions[at] += [next(found) for _ in range(len(part))]
                benefits[at] = self.target.benefit(motions[at])
            left = [at for at in left if benefits[at]]
        return benefits

    def settled(self, design: Any) -> list[Measured]:
        """Return the motions from all initial conditions, or from as few as show that there is no benefit."""
        spread, cycles = spread_cells(design), [cycle.cells(design) for cycle in self.cycles]
        many = Cells.join([design.cells({}), spread, *cycles, *orbit_cells(design)])
        number = len(many)
        mixed = np.argsort(np.arange(number) % FEW, kind="stable")
        motions: list[Measured] = []
        for some in np.split(mixed, [number // FEW, number // 4, number // 2]):
            motions += measure(self.runner, many[some], TEST)
            if not self.target.benefit(motions):
                break
        return motions


def advise(
    present: Present, motions: Sequence[Coexisting], ranges: Sequence[Range], runner: Runner
) -> tuple[Advice, ...]:
    """Return for each parameter the smallest change to gentler motions, and to none that hit; the smallest first."""
    reached = [motion for motion in motions if motion.reached]
    target = Target.of(reached)
    if not 0.0 < target.hardest < math.inf:
        return ()
    judge = Judge(target, runner, present_cycles(present.oscillator, reached, runner))
    searches = [
        Search(each, direction, path, wanted)
        for each in ranges
        for direction in (-1, 1)
        if (path := each.path(direction, PLACES)) and not each.only_scales
        for wanted in (("softer", "no_chaos", "no_impact"), ("no_impact",))
    ]
    _locate(searches, judge)
    good = [search for search in searches if search.values]
    _refine(good, judge)
    found = [_scaled(reached, each) for each in ranges if each.only_scales]
    for each in ranges:
        mine = [search for search in good if search.range is each]
        first = _smallest([search for search in mine if len(search.wanted) > 1], judge)
        if first is not None and first.benefit != "no_impact":
            found.append(_smallest([search for search in mine if len(search.wanted) == 1], judge))
        found.append(first)
    return tuple(sorted((advice for advice in found if advice is not None), key=lambda advice: abs(advice.change)))


def _locate(searches: Sequence[Search], judge: Judge) -> None:
    """Find along each path the first value with a benefit that its next neighbour has too."""
    paths = {(search.range.name, search.direction): search for search in searches}
    benefits = iter(judge.glance([search.range.at(value) for search in paths.values() for value in search.path]))
    found = {key: [next(benefits) for _ in search.path] for key, search in paths.items()}
    for search in searches:
        search.begins([benefit in search.wanted for benefit in found[search.range.name, search.direction]])


def _refine(searches: Sequence[Search], judge: Judge) -> None:
    for _ in range(HALVINGS if searches else 0):
        middles = [search.range.between(search.inside, search.outside, 0.5) for search in searches]
        there = [search.range.at(value) for search, value in zip(searches, middles, strict=True)]
        for search, middle, benefit in zip(searches, middles, judge.glance(there), strict=True):
            if benefit in search.wanted:
                search.outside = middle
            else:
                search.inside = middle


def _smallest(searches: Sequence[Search], judge: Judge) -> Advice | None:
    """Return the smallest change, rounded, whose benefit stands from all initial conditions."""
    values = {value: search for search in searches for value in search.candidates()}
    for value, search in sorted(values.items(), key=lambda pair: abs(pair[1].range.change(pair[0]))):
        varied = search.range
        motions = judge.settled(varied.at(value))
        benefit, worst = judge.target.benefit(motions), max(motions, key=hit)
        if benefit in search.wanted:
            what = varied.name, value, varied.change(value), varied.of, benefit, worst.name
            return Advice(*what, worst.hardest, judge.target.hardest, len(motions))
    return None


def _scaled(motions: Sequence[Coexisting], varied: Range) -> Advice | None:
    """Return the change of a force to which all motions are proportional; None without room."""
    worst = max(motions, key=lambda motion: motion.max_velocity)
    value = _rounded(SOFTER * varied.value, varied, -1)
    change, hardest = varied.change(value), value / varied.value * worst.max_velocity
    if hardest > SOFTER * worst.max_velocity:
        return None
    return Advice(varied.name, value, change, varied.of, "softer", worst.name, hardest, worst.max_velocity, 0)


def _rounded(value: float, varied: Range, outwards: int) -> float:
    """Return a value whose change has two digits, rounded outwards or (0) to the nearest, inside the varied.

    The change is that relative to the scale: so advice is the same in any unit.
    """
    change = varied.change(value)
    power = math.floor(math.log10(abs(change)) - 1.0)
    steps = change / 10.0**power - outwards * 1e-9
    whole = round(steps) if not outwards else math.ceil(steps) if outwards > 0 else math.floor(steps)
    return min(max(varied.value + float(f"{whole}e{power}") * varied.scale, varied.low), varied.high)
