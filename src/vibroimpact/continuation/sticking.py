"""The end of sticking as a curve in two parameters, followed on small circles about its last point.

On a small circle about a point of the curve, the sticking cycle exists on one arc. The forward end of that arc is the
next point, found by bisection. The curve has a corner where a graze lies on it, and turns by almost pi at the tip of a
tongue, where a line normal to its tangent would miss it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

from vibroimpact.coexistence.final import release_phase
from vibroimpact.continuation.equations import Range
from vibroimpact.continuation.following import EDGE, GROWTH, UNKNOWN, Way
from vibroimpact.model import Model, State
from vibroimpact.options import Tolerances
from vibroimpact.orbits.orbit import Orbit, family_of, value_of
from vibroimpact.orbits.sticking import Stick, from_release, sticking_orbit
from vibroimpact.orbits.sticking_end import KIND, MET, residual
from vibroimpact.progress import Report

Place = tuple[float, float]  # in a plane, relative to its ranges and to the beginning of the curve
Path = Callable[[float], Place]

# Radians to either side of the last direction, tried in turn; the largest ones lead around the tip of a tongue.
FANS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.4, 2.0, 2.4, 2.8, 3.0, 3.08, 3.12, math.pi)
LONGEST_STEP = 0.02  # of the ranges: the largest distance between points
FINEST_STEP = 1 / 1024  # of the step: largest distance between points on either side of a corner
BAND = 0.12  # of the chord between points: largest deviation of the curve from it
MOST = 2000  # points to either side
AIM = 1e-2  # of the distance to the expected end: offset from it of the next test


@dataclass(frozen=True)
class CurvePoint:
    """A point of the curve: the last sticking cycle; at the neighbouring floating-point numbers there is none."""

    model: Model
    stick: Stick | None
    n_periods: int
    kind: str = KIND
    touched: str = ""

    @cached_property
    def orbit(self) -> Orbit:
        """The last cycle before sticking ends; at the last bit its stick may be lost already."""
        if self.stick and self.stick.periods == self.n_periods:
            return sticking_orbit(self.model, self.stick, Tolerances().chatter)
        osc = self.model.at()
        release = State(osc.gap, 0.0, release_phase(osc) * osc.period)
        return Orbit(osc, self.n_periods, -1, (), (), (0j, 0j), family=family_of(self.model, osc), start=release)

    @property
    def residual(self) -> float:
        """The distance between the end of the chatter and the release (stuck time / T)^(1/e)."""
        return residual(self.model.at().restitution, self.stick.fraction if self.stick else math.nan)

    @property
    def touch_phase(self) -> float:
        """Driving phase of the release."""
        return self.stick.release_phase if self.stick else math.nan


@dataclass
class Sticking:
    """The region of a period-n sticking cycle in a plane of two parameters, relative to the model's own values.

    Beyond the edges of the ranges, values at the edge are used.
    """

    model: Model
    names: tuple[str, str]
    ranges: tuple[Range, Range]
    n_periods: int
    report: Report
    done: int = field(default=0, init=False)  # points
    why: str = field(default="", init=False)  # reason why no end was found

    @cached_property
    def _spans(self) -> list[tuple[float, Range]]:
        return [(value_of(self.model, name), ends) for name, ends in zip(self.names, self.ranges, strict=True)]

    def inside(self, at: Place) -> Place:
        """Return the nearest place within the ranges."""
        edges = [((low - origin) / (high - low), (high - origin) / (high - low)) for origin, (low, high) in self._spans]
        x, y = (min(max(z, low), high) for z, (low, high) in zip(at, edges, strict=True))
        return x, y

    def values(self, at: Place) -> list[float]:
        """Return the two parameters."""
        pairs = zip(at, self._spans, strict=True)
        return [min(max(origin + z * (high - low), low), high) for z, (origin, (low, high)) in pairs]

    def model_at(self, at: Place) -> Model:
        """Return the model at a place."""
        return self.model.replace(**dict(zip(self.names, self.values(at), strict=True)))

    def stick(self, at: Place) -> Stick | None:
        """Return the stick that closes a cycle of at most `n_periods`, or None."""
        self.report(self.done, UNKNOWN, None)
        return from_release(self.model_at(at).at(), self.n_periods)

    def point(self, at: Place) -> CurvePoint:
        """Return a place on the curve as one of its points."""
        return CurvePoint(self.model_at(at), self.stick(at), self.n_periods)

    def stuck(self, at: Place) -> float:
        """Return the stuck time over T of the cycle; NaN where the cycle does not exist."""
        stick = self.stick(at)
        return stick.fraction if stick and stick.periods == self.n_periods else math.nan

    def sticks(self, at: Place) -> bool:
        """Whether the cycle exists at a place."""
        return not math.isnan(self.stuck(at))

    def _level(self, at: Place) -> float:
        """Return the level that falls linearly to zero at the end of the cycle; NaN where the cycle does not exist."""
        return residual(self.model_at(at).at().restitution, self.stuck(at))

    def end(self, path: Path, out: float, into: float) -> float | None:
        """Return the last place on a path with the cycle; None if it ends for a reason other than its chatter's end."""
        before, last = (math.nan, math.nan), (into, self._level(path(into)))  # where it sticks
        beside = AIM
        while (middle := 0.5 * (out + into)) not in (out, into) and self.values(path(out)) != self.values(path(into)):
            # The level falls linearly to zero at the end: test next to the extrapolated zero, inside and outside in
            # turn, and in the middle if that is not between.
            away = last[1] * (last[0] - before[0]) / (last[1] - before[1]) if last[1] != before[1] else math.nan
            trial, beside = last[0] - away * (1.0 - beside), -beside
            if not min(out, into) < trial < max(out, into) or not abs(away) < 2.0 * abs(into - out):
                trial = middle
            level = self._level(path(trial))
            if math.isnan(level):
                out = trial
            else:
                into, before, last = trial, last, (trial, level)
        if self._level(path(into)) <= MET:
            return into
        other = self.stick(path(out))
        self.why = (
            f"beyond it the mass comes to rest earlier, in a cycle of n = {other.periods}"
            if other and other.periods < self.n_periods
            else "its stuck time does not go to zero"
        )
        return None

    def crossing(self, path: Path, side: int) -> float | None:
        """Return the end closest to 0 on a path, with the cycle on its positive (1) or negative (-1) side."""
        sticks: dict[float, bool] = {}
        for fan in FANS:
            sticks |= {-fan: self.sticks(path(-fan)), fan: self.sticks(path(fan))}
            pairs = [(a, b)[::side] for a, b in pairwise(sorted(sticks)) if (sticks[b] - sticks[a]) * side > 0]
            for out, into in sorted(pairs, key=lambda pair: abs(pair[0] + pair[1])):
                if (end := self.end(path, out, into)) is not None:
                    return end
        return None

    def joined(self, a: Place, b: Place, side: int) -> bool:
        """Whether two points lie on the same piece of the curve: it follows the chord between them."""
        dx, dy, off = b[0] - a[0], b[1] - a[1], side * BAND
        for share in (0.25, 0.5, 0.75):
            x, y = a[0] + share * dx, a[1] + share * dy
            if not self.sticks((x - off * dy, y + off * dx)) or self.sticks((x + off * dy, y - off * dx)):
                return False
        return True


