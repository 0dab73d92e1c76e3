"""The final motion from one initial condition: a motion that does not repeat is followed for 1e5 impacts.

A motion that is chaotic over the 5000 impacts of a map may be a transient, and a motion without a cycle by then may
still settle to one: both are continued.

A rest at the stop erases the memory of one mass. But if perturbations grow by more than 1e13 before the next rest
(`recognition.UNRESOLVED`), rounding determines the cycle from release to release. The final motion is then found from
releases perturbed by up to 1e-11 V: motions that rest again are released again, and the motion to which most of the
others lead is taken. It is intermittent sticking only if all of them rest again, time after time, for 1e5 impacts.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.coexistence.measuring import Measured, Runner, last_of
from vibroimpact.indices import INDICES
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.motion import MotionClass
from vibroimpact.status import Status

WATCHED = 100_000  # impacts over which a motion is watched that does not repeat
LATE = ImpactWindow(WATCHED // 2, WATCHED // 2)
RELEASES = 32  # moved releases that are followed at a time
MOVED = 1e-11  # of V: the most that a release is moved
TURNS = 4  # computed of a motion that rests again: its own, and that of the exact release until that is closed


@dataclass(frozen=True)
class Final:
    """The final motion from an initial condition, as far as it was followed.

    Parameters
    ----------
    measured : Measured
        The final motion with every index; for a cycle, the indices are those of the cycle alone.
    samples : Samples
        The samples of it in the requested window.
    watched : int
        Impacts after which the motion was certain, or over which it was followed without becoming regular.
    before : Measured or None
        The motion named by the first 5100 impacts, if that is another one.
    ends : dict
        For rests determined by rounding: how many perturbed releases lead to the motion of each name.
    """

    measured: Measured
    samples: Any  # None of a system
    watched: int
    before: Measured | None = None
    ends: dict[str, int] = field(default_factory=dict)


def final_motion(runner: Runner, osc: ImpactOscillator, sample_window: ImpactWindow) -> Final:
    """Follow one mass from rest to its final motion, for up to 1e5 impacts if it does not repeat before.

    A motion that is certain within the paper's 5100 impacts is computed only once.
    """
    cell = osc.cells({})
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
        final = _released(runner, osc, sample_window, final)
    return final if final.measured.name == first.name else replace(final, before=first)


def irregular(measured: Measured) -> bool:
    """Return whether a motion with impacts was followed to the end without a period being found."""
    open_ended = (MotionClass.CHAOTIC, MotionClass.UNDECIDED)
    return measured.motion_class in open_ended or (
        measured.motion_class == MotionClass.STICKING and not measured.n_periods
    )


def rests(measured: Measured) -> bool:
    """Return whether a motion came to rest at the stop within its window."""
    return measured.status == Status.STICKING


def release_phase(osc: ImpactOscillator) -> float:
    """Return the phase at which the force releases a resting mass."""
    return 0.5 - math.asin(osc.stiffness * osc.gap / osc.amplitude) / (2.0 * math.pi)


def released(osc: ImpactOscillator, number: int = 0) -> Cells:
    """Return `RELEASES` releases of the mass, perturbed by up to 1e-11 V, differently for each `number`."""
    share = (np.arange(RELEASES) + 1.0 / (number + 1.0)) / RELEASES
    speed = -MOVED * osc.velocity_scale * share
    cells = osc.cells({}).copies(RELEASES)
    return cells.replace(clearance=0.0, velocity=speed, periods=0.0, phase=release_phase(osc))


@dataclass(frozen=True)
class Fate:
    """The final motion of a mass whose next rest is determined by rounding.

    `cell` is the perturbed release and `end` the motion that it leads to, `ends` the number of releases that led to
    each name, and `watched` the total number of impacts. On average it takes `lasts` impacts, of up to `passing` m/s,
    until a release leads to something other than a rest.
    """

    cell: Cells
    end: Measured
    ends: dict[str, int]
    watched: int
    lasts: int
    passing: float


def fate_of_release(runner: Runner, osc: ImpactOscillator) -> Fate:
    """Return the final motion of most perturbed releases that do not lead to the next rest, or that rest if all do.

    Each interval between rests is an independent trial, so many releases give the same statistics as one long motion.
    """
    if osc not in runner.fates:
        runner.fates[osc] = _fate(runner, osc)
    fate: Fate = runner.fates[osc]
    return fate


def _fate(runner: Runner, osc: ImpactOscillator) -> Fate:
    """Follow perturbed releases until some do not lead to the next rest, or all were followed for long enough."""
    names: Counter[str] = Counter()
    impacts, tried, passing = 0, 0, 0.0
    while True:
        cells = Cells.join([released(osc, number) for number in range(tried, 2 * tried + 1)])
        ends = runner.measure(cells, LATE, runner.thrifty, tuple(INDICES))
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


def _watched(runner: Runner, cell: Cells, sample_window: ImpactWindow) -> Final:
    """Return the motion of a cell over 1e5 impacts; if it is on a cycle by then, with that cycle's indices."""
    last = ImpactWindow(WATCHED - sample_window.keep, sample_window.keep)
    measured, samples = runner.record(cell, last, LATE, runner.thrifty)
    watched, end = measured.impacts, last_of(samples)
    if measured.motion_class.hits and measured.n_periods and end is not None:
        measured, samples = runner.record(cell.replace(**end._asdict()), sample_window)
    return Final(measured, samples, watched)


def _released(runner: Runner, osc: ImpactOscillator, sample_window: ImpactWindow, resting: Final) -> Final:
    """Return the attractor of a motion whose next rest is determined by rounding."""
    fate = fate_of_release(runner, osc)
    if irregular(fate.end) and rests(fate.end):
        measured = resting.measured if resting.measured.name == fate.end.name else fate.end
        return replace(resting, measured=measured, watched=fate.watched, ends=fate.ends)
    final = _watched(runner, fate.cell, sample_window)
    return replace(final, watched=resting.watched + final.watched, ends=fate.ends)
