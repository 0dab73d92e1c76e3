"""The end of sticking as a curve in two parameters, followed by circles about its last point.

On a small circle about a point of the boundary the sticking cycle lives on one arc. Where that arc ends, ahead, lies
the next point: found by bisection, on a path that a corner of the curve cannot evade as it could a straight line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from vibroimpact.continuation.following import UNKNOWN, Way, both_ways
from vibroimpact.continuation.results import Boundary
from vibroimpact.model import Model
from vibroimpact.options import Tolerances
from vibroimpact.orbits.orbit import Orbit, family_of, value_of
from vibroimpact.orbits.sticking import (
    KIND,
    MET,
    Stick,
    StickingEnd,
    end_of_sticking,
    from_release,
    periods_from_release,
    residual,
    sticking_orbit,
)
from vibroimpact.progress import Report

Point = tuple[float, float]
Range = tuple[float, float]

# Radians to either side of the tangent, tried in turn; the last ones lead back along a tongue, around its tip.
FANS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.4, 2.0, 2.4, 2.8, 3.0, 3.08, 3.12)
ALL_ROUND = 48  # directions tried about the first point
LONGEST_STEP = 0.02  # of the ranges: the longest distance between points that `continue_boundary` takes
FINEST_STEP = 1 / 1024  # of the step: only so close together may points lie on either side of a corner
BAND = 0.12  # of the chord between points: how far off it the curve may lie
MOST = 2000  # points to either side
AIM = 1e-2  # of the distance to the end that is expected: so far beside it the cycle is looked at next


def _silent(*_: object) -> None:
    """Report to nobody."""


def sticking_curve(
    point: StickingEnd,
    names: tuple[str, str],
    box: tuple[Range, Range],
    longest: float = LONGEST_STEP,
    report: Report = _silent,
    most: int = MOST,
) -> Boundary:
    """Return the curve in two parameters on which the sticking cycle of a point ends, to both sides of the point.

    Each point lies on neighbouring floating-point numbers, at most `longest` of the ranges from the one before; the
    curve ends at an edge of the ranges, closed, or lost: where the chatter in an earlier period completes first, for
    example. `touch_phases` are those of the release. A point costs about 70 walks from the release, each of them after
    a call of `report`: some 10 ms at r = 0.8. Residuals are below 1e-10, except near a graze in the flight, where the
    stuck time changes with infinite slope.
    """
    assert point.orbit is not None
    plane, start = _Plane(point.orbit.model, names, box, point.n_periods, report), (0.0, 0.0)
    headings = _headings(plane, start, longest)
    if headings:
        ways = both_ways(lambda side: _follow(plane, start, headings[int(side)], int(side), longest, most), report)
    else:
        why = "no curve leaves the start" + (f": {plane.why}" if plane.why else "")
        ways = [Way([start], end="lost", why=why), Way([start], end="lost")]
    points = ways[0].points[::-1] + ways[1].points[1:]
    sticks = [(plane.model_at(at), plane.stick(at)) for at in points]
    return Boundary(
        kind=KIND,
        parameters=names,
        orbits=[_orbit(model, stick, point.n_periods) for model, stick in sticks],
        residuals=[residual(model.at(), stick.fraction if stick else math.nan) for model, stick in sticks],
        touch_phases=[stick.release_phase if stick else math.nan for _, stick in sticks],
        outcome=(ways[0].end, ways[1].end),
        message="; ".join(way.why for way in ways if way.why),
    )


def _orbit(model: Model, stick: Stick | None, n_periods: int) -> Orbit:
    """Return the cycle about to be lost; on the last bit its stick may be gone already."""
    if stick and stick.periods == n_periods:
        return sticking_orbit(model, stick, Tolerances().chatter)
    return Orbit(model.at(), n_periods, -1, (), (), (0j, 0j), family=family_of(model))


def ends_on_line(
    model: Model, parameter: str, range: Range, n_periods: int, seeds: int, report: Report
) -> Iterator[StickingEnd]:
    """Yield the ends of period-n sticking along a line, as far as neighbouring seeds differ."""

    def periods(value: float) -> int:
        report(0, UNKNOWN, None)
        return periods_from_release(model.at(**{parameter: value}), n_periods)

    values = np.linspace(*range, seeds).tolist()
    names = [periods(value) for value in values]
    for (low, before), (high, after) in pairwise(zip(values, names, strict=True)):
        if before != after and n_periods in (before, after):
            inside, beyond = (low, high) if before == n_periods else (high, low)
            end = end_of_sticking(model, parameter, (inside, beyond), longest=n_periods)
            if end.found and end.n_periods == n_periods:
                yield end


@dataclass
class _Plane:
    """Two parameters of a model, in units of their ranges from the model's own values, and one cycle.

    Beyond the edges of the ranges the plane goes on as it is at the edge.
    """

    model: Model
    names: tuple[str, str]
    ranges: tuple[Point, Point]
    n_periods: int
    report: Report
    done: int = field(default=0, init=False)  # points
    why: str = field(default="", init=False)

    @cached_property
    def edges(self) -> list[Point]:
        return [((low - own) / (high - low), (high - own) / (high - low)) for own, (low, high) in self._own]

    @cached_property
    def _own(self) -> list[tuple[float, Point]]:
        return [(value_of(self.model, name), ends) for name, ends in zip(self.names, self.ranges, strict=True)]

    def holds(self, at: Point) -> bool:
        return all(low <= z <= high for z, (low, high) in zip(at, self.edges, strict=True))

    def values(self, at: Point) -> list[float]:
        pairs = zip(at, self._own, strict=True)
        return [min(max(own + z * (high - low), low), high) for z, (own, (low, high)) in pairs]

    def model_at(self, at: Point) -> Model:
        return self.model.replace(**dict(zip(self.names, self.values(at), strict=True)))

    def stick(self, at: Point) -> Stick | None:
        """Return the stick that closes a cycle of at most so many periods, or None."""
        self.report(self.done, UNKNOWN, None)
        return from_release(self.model_at(at).at(), self.n_periods)

    def stuck(self, at: Point) -> float:
        """Return the stuck time over T of the cycle, or NaN where it is not there."""
        stick = self.stick(at)
        return stick.fraction if stick and stick.periods == self.n_periods else math.nan

    def sticks(self, at: Point) -> bool:
        return not math.isnan(self.stuck(at))

    def _level(self, at: Point) -> float:
        """Return the level that falls linearly to zero at the end of the cycle, or NaN where it is not there."""
        return residual(self.model_at(at).at(), self.stuck(at))

    def bisect(self, place: Callable[[float], Point], out: float, into: float) -> float | None:
        """Return the place along a line where the cycle ends, on its side, or None if not by its chatter's end."""
        before, last = (math.nan, math.nan), (into, self._level(place(into)))  # where it sticks
        beside = AIM
        while (middle := 0.5 * (out + into)) not in (out, into) and self.values(place(out)) != self.values(place(into)):
            # The level falls linearly to zero at the end: look beside that zero, on the inner and the outer side in
            # turn, and in the middle whenever this is not between.
            away = last[1] * (last[0] - before[0]) / (last[1] - before[1]) if last[1] != before[1] else math.nan
            trial, beside = last[0] - away * (1.0 - beside), -beside
            if not min(out, into) < trial < max(out, into) or not abs(away) < 2.0 * abs(into - out):
                trial = middle
            level = self._level(place(trial))
            if math.isnan(level):
                out = trial
            else:
                into, before, last = trial, last, (trial, level)
        at = place(into)
        if self._level(at) <= MET:
            return into
        other = self.stick(place(out))
        self.why = (
            f"the mass comes to rest {self.n_periods - other.periods} periods earlier beyond it"
            if other and other.periods < self.n_periods
            else "its stuck time does not go to zero"
        )
        return None


