"""Where sticking ends, as a boundary like the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from vibroimpact.continuation.results import Boundary
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.sticking import find_sticking_orbit, from_release
from vibroimpact.orbits.sticking_curve import continue_end_of_sticking
from vibroimpact.orbits.sticking_end import StickingEnd, end_of_sticking
from vibroimpact.oscillator import ImpactOscillator

Range = tuple[float, float]
LONGEST_STEP = 0.02  # of the ranges


def sticking_boundary(
    point: StickingEnd,
    parameters: tuple[str, str],
    ranges: tuple[Range, Range],
    step: float | None = None,
    look: Callable[[], object] = bool,
) -> Boundary:
    """Return the curve on which the sticking cycle of `point` ends; `look` is called along the way and may raise."""
    longest = None if step is None else min(step, LONGEST_STEP)
    curve = continue_end_of_sticking(point, parameters, ranges, longest, look)
    rows = zip(curve.values[0].tolist(), curve.values[1].tolist(), strict=True)
    ends = ("range" if curve.outcome == "complete" else curve.outcome,) * 2
    return Boundary(
        curve.kind,
        curve.parameters,
        [
            _orbit(point.oscillator.replace(**dict(zip(curve.parameters, row, strict=True))), curve, look)
            for row in rows
        ],
        curve.residual.tolist(),
        curve.release_phase.tolist(),
        ends,
        curve.message,
    )


def _orbit(osc: ImpactOscillator, curve: Any, look: Callable[[], object]) -> Orbit:
    """Return the cycle about to be lost; on the last bit its stick may be gone already."""
    look()
    found = find_sticking_orbit(osc, curve.n_periods)
    return found[0] if found else Orbit(osc, curve.n_periods, -1, (), (), (0j, 0j))


def ends_on_line(
    osc: ImpactOscillator,
    parameter: str,
    range: Range,
    lengths: Sequence[int],
    seeds: int,
    look: Callable[[], object] = bool,
) -> Iterator[StickingEnd]:
    """Yield the ends of period-n sticking, n in `lengths`, along a line, as far as neighbouring seeds tell them."""

    def periods(value: float) -> int:
        look()
        stick = from_release(osc.replace(**{parameter: value}), max(lengths))
        return stick.periods if stick else 0

    values = np.linspace(*range, seeds).tolist()
    names = [periods(value) for value in values]
    for (low, before), (high, after) in pairwise(zip(values, names, strict=True)):
        if before != after and {before, after} & set(lengths):
            inside, beyond = (low, high) if before in lengths else (high, low)
            end = end_of_sticking(osc.replace(**{parameter: inside}), parameter, (inside, beyond), longest=max(lengths))
            if end.found and end.n_periods in lengths:
                yield end
