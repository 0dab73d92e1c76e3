"""An orbit that rests at a stop, along a parameter: found again, value by value, from the last one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from vibroimpact.orbits.search import find_orbit

NEAREST = 2.0**-52  # of a value: steps end where values are neighbouring numbers
SUDDEN = 0.05  # a change from orbit to orbit, of T at rest or of the hardest hit, that asks for a shorter step


def resting_orbits(orbit: Any, parameter: str, goal: float, longest: float) -> Iterator[Any]:
    """Yield an orbit and those that follow it on the way to another value of a parameter, while they rest at a stop.

    Steps are as long as `longest`, halved wherever no orbit is found near the last one, down to neighbouring numbers.
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
    """Return how far two orbits are from each other, in T at rest or in shares of their hardest hits.

    Of one coordinate a rest leaves no memory, so that no other orbit rests at the same stops.
    """
    if one.oscillator.coordinates == 1 and {rest.stop for rest in one.rests} == {rest.stop for rest in other.rests}:
        return 0.0
    rested = abs(one.stuck_time / one.oscillator.period - other.stuck_time / other.oscillator.period)
    hardest = max(one.velocities), max(other.velocities)
    return float(max(rested, 1.0 - min(hardest) / max(hardest)))
