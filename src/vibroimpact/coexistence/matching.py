"""From what became of each start to the attractors: starts with the same cycle belong together.

Starts are first sorted by what does not depend on where their sample began: the name, the energy lost a period, the
exponent and the closest near-miss of a cycle, or the mean velocity and the impacts a period of chaos. Wherever the
sorted values leave a gap, a new group begins. One start of each group is then walked onto its attractor, and groups
whose whole cycles agree within 1e-6 V, or whose chaos fills the same part of the impact surface, become one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.backends.base import Counts, Floats
from vibroimpact.coexistence.attractor import Attractor
from vibroimpact.coexistence.settling import Fate, Runner, Settled
from vibroimpact.coexistence.walking import (
    Walk,
    described,
    quiet,
    same_chaos,
    same_cycle,
    settled_walk,
    sticking,
)

# Gaps that part groups, beyond what the way to go (1e-10 V) leaves in a cycle, and chance in a short chaotic sample.
ENERGY_GAP = 1e-7  # of m V^2, of a cycle's loss a period
EXPONENT_GAP = 1e-5  # a period; the logarithm of two equal multipliers is good to 1e-5
MISS_GAP = 1e-6  # of V/w_n
MEAN_GAP, RATE_GAP = 0.02, 0.02  # of V; impacts a period


@dataclass(frozen=True)
class Basin:
    """An attractor and the starts that lead to it."""

    attractor: Attractor
    members: Counts


def match(runner: Runner, cells: Cells, settled: Settled, longest: ImpactWindow) -> list[Basin]:
    """Return the attractors, the one with most starts first."""
    found = [*_cycles(runner, cells, settled, longest), *_chaos(runner, cells, settled, longest)]
    for fate in (Fate.STICKING, Fate.NO_IMPACT, Fate.STUCK_FOREVER, Fate.AT_REST):
        members = np.flatnonzero(settled.fate == fate)
        if members.size:
            at = int(members[0])
            is_sticking = fate == Fate.STICKING
            attractor = (
                sticking(runner, settled, at) if is_sticking else quiet(runner.osc, fate, int(settled.status[at]))
            )
            found.append(Basin(attractor, members))
    found.sort(key=lambda basin: (-len(basin.members), basin.attractor.name, -basin.attractor.max_velocity))
    return [replace(b, attractor=replace(b.attractor, share=len(b.members) / len(cells))) for b in found]


def _cycles(runner: Runner, cells: Cells, settled: Settled, longest: ImpactWindow) -> Iterator[Basin]:
    osc, told = runner.osc, settled.told
    scale = osc.velocity_scale
    periodic = np.flatnonzero(settled.fate == Fate.PERIODIC)
    if periodic.size == 0:
        return
    names, which = np.unique(
        np.column_stack([told["n_periods"][periodic], told["n_impacts"][periodic]]), axis=0, return_inverse=True
    )
    for number in range(len(names)):
        members = periodic[which.ravel() == number]
        columns = [
            (told["dissipation"][members], ENERGY_GAP * osc.mass * scale**2),
            (told["lyapunov"][members] * osc.period * names[number, 0], EXPONENT_GAP),
            (np.nan_to_num(told["grazing_margin"][members], posinf=-scale), MISS_GAP * scale / osc.natural_frequency),
        ]
        groups = [members[part] for part in apart(columns)]
        yield from _joined(runner, cells, settled, groups, longest)


def _chaos(runner: Runner, cells: Cells, settled: Settled, longest: ImpactWindow) -> Iterator[Basin]:
    members = np.flatnonzero(settled.fate == Fate.CHAOTIC)
    if members.size == 0:
        return
    columns = [
        (settled.told["mean_velocity"][members], MEAN_GAP * runner.osc.velocity_scale),
        (settled.told["impacts_per_period"][members], RATE_GAP),
    ]
    yield from _joined(runner, cells, settled, [members[part] for part in apart(columns)], longest)


def apart(columns: Sequence[tuple[Floats, float]]) -> list[Counts]:
    """Return groups of rows, parted wherever the sorted values of a column leave a gap wider than that column's.

    Examples
    --------
    >>> [group.tolist() for group in apart([(np.array([1.0, 5.0, 1.01, 1.02]), 0.1)])]
    [[0, 2, 3], [1]]
    """
    label = np.zeros(len(columns[0][0]), dtype=np.int64)
    for values, gap in columns:
        order = np.lexsort((values, label))
        steps = (np.diff(values[order]) > gap) | (np.diff(label[order]) > 0)
        label[order] = np.concatenate([[0], np.cumsum(steps)])
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _joined(
    runner: Runner, cells: Cells, settled: Settled, groups: Sequence[Counts], longest: ImpactWindow
) -> Iterator[Basin]:
    """Walk one start of each group, join the groups that it shows to be one, and describe them."""
    known: list[tuple[int, Walk, list[Counts]]] = []
    for group in groups:
        at = int(group[settled.told["impacts"][group].argmin()])  # the one that settled first
        chaotic = settled.fate[at] == Fate.CHAOTIC
        seen = settled_walk(runner, cells, settled, at, longest)
        for _, other, members in known:
            one = same_chaos(seen, other) if chaotic else same_cycle(seen, other, runner.osc.velocity_scale)
            if one:
                members.append(group)
                break
        else:
            known.append((at, seen, [group]))
    for at, seen, joined in known:
        together = np.sort(np.concatenate(joined))
        yield Basin(described(runner, settled, at, together, seen), together)
