"""What is zero at a bifurcation of a cycle: functions of all its multipliers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.continuation.equations import DOUBLING, FOLD, TORUS


def _nearest_zero(values: Sequence[complex] | NDArray[np.complex128]) -> float:
    """Return the product of the two numbers closest to zero, with the sign of the product of all, which is real."""
    sizes = np.sort(np.abs(values))
    if not np.isfinite(sizes).all() or sizes[0] == 0.0:
        return 0.0 if np.isfinite(sizes).all() else math.inf
    return math.copysign(float(np.prod(sizes[:2])), float(np.prod(np.array(values) / np.abs(values)).real))


def _products(multipliers: Sequence[complex]) -> NDArray[np.complex128]:
    """Return the products of all pairs."""
    with np.errstate(invalid="ignore"):  # one is infinite at a graze
        return np.asarray(np.outer(multipliers, multipliers)[np.triu_indices(len(multipliers), 1)])


TESTS: dict[str, Any] = {
    FOLD: lambda multipliers: _nearest_zero([1.0 - value for value in multipliers]),
    DOUBLING: lambda multipliers: _nearest_zero([1.0 + value for value in multipliers]),
    TORUS: lambda multipliers: _nearest_zero(1.0 - _products(multipliers)) if len(multipliers) > 2 else 1.0,
}
