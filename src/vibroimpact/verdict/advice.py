"""Ways to soften the impacts: the smallest change of one parameter with a clear benefit from every initial condition.

A change is found with a few initial conditions and tested with many: 256 spread over the impact surface, the known
orbits of one impact at the new value, the present motions, changed at 128 instants of each cycle, and their orbits,
continued along the parameter to the value. A change is rejected, and the next value tried, if the mass hits harder than
the motions to be softened from even one of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow, StroboscopicWindow
from vibroimpact.cells import Floats
from vibroimpact.coexistence.final import LATE, irregular, rests
from vibroimpact.coexistence.measuring import EQUAL, Measured, Runner, carried, orbit_cells, spread_cells
from vibroimpact.motion import MotionClass
from vibroimpact.orbits.search import search_of
from vibroimpact.verdict.branches import Branches, present_orbits
from vibroimpact.verdict.present import Coexisting, Present
from vibroimpact.verdict.ranges import ANY, CANDIDATES, ENDS, PLACES, Bracket, Line, Range, rounded

FINER, HALVINGS = 2, 6  # times that steps near the present value are halved; of the step in which the benefit begins
NEARER = PLACES // 3  # of these are looked at first
SOFTER = 0.8 * (1.0 + EQUAL)  # of the hardest hit: a clear benefit
SCOUTS = 6  # spread initial conditions with which a value is found
INSTANTS = 128  # of each present cycle at which the change is made
SCAN, TEST = ImpactWindow(500, 1500), ImpactWindow(1000, 2000)
FEW = 8  # one in so many initial conditions is tried first: these reject most of what is rejected


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
        What the change is relative to, if not the present value.
    benefit : str
        "no_impact", "no_chaos", or "softer" (the hardest hit at least a fifth lower).
    motion : str
        The motion that hits hardest at the new value, in two or three words.
    max_velocity, before : float
        The hardest hit of that motion from the 1,000th impact on (more than once it has settled, if it settles later),
        and of all present motions, in m/s.
    tried : int
        Number of initial conditions tried, none of which leads to a hit harder than `max_velocity`; 0 if no trial was
        needed because all hits are proportional to the parameter.
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
    """The motions to be softened: the hardest hit, whether any never repeats, and whether the hardest is chaotic."""

    hardest: float
    irregular: bool
    chaotic: bool

    @classmethod
    def of(cls, motions: Sequence[Coexisting]) -> Target:
        """Return the target for given coexisting motions."""
        worst = max(motions, key=lambda motion: motion.max_velocity)
        return cls(worst.max_velocity, not all(motion.repeats for motion in motions), worst.chaotic)

    def benefit(self, motions: Sequence[Measured], *, watched: bool = True) -> str:
        """Return the benefit of a change to these motions; empty if there is none.

        Replacing regular motions by chaos is no benefit, nor is replacing chaos by harder hits. Rests that do not
        repeat do not count as chaos, because rounding may decide when they occur, nor do undecided motions that have
        not been `watched` for long: they may settle slowly.
        """
        hardest = max(map(hit, motions))
        if hardest == 0.0:
            return "no_impact"
        irregular = [motion for motion in motions if motion.group[0] == "aperiodic"]
        if not watched:
            irregular = [motion for motion in irregular if motion.motion_class != MotionClass.UNDECIDED]
        if not self.irregular and any(motion.motion_class != MotionClass.STICKING for motion in irregular):
            return ""
        if hardest <= SOFTER * self.hardest:
            return "softer"
        return "no_chaos" if self.chaotic and not irregular and hardest <= self.hardest else ""


def hit(motion: Measured) -> float:
    """Return the hardest hit of a motion; infinity if it could not be followed."""
    followed = motion.hardest == 0.0 or motion.status.has_indices
    return motion.hardest if followed and not math.isnan(motion.hardest) else math.inf


States = tuple[Floats, Floats, Floats]  # displacements in m, velocities in m/s and driving phases


def on_cycle(cell: Cells, states: States, every: int = 1) -> Cells:
    """Return states of a present motion as cells of a single changed design."""
    y, v, phase = (column[::every] for column in states)
    return cell.copies(len(phase)).carried(y, v, phase)


def present_cycles(osc: Any, motions: Sequence[Coexisting], runner: Runner) -> list[States]:
    """Return the states of each motion at instants spread evenly over its cycle, or over 16 periods of chaos."""
    cycles = []
    for motion in motions:
        periods = min(motion.n_periods or 16, INSTANTS)
        per_period = math.ceil(INSTANTS / periods)
        window = StroboscopicWindow(0, periods * per_period, None, per_period)
        (samples,) = runner.samples(carried(osc, motion.start), window)
        cycles.append((samples.look_displacement, samples.look_velocity, samples.look_phase))
    return cycles


@dataclass(frozen=True)
class Trials:
    """The benefits of changes, from initial conditions that depend on the design."""

    target: Target
    runner: Runner
    cycles: Sequence[States]
    orbits: Sequence[Any]
    branches: Branches

    def scan(self, designs: Sequence[Any], wanted: Sequence[tuple[str, ...]]) -> list[str]:
        """Return the benefit of each design, if wanted, from rest, the present motions, and then spread impacts."""
        if not designs:
            return []
        at_rest: Any = designs[0].cells_of(designs)
        motions: list[list[Measured]] = [[] for _ in designs]
        benefits = [""] * len(designs)
        remaining = list(range(len(designs)))
        for initial in (self._at_rest_and_present, partial(spread_cells, number=SCOUTS)):
            cells = [initial(at_rest[at : at + 1]) for at in remaining]
            measured = iter(self.runner.glance(Cells.join(cells), SCAN) if cells else ())
            for at, part in zip(remaining, cells, strict=True):
                motions[at] += [next(measured) for _ in range(len(part))]
                benefit = self.target.benefit(motions[at], watched=False)
                benefits[at] = benefit if benefit in wanted[at] else ""
            remaining = [at for at in remaining if benefits[at]]
        return benefits

    def _at_rest_and_present(self, cell: Cells) -> Cells:
        return Cells.join([cell, *(on_cycle(cell, states, INSTANTS) for states in self.cycles)])

    def test(self, varied: Range, value: float) -> list[Measured]:
        """Return the motions from all initial conditions, or from as few as show that there is no benefit."""
        motions: list[Measured] = []
        tried: list[Cells] = []
        for cells in self._initial_conditions(varied, value):
            tried.append(cells)
            motions += self.runner.glance(cells, TEST)
            if not self.target.benefit(motions, watched=False):
                return motions
        return self._without_transients(Cells.join(tried), motions)

    def _without_transients(self, cells: Cells, motions: list[Measured]) -> list[Measured]:
        """Return motions; if the hardest that never repeats is a transient, those are replaced by their final ones."""
        open_ended = [at for at, motion in enumerate(motions) if irregular(motion) and not rests(motion)]
        if not open_ended:
            return motions
        hardest = max(open_ended, key=lambda at: hit(motions[at]))
        (late,) = self.runner.glance(cells[hardest : hardest + 1], LATE)
        if not irregular(late):
            for at, motion in zip(open_ended, self.runner.glance(cells[np.array(open_ended)], LATE), strict=True):
                motions[at] = motion
        return motions

    def _initial_conditions(self, varied: Range, value: float) -> Iterator[Cells]:
        """Yield initial conditions, a few of each kind first; those on orbits take longer to find.

        A slow change leads along the branches of the present orbits.
        """
        design = varied.at(value)
        cell = design.cells({})
        cells = Cells.join([cell, spread_cells(cell), *(on_cycle(cell, states) for states in self.cycles)])
        number = len(cells)
        mixed = np.argsort(np.arange(number) % FEW, kind="stable")
        first, *others = np.split(mixed, [number // FEW, number // 4, number // 2])
        yield cells[first]
        if on_branches := [carried(design, orbit.start) for orbit in self.branches.at(self.orbits, varied, value)]:
            yield Cells.join(on_branches)
        if of_one_impact := orbit_cells(search_of(design)):
            yield Cells.join(of_one_impact)
        yield from (cells[part] for part in others)


def advise(
    present: Present, motions: Sequence[Coexisting], ranges: Sequence[Range], runner: Runner, branches: Branches
) -> tuple[Advice, ...]:
    """Return the smallest change of each parameter to gentler motions, and to no impacts; the smallest first."""
    reached = [motion for motion in motions if motion.reached]
    target = Target.of(reached)
    if not 0.0 < target.hardest < math.inf:
        return ()
    cycles, orbits = present_cycles(present.oscillator, reached, runner), present_orbits(present, reached)
    trials = Trials(target, runner, cycles, orbits, branches)
    searched = [varied for varied in ranges if not varied.only_scales]
    lines = [Line(varied, path) for varied in searched for way in (-1, 1) if (path := varied.path(way, PLACES))]
    _look_along(lines, trials)
    brackets = [bracket for line in lines for wanted in (ANY, ENDS) if (bracket := line.bracket(wanted))]
    _refine(brackets, trials)
    advice = [_scaled(reached, varied) for varied in ranges if varied.only_scales]
    for varied in searched:
        of_any, of_ends = (
            [bracket for bracket in brackets if bracket.range is varied and bracket.wanted == wanted]
            for wanted in (ANY, ENDS)
        )
        smallest = _smallest(of_any, trials)
        if smallest is not None and smallest.benefit != "no_impact":
            advice.append(_smallest(of_ends, trials))
        advice.append(smallest)
    return tuple(sorted((change for change in advice if change is not None), key=lambda change: abs(change.change)))


def _look_along(lines: Sequence[Line], trials: Trials) -> None:
    """Find the benefits along each line, and between its values where changes are smaller than any with a benefit.

    Windows with a benefit may be narrower than the steps; near the present value they matter most. Beyond several
    values with a benefit, only the end of impacts matters.
    """
    any_benefit = [ANY for _ in lines]
    _look(lines, [line.path[:NEARER] for line in lines], any_benefit, trials)
    wanted = [ENDS if _enough(line, lines) else ANY for line in lines]
    _look(lines, [line.path[NEARER:] for line in lines], wanted, trials)
    for _ in range(FINER):
        midpoints = [line.midpoints(_first_change(line.range, lines))[: PLACES // 4] for line in lines]
        _look(lines, midpoints, any_benefit, trials)


def _look(
    lines: Sequence[Line], added: Sequence[Sequence[float]], wanted: Sequence[tuple[str, ...]], trials: Trials
) -> None:
    """Add values to each line, with their benefits if these are wanted for the line."""
    designs = [line.range.at(value) for line, values in zip(lines, added, strict=True) for value in values]
    of_designs = [of_line for of_line, values in zip(wanted, added, strict=True) for _ in values]
    benefits = iter(trials.scan(designs, of_designs))
    for line, values in zip(lines, added, strict=True):
        line.add(values, [next(benefits) for _ in values])


def _enough(line: Line, lines: Sequence[Line]) -> bool:
    """Whether as many values of a line's parameter have a benefit as will be tried."""
    number = sum(sum(map(bool, other.benefits)) for other in lines if other.range is line.range)
    return number >= CANDIDATES and _first_change(line.range, lines) < math.inf


