"""How far the nearest boundary is in each parameter, and what lies beyond."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from vibroimpact.backends import ImpactWindow
from vibroimpact.verdict.edges import Edge, Found
from vibroimpact.verdict.exact import exact_boundary
from vibroimpact.verdict.present import Present
from vibroimpact.verdict.reach import Reach
from vibroimpact.verdict.readings import Laboratory
from vibroimpact.verdict.tracks import bisected_boundaries

ACROSS = ImpactWindow(1500, 2000)  # close to a boundary motions settle slowly
BOTH = (-1, 1)


def nearest_boundaries(
    present: Present,
    reaches: Sequence[Reach],
    laboratory: Laboratory,
    done: Callable[[], bool] = lambda: True,
) -> tuple[Edge, ...]:
    """Return the nearest boundary of a motion down and up each parameter; `done` hears of each, False stops."""
    found: dict[tuple[str, int], Found] = {}
    unknown: list[tuple[Reach, int]] = []
    for reach in reaches:
        for direction in BOTH:
            known = exact_boundary(present, reach, direction)
            if known is None:
                unknown.append((reach, direction))
            else:
                found[reach.name, direction] = known
        if not done():
            return ()
    for known in bisected_boundaries(present, unknown, laboratory):
        found[known.reach.name, known.direction] = known
    return _looked_beyond(present, [found[r.name, direction] for r in reaches for direction in BOTH], laboratory)


def _looked_beyond(present: Present, found: Sequence[Found], laboratory: Laboratory) -> tuple[Edge, ...]:
    values = [boundary.beyond_at() for boundary in found]
    beyond = [i for i, value in enumerate(values) if not math.isnan(value)]
    there = [found[i].reach.at(present.oscillator, values[i]) for i in beyond]
    readings = laboratory.read(there, [found[i].start for i in beyond], ACROSS)
    names = {i: reading.name for i, reading in zip(beyond, readings, strict=True) if reading.kind != "undecided"}
    return tuple(boundary.edge(names.get(i, ""), values[i]) for i, boundary in enumerate(found))
