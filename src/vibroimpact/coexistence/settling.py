"""Run starts until it is clear what becomes of each.

A start is decided once its cycle is certain, or it can never hit again, or stays at rest; what has not closed a cycle
is chaotic if neighbours part by a factor of e^20 within the sampled impacts. A start that is not decided is run again,
four times as long, then sixteen times. One that has stuck, without a cycle that was found, has the fate of the
release: all motions are alike from there on.

Chaos may be a long transient. It is believed after the shortest run if 256 starts spread over the impact surface show
that it lasts: each of them that is chaotic there still is so after the longest run. Else every chaotic start is run
to the end. With r = 1 and c = 0 areas are kept and nothing attracts: only that it never hits is decided of a start. So
what becomes of a start never depends on the other starts of a grid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from threading import Event
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import Backend, Cells, ImpactWindow, Measurement
from vibroimpact.backends.base import Counts, Outcome
from vibroimpact.cells import cells_at
from vibroimpact.coexistence.starts import CREST
from vibroimpact.execution.threads import run_sweep
from vibroimpact.indices import INDICES
from vibroimpact.options import Tolerances
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.status import Status

ROUNDS = 3
LONGER = 4  # how much each round is longer than the one before
PARTED = 20.0  # ln of the factor by which neighbours must part for a motion to be called chaotic
NEEDED = (
    "mean_velocity",
    "impacts_per_period",
    "lyapunov",
    "lyapunov_per_impact",
    "n_periods",
    "n_impacts",
    "dissipation",
    "grazing_margin",
)


class Fate(IntEnum):
    """What becomes of a start."""

    UNDECIDED = 0
    PERIODIC = 1
    STICKING = 2
    CHAOTIC = 3
    NO_IMPACT = 4
    STUCK_FOREVER = 5
    AT_REST = 6


@dataclass(frozen=True)
class Runner:
    """Who computes, how exactly, in how many threads, and what stops it."""

    osc: ImpactOscillator
    engine: Backend
    limits: Tolerances
    workers: int
    stop: Event

    def run(self, cells: Cells, window: ImpactWindow) -> Iterator[tuple[Counts | slice, Outcome]]:
        """Yield which cells have ended, and what is told of them."""
        asked = Measurement(window, self.limits, indices=NEEDED)
        return run_sweep(self.engine, cells, asked, self.workers, self.stop)


@dataclass(frozen=True)
class Settled:
    """What became of each start: its fate, its status, and what the back end told of it last."""

    fate: NDArray[np.int8]
    status: NDArray[np.int8]
    told: dict[str, NDArray[Any]]

    @classmethod
    def of(cls, number: int) -> Settled:
        """Return what is known before any start has run: nothing."""
        counts = {name: np.zeros(number, np.int64) for name in ("impacts", "steps")}
        indices = {name: np.zeros(number, INDICES[name].dtype) for name in NEEDED}
        return cls(np.zeros(number, np.int8), np.full(number, Status.INTERRUPTED, np.int8), counts | indices)

    def note(self, at: Counts, outcome: Outcome, osc: ImpactOscillator, kept: int) -> None:
        """Take down what a window of `kept` impacts told of starts."""
        for name in (*NEEDED, "impacts"):
            self.told[name][at] = outcome[name]
        self.told["steps"][at] += outcome["steps"]
        self.fate[at] = judge(osc, outcome, kept)
        self.status[at] = _plain(outcome["status"], self.fate[at])

    def follow(self, at: Counts, released: Settled) -> None:
        """Let starts that have stuck go on as every mass does that is released."""
        self.fate[at], self.status[at] = released.fate[0], released.status[0]
        for name in NEEDED:
            self.told[name][at] = released.told[name][0]
        self.told["impacts"][at] += released.told["impacts"][0]


def attracts(osc: ImpactOscillator) -> bool:
    """Return whether impacts or damping shrink areas, without which nothing is attracted."""
    return osc.damping > 0.0 or osc.restitution < 1.0


def rounds(osc: ImpactOscillator, transient: int, keep: int) -> list[ImpactWindow]:
    """Return the windows of one round after the other; a single one where longer rounds would tell nothing."""
    return [ImpactWindow(transient * LONGER**i, keep * LONGER**i) for i in range(ROUNDS if attracts(osc) else 1)]


def settle(
    runner: Runner,
    cells: Cells,
    windows: Sequence[ImpactWindow],
    chaos_lasts: Callable[[], bool] = lambda: False,
    report: Callable[[Settled, int], None] = lambda settled, undecided: None,
) -> Settled:
    """Run cells in ever longer windows until each is decided; `report` is told after each batch how many are not."""
    number = len(cells)
    settled = Settled.of(number)
    fate, status = settled.fate, settled.status
    released = cache(lambda: _released(runner, windows))
    left = np.arange(number)
    for window in windows:
        fate[left], status[left] = Fate.UNDECIDED, Status.INTERRUPTED
        undecided = len(left)
        for which, outcome in runner.run(cells[left], window):
            settled.note(left[which], outcome, runner.osc, window.keep)
            undecided -= int(np.count_nonzero(fate[left[which]]))
            report(settled, undecided)
        stuck = left[(fate[left] == Fate.UNDECIDED) & (status[left] == Status.STICKING)]
        if stuck.size and not runner.stop.is_set():
            settled.follow(stuck, released())
        again = (fate == Fate.UNDECIDED) & (status != Status.BUDGET) & (status != Status.INTERRUPTED)
        chaotic = fate == Fate.CHAOTIC
        if window is not windows[-1] and chaotic[left].any() and not chaos_lasts():
            again |= chaotic
        left = np.flatnonzero(again)
        if left.size == 0 or runner.stop.is_set():
            break
    return settled


def _released(runner: Runner, windows: Sequence[ImpactWindow]) -> Settled:
    """Return what becomes of a mass that rests at the stop while the force presses most, waiting for its release."""
    cell = cells_at(runner.osc, np.zeros(1), np.zeros(1), np.array([CREST]))
    settled = Settled.of(1)
    for window in windows:
        for which, outcome in runner.run(cell, window):
            settled.note(np.arange(1)[which], outcome, runner.osc, window.keep)
        if settled.fate[0] not in (Fate.UNDECIDED, Fate.CHAOTIC):
            break
    return settled


def lasts(runner: Runner, cells: Cells, windows: Sequence[ImpactWindow]) -> bool:
    """Return whether cells that are chaotic in the first window are so in the last one too, all of them."""
    early = settle(runner, cells, windows[:1]).fate == Fate.CHAOTIC
    return bool(early.any()) and bool((settle(runner, cells[early], windows[-1:]).fate == Fate.CHAOTIC).all())


def judge(osc: ImpactOscillator, told: Outcome, kept: int) -> NDArray[np.int8]:
    """Return the fate of each cell from what a window of `kept` impacts told."""
    status, exponent = told["status"], told["lyapunov_per_impact"]
    cycle = told["n_periods"] > 0
    returns = cycle | (told["n_impacts"] == -1)  # if not with a period of its own: rounding decides when
    sampled = status <= Status.SHORT_WINDOW
    clear_of_stop = (status == Status.NO_IMPACT) | (status == Status.STOPPED_IMPACTING)
    stuck, dying = status == Status.STUCK_FOREVER, status == Status.DECAYING
    damped, driven = osc.damping > 0.0, osc.amplitude > 0.0
    swings_on = dying & (not damped and osc.gap > 0.0)  # unforced and undamped, it ends just not touching the stop
    clear_of_stop = clear_of_stop & (driven or not damped) | swings_on
    fates = [
        (Fate.STICKING, returns & np.isneginf(exponent)),
        (Fate.PERIODIC, cycle & attracts(osc)),
        (Fate.CHAOTIC, sampled & ~cycle & (exponent * kept > PARTED) & attracts(osc)),
        (Fate.NO_IMPACT, clear_of_stop),
        (Fate.STUCK_FOREVER, stuck & driven),
        (Fate.AT_REST, ~sampled & (status < Status.BUDGET)),
    ]
    return np.select([cases for _, cases in fates], [fate for fate, _ in fates], Fate.UNDECIDED).astype(np.int8)


def _plain(status: NDArray[np.int8], fate: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return the status of decided cells without what it says of the window, which a fate does not depend on."""
    cases = [fate == Fate.PERIODIC, fate == Fate.STICKING, fate == Fate.CHAOTIC]
    return np.select(cases, [Status.CLOSED, Status.STICKING, Status.OK], status).astype(np.int8)
