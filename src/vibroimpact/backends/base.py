"""The protocol of back ends: cells in, indices or samples out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Cells
from vibroimpact.indices import FORCES, INDICES, RESPONSES, VELOCITY_INDICES
from vibroimpact.model import State
from vibroimpact.model.elements import Contact
from vibroimpact.options import Tolerances
from vibroimpact.status import Status, window_status

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]

NO_HARMONIC = 1e-12  # of the rms displacement: a smaller harmonic is rounding


@dataclass(frozen=True)
class ImpactWindow:
    """Skip the first recorded impacts and keep the next ones."""

    transient: int
    keep: int


@dataclass(frozen=True)
class StroboscopicWindow:
    """Sample the motion `per_period` times per period, `keep` times in all.

    The first sample is at the first time with this `phase` that is at least `skip_periods` periods after the start, or
    exactly so many periods after it if `phase` is None; the next ones follow at intervals of T / `per_period`. At an
    impact the state after it is given.
    """

    skip_periods: int
    keep: int
    phase: float | None = None
    per_period: int = 1

    @property
    def length(self) -> float:
        """The time from the start to about the last sample, in driving periods."""
        return self.skip_periods + self.keep / self.per_period

    def schedule(self, periods: float, phase: float) -> tuple[Floats, Floats]:
        """Return the sampling times of a cell that starts at (periods + phase) T, as whole periods and phase."""
        first = periods + self.skip_periods
        if self.phase is not None:
            first += 1.0 if self.phase < phase else 0.0
            phase = self.phase
        offset = np.arange(self.keep)
        fraction: Floats = phase + (offset % self.per_period) / self.per_period
        whole: Floats = np.floor(fraction)
        return first + offset // self.per_period + whole, fraction - whole


@dataclass(frozen=True, eq=False)
class TimesWindow:
    """Sample the motion at given times, in ascending order and not before the start: whole periods, and phases.

    `length` is the time from the start to the last sample, in driving periods. At an impact the state after it is
    given.
    """

    periods: Floats
    phase: Floats
    length: float

    @property
    def keep(self) -> int:
        """The number of samples."""
        return len(self.periods)

    def schedule(self, _periods: float, _phase: float) -> tuple[Floats, Floats]:
        """Return the sampling times as whole periods and phase, wherever a cell starts."""
        return self.periods, self.phase

    @classmethod
    def of(cls, turns: Floats, start: float) -> TimesWindow:
        """Return the window of times in driving periods, for motions that start at `start`."""
        whole = np.floor(turns)
        return cls(whole, turns - whole, float(turns[-1]) - start)


LooksWindow = StroboscopicWindow | TimesWindow
Window = ImpactWindow | LooksWindow


@dataclass(frozen=True)
class Measurement:
    """The quantities measured for each cell.

    With `early_closing` a cell ends as soon as its cycle is certain, and its sums are completed in closed form. With
    `by_stop`, indices are computed for the impacts on each stop of a system. `of` is what the indices of displacements
    are of, if any: factors of all coordinates, or the number of a stop for its clearance. Samples depend only on window
    and tolerances.
    """

    window: Window
    tolerances: Tolerances = field(default_factory=Tolerances)
    early_closing: bool = True
    indices: tuple[str, ...] = ("std",)
    by_stop: bool = False
    of: tuple[float, ...] | int | None = None

    @property
    def impacts(self) -> ImpactWindow:
        """The window of impacts over which indices are computed."""
        if not isinstance(self.window, ImpactWindow):
            raise TypeError("indices are taken over impacts")
        return self.window

    @property
    def thorough(self) -> bool:
        """Whether the indices need more than sums over impact velocities."""
        return not (VELOCITY_INDICES | FORCES.keys() | RESPONSES.keys()).issuperset(self.indices)

    @property
    def swings(self) -> bool:
        """Whether displacements or forces are measured over a cycle, after the impacts."""
        return not RESPONSES.keys().isdisjoint(self.indices)


@dataclass(eq=False, slots=True)  # freezing so many fields takes as long as recording two impacts
class Samples:
    """Samples of one cell's motion in a window; times in whole `periods` plus `phase`.

    `impact_*`: recorded impacts, those that an `ImpactWindow` keeps, or all up to the last sample of another window:
    number of the `stop`, speed in m/s, whether other stops were struck at the same instant. `contacts`: arrays of what
    they come to, or a number that is the same for all; for an unfinished contact all are NaN. `look_*`: the samples in
    time, coordinates and velocities, one row per sample; none for an `ImpactWindow`. `rest_*`: the stop that closed,
    when it closed, and when it was released (NaN if it was not), over the same span as the impacts. `last_*`: the state
    after the last item kept, from which to continue; one mass has its clearance, too, which is not rounded as its
    displacement is.
    """

    impact_periods: Floats
    impact_phase: Floats
    impact_stop: Counts
    impact_velocity: Floats
    impact_simultaneous: NDArray[np.bool_]
    contacts: Contact
    look_periods: Floats
    look_phase: Floats
    look_displacement: Floats
    look_velocity: Floats
    rest_stop: Counts
    rest_begin: Floats
    rest_end: Floats
    status: int
    steps: int
    last_displacement: Floats
    last_velocity: Floats
    last_phase: float
    last_clearance: float = math.nan

    @property
    def impact_turns(self) -> Floats:
        """Times of the impacts in driving periods; over long times their phases lose digits in this sum."""
        return self.impact_periods + self.impact_phase

    @property
    def look_turns(self) -> Floats:
        """Times of the samples in driving periods."""
        return self.look_periods + self.look_phase

    def last_state(self, period: float) -> State:
        """Return the state after the last item kept, with its time in one driving period, in s."""
        return State(self.last_displacement, self.last_velocity, self.last_phase * period)

    @classmethod
    def of_one_mass(
        cls,
        design: Mapping[str, float],
        *,
        impacts: Floats,
        looks: Floats,
        sticks: Floats,
        status: Status,
        last: tuple[float, float, float, float],
        steps: int,
    ) -> Samples:
        """Return the samples of one mass at one rigid stop from rows of numbers.

        `design` holds its mass, restitution and gap. The columns are, for impacts: periods, phase, velocity; for looks:
        periods, phase, displacement, velocity; for sticks: periods and phase of their begin, then of their release; for
        `last`: clearance, velocity, periods, phase.
        """
        speed, (clearance, velocity, _, phase) = impacts[:, 2], last
        stop = np.zeros(len(speed), np.int64)
        return cls(
            impact_periods=impacts[:, 0],
            impact_phase=impacts[:, 1],
            impact_stop=stop,
            impact_velocity=speed,
            impact_simultaneous=stop > 0,
            contacts=taken_by(design["mass"], design["restitution"], speed),
            look_periods=looks[:, 0],
            look_phase=looks[:, 1],
            look_displacement=looks[:, 2:3],
            look_velocity=looks[:, 3:4],
            rest_stop=np.zeros(len(sticks), np.int64),
            rest_begin=sticks[:, :2],
            rest_end=sticks[:, 2:],
            status=int(status),
            steps=steps,
            last_displacement=np.array([design["gap"] - clearance]),
            last_velocity=np.array([velocity]),
            last_phase=phase,
            last_clearance=clearance,
        )


def impacts_status(impacts: Floats, sticks: Floats, window: ImpactWindow, ended: Status) -> Status:
    """Return the status of a motion from its ending `ended` and the rows of impacts and sticks in its window."""
    turns = impacts[:, 0] + impacts[:, 1]
    span = float(turns[-1] - turns[0]) if len(turns) else 0.0
    return window_status(sampled=len(impacts), wanted=window.keep, stuck=len(sticks) > 0, periods=span, ended=ended)


def within_impacts(impacts: Floats, rests: Floats, window: ImpactWindow, ended: Status) -> tuple[Floats, Status]:
    """Return the rests between the first and the last impact of a window, and the status of its motion.

    The first columns of impacts, and those of rests after the number of a stop, are times in whole periods and phase.
    """
    turns, filled = impacts[:, 0] + impacts[:, 1], len(impacts) == window.keep
    first, last = (turns[0], turns[-1] if filled else math.inf) if len(turns) else (math.inf, -math.inf)
    later = np.isnan(rests[:, 3]) | (rests[:, 3] + rests[:, 4] > first)
    rests = rests[later & (rests[:, 1] + rests[:, 2] < last)]
    return rests, impacts_status(impacts, rests, window, ended)


def looks_status(sticks: Floats, first: float, pressed: bool) -> Status:
    """Return the status of a full stroboscopic window that begins `first` periods from time 0, from rows of sticks.

    With `pressed`, a mass at rest at the stop is never released.
    """
    released = sticks[:, 2] + sticks[:, 3]
    if pressed and np.isnan(released).any():
        return Status.STUCK_FOREVER
    return Status.STICKING if (np.isnan(released) | (released > first)).any() else Status.OK


Outcome = dict[str, NDArray[Any]]


def with_stop_axis(outcome: Outcome, measurement: Measurement) -> Outcome:
    """Return the outcome of cells with one stop, with an axis of stops added if indices are by stop."""
    of_stops = {name for name, index in INDICES.items() if measurement.by_stop and index.by_stop}
    return {name: values[:, None] if name in of_stops else values for name, values in outcome.items()}


class Backend(Protocol):
    """The protocol of back ends, with two methods on cells; neither raises because of a cell's physics.

    `largest_tile` is the largest number of cells per call that still allows timely progress reports and Ctrl-C; with
    fewer than `smallest_tile` part of the machine is idle. `known_indices` are the indices it can compute, and
    `sampler` is the back end that follows single orbits for it; a `slow` back end takes up to seconds per cell.
    """

    name: str
    sampler: str
    smallest_tile: int
    largest_tile: int
    known_indices: frozenset[str]
    slow: bool = False

    def check_here(self) -> None:
        """Raise `ValueError` if this machine does not meet the requirements of the back end."""
        return

    def indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        """Return at least the requested indices, and status and counts of each cell, each of shape (n,).

        An index without a value is NaN, or 0 for a whole number. The others are `status` (int8), `impacts` (recorded
        impacts computed, int64) and `steps` (int64).
        """
        ...

    def samples(self, cells: Cells, measurement: Measurement) -> list[Samples]:
        """Return the samples of each cell in the window."""
        ...

    def follow(self, cell: Cells, measurement: Measurement, sampling: Measurement) -> tuple[Outcome, Samples]:
        """Return the outcome of `indices` for a single cell, and its samples in the window of `sampling`.

        If possible, both come from one run.
        """
        return self.indices(cell, measurement), self.samples(cell, sampling)[0]


def energy_loss(mass: float, restitution: float) -> float:
    """Return m (1 - r^2)/2, the energy lost in an impact of unit speed."""
    return 0.5 * mass * (1.0 - restitution) * (1.0 + restitution)


def taken_by(mass: float, restitution: float, speed: Any) -> Contact:
    """Return impulse, loss and exit velocity of impacts of one mass on a rigid stop, at one speed or an array."""
    loss, away = energy_loss(mass, restitution) * speed**2, restitution * speed
    return Contact(mass * (1.0 + restitution) * speed, energy_lost=loss, exit_velocity=away, exit_time=0.0)


def phase_of(harmonic: Any, rms: Any) -> Any:
    """Return the phase of a first harmonic Y in rad; NaN where |Y| is rounding beside the rms displacement."""
    return np.where(np.abs(harmonic) > NO_HARMONIC * rms, np.angle(harmonic), np.nan)
