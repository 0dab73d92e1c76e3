"""Designs with their starts, as the one table that back ends read."""

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
    from vibroimpact.model.oscillator import ImpactOscillator

Floats = NDArray[np.float64]

COUNTABLE = 2.0**53  # periods: the next whole number is the next number
BEYOND = 1e-12  # of the lengths that a clearance is the sum of: so little beyond a stop is rounding
NOWHERE = 1e-15  # of V over the fastest rate: the same where all these lengths vanish
FASTEST = 4.0  # of V: the hardest of the impacts that are spread over the impact surface


@dataclass(frozen=True)
class Cells:
    """One cell per row: the numbers of its design, then its start, in named columns.

    The columns of a start are `clearance`, g - y >= 0 (carried instead of y, which would round it), `velocity` y',
    and the start time (`periods` + `phase`) T with whole `periods` and 0 <= phase < 1.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> cells = ImpactOscillator(gap=0.5).cells({"omega": np.array([1.0, 2.0])})
    >>> len(cells), cells["omega"].tolist(), cells["clearance"].tolist()
    (2, [1.0, 2.0], [0.5, 0.5])
    """

    # Beside n, p and means, what parts the cycles that cells lead to: the closest near-miss.
    parting: ClassVar[tuple[str, ...]] = ("grazing_margin",)

    table: Floats
    columns: tuple[str, ...]

    @classmethod
    def of(cls, columns: Mapping[str, Any]) -> Cells:
        """Return cells from columns of one length, or single numbers."""
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
        """Return the cells of all parts, one behind the other."""
        return replace(parts[0], table=np.concatenate([part.table for part in parts]))

    def __len__(self) -> int:
        return len(self.table)

    def copies(self, number: int) -> Self:
        """Return so many cells like the first one."""
        copies: Self = self[np.zeros(number, np.int64)]  # type: ignore[assignment]
        return copies

    @property
    def coordinates(self) -> int:
        """How many coordinates each cell has, a free centre not counted."""
        return 1

    @property
    def phases(self) -> Floats:
        """The phases at which cells start, in [0, 1)."""
        return self["phase"]

    @property
    def fastest_rate(self) -> Floats:
        """The driving rate, the natural one, or the fast decay of overdamped motion: steps are as short as it asks."""
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
        """Return the cells, each from a numbered impact of those spread over its own impact surface.

        They have the bits of a `State` at the gap with that velocity, at the phase's time. Without a scale (V = 0) the
        motions are alike at every speed, and 1 m/s stands for V.
        """
        phase, velocity = spread(numbers)
        scale = self.velocity_scale
        time = phase * (2.0 * np.pi / self["omega"])
        turns = time * self["omega"] / (2.0 * np.pi)
        return self.striking(0, np.where(scale > 0.0, scale, 1.0) * velocity, turns)

    def striking(self, stops: Any, velocities: Any, phases: Any) -> Cells:
        """Return the cells with the stop struck at velocities and phases; all `stops` are number 0."""
        return self.replace(**_start(0.0, velocities, phases))

    def at(self, displacement: Any, velocity: Any, turns: Any) -> Cells:
        """Return the cells from coordinates and velocities, a row each or one for all, at times in driving periods."""
        y, speed = (np.reshape(part, -1) for part in (displacement, velocity))
        return self.replace(**_start(self["gap"] - y, speed, np.asarray(turns, np.float64)))

    def carried(self, displacement: Any, velocity: Any, phases: Any) -> Cells:
        """Return the cells from states, a row each, at phases; beyond the stop, from rest at it or leaving it.

        What is beyond it by rounding alone is at the stop.
        """
        y, speed = (np.reshape(part, -1) for part in (displacement, velocity))
        reach = self.velocity_scale * np.sqrt(self["mass"] / self["stiffness"])  # f/k or |g|
        passed = y - self["gap"] > BEYOND * reach
        return self.at(np.minimum(y, self["gap"]), np.where(passed, np.minimum(speed, 0.0), speed), phases)

    def beyond(self) -> Floats:
        """Return the depth in m of each start beyond the stop, its only column; 0 before it."""
        return np.maximum(-self["clearance"], 0.0)[:, None]

    def begun(self, start: State | None) -> Cells:
        """Return the cells from an initial condition; None leaves them as they are.

        Raises
        ------
        ValueError
            It lies beyond the stop of one of them, or so many periods from time 0 that they cannot be counted.
        """
        if start is None:
            return self
        turns = start.time * self["omega"] / (2.0 * np.pi)
        _check_start(start, self["gap"], turns, NOWHERE * self.velocity_scale / self.fastest_rate)
        return self.replace(**_start(np.maximum(self["gap"] - start.displacement, 0.0), start.velocity, turns))


