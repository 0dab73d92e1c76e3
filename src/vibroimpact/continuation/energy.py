"""Follow an orbit of a system without load and loss along its energy: a family of free vibrations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from vibroimpact.continuation.equations import Range
from vibroimpact.continuation.following import MOST_POINTS, Way
from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.orbits.systems.conserved import Member, member_of, misses
from vibroimpact.orbits.systems.free_families import follow, located


@dataclass(frozen=True)
class _Free:
    """A point of a branch along the energy, and its kind if it is special."""

    one: Member
    system: Any
    kind: str = ""

    @cached_property
    def orbit(self) -> Any:
        """The orbit there."""
        return self.one.orbit(self.system)

    def bifurcation(self, parameter: str) -> BifurcationPoint:
        """Return the point as a public `BifurcationPoint`."""
        residual = float(np.abs(misses(self.one.cycle, self.one.z)[0]).max() / np.abs(self.one.z).max())
        return BifurcationPoint(self.kind, parameter, self.one.joules, self.orbit, residual)


def along_energy(orbit: Any, ends: Range, longest: float, direction: float) -> Iterator[Way]:
    """Yield a branch along the energy after each orbit, with its folds and the points where multipliers meet at -1."""
    first = member_of(orbit)
    before = replace(first, tangent=direction * first.tangent)
    way = Way([_Free(before, orbit.system)])
    for after, end, why in follow(before, longest, *ends, MOST_POINTS):
        way.end, way.why = end or "budget", why
        if after is before:
            break
        for kind in before.tests:
            special = located(kind, before, after)
            if special is not None:
                way.special.append(_Free(special, orbit.system, kind))
                way.points.append(way.special[-1])
        way.points.append(_Free(after, orbit.system))
        yield way
        before = after
    yield way
