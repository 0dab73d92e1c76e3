"""Designs with their starts, as the one table that back ends read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from vibroimpact.oscillator import ImpactOscillator, State

Floats = NDArray[np.float64]

COUNTABLE = 2.0**53  # periods: the next whole number is the next number


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

    table: Floats
    columns: tuple[str, ...]

    @classmethod
    def of(cls, columns: Mapping[str, Any]) -> Cells:
        """Return cells from columns of one length, or single numbers."""
        values = np.broadcast_arrays(*(np.asarray(column, np.float64) for column in columns.values()))
        return cls(np.stack([np.ravel(column) for column in values], axis=1), tuple(columns))

    @classmethod
    def at_rest(cls, numbers: Mapping[str, Any]) -> Cells:
        """Return cells of the given numbers, at rest at min(0, gap) at time 0."""
        return cls.of({**numbers, **_start(np.maximum(numbers["gap"], 0.0), 0.0, np.zeros(()))})

    @classmethod
    def join(cls, parts: Sequence[Cells]) -> Cells:
        """Return the cells of all parts, one behind the other."""
        return cls(np.concatenate([part.table for part in parts]), parts[0].columns)

    def __len__(self) -> int:
        return len(self.table)

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
        _check_start(start, self["gap"], turns)
        return self.replace(**_start(self["gap"] - start.displacement, start.velocity, turns))


def cells_at(osc: ImpactOscillator, clearance: Floats, velocity: Floats, turns: Floats) -> Cells:
    """Return one cell of an oscillator per start, at times in driving periods."""
    return Cells.of(asdict(osc) | _start(clearance, velocity, turns))


def _start(clearance: Any, velocity: Any, turns: Floats) -> dict[str, Any]:
    whole = np.floor(turns)
    return {"clearance": clearance, "velocity": velocity, "periods": whole, "phase": turns - whole}


def _check_start(start: State, gap: Floats, turns: Floats) -> None:
    nearest = float(np.min(gap, initial=np.inf))
    if start.displacement > nearest:
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