def spread(numbers: Any, further: int = 0) -> tuple[Floats, ...]:
    """Return the phases, 0 to 1, and velocities, 0 to 4 of V, of numbered impacts, spread evenly and always the same.

    Of each of `further` quantities they are followed by its numbers, -1 to 1.

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
    """Return 1/x, 1/x^2, ... with x^(number + 1) = x + 1: what spreads points most evenly over so many quantities."""
    x = 1.0
    for _ in range(200):
        x = (1.0 + x) ** (1.0 / (number + 1))
    return tuple(x**-power for power in range(1, number + 1))


@dataclass(frozen=True)
class Tiling:
    """A grid of cells cut into equal boxes, those at the far edges smaller."""

    shape: tuple[int, ...]  # cells along each axis of the grid
    tile: tuple[int, ...]  # and of a tile

    @property
    def counts(self) -> tuple[int, ...]:
        """Tiles along each axis."""
        return tuple(-(-cells // side) for cells, side in zip(self.shape, self.tile, strict=True))

    def __len__(self) -> int:
        return math.prod(self.counts)

    def __getitem__(self, number: int) -> tuple[slice, ...]:
        """Return the place of tile `number`, the last axis fastest."""
        places = []
        for count, side, cells in zip(self.counts[::-1], self.tile[::-1], self.shape[::-1], strict=True):
            number, at = divmod(number, count)
            places.append(slice(at * side, min((at + 1) * side, cells)))
        return tuple(places[::-1])

    def cells(self, number: int) -> int:
        """Return the number of cells in a tile."""
        return math.prod(part.stop - part.start for part in self[number])


def cells_at(osc: ImpactOscillator, clearance: Floats, velocity: Floats, turns: Floats) -> Cells:
    """Return one cell of an oscillator per start, at times in driving periods."""
    return Cells.of(osc.values | _start(clearance, velocity, turns))


def _start(clearance: Any, velocity: Any, turns: Floats) -> dict[str, Any]:
    whole = np.floor(turns)
    return {"clearance": clearance, "velocity": velocity, "periods": whole, "phase": turns - whole}


def check_single(name: str, start: State) -> None:
    """Refuse an initial condition of several coordinates for one mass."""
    if isinstance(start.displacement, tuple):
        raise invalid(name, start, "a State of one mass", "give its displacement and velocity as numbers, not as lists")


def _check_start(start: State, gap: Floats, turns: Floats, nowhere: Floats) -> None:
    check_single("start", start)
    nearest = float(np.min(gap, initial=np.inf))
    rounding = BEYOND * (abs(nearest) + abs(start.displacement)) + float(np.min(nowhere, initial=np.inf))
    if start.displacement - nearest > rounding:
        raise ValueError(
            f"`start` must have a displacement of at most the gap, {nearest:g} m here, got {start.displacement!r}; "
            "start the mass in front of the stop"
        )
    most = float(np.max(np.abs(turns), initial=0.0))
    if not most < COUNTABLE:
        raise ValueError(
            f"`start` must have a time of less than 2^53 driving periods, beyond which they cannot be counted, got "
            f"{start.time!r} ({most:.3g} periods); start nearer to time 0"
        )
