"""What motions many oscillators do, each from a start of its own: all in one batch of lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from threading import Event
from typing import Any

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow, Measurement, get_backend
from vibroimpact.execution.threads import run_sweep, worker_count
from vibroimpact.indices import INDICES
from vibroimpact.motion import MotionClass, decide, motion_name
from vibroimpact.options import Tolerances
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.status import Status

PAPER = ImpactWindow(100, 5000)
BRIEF = ImpactWindow(100, 1500)  # tells a name, and an exponent to a few per cent
THRIFT = 100  # certified steps an impact, but for the motion itself: others are not worth a long wait for rare hits
HARDLY_EVER = 64  # periods: chaos in which the mass rests now and then is, to the letter, a long sticking cycle


@dataclass(frozen=True)
class Start:
    """Clearance to the stop in m, velocity in m/s and driving phase: what a motion carries on with."""

    clearance: float
    velocity: float
    phase: float


@dataclass(frozen=True)
class Reading:
    """The status and indices of one motion, from `sampled` impacts."""

    status: Status
    indices: dict[str, float]
    sampled: int

    @cached_property
    def motion_class(self) -> MotionClass:
        """The kind of the motion, by the rule of `classify`."""
        growth = self.sampled * self.indices["lyapunov_per_impact"]
        return MotionClass(int(decide(self.status, growth, self.n_periods, self.n_impacts)))

    @property
    def kind(self) -> str:
        """The kind of the motion in a word."""
        return self.motion_class.word

    @property
    def n_periods(self) -> int:
        """Driving periods in a cycle; 0 where there is none."""
        return int(self.indices["n_periods"])

    @property
    def n_impacts(self) -> int:
        """Impacts in a cycle; -1 for a complete chatter."""
        return int(self.indices["n_impacts"])

    @property
    def _hardly_repeats(self) -> bool:
        return self.n_periods > HARDLY_EVER or (self.kind == "sticking" and not self.n_periods)

    @property
    def group(self) -> tuple[str, int, int]:
        """What tells one class of motion from another; all that do not repeat, or hardly ever, are one."""
        if self.kind in ("chaotic", "undecided") or self._hardly_repeats:
            return "aperiodic", 0, 0
        return self.kind, self.n_periods, self.n_impacts

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        return motion_name(self.motion_class, self.n_periods, self.n_impacts)

    @property
    def hardest(self) -> float:
        """The largest impact velocity in m/s; 0 where the mass does not hit, NaN where it is not known."""
        if self.kind in ("no_impact", "stuck_forever"):
            return 0.0
        return self.indices["max_velocity"]

    @property
    def loss(self) -> float:
        """Energy lost at the stop a driving period, in J; NaN where it is not known."""
        return 0.0 if self.kind in ("no_impact", "stuck_forever") else self.indices["dissipation"]


@dataclass(frozen=True)
class Laboratory:
    """How motions are computed: tolerances and threads; `cells` counts what was asked of it."""

    tolerances: Tolerances = field(default_factory=Tolerances)
    workers: int | None = None
    cells: list[int] = field(default_factory=lambda: [0])

    def read(
        self,
        oscillators: Sequence[ImpactOscillator],
        starts: Sequence[Start | None],
        window: ImpactWindow = PAPER,
    ) -> list[Reading]:
        """Return what each oscillator does from its start; None is at rest at min(0, gap)."""
        if not oscillators:
            return []
        self.cells[0] += len(oscillators)
        cells, names = make_cells_of(oscillators, starts), tuple(INDICES)
        table: dict[str, Any] = {name: np.full(len(cells), np.nan) for name in (*names, "status")}
        threads, limits = worker_count(self.workers), self.tolerances
        if window is not PAPER:
            limits = replace(limits, steps_per_impact=min(limits.steps_per_impact, THRIFT))
        asked = Measurement(window, limits, indices=names)
        for which, result in run_sweep(get_backend("cpu"), cells, asked, threads, Event()):
            for name, column in table.items():
                column[which] = result[name]
        return [
            Reading(Status(int(table["status"][i])), {name: float(table[name][i]) for name in names}, window.keep)
            for i in range(len(cells))
        ]

    def carry(
        self, oscillators: Sequence[ImpactOscillator], starts: Sequence[Start | None], impacts: int = 300
    ) -> list[Start | None]:
        """Return where each motion is after so many impacts, or None where it could not be followed."""
        if not oscillators:
            return []
        cells = make_cells_of(oscillators, starts)
        seen = get_backend("cpu").samples(cells, Measurement(ImpactWindow(impacts, 1), self.tolerances))
        return [
            Start(max(s.last_clearance, 0.0), s.last_velocity, s.last_phase)
            if s.status != Status.BUDGET and all(map(math.isfinite, (s.last_clearance, s.last_velocity, s.last_phase)))
            else None
            for s in seen
        ]


def make_cells_of(oscillators: Sequence[ImpactOscillator], starts: Sequence[Start | None]) -> Cells:
    """Return one cell an oscillator."""
    return Cells.join([_cell(osc, start) for osc, start in zip(oscillators, starts, strict=True)])


def _cell(osc: ImpactOscillator, start: Start | None) -> Cells:
    cell = osc.cells({})
    if start is None:
        return cell
    return cell.replace(clearance=start.clearance, velocity=start.velocity, phase=start.phase)
