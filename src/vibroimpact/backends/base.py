"""What every back end promises: cells in, indices or samples out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Cells
from vibroimpact.indices import VELOCITY_INDICES
from vibroimpact.options import Tolerances

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
        """Return when a cell that starts at (periods + phase) T is looked at, as whole periods and phase."""
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
    """What is asked of each cell.

    With `early_closing` a cell ends once its cycle is certain, and its sums are finished in closed form. Samples are
    what the window sees; they take nothing but window and tolerances.
    """

    window: ImpactWindow | StroboscopicWindow
    tolerances: Tolerances = field(default_factory=Tolerances)
    early_closing: bool = True
    indices: tuple[str, ...] = ("std",)

    @property
    def impacts(self) -> ImpactWindow:
        """The window of impacts over which indices are taken."""
        if not isinstance(self.window, ImpactWindow):
            raise TypeError("indices are taken over impacts")
        return self.window

    @property
    def thorough(self) -> bool:
        """Whether sums over impact velocities do not suffice for the indices."""
        return not VELOCITY_INDICES.issuperset(self.indices)


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


Outcome = dict[str, NDArray[Any]]


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
        """Return what the window sees of each cell."""
        ...

    def follow(self, cell: Cells, measurement: Measurement, seen: Measurement) -> tuple[Outcome, Samples]:
        """Return what `indices` gives for a single cell, and what the window of `seen` sees of it.

        A back end that can takes both from one run.
        """
        return self.indices(cell, measurement), self.samples(cell, seen)[0]


@runtime_checkable
class SharesCells(Protocol):
    """A back end of whose cells each thread takes the next one, so that all threads end together."""

    def share(
        self, cells: Cells, measurement: Measurement
    ) -> Callable[[Callable[[], bool]], Iterator[tuple[Counts, Outcome]]]:
        """Return what each thread calls with a function that says when to stop; it yields which cells have ended, and
        their indices as `indices` gives them.
        """
        ...
