"""The final motion of one initial condition: a motion that does not repeat is watched over 1e5 impacts.

What looks chaotic over the 5000 impacts of a map may be a transient, and what has not closed a cycle by then may be on
its way to one: both are run on.

A mass that rests at the stop forgets what was before, but where neighbours part by more than 1e13 until it rests again
(`motion.UNRESOLVED`), the cycle from release to release is an accident of rounding. What such a mass does in the end is
found from releases that are moved by up to 1e-11 V: those that rest again are released again, and most of the others
decide. Only where all rest again, turn after turn, for 1e5 impacts, is it intermittent sticking.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.coexistence.measuring import Measured, Runner, last_of
from vibroimpact.indices import INDICES
from vibroimpact.motion import MotionClass
from vibroimpact.options import Tolerances
from vibroimpact.status import Status

WATCHED = 100_000  # impacts over which a motion is watched that does not repeat
LATE = ImpactWindow(WATCHED // 2, WATCHED // 2)
RELEASES = 32  # moved releases that are followed at a time
MOVED = 1e-11  # of V: the most that a release is moved
TURNS = 4  # computed of a motion that rests again: its own, and that of the exact release until that is closed
THRIFT = 100  # certified steps per impact: rare hits are not worth a long wait


@dataclass(frozen=True)
class Final:
    """What an initial condition settles to, as far as it was watched.

    Parameters
    ----------
    measured : Measured
        The final motion with every index: of a cycle those of the cycle alone.
    samples : Samples
        Those that the wanted window takes of it.
    watched : int
        Impacts after which it was certain, or over which it was watched in vain for an end of its irregularity.
    before : Measured or None
        The transient as the first 5100 impacts name it, where that is another name.
    ends : dict
        Of an irregular rest how many moved releases lead to the motion of each name.
    """

    measured: Measured
    samples: Any  # Samples; None of a system
    watched: int
    before: Measured | None = None
    ends: dict[str, int] = field(default_factory=dict)


def final_motion(runner: Runner, cell: Cells, sample_window: ImpactWindow) -> Final:
    """Follow one cell to its final motion, for up to 1e5 impacts where it does not repeat before.

    What is certain within the paper's 5100 impacts is computed once.
    """
    first, samples = runner.record(cell, sample_window)
    if first.motion_class.hits and first.n_periods and first.impacts > sample_window.transient:  # sampled too early
        (samples,) = runner.samples(cell, replace(sample_window, transient=first.impacts))
    final = Final(first, samples, first.impacts)
    if irregular(first) and not rests(first):
        final = _watched(runner, cell, sample_window)
        if final.measured.name == first.name or final.measured.status == Status.BUDGET:
            # The indices stay those of a map.
            final = Final(first, samples, final.watched)
    if irregular(final.measured) and rests(final.measured):
        final = _released(runner, cell, sample_window, final)
    return final if final.measured.name == first.name else replace(final, before=first)


def irregular(measured: Measured) -> bool:
    """Return whether a motion has no period that was found, although it hits, and was followed to the end."""
    open_ended = (MotionClass.CHAOTIC, MotionClass.UNDECIDED)
    return measured.motion_class in open_ended or (
        measured.motion_class == MotionClass.STICKING and not measured.n_periods
    )


def rests(measured: Measured) -> bool:
    """Return whether a motion came to rest at the stop within its window."""
    return measured.status == Status.STICKING


def release_phase(design: Mapping[str, float]) -> float:
    """Return the phase at which the force releases a resting mass."""
    return 0.5 - math.asin(design["stiffness"] * design["gap"] / design["amplitude"]) / (2.0 * math.pi)


def released(cell: Cells, number: int = 0) -> Cells:
    """Return so many releases of the mass, moved by up to 1e-11 V; others for each `number`."""
    (design,) = cell
    preload = abs(design["stiffness"] * design["gap"])
    scale = max(design["amplitude"], preload) / math.sqrt(design["stiffness"] * design["mass"])
    share = (np.arange(RELEASES) + 1.0 / (number + 1.0)) / RELEASES
    many = Cells(np.repeat(cell.table, RELEASES, axis=0), cell.columns)
    return many.replace(clearance=0.0, velocity=-MOVED * scale * share, periods=0.0, phase=release_phase(design))


@dataclass(frozen=True)
class Fate:
    """What becomes of a mass whose next rest is an accident of rounding.

    `cell` is the moved release and `end` the motion that it leads to, `ends` how many releases led to each name, and
    `watched` the impacts of all turns. Until a release leads elsewhere than to a rest, it takes `lasts` impacts on
    average, of up to `passing` m/s.
    """

    cell: Cells
    end: Measured
    ends: dict[str, int]
    watched: int
    lasts: int
    passing: float


def fate_of_release(runner: Runner, cell: Cells) -> Fate:
    """Return the fate of most moved releases that do not lead to the next rest, or that all lead to it.

    As each turn between rests is one more throw of the same dice, turns from many releases are as good as one motion.
    """
    design = released(cell).table.tobytes()
    if design not in runner.fates:
        runner.fates[design] = _fate(runner, cell)
    fate: Fate = runner.fates[design]
    return fate


def _fate(runner: Runner, cell: Cells) -> Fate:
    """Follow moved releases until some lead elsewhere than to the next rest, or all were watched for long enough."""
    names: Counter[str] = Counter()
    impacts, tried, passing = 0, 0, 0.0
    while True:
        cells = Cells.join([released(cell, number) for number in range(tried, 2 * tried + 1)])
        ends = runner.measure(cells, LATE, thrifty(runner), tuple(INDICES))
        names.update(end.name for end in ends)
        impacts += sum(end.impacts for end in ends)
        tried = 2 * tried + 1  # twice as many releases each time
        resting = [irregular(end) and rests(end) for end in ends]
        passing = max(passing, *(end.hardest for end, rest in zip(ends, resting, strict=True) if rest), 0.0)
        elsewhere = [end for end, rest in zip(ends, resting, strict=True) if not rest and end.status != Status.BUDGET]
        if elsewhere or impacts >= TURNS * WATCHED or not any(resting) or runner.stop.is_set():
            break
    name, _ = Counter(end.name for end in elsewhere or ends).most_common(1)[0]
    at = next(at for at, end in enumerate(ends) if end.name == name)
    end = ends[at]
    if not elsewhere and rests(end):  # also where the turn from the exact release was given up as too long
        indices = end.indices | {"n_periods": 0.0, "n_impacts": -1.0}
        end = replace(end, kind=MotionClass.STICKING.word, n_periods=0, n_impacts=-1, indices=indices)
    watched = impacts // TURNS
    return Fate(cells[at : at + 1], end, dict(names), watched, watched // max(len(elsewhere), 1), passing)


def thrifty(runner: Runner) -> Tolerances:
    """Return the tolerances with which a motion is watched."""
    return replace(runner.tolerances, steps_per_impact=min(runner.tolerances.steps_per_impact, THRIFT))


def _watched(runner: Runner, cell: Cells, sample_window: ImpactWindow) -> Final:
    """Return the motion of a cell over 1e5 impacts, and a cycle that it is on by then, with that cycle's indices."""
    last = ImpactWindow(WATCHED - sample_window.keep, sample_window.keep)
    measured, samples = runner.record(cell, last, LATE, thrifty(runner))
    watched, end = measured.impacts, last_of(samples)
    if measured.motion_class.hits and measured.n_periods and end is not None:
        measured, samples = runner.record(cell.replace(**end._asdict()), sample_window)
    return Final(measured, samples, watched)


def _released(runner: Runner, cell: Cells, sample_window: ImpactWindow, resting: Final) -> Final:
    """Return the attractor of a motion whose next rest is an accident of rounding."""
    fate = fate_of_release(runner, cell)
    if irregular(fate.end) and rests(fate.end):
        measured = resting.measured if resting.measured.name == fate.end.name else fate.end
        return replace(resting, measured=measured, watched=fate.watched, ends=fate.ends)
    final = _watched(runner, fate.cell, sample_window)
    return replace(final, watched=resting.watched + final.watched, ends=fate.ends)
