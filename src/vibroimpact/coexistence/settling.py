"""Compute motions from initial conditions until it is clear what each settles to.

A motion is decided once its cycle is certain, or it can never hit again, or it stays at rest; a motion without a cycle
is chaotic if perturbations grow by more than 2^53 within the sampled impacts, the rule of `classify`. A motion that is
not decided is computed again, four times as long, then sixteen times. For a motion that has rested, without a cycle
that double precision resolves, perturbed releases decide (`final.fate_of_release`): after a rest, all motions are the
same.

Chaos may be a long transient. It is accepted if 32 of the chaotic motions, some of each group, stay chaotic for 1e5
impacts; if nearly all of them rest, all chaotic motions count as resting; otherwise every chaotic motion is followed
for 1e5 impacts and sorted by its end. Motions that are still undecided are followed as well. A motion that was chaotic
at first and then seems quasi-periodic may be half chaos and half a cycle; it is followed once more, from there on. For
a grid, 256 initial conditions spread over the impact surface decide whether chaos lasts, so the result for one initial
condition never depends on the others. If impacts never lose energy (r = 1 and c = 0), nothing is attracted: only
motions that never hit are decided.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import Cells, ImpactWindow, Samples, check_takes
from vibroimpact.backends.base import Counts, Floats, Outcome
from vibroimpact.coexistence.final import LATE, MOVED, RELEASES, TURNS, WATCHED, Fate, fate_of_release
from vibroimpact.coexistence.losses import LASTING, attracting_kinds, attracts, lasting_stops
from vibroimpact.coexistence.measuring import Measured, Runner, identifying, named
from vibroimpact.indices import INDICES
from vibroimpact.model import Model
from vibroimpact.motion import MotionClass, decide, may_wind
from vibroimpact.options import Sampling
from vibroimpact.orbits.results import Search
from vibroimpact.orbits.search import search_of
from vibroimpact.status import Status

SAMPLING = Sampling(transient_impacts=100, sample_impacts=500)  # of the first round
ROUNDS = 3  # in which motions that do not repeat are followed further
LONGER = 4  # how much each round is longer than the one before
REPRESENTATIVES = 32  # chaotic initial conditions that are watched for all: as many as fill the lanes
LATE_OF_SYSTEMS = ImpactWindow((1 << 14) - 1, 1 << 14)  # 32,767 impacts in all
AFTER_LATE = ImpactWindow((1 << 15) - 1, 1 << 15)  # the next ones
NEARLY_ALL = 0.9  # of them rest within 1e5 impacts: chance lets the others not, and all are one attractor
# Gaps that part groups of cycles, beyond what the way to go (1e-10 V) leaves.
ENERGY_GAP = 1e-7  # of m V^2, of a cycle's loss per period
EXPONENT_GAP = 1e-5  # per period; the logarithm of two equal multipliers is good to 1e-5
MISS_GAP = 1e-6  # of V/w_n
# Gaps that part groups of chaotic motions, beyond chance in a short sample: of V; impacts per period.
MEAN_GAP, RATE_GAP = 0.02, 0.02


@dataclass(frozen=True)
class Settling:
    """How motions of a model are followed until they settle: with which runner, and in which windows one by one."""

    runner: Runner
    search: Search
    windows: tuple[ImpactWindow, ...]

    @classmethod
    def of(cls, runner: Runner, model: Model, sampling: Sampling = SAMPLING) -> Settling:
        """Return how motions are followed; refuse a model without stops, and one that the back end does not support.

        There is a single window if longer ones would decide nothing. For systems, 2^k - 1 impacts are skipped and 2^k
        kept, since lanes compare later impacts with the first one kept.
        """
        search, transient, keep = search_of(model), sampling.transient_impacts, sampling.sample_impacts
        osc = search.design
        check_takes(runner.engine, osc)
        if not osc.stops:
            raise ValueError(
                f"`osc` must have a stop, got {osc!s}: without one there is a single motion, the steady one"
            )
        times, half = [LONGER**i for i in range(ROUNDS)], 1 << max(transient, (keep - 1) // 4).bit_length()
        of_one = (ImpactWindow(transient * longer, keep * longer) for longer in times)
        of_system = (ImpactWindow(half * longer - 1, half * longer) for longer in times)
        settling = cls(runner, search, tuple(of_one if osc.forgets else of_system))
        return settling if settling.attracts else replace(settling, windows=settling.windows[:1])

    @property
    def model(self) -> Model:
        """The model."""
        return self.search.model

    @property
    def osc(self) -> Any:
        """The oscillator or system at the values of the model."""
        return self.search.design

    @cached_property
    def attracts(self) -> bool:
        """Whether anything is attracted."""
        return attracts(self.osc)

    @cached_property
    def rule(self) -> tuple[NDArray[np.int8], int, bool]:
        """What motions of each kind settle to, bits of the stops struck without loss, and whether motions may wind."""
        lossless = int(lasting_stops(self.osc) @ (1 << np.arange(len(self.osc.stops))))
        return attracting_kinds(self.osc), lossless, may_wind(self.osc)

    @property
    def late(self) -> ImpactWindow:
        """The window over which motions that do not repeat are followed."""
        return LATE if self.osc.forgets else LATE_OF_SYSTEMS

    @property
    def whole(self) -> tuple[ImpactWindow, ...]:
        """All windows: also the late one, in which motions that do not repeat are followed, if anything is gained."""
        last, late = self.windows[-1], self.late
        longer = last.transient + last.keep >= late.transient + late.keep
        return self.windows if longer or self.runner.engine.slow or not self.attracts else (*self.windows, late)


@dataclass(frozen=True)
class Settled:
    """The motion that each initial condition settles to: its kind and status, and the indices of its last run.

    `passing` is the hardest impact in m/s in any window before it had a cycle.
    """

    settling: Settling
    cells: Cells
    kind: NDArray[np.int8]
    status: NDArray[np.int8]
    indices: dict[str, NDArray[Any]]
    passing: Floats

    @property
    def osc(self) -> Any:
        """The oscillator or system."""
        return self.settling.osc

    @property
    def runner(self) -> Runner:
        """The means of computing its motions."""
        return self.settling.runner

    @property
    def columns(self) -> list[NDArray[Any]]:
        """What each motion has come to: its kind, status and indices, without the steps that it took."""
        return [self.kind, self.status, *(column for name, column in self.indices.items() if name != "steps")]

    @classmethod
    def of(cls, settling: Settling, cells: Cells) -> Settled:
        """Return the initial state, in which nothing is known."""
        number, cells = len(cells), cells[np.arange(len(cells))]
        counts = {name: np.zeros(number, np.int64) for name in ("impacts", "steps", "kept")}
        kinds = {name: INDICES[name].dtype if name in INDICES else np.float64 for name in identifying(cells)}
        indices = {name: np.zeros(number, kind) for name, kind in kinds.items()}
        status = np.full(number, Status.INTERRUPTED, np.int8)
        return cls(settling, cells, np.zeros(number, np.int8), status, counts | indices, np.zeros(number))

    def __getitem__(self, at: int) -> Measured:
        indices = {name: float(column[at]) for name, column in self.indices.items()}
        return named(int(self.kind[at]), int(self.status[at]), indices, float(self.indices["impacts"][at]))

    def note(self, at: Counts, outcome: Outcome, kept: int) -> None:
        """Record the outcome of a window of `kept` impacts."""
        for name in (*identifying(self.cells), "impacts"):
            self.indices[name][at] = outcome[name]
        self.indices["steps"][at] += outcome["steps"]
        self.indices["kept"][at] = kept
        hit = np.where(outcome["n_periods"] == 0, outcome["max_velocity"], 0.0)
        self.passing[at] = np.fmax(self.passing[at], hit)
        self.kind[at] = self._kinds(outcome, kept)
        self.status[at] = _plain(outcome["status"], self.kind[at])
        unnamed = at[~np.isin(self.kind[at], (MotionClass.PERIODIC, MotionClass.STICKING))]
        self.indices["n_periods"][unnamed] = 0  # what repeats without a loss, or without force, is no cycle
        self.indices["n_impacts"][unnamed] = 0

    def _kinds(self, outcome: Outcome, kept: int) -> NDArray[np.int8]:
        """Return the kind of motion that each cell settles to, from the outcome of a window of `kept` impacts."""
        settles_to, lossless, winds = self.settling.rule
        growth = outcome["lyapunov_per_impact"] * kept
        kinds = decide(outcome["status"], growth, outcome["n_periods"], outcome["n_impacts"], kept if winds else 0)
        attracting: NDArray[np.int8] = settles_to[kinds]
        # Hits may last without loss: motions that hit as hard do not approach each other.
        struck = outcome.get("struck", np.ones_like(outcome["n_impacts"]))  # one bit a stop, if there are several
        lasts = struck & lossless != 0
        attracting[lasts & np.isin(kinds, (MotionClass.UNDECIDED, *LASTING))] = MotionClass.UNDECIDED
        return attracting

    def follow(self, at: Counts, fate: Fate) -> None:
        """Continue motions that have rested as perturbed releases continue."""
        self.cells.table[at] = fate.cell.table[0]
        self.kind[at] = MotionClass.UNDECIDED if fate.end.status == Status.BUDGET else fate.end.motion_class
        self.status[at] = _plain(np.array([fate.end.status]), self.kind[at[:1]])[0]
        for name in identifying(self.cells):
            self.indices[name][at] = fate.end.indices[name]
        self.indices["impacts"][at] = max(fate.lasts, fate.end.impacts)
        self.passing[at] = np.fmax(fate.passing, self.passing[at])


def settle(
    settling: Settling,
    cells: Cells,
    windows: Sequence[ImpactWindow],
    outlook: Callable[[Settled, ImpactWindow], MotionClass] = lambda settled, window: MotionClass.UNDECIDED,
    report: Callable[[Settled, int], None] = lambda settled, undecided: None,
    *,
    leaves: bool = True,
) -> Settled:
    """Compute cells in ever longer windows until each is decided; `report` gets the number undecided after each batch.

    After a window, `outlook` gives the final motion of all motions that are chaotic there: lasting chaos, intermittent
    sticking, or undecided if they differ, in which case all must be continued. Motions whose next rest is determined by
    rounding end as perturbed ones do; those of a system only if it `leaves` its rests.
    """
    runner, osc, settled = settling.runner, settling.osc, Settled.of(settling, cells)
    kind, status = settled.kind, settled.status
    results = settled.columns
    fate = partial(fate_of_release, runner, osc)
    remaining, planned, windows = np.arange(len(cells)), windows, list(windows)
    for window in windows:
        before = [column[remaining] for column in results]
        kind[remaining], status[remaining] = MotionClass.UNDECIDED, Status.INTERRUPTED
        undecided = len(remaining)
        watched = window == settling.late or window is AFTER_LATE
        for which, outcome in runner.run(settled.cells[remaining], window, runner.thrifty if watched else None):
            settled.note(remaining[which], outcome, window.keep)
            undecided -= int(np.count_nonzero(kind[remaining[which]]))
            report(settled, undecided)
        if watched:  # what is not followed to the end there stays what it was
            cut = (status[remaining] == Status.BUDGET) | (status[remaining] == Status.INTERRUPTED)
            for column, values in zip(results, before, strict=True):
                column[remaining[cut]] = values[cut]
        resting = (status == Status.STICKING) & (settled.indices["n_periods"] == 0)
        resting &= np.isin(kind, (MotionClass.UNDECIDED, MotionClass.STICKING)) & osc.forgets
        stuck = remaining[resting[remaining]]
        if stuck.size and not runner.stop.is_set():
            settled.follow(stuck, fate())
        again = (kind == MotionClass.UNDECIDED) & (status != Status.BUDGET) & (status != Status.INTERRUPTED)
        again[stuck] = False
        chaotic = kind == MotionClass.CHAOTIC
        if window is not windows[-1] and chaotic[remaining].any():
            match outlook(settled, window):
                case MotionClass.STICKING if osc.forgets:
                    settled.follow(np.flatnonzero(chaotic), fate())
                case MotionClass.UNDECIDED | MotionClass.STICKING:
                    again |= chaotic
        winds = kind == MotionClass.QUASI_PERIODIC
        if window is not windows[-1] and winds[remaining].any():
            again |= winds & (window is not windows[-2] or not _winds_on(settled, winds, windows[-1]))
        mixed = winds[remaining] & (before[0] == MotionClass.CHAOTIC)
        if window is windows[-1] and window == LATE_OF_SYSTEMS and mixed.any():
            windows.append(AFTER_LATE)
            again[:] = False
            again[remaining[mixed]] = True
        remaining = np.flatnonzero(again)
        if remaining.size == 0 or runner.stop.is_set():
            break
    if leaves and not osc.forgets:
        _leave(settled, planned)
    return settled


def _intermittent(settled: Settled) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = (settled.indices["n_periods"] == 0) & (settled.kind == MotionClass.STICKING)
    return found


def _leave(settled: Settled, windows: Sequence[ImpactWindow]) -> None:
    """Continue motions of a system that rest and never repeat as most perturbed ones do that do not rest again.

    The state after the first impact from a rest is perturbed. Each interval between rests is an independent trial.
    """
    runner, stuck = settled.runner, np.flatnonzero(_intermittent(settled))
    if not stuck.size or runner.stop.is_set():
        return
    cell, impacts, tried = settled.cells[stuck[:1]], 0, 0
    (samples,) = runner.samples(cell, ImpactWindow(0, 2 * int(settled.indices["impacts"][stuck[0]])))
    (samples,) = runner.samples(cell, ImpactWindow(_first_after_rest(samples), 1))
    while impacts < TURNS * WATCHED and not runner.stop.is_set():
        shares = MOVED * np.random.default_rng(tried).uniform(-1.0, 1.0, (RELEASES * (tried + 1), 1))
        cells = cell.copies(len(shares)).at(
            samples.last_displacement, samples.last_velocity * (1.0 + shares), samples.last_phase
        )
        others = settle(settled.settling, cells, windows, leaves=False)
        tried, impacts = 2 * tried + 1, impacts + int(others.indices["impacts"].sum())
        elsewhere = np.flatnonzero(~_intermittent(others) & (others.kind != MotionClass.UNDECIDED))
        if elsewhere.size:
            names = [others[at].name for at in elsewhere.tolist()]
            at = elsewhere[names.index(Counter(names).most_common(1)[0][0])]
            settled.cells.table[stuck], settled.passing[stuck] = cells.table[at], others.passing[at]
            for column, values in zip(settled.columns, others.columns, strict=True):
                column[stuck] = values[at]
            return


def _first_after_rest(samples: Samples) -> int:
    """Return the number of the first impact after the first rest that ended."""
    ends = samples.rest_end.sum(axis=1)
    return int(np.searchsorted(samples.impact_turns, ends[np.isfinite(ends)].min(initial=math.inf), side="right"))


def _winds_on(settled: Settled, winds: NDArray[np.bool_], window: ImpactWindow) -> bool:
    """Return whether representatives of the motions that look quasi-periodic all do so in a longer window, too."""
    which = np.flatnonzero(winds)
    chosen = which[:: math.ceil(len(which) / REPRESENTATIVES)]
    return bool((settle(settled.settling, settled.cells[chosen], [window]).kind == MotionClass.QUASI_PERIODIC).all())


def outlook_of(settled: Settled) -> MotionClass:
    """Return the outlook of representatives of all chaos after 1e5 impacts, or undecided if they differ."""
    groups = chaotic_groups(settled)
    number = sum(map(len, groups))
    if not number:
        return MotionClass.UNDECIDED  # stopped before any was
    chosen = np.concatenate([group[:: math.ceil(number / REPRESENTATIVES)] for group in groups])
    return _common(settle(settled.settling, settled.cells[chosen], [settled.settling.late]))


def outlook_from(settling: Settling, cells: Cells) -> MotionClass:
    """Return the outlook, in the last window, of cells that are chaotic in the first one, and of representatives."""
    early = settle(settling, cells, settling.windows[:1]).kind == MotionClass.CHAOTIC
    later = settle(settling, cells[early], settling.windows[-1:])
    common = _common(later)
    if common == MotionClass.STICKING or not _irregular(later).all() or settling.whole == settling.windows:
        return common
    lasting = outlook_of(later)
    return lasting if lasting in (common, MotionClass.STICKING) else MotionClass.UNDECIDED


def _irregular(settled: Settled) -> NDArray[np.bool_]:
    open_ended: NDArray[np.bool_] = np.isin(settled.kind, (MotionClass.CHAOTIC, MotionClass.STICKING))
    unresolved: NDArray[np.bool_] = settled.indices["n_periods"] == 0
    return open_ended & unresolved


def _common(settled: Settled) -> MotionClass:
    """Return chaotic if all cells are, sticking if nearly all of them rest again and again; else undecided."""
    resting = settled.kind == MotionClass.STICKING
    if not len(resting) or not _irregular(settled).all():
        return MotionClass.UNDECIDED
    if not resting.any():
        return MotionClass.CHAOTIC
    return MotionClass.STICKING if resting.mean() > NEARLY_ALL else MotionClass.UNDECIDED


def cycle_groups(settled: Settled, members: Counts) -> list[Counts]:
    """Return the members that lead to cycles, grouped by quantities that do not depend on where a sample began.

    These are n and p, the loss per period, the exponent and the closest near-miss. For systems, all are one group.
    """
    osc, columns = settled.osc, {name: column[members] for name, column in settled.indices.items()}
    if not members.size or not osc.forgets:
        return [members]
    scale, n = osc.velocity_scale, columns["n_periods"]
    sorted_by = [
        (n, 0.0),
        (columns["n_impacts"], 0.0),
        (columns["dissipation"], ENERGY_GAP * osc.mass * scale**2),
        (columns["lyapunov"] * osc.period * n, EXPONENT_GAP),
        (np.nan_to_num(columns["grazing_margin"], posinf=-scale), MISS_GAP * scale / osc.natural_frequency),
    ]
    return [members[part] for part in clusters(sorted_by)]


def chaotic_groups(settled: Settled) -> list[Counts]:
    """Return members that lead to chaos, grouped by mean velocity and impacts per period; for systems, as one group."""
    members = np.flatnonzero(settled.kind == MotionClass.CHAOTIC)
    if not members.size or not settled.osc.forgets:
        return [members]
    sorted_by = [
        (settled.indices["mean_velocity"][members], MEAN_GAP * settled.osc.velocity_scale),
        (settled.indices["impacts_per_period"][members], RATE_GAP),
    ]
    return [members[part] for part in clusters(sorted_by)]


def clusters(columns: Sequence[tuple[Floats, float]]) -> list[Counts]:
    """Return groups of rows, separated wherever the sorted values of a column leave a gap wider than that column's."""
    label = np.zeros(len(columns[0][0]), dtype=np.int64)
    for values, gap in columns:
        order = np.lexsort((values, label))
        steps = (np.diff(values[order]) > gap) | (np.diff(label[order]) > 0)
        label[order] = np.concatenate([[0], np.cumsum(steps)])
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _plain(status: NDArray[np.int8], kind: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return the status of decided cells without its statement on the window, on which the kind does not depend."""
    cases = [kind == MotionClass.PERIODIC, kind == MotionClass.STICKING, kind == MotionClass.CHAOTIC]
    return np.select(cases, [Status.CLOSED, Status.STICKING, Status.OK], status).astype(np.int8)
