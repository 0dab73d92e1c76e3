"""Run initial conditions until it is clear what each settles to.

One is decided once its cycle is certain, or it can never hit again, or stays at rest; what has not closed a cycle is
chaotic if neighbours part by more than 2^53 within the sampled impacts, the rule of `classify`. One that is not decided
is run again, four times as long, then sixteen times. One that has stuck, without a cycle that was found, goes where
the release goes: all motions are alike from there on.

Chaos may be a long transient. It is accepted after the shortest run if 256 initial conditions spread over the impact
surface show that it lasts: each of them that is chaotic there still is so after the longest run. Otherwise every
chaotic one is run to the end. With r = 1 and c = 0 areas are kept and nothing attracts: only that it never hits is
decided. So what an initial condition leads to never depends on the others of a grid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.backends.base import Counts, Outcome
from vibroimpact.coexistence.measuring import AT_REST, IDENTIFYING, Measured, Runner, named
from vibroimpact.indices import INDICES
from vibroimpact.motion import MotionClass, decide
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.status import Status

ROUNDS = 3
LONGER = 4  # how much each round is longer than the one before


@dataclass(frozen=True)
class Settled:
    """What each initial condition of an oscillator settles to: the kind, its status, the indices of its last run."""

    osc: ImpactOscillator
    cells: Cells
    kind: NDArray[np.int8]
    status: NDArray[np.int8]
    indices: dict[str, NDArray[Any]]

    @classmethod
    def of(cls, osc: ImpactOscillator, cells: Cells) -> Settled:
        """Return what is known before anything has run: nothing."""
        number = len(cells)
        counts = {name: np.zeros(number, np.int64) for name in ("impacts", "steps")}
        indices = {name: np.zeros(number, INDICES[name].dtype) for name in IDENTIFYING}
        status = np.full(number, Status.INTERRUPTED, np.int8)
        return cls(osc, cells, np.zeros(number, np.int8), status, counts | indices)

    def __getitem__(self, at: int) -> Measured:
        indices = {name: float(column[at]) for name, column in self.indices.items()}
        return named(int(self.kind[at]), int(self.status[at]), indices, float(self.indices["impacts"][at]))

    def note(self, at: Counts, outcome: Outcome, kept: int) -> None:
        """Take down the outcome of a window of `kept` impacts."""
        for name in (*IDENTIFYING, "impacts"):
            self.indices[name][at] = outcome[name]
        self.indices["steps"][at] += outcome["steps"]
        self.kind[at] = attracting_kinds(self.osc, outcome, kept)
        self.status[at] = _plain(outcome["status"], self.kind[at])

    def follow(self, at: Counts, released: Settled) -> None:
        """Let those that have stuck go on as every mass does that is released."""
        self.kind[at], self.status[at] = released.kind[0], released.status[0]
        for name in IDENTIFYING:
            self.indices[name][at] = released.indices[name][0]
        self.indices["impacts"][at] += released.indices["impacts"][0]


def attracts(osc: ImpactOscillator) -> bool:
    """Return whether impacts or damping shrink areas, without which nothing is attracted."""
    return osc.damping > 0.0 or osc.restitution < 1.0


def rounds(osc: ImpactOscillator, transient: int, keep: int) -> list[ImpactWindow]:
    """Return the windows of one round after the other; a single one where longer rounds would decide nothing."""
    return [ImpactWindow(transient * LONGER**i, keep * LONGER**i) for i in range(ROUNDS if attracts(osc) else 1)]


def settle(
    runner: Runner,
    osc: ImpactOscillator,
    cells: Cells,
    windows: Sequence[ImpactWindow],
    chaos_lasts: Callable[[], bool] = lambda: False,
    report: Callable[[Settled, int], None] = lambda settled, undecided: None,
) -> Settled:
    """Run cells in ever longer windows until each is decided; `report` gets the number undecided after each batch."""
    settled = Settled.of(osc, cells)
    kind, status = settled.kind, settled.status
    released = cache(lambda: _released(runner, osc, windows))
    left = np.arange(len(cells))
    for window in windows:
        kind[left], status[left] = MotionClass.UNDECIDED, Status.INTERRUPTED
        undecided = len(left)
        for which, outcome in runner.run(cells[left], window):
            settled.note(left[which], outcome, window.keep)
            undecided -= int(np.count_nonzero(kind[left[which]]))
            report(settled, undecided)
        stuck = left[(kind[left] == MotionClass.UNDECIDED) & (status[left] == Status.STICKING)]
        if stuck.size and not runner.stop.is_set():
            settled.follow(stuck, released())
        again = (kind == MotionClass.UNDECIDED) & (status != Status.BUDGET) & (status != Status.INTERRUPTED)
        chaotic = kind == MotionClass.CHAOTIC
        if window is not windows[-1] and chaotic[left].any() and not chaos_lasts():
            again |= chaotic
        left = np.flatnonzero(again)
        if left.size == 0 or runner.stop.is_set():
            break
    return settled


def _released(runner: Runner, osc: ImpactOscillator, windows: Sequence[ImpactWindow]) -> Settled:
    """Return what a mass settles to that waits at the stop for its release."""
    settled = Settled.of(osc, AT_REST.cell(osc))
    for window in windows:
        for which, outcome in runner.run(settled.cells, window):
            settled.note(np.arange(1)[which], outcome, window.keep)
        if settled.kind[0] not in (MotionClass.UNDECIDED, MotionClass.CHAOTIC):
            break
    return settled


def lasts(runner: Runner, osc: ImpactOscillator, cells: Cells, windows: Sequence[ImpactWindow]) -> bool:
    """Return whether cells that are chaotic in the first window are so in the last one too, all of them."""
    early = settle(runner, osc, cells, windows[:1]).kind == MotionClass.CHAOTIC
    late = settle(runner, osc, cells[early], windows[-1:]).kind == MotionClass.CHAOTIC
    return bool(early.any()) and bool(late.all())


def attracting_kinds(osc: ImpactOscillator, outcome: Outcome, kept: int) -> NDArray[np.int8]:
    """Return the kind of motion that each cell settles to, from the outcome of a window of `kept` impacts.

    To the rule of `classify` comes what the oscillator decides: without loss nothing attracts, and without force a
    mass comes to rest, unless it swings on, undamped, just clear of the stop.
    """
    growth = outcome["lyapunov_per_impact"] * kept
    kinds = decide(outcome["status"], growth, outcome["n_periods"], outcome["n_impacts"])
    driven, damped = osc.amplitude > 0.0, osc.damping > 0.0
    settles_to = np.arange(len(MotionClass), dtype=np.int8)
    settles_to[[MotionClass.BUDGET, MotionClass.INTERRUPTED]] = MotionClass.UNDECIDED
    settles_to[MotionClass.DECAYING] = MotionClass.AT_REST if damped or osc.gap <= 0.0 else MotionClass.NO_IMPACT
    if not driven:
        settles_to[MotionClass.STUCK_FOREVER] = MotionClass.AT_REST
        settles_to[MotionClass.NO_IMPACT] = MotionClass.AT_REST if damped else MotionClass.NO_IMPACT
    if not attracts(osc):
        settles_to[[MotionClass.PERIODIC, MotionClass.CHAOTIC]] = MotionClass.UNDECIDED
    found: NDArray[np.int8] = settles_to[kinds]
    return found


def _plain(status: NDArray[np.int8], kind: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return the status of decided cells without what it says of the window, on which the kind does not depend."""
    cases = [kind == MotionClass.PERIODIC, kind == MotionClass.STICKING, kind == MotionClass.CHAOTIC]
    return np.select(cases, [Status.CLOSED, Status.STICKING, Status.OK], status).astype(np.int8)