def _on_circle(centre: Point, radius: float, heading: float) -> Callable[[float], Point]:
    return lambda angle: (
        centre[0] + radius * math.cos(heading + angle),
        centre[1] + radius * math.sin(heading + angle),
    )


def _nearest_crossing(plane: _Plane, place: Callable[[float], Point], fans: Sequence[float], side: int) -> float | None:
    """Return the crossing nearest to 0 with the cycle on the positive (1), negative (-1) or either (0) side of it."""
    seen: dict[float, bool] = {}
    for fan in fans:
        seen |= {-fan: plane.sticks(place(-fan)), fan: plane.sticks(place(fan))}
        at = sorted(seen)
        pairs = [(a, b) if seen[b] else (b, a) for a, b in pairwise(at) if seen[a] != seen[b]]
        pairs = [(out, into) for out, into in pairs if (into - out) * side >= 0.0]
        for out, into in sorted(pairs, key=lambda pair: abs(pair[0] + pair[1])):
            if (found := plane.bisect(place, out, into)) is not None:
                return found
    return None


def _headings(plane: _Plane, start: Point, step: float) -> dict[int, float]:
    """Return the directions in which the curve leaves its first point: with the cycle on the left (1), right (-1)."""
    radius = step
    while radius > step * FINEST_STEP:
        place = _on_circle(start, radius, 0.0)
        angles = [2.0 * math.pi * (j + 0.5) / ALL_ROUND for j in range(ALL_ROUND + 1)]
        inside = [plane.sticks(place(angle)) for angle in angles]
        found: dict[int, float] = {}
        for j in range(ALL_ROUND):
            if inside[j] != inside[j + 1]:
                side = 1 if inside[j + 1] else -1
                out, into = (angles[j], angles[j + 1])[::side]
                at = plane.bisect(place, out, into)
                if at is not None:
                    found.setdefault(side, at)
        if len(found) == 2:
            return found
        radius *= 0.5
    return {}