def sticking_curve(sticking: Sticking, longest: float, most: int, side: float) -> Iterator[Way]:
    """Yield the curve through the origin of a plane as far as it has been followed, after each point.

    The cycle is to its left (`side` 1) or right (-1). Each point lies on neighbouring floating-point numbers, at most
    `longest` of the ranges from the previous point. The curve ends at an edge of the ranges, closed, after `most`
    points, or lost, for example where a chatter in an earlier period completes first. A point takes about 45 runs from
    the release, with a progress report before each: about 10 ms at r = 0.8. Residuals are below 1e-10, except near a
    graze in the flight, where the stuck time changes with infinite slope.
    """
    start = (0.0, 0.0)
    way, last, heading, step, finest = Way([sticking.point(start)]), start, 0.0, longest, longest * FINEST_STEP
    while len(way.points) <= most:
        path = _circle(last, step, heading)
        angle = sticking.crossing(path, int(side))
        place = last if angle is None else path(angle)
        inside = sticking.inside(place)  # values are constant beyond the edge
        moved = math.dist(inside, last) > EDGE  # a first point on the edge does not count twice
        if angle is None or not (step <= finest or not moved or sticking.joined(last, inside, int(side))):
            if step <= finest:
                way.end, way.why = "lost", sticking.why
                break
            step = max(0.5 * step, finest)
            continue
        if moved:
            way.points.append(sticking.point(place))
        if inside != place:
            way.end = "range"
            break
        sticking.done += 1
        last, heading, step = place, heading + angle, min(longest, GROWTH * step)
        if len(way.points) > 4 and math.dist(last, start) < 0.75 * step and sticking.joined(last, start, int(side)):
            way.points.append(way.points[0])
            way.end = "closed"
            break
        yield way
    yield way


def _circle(centre: Place, radius: float, heading: float) -> Path:
    """Return the places on a circle by their angles from a direction."""
    return lambda angle: (
        centre[0] + radius * math.cos(heading + angle),
        centre[1] + radius * math.sin(heading + angle),
    )
