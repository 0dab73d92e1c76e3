"""Follow an orbit that rests at a stop along a parameter: each orbit is found from the one before."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from vibroimpact.orbits.search import find_orbit

NEAREST = 2.0**-52  # of a value: steps are halved down to neighbouring floating-point numbers
SUDDEN = 0.05  # largest change per step, in time at rest over T or of the hardest impact


def resting_orbits(orbit: Any, parameter: str, goal: float, longest: float) -> Iterator[Any]:
    """Yield an orbit and the next ones towards another value of a parameter, as long as they rest at a stop.

    Steps have the length `longest` and are halved wherever no orbit is found near the last one, down to neighbouring
    floating-point numbers.
    """
    value, step, easy = orbit.value(parameter), longest, True
    finest = NEAREST * max(abs(value), abs(goal))
    yield orbit
    while value != goal and step >= finest:
        further = goal if abs(goal - value) <= step else value + step * (1.0 if goal > value else -1.0)
        model = orbit.model.replace(**{parameter: further})
        found = find_orbit(model, n_periods=orbit.n_periods, n_impacts=-1, near=orbit)
        if not found or _change(orbit, found[0]) > SUDDEN:
            step, easy = 0.5 * min(step, abs(goal - value)), False
            continue
        value, orbit = further, found[0]
        yield orbit
        step, easy = min(longest, 2.0 * step) if easy else step, True


def _change(one: Any, other: Any) -> float:
    """Return the change between two orbits, in time at rest over T or relative to their hardest impacts.

    With one coordinate a rest erases all memory, so no other orbit rests at the same stops.
    """
    if one.oscillator.coordinates == 1 and {rest.stop for rest in one.rests} == {rest.stop for rest in other.rests}:
        return 0.0
    rested = abs(one.stuck_time / one.oscillator.period - other.stuck_time / other.oscillator.period)
    hardest = max(one.velocities), max(other.velocities)
    return float(max(rested, 1.0 - min(hardest) / max(hardest)))
