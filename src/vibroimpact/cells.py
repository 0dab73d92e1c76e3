"""Cells: designs with their initial conditions, as the one table that back ends read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Self, overload

import numpy as np
from numpy.typing import NDArray

from vibroimpact.parameters import invalid

if TYPE_CHECKING:
    from vibroimpact.model import State

Floats = NDArray[np.float64]

COUNTABLE = 2.0**53  # periods, above which floats no longer hold every whole number
BEYOND = 1e-12  # of the lengths that add up to a clearance: a smaller penetration is rounding
NOWHERE = 1e-15  # of V/w: the same where all these lengths vanish
FASTEST = 4.0  # of V: the largest velocity of the impacts spread over the impact surface


@dataclass(frozen=True)
class Cells:
    """One cell per row: the numbers of its design, then its initial condition, in named columns.

    The columns of an initial condition are `clearance`, g - y >= 0 (stored instead of y, which would round it),
    `velocity` y', and the time (`periods` + `phase`) T with whole `periods` and 0 <= phase < 1.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> cells = ImpactOscillator(gap=0.5).cells({"omega": np.array([1.0, 2.0])})
    >>> len(cells), cells["omega"].tolist(), cells["clearance"].tolist()
    (2, [1.0, 2.0], [0.5, 0.5])
    """

    # What distinguishes cycles besides n, p and means: the closest near-miss.
    parting: ClassVar[tuple[str, ...]] = ("grazing_margin",)

    table: Floats
    columns: tuple[str, ...]

    @classmethod
    def of(cls, columns: Mapping[str, Any]) -> Cells:
        """Return cells from columns of equal length, or from single numbers."""
        table = np.empty((max(getattr(column, "size", 1) for column in columns.values()), len(columns)))
        for j, column in enumerate(columns.values()):
            table[:, j] = column
        return cls(table, tuple(columns))

    @classmethod
    def at_rest(cls, numbers: Mapping[str, Any]) -> Cells:
        """Return cells of the given numbers, at rest at min(0, gap) at time 0."""
        return cls.of({**numbers, **_start(np.maximum(numbers["gap"], 0.0), 0.0, np.zeros(()))})

    @classmethod
    def join(cls, parts: Sequence[Cells]) -> Cells:
        """Return the cells of all parts, one after another."""
        return replace(parts[0], table=np.concatenate([part.table for part in parts]))

    def __len__(self) -> int:
        return len(self.table)

    def copies(self, number: int) -> Self:
        """Return `number` copies of the first cell."""
        copies: Self = self[np.zeros(number, np.int64)]  # type: ignore[assignment]
        return copies

    @property
    def coordinates(self) -> int:
        """The number of coordinates of each cell, not counting a free centre."""
        return 1

    @property
    def phases(self) -> Floats:
        """The phases of the initial conditions, in [0, 1)."""
        return self["phase"]

    @property
    def fastest_rate(self) -> Floats:
        """The fastest rate in 1/s: driving, natural or the decay of overdamped motion; it limits the step size."""
        stiff, half = self["stiffness"] / self["mass"], 0.5 * self["damping"] / self["mass"]
        over = half * half - stiff
        decay = np.where(over > 0.0, half + np.sqrt(np.maximum(over, 0.0)), 0.0)
        fastest: Floats = np.maximum(np.maximum(self["omega"], np.sqrt(stiff)), decay)
        return fastest

    @property
    def slowest_rate(self) -> Floats:
        """The driving rate or the natural one, whichever is slower."""
        slowest: Floats = np.minimum(self["omega"], np.sqrt(self["stiffness"] / self["mass"]))
        return slowest

    @property
    def velocity_scale(self) -> Floats:
        """V = max(f, k |g|) / sqrt(k m) in m/s of each cell."""
        force = np.maximum(self["amplitude"], self["stiffness"] * np.abs(self["gap"]))
        scale: Floats = force / np.sqrt(self["stiffness"] * self["mass"])
        return scale

    @overload
    def __getitem__(self, part: str) -> Floats: ...

    @overload
    def __getitem__(self, part: slice | NDArray[Any]) -> Cells: ...

    def __getitem__(self, part: str | slice | NDArray[Any]) -> Floats | Cells:
        if isinstance(part, str):
            column: Floats = self.table[:, self.columns.index(part)]
            return column
        return Cells(self.table[part], self.columns)

    def __iter__(self) -> Iterator[dict[str, float]]:
        for row in self.table.tolist():
            yield dict(zip(self.columns, row, strict=True))

    def replace(self, **columns: Any) -> Cells:
        """Return the cells with some columns changed."""
        table = self.table.copy()
        for name, values in columns.items():
            table[:, self.columns.index(name)] = values
        return Cells(table, self.columns)

    def struck(self, numbers: Any) -> Cells:
        """Return the cells, each starting with one of the numbered impacts that `spread` puts on its impact surface.

        They equal, bit for bit, a `State` at the gap with that velocity at the time of that phase. If V = 0, motions
        are similar at every speed, and 1 m/s replaces V.
        """
        phase, velocity = spread(numbers)
        scale = self.velocity_scale
        time = phase * (2.0 * np.pi / self["omega"])
        turns = time * self["omega"] / (2.0 * np.pi)
        return self.striking(0, np.where(scale > 0.0, scale, 1.0) * velocity, turns)

    def striking(self, stops: Any, velocities: Any, phases: Any) -> Cells:
        """Return the cells starting with impacts at these velocities and phases; all `stops` are number 0."""
        return self.replace(**_start(0.0, velocities, phases))

    def at(self, displacement: Any, velocity: Any, turns: Any) -> Cells:
        """Return the cells started from coordinates and velocities, a row each or one for all, at times in periods."""
        y, speed = (np.reshape(part, -1) for part in (displacement, velocity))
        return self.replace(**_start(self["gap"] - y, speed, np.asarray(turns, np.float64)))

    def carried(self, displacement: Any, velocity: Any, phases: Any) -> Cells:
        """Return the cells started from states, one row each, at phases.

        A state beyond the stop is moved to it and rests there or leaves; one beyond it by rounding alone keeps its
        velocity.
        """
        y, speed = (np.reshape(part, -1) for part in (displacement, velocity))
        reach = self.velocity_scale * np.sqrt(self["mass"] / self["stiffness"])  # f/k or |g|
        passed = y - self["gap"] > BEYOND * reach
        return self.at(np.minimum(y, self["gap"]), np.where(passed, np.minimum(speed, 0.0), speed), phases)

    def continuing(self, motion: Any) -> Cells:
        """Return the cell started where a sampled motion ended; one mass keeps its clearance, also at another gap."""
        if math.isnan(motion.last_clearance):
            return self.carried(motion.last_displacement, motion.last_velocity, motion.last_phase)
        last = {"clearance": motion.last_clearance, "velocity": motion.last_velocity, "phase": motion.last_phase}
        return self.replace(**last, periods=0.0)

    def beyond(self) -> Floats:
        """Return the depth in m of each initial condition beyond the stop, as one column; 0 in front of the stop."""
        return np.maximum(-self["clearance"], 0.0)[:, None]

    def begun(self, start: State | None, names: Sequence[str] = ()) -> Cells:
        """Return the cells started from an initial condition; None leaves them as they are.

        Raises
        ------
        ValueError
            The initial condition lies beyond the stop of a cell, or is 2^53 driving periods or more from time 0.
        """
        if start is None:
            return self
        turns = start.time * self["omega"] / (2.0 * np.pi)
        _check_start(start, self["gap"], turns, NOWHERE * self.velocity_scale / self["omega"])
        return self.replace(**_start(np.maximum(self["gap"] - start.displacement, 0.0), start.velocity, turns))


def spread(numbers: Any, further: int = 0) -> tuple[Floats, ...]:
    """Return the phases, 0 to 1, and velocities, 0 to 4 V, of numbered impacts, spread evenly and always the same.

    They are followed by `further` arrays of numbers from -1 to 1.

    Examples
    --------
    >>> phase, velocity = spread([0, 1, 2])
    >>> phase.round(3).tolist(), velocity.round(3).tolist()
    ([0.5, 0.255, 0.01], [2.0, 0.279, 2.559])
    """
    counted = np.asarray(numbers, np.float64)
    phase, part, *others = (np.mod(0.5 + counted * stride, 1.0) for stride in _strides(2 + further))
    return phase, FASTEST * part, *(2.0 * other - 1.0 for other in others)


@cache
def _strides(number: int) -> tuple[float, ...]:
    """Return 1/x, 1/x^2, ... with x^(number + 1) = x + 1: strides that spread points evenly in `number` dimensions."""
    x = 1.0
    for _ in range(200):
        x = (1.0 + x) ** (1.0 / (number + 1))
    return tuple(x**-power for power in range(1, number + 1))


@dataclass(frozen=True)
class Tiling:
    """A grid of cells cut into equal boxes; those at the far edges may be smaller."""

    shape: tuple[int, ...]  # cells along each axis of the grid
    tile: tuple[int, ...]  # cells along each axis of a tile

    @property
    def counts(self) -> tuple[int, ...]:
        """The number of tiles along each axis."""
        return tuple(-(-cells // side) for cells, side in zip(self.shape, self.tile, strict=True))

    def __len__(self) -> int:
        return math.prod(self.counts)

    def __getitem__(self, number: int) -> tuple[slice, ...]:
        """Return the slices of tile `number`; the last axis varies fastest."""
        places = []
        for count, side, cells in zip(self.counts[::-1], self.tile[::-1], self.shape[::-1], strict=True):
            number, at = divmod(number, count)
            places.append(slice(at * side, min((at + 1) * side, cells)))
        return tuple(places[::-1])

    def cells(self, number: int) -> int:
        """Return the number of cells in a tile."""
        return math.prod(part.stop - part.start for part in self[number])


def _start(clearance: Any, velocity: Any, turns: Floats) -> dict[str, Any]:
    whole = np.floor(turns)
    return {"clearance": clearance, "velocity": velocity, "periods": whole, "phase": turns - whole}


def _check_start(start: State, gap: Floats, turns: Floats, nowhere: Floats) -> None:
    if isinstance(start.displacement, tuple):
        raise invalid(
            "start", start, "a State of one mass", "give its displacement and velocity as numbers, not as lists"
        )
    nearest = float(np.min(gap, initial=np.inf))
    rounding = BEYOND * (abs(nearest) + abs(start.displacement)) + float(np.min(nowhere, initial=np.inf))
    if start.displacement - nearest > rounding:
        raise ValueError(
            f"`start` must have a displacement of at most the gap, {nearest:g} m here, got {start.displacement!r}; "
            "place the mass in front of the stop"
        )
    most = float(np.max(np.abs(turns), initial=0.0))
    if not most < COUNTABLE:
        raise ValueError(
            f"`start` must have a time of less than 2^53 driving periods, as floats count no further, got "
            f"{start.time!r} ({most:.3g} periods); choose a time nearer to 0"
        )
