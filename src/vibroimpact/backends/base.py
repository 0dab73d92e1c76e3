"""What every back end promises: cells in, indices or samples out; and indices of impacts that are all kept."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Cells
from vibroimpact.indices import FORCES, INDICES, VELOCITY_INDICES
from vibroimpact.model.system_cells import SystemCells
from vibroimpact.options import Tolerances
from vibroimpact.status import Status, window_status

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]


@dataclass(frozen=True)
class ImpactWindow:
    """Leave out the first recorded impacts, keep the next ones."""

    transient: int
    keep: int


@dataclass(frozen=True)
class StroboscopicWindow:
    """Look at the mass `per_period` times a period, `keep` times in all.

    The first look is at the first time after `skip_periods` periods from the start (the start itself
    included) whose phase is `phase`, or at start + `skip_periods` T where `phase` is None; the
    following ones are T / `per_period` apart. At an impact the state after it is given.
    """

    skip_periods: int
    keep: int
    phase: float | None = None
    per_period: int = 1

    def schedule(self, periods: float, phase: float) -> tuple[Floats, Floats]:
        """Return the times of the looks at a cell that starts at (periods + phase) T, as whole periods and phase."""
        first = periods + self.skip_periods
        if self.phase is not None:
            first += 1.0 if self.phase < phase else 0.0
            phase = self.phase
        offset = np.arange(self.keep)
        fraction: Floats = phase + (offset % self.per_period) / self.per_period
        whole: Floats = np.floor(fraction)
        return first + offset // self.per_period + whole, fraction - whole


@dataclass(frozen=True)
class Measurement:
    """What is measured of each cell.

    With `early_closing` a cell ends once its cycle is certain, and its sums are finished in closed form. Indices
    `by_stop` are those of the impacts on each stop of a system. Samples are what the window takes; they depend on
    nothing but window and tolerances.
    """

    window: ImpactWindow | StroboscopicWindow
    tolerances: Tolerances = field(default_factory=Tolerances)
    early_closing: bool = True
    indices: tuple[str, ...] = ("std",)
    by_stop: bool = False

    @property
    def impacts(self) -> ImpactWindow:
        """The window of impacts over which indices are taken."""
        if not isinstance(self.window, ImpactWindow):
            raise TypeError("indices are taken over impacts")
        return self.window

    @property
    def thorough(self) -> bool:
        """Whether sums over impact velocities do not suffice for the indices."""
        return not (VELOCITY_INDICES | FORCES.keys()).issuperset(self.indices)


@dataclass(frozen=True)
class Samples:
    """One cell's motion as a window saw it; times in whole `periods` plus `phase`, speeds in m/s.

    `impact_*`: recorded impacts (velocity before contact, > 0): those an `ImpactWindow` keeps, or all up
    to the last look of a `StroboscopicWindow`. `look_*`: the looks (`displacement`, `velocity`); empty for an
    `ImpactWindow`. `stick_*` / `release_*`: when the mass came to rest at the stop and when it left (NaN if it
    had not), over the same span as the impacts. `last_*`: the state after the last thing kept, for carrying on.
    """

    impact_periods: Floats
    impact_phase: Floats
    impact_velocity: Floats
    look_periods: Floats
    look_phase: Floats
    look_displacement: Floats
    look_velocity: Floats
    stick_periods: Floats
    stick_phase: Floats
    release_periods: Floats
    release_phase: Floats
    status: int
    last_clearance: float
    last_velocity: float
    last_periods: float
    last_phase: float
    steps: int

    @property
    def impact_stop(self) -> Counts:
        """The number of the stop of each impact, the only one."""
        return np.zeros(len(self.impact_velocity), np.int64)

    @property
    def rest_begin(self) -> Floats:
        """When each rest began, in whole periods and phase, a row each."""
        return np.column_stack([self.stick_periods, self.stick_phase])

    @property
    def rest_end(self) -> Floats:
        """When each rest ended, in whole periods and phase, a row each."""
        return np.column_stack([self.release_periods, self.release_phase])

    @classmethod
    def of(
        cls,
        *,
        impacts: Floats,
        looks: Floats,
        sticks: Floats,
        status: Status,
        last: tuple[float, float, float, float],
        steps: int,
    ) -> Samples:
        """Return samples from rows of impacts (periods, phase, velocity), looks (periods, phase, displacement,
        velocity) and sticks (periods, phase, periods, phase of the release); `last` is (clearance, velocity, periods,
        phase).
        """
        values: tuple[Any, ...] = *impacts.T, *looks.T, *sticks.T, int(status), *last, steps
        return cls(*values)

    def carry_on(self, cell: Cells) -> Cells:
        """Return another cell begun where this motion ended: clearance, velocity and phase are carried along."""
        if not math.isfinite(self.last_clearance):
            return cell
        last = {"clearance": self.last_clearance, "velocity": self.last_velocity, "phase": self.last_phase}
        return cell.replace(**last, periods=0.0)


@dataclass(frozen=True)
class SystemSamples:
    """One system's motion as a window saw it; times in whole `periods` plus `phase`.

    `impact_*`: recorded impacts, `stop` by its number, speed in m/s, impulse in N s, energy lost in J, whether other
    stops were struck at the same instant, and of compliant stops, else NaN, the largest force in N, the time in s and
    the penetration in m; of a contact that was not over all but the speed is NaN; `look_*`: coordinates and velocities,
    one row a look; `rest_*`: which stop closed, when, and when it was let go (NaN if it was not); `last_*`: where it
    ended, for carrying on.
    """

    impact_periods: Floats
    impact_phase: Floats
    impact_stop: Counts
    impact_velocity: Floats
    impact_impulse: Floats
    impact_energy: Floats
    impact_simultaneous: NDArray[np.bool_]
    impact_force: Floats
    impact_duration: Floats
    impact_depth: Floats
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

    def carry_on(self, cell: SystemCells) -> SystemCells:
        """Return another cell begun where this motion ended: coordinates, velocities and phase are carried along."""
        return cell.carried(self.last_displacement, self.last_velocity, self.last_phase)


def impacts_status(impacts: Floats, sticks: Floats, window: ImpactWindow, ended: Status) -> Status:
    """Return the status of a motion that `ended` so, from rows of the impacts and sticks that its window kept."""
    turns = impacts[:, 0] + impacts[:, 1]
    span = float(turns[-1] - turns[0]) if len(turns) else 0.0
    return window_status(sampled=len(impacts), wanted=window.keep, stuck=len(sticks) > 0, periods=span, ended=ended)


def looks_status(sticks: Floats, first: float, pressed: bool) -> Status:
    """Return the status of a full window of looks, the first of them `first` periods from time 0, from rows of sticks.

    `pressed`: a mass at rest at the stop is never released.
    """
    released = sticks[:, 2] + sticks[:, 3]
    if pressed and np.isnan(released).any():
        return Status.STUCK_FOREVER
    return Status.STICKING if (np.isnan(released) | (released > first)).any() else Status.OK


Outcome = dict[str, NDArray[Any]]


def with_stop_axis(outcome: Outcome, measurement: Measurement) -> Outcome:
    """Return the outcome of cells with one stop, with an axis for it where indices are those of each stop."""
    of_stops = {name for name, index in INDICES.items() if measurement.by_stop and index.by_stop}
    return {name: values[:, None] if name in of_stops else values for name, values in outcome.items()}


class Backend(Protocol):
    """Two questions a back end answers about cells; neither ever raises because of a cell's physics.

    `largest_tile` is how many cells it should be asked about at once, so that progress and Ctrl-C are heard;
    with fewer than `smallest_tile` part of the machine would stand idle. `known_indices` are those it can give,
    `sampler` is the back end that follows its single orbits; a `slow` one takes up to seconds per cell.
    """

    name: str
    sampler: str
    smallest_tile: int
    largest_tile: int
    known_indices: frozenset[str]
    slow: bool = False

    def check_here(self) -> None:
        """Raise `ValueError` where this machine lacks what the back end needs."""
        return

    def indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        """Return at least the indices asked for (NaN where one has no value, 0 for a whole number), `status` (int8),
        `impacts` (recorded impacts computed, int64) and `steps` (int64), each of shape (n,).
        """
        ...

    def samples(self, cells: Cells, measurement: Measurement) -> list[Samples]:
        """Return the samples that the window takes of each cell."""
        ...

    def follow(self, cell: Cells, measurement: Measurement, sampling: Measurement) -> tuple[Outcome, Samples]:
        """Return the outcome of `indices` for a single cell, and the samples that the window of `sampling` takes of it.

        A back end that can takes both from one run.
        """
        return self.indices(cell, measurement), self.samples(cell, sampling)[0]


@runtime_checkable
class SharesCells(Protocol):
    """A back end of whose cells each thread takes the next one, so that all threads end together.

    With as few cells as `alone` one thread ends as soon as several.
    """

    alone: int

    def share(
        self, cells: Cells, measurement: Measurement
    ) -> Callable[[Callable[[], bool]], Iterator[tuple[Counts, Outcome]]]:
        """Return the work of a thread, called with a function that says when to stop; it yields cells that ended, and
        their indices as `indices` gives them.
        """
        ...


def energy_loss(mass: float, restitution: float) -> float:
    """Return m (1 - r^2)/2: what an impact of unit speed costs."""
    return 0.5 * mass * (1.0 - restitution) * (1.0 + restitution)
