"""What every back end promises: cells in, indices or samples out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from vibroimpact.indices import VELOCITY_INDICES
from vibroimpact.options import Tolerances

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]


@dataclass(frozen=True)
class Cells:
    """Parameter points with their starts, one array entry a cell, all of shape (n,).

    `clearance` is g - y >= 0 at the start (carried instead of y, which would round it), `velocity`
    is y', and the start time is (`periods` + `phase`) T with whole `periods` and 0 <= phase < 1.
    """

    mass: Floats
    damping: Floats
    stiffness: Floats
    amplitude: Floats
    omega: Floats
    restitution: Floats
    gap: Floats
    clearance: Floats
    velocity: Floats
    periods: Floats
    phase: Floats

    def __len__(self) -> int:
        return len(self.mass)

    def __getitem__(self, part: slice | NDArray[Any]) -> Cells:
        return replace(self, **{field.name: getattr(self, field.name)[part] for field in fields(self)})


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


def look_schedule(periods: float, phase: float, window: StroboscopicWindow) -> tuple[Floats, Floats]:
    """Return when a window looks at a cell that starts at (periods + phase) T, as whole periods and phase."""
    first = periods + window.skip_periods
    if window.phase is not None:
        first += 1.0 if window.phase < phase else 0.0
        phase = window.phase
    offset = np.arange(window.keep)
    fraction: Floats = phase + (offset % window.per_period) / window.per_period
    whole: Floats = np.floor(fraction)
    return first + offset // window.per_period + whole, fraction - whole


Outcome = dict[str, NDArray[Any]]


class Backend(Protocol):
    """Two questions a back end answers about cells; neither ever raises because of a cell's physics.

    `largest_tile` is how many cells it should be asked about at once, so that progress and Ctrl-C are heard;
    with fewer than `smallest_tile` part of the machine would stand idle. `tells` are the indices it knows.
    """

    name: str
    smallest_tile: int
    largest_tile: int
    tells: frozenset[str]

    def indices(
        self,
        cells: Cells,
        window: ImpactWindow,
        tolerances: Tolerances,
        early_closing: bool = True,
        names: Iterable[str] = VELOCITY_INDICES,
    ) -> Outcome:
        """Return at least the indices `names` (NaN where one has no value, 0 for a whole number), `status` (int8),
        `impacts` (recorded impacts computed, int64) and `steps` (int64), each of shape (n,).
        """
        ...

    def samples(self, cells: Cells, window: ImpactWindow | StroboscopicWindow, tolerances: Tolerances) -> list[Samples]:
        """Return what the window sees of each cell."""
        ...


@runtime_checkable
class SharesCells(Protocol):
    """A back end of whose cells each thread takes the next one, so that all threads end together."""

    def share(
        self,
        cells: Cells,
        window: ImpactWindow,
        tolerances: Tolerances,
        early_closing: bool = True,
        names: Iterable[str] = VELOCITY_INDICES,
    ) -> Callable[[Callable[[], bool]], Iterator[tuple[Counts, Outcome]]]:
        """Return what each thread calls with a function that says when to stop; it yields which cells have ended, and
        their indices as `indices` gives them.
        """
        ...