def _joined(plane: _Plane, last: Point, found: Point, side: int) -> bool:
    """Return whether the boundary runs along the chord between two points, not on to another piece of it."""
    dx, dy = found[0] - last[0], found[1] - last[1]
    for share in (0.25, 0.5, 0.75):
        x, y = last[0] + share * dx, last[1] + share * dy
        off = side * BAND
        if not plane.sticks((x - off * dy, y + off * dx)) or plane.sticks((x + off * dy, y - off * dx)):
            return False
    return True


def _to_edge(plane: _Plane, last: Point, heading: float, reach: float) -> tuple[Point, int] | None:
    """Return the place where the curve meets the edge of the ranges ahead within `reach`, and the axis."""
    slope = (math.cos(heading), math.sin(heading))
    hits = []
    for axis in (0, 1):
        if abs(slope[axis]) > 1e-9:
            edge = plane.edges[axis][1 if slope[axis] > 0.0 else 0]
            hits.append(((edge - last[axis]) / slope[axis], axis, edge))
    distance, axis, edge = min(hits)
    if distance > reach:
        return None
    across = last[1 - axis] + distance * slope[1 - axis]

    def place(offset: float) -> Point:
        return (edge, across + offset) if axis == 0 else (across + offset, edge)

    widths = [reach * 2.0**-j for j in range(6, -2, -1)]
    found = _nearest_crossing(plane, place, widths, 0)
    return (place(found), axis) if found is not None and plane.holds(place(found)) else None


def _follow(plane: _Plane, start: Point, heading: float, side: int, longest: float, most: int) -> Iterator[Way]:
    """Yield, point by point, the curve to one side of its first point as far as it has been followed."""
    way, step = Way([start]), longest
    while len(way.points) <= most:
        last, finest = way.points[-1], step <= longest * FINEST_STEP
        end = _to_edge(plane, last, heading, 1.5 * step)
        if end and (finest or end[0] == last or _joined(plane, last, end[0], side)):
            way.points += [end[0]] if math.dist(end[0], last) > 1e-12 else []  # a start on the edge is no second point
            way.end, way.why = "range", f"at the edge of the range of `{plane.names[end[1]]}`"
            break
        place = _on_circle(last, step, heading)
        angle = _nearest_crossing(plane, place, FANS, side)
        found = last if angle is None else place(angle)
        if angle is not None and plane.holds(found) and (finest or _joined(plane, last, found, side)):
            way.points.append(found)
            plane.done += 1
            heading += angle
            step = min(longest, 1.5 * step)
            if len(way.points) > 4 and math.dist(found, start) < 0.75 * step and _joined(plane, found, start, side):
                way.points.append(start)
                way.end, way.why = "closed", "closed upon itself"
                break
            yield way
        elif finest:
            x, y = plane.values(last)
            reason = f": {plane.why}" if plane.why else ""
            way.end, way.why = "lost", f"lost at {plane.names[0]} = {x:.9g}, {plane.names[1]} = {y:.9g}{reason}"
            break
        else:
            step = max(0.5 * step, longest * FINEST_STEP)
    else:
        way.why = f"not at its end after {most} points; take a longer `step`"
    yield way