def _first_change(varied: Range, lines: Sequence[Line]) -> float:
    """Return the smallest change of a parameter at which benefits begin on one of its lines."""
    both = [line for line in lines if line.range is varied]
    first_values = [line.values[first] for line in both if (first := line.first(ANY)) is not None]
    return min((abs(varied.change(value)) for value in first_values), default=math.inf)


def _refine(brackets: Sequence[Bracket], trials: Trials) -> None:
    for _ in range(HALVINGS):
        middles = [bracket.range.between(bracket.inside, bracket.outside, 0.5) for bracket in brackets]
        designs = [bracket.range.at(value) for bracket, value in zip(brackets, middles, strict=True)]
        benefits = trials.scan(designs, [bracket.wanted for bracket in brackets])
        for bracket, middle, benefit in zip(brackets, middles, benefits, strict=True):
            if benefit:
                bracket.outside = middle
            else:
                bracket.inside = middle


def _smallest(brackets: Sequence[Bracket], trials: Trials) -> Advice | None:
    """Return the smallest change, rounded, that has its benefit from all initial conditions."""
    values = {value: bracket for bracket in brackets for value in bracket.candidates()}
    for value, bracket in sorted(values.items(), key=lambda pair: abs(pair[1].range.change(pair[0]))):
        varied = bracket.range
        motions = trials.test(varied, value)
        benefit, worst = trials.target.benefit(motions), max(motions, key=hit)
        if benefit in bracket.wanted:
            hardest, before = worst.hardest, trials.target.hardest
            change = varied.change(value)
            return Advice(
                varied.name, value, change, varied.of, benefit, worst.name, hardest, before, tried=len(motions)
            )
    return None


def _scaled(motions: Sequence[Coexisting], varied: Range) -> Advice | None:
    """Return the change of a force to which all motions are proportional; None if there is no range."""
    worst = max(motions, key=lambda motion: motion.max_velocity)
    value = rounded(SOFTER * varied.value, varied, -1)
    change, hardest = varied.change(value), value / varied.value * worst.max_velocity
    if hardest > SOFTER * worst.max_velocity:
        return None
    return Advice(varied.name, value, change, varied.of, "softer", worst.name, hardest, worst.max_velocity, tried=0)
