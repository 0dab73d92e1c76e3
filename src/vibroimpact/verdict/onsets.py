"""The values of a parameter beyond which other motions hit: that from rest, and those from other initial conditions.

A motion without impacts has three edges. The value at which the steady motion itself touches the stop follows from an
equation. From rest the mass overshoots and may settle to impacts long before that value. From other initial conditions
it may settle to impacts even earlier: attractors that hit are sought from initial conditions spread over the impact
surface and on the closed-form orbits of one impact, and the first one found is carried back to the value at which it
ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from vibroimpact.backends import Cells, Measurement
from vibroimpact.coexistence.measuring import Measured, Runner, Start, cells_of, spread_cells
from vibroimpact.model import Model
from vibroimpact.orbits.equations import impact_1_orbits
from vibroimpact.status import Status
from vibroimpact.verdict.carried import BRIEF, LONG, NARROW, SECTIONS, STATES, UNSURE, Track, carry
from vibroimpact.verdict.edges import NOISE, Onset, Side
from vibroimpact.verdict.ranges import PLACES
from vibroimpact.verdict.searches import Query, Search, followed, measured

IMPACTS = 32  # initial conditions at a value, besides the orbits of one impact
ORBITS = 4  # periods of these, at most
BATCH = 12  # values looked at together
ROUNDS, PASSING = 2, 3  # times that a step is cut so: close to where impacts begin to last they settle slowly
TOGETHER = 4  # values of a side at which impacts are looked at more closely at a time
TRIED = 3  # motions that hit, of which one is to last
ONWARD = 3000  # impacts after which a motion is taken to be on its attractor


def _widest(side: Side, path: Sequence[float]) -> float:
    """Return the widest step of a path from the present value on."""
    return side.range.widest_step([side.range.value, *path])


def _path(side: Side) -> list[float]:
    """Return values up to just before the end of the motion or of the range."""
    varied = side.range
    return [*varied.before(side.limit, PLACES), varied.between(varied.value, side.limit, 1.0 - NARROW)]


def onset_from_rest(side: Side, lasting: bool = True) -> Search[Onset | None]:
    """Return the value beyond which rest leads to lasting impacts; at the latest, the motion itself ends there.

    Without `lasting`: the value beyond which the motion from rest strikes the stop at all.
    """
    path = _path(side)
    first = yield from _first_hitting(side, path, _at_rest, lasting)
    if first is None or first[0] == len(path) - 1:
        return side.onset(side.value, start=side.start) if math.isfinite(side.value) else None
    place, start = first
    before, after = [side.range.value, *path][place : place + 2]
    for _ in range(ROUNDS if lasting else PASSING):
        cuts = side.range.cut(before, after, SECTIONS)
        inner = yield from _first_hitting(side, cuts[1:-1], _at_rest, lasting)
        at, start = (len(cuts) - 2, start) if inner is None else inner
        before, after = cuts[at : at + 2]
    return side.onset(0.5 * (before + after), 0.5 * abs(after - before), _widest(side, path[: place + 1]), start)


def onset_from_some(side: Side, at_rest: Onset | None) -> Search[Onset | None]:
    """Return the value beyond which some initial condition settles to impacts; at the latest, that at rest does.

    The first attractor that hits, or else the motion from rest, is carried towards the present value.
    """
    most = abs(side.range.change(at_rest.value)) if at_rest else math.inf
    path = [value for value in _path(side) if abs(side.range.change(value)) < most]
    first = yield from _first_hitting(side, path, _spread)
    if first is not None:
        origin, start = path[first[0]], first[1]
    elif at_rest is None or abs(at_rest.change) <= NOISE:
        return at_rest
    else:
        exact = at_rest.half_width == 0.0
        origin = side.beyond_at() if exact else at_rest.value + side.direction * at_rest.half_width
        start = at_rest.start
    if math.isnan(origin):
        return at_rest
    track = Track(side.range, origin, side.range.value, _surely_hits, start, lasts=True)
    yield from carry(track)
    if track.place >= 1.0:
        return side.onset(side.range.value, start=track.start)
    outside = track.inside if track.beyond is None else track.outside
    value, half = 0.5 * (track.inside + outside), 0.5 * abs(outside - track.inside)
    if at_rest is not None and abs(value - at_rest.value) <= 2.0 * (half + at_rest.half_width):
        return at_rest
    return side.onset(value, half, _widest(side, path[: first[0] + 1] if first else path), track.start)


def _surely_hits(motion: Measured) -> bool:
    """Return whether a motion certainly continues to hit, and does not only end slowly."""
    return motion.status.has_indices and motion.motion_class not in UNSURE


def _at_rest(model: Model) -> Cells:
    return cells_of([model])


def _spread(model: Model) -> Cells:
    """Return the initial conditions from which impacts are sought."""
    osc = model.at()
    orbits = (z for n in range(1, ORBITS + 1) for z in impact_1_orbits(osc, n)[0])
    starts = [Start(0.0, float(z[1]), float(z[0]) % 1.0) for z in orbits if z[1] > 0.0]
    return Cells.join([spread_cells(osc.cells({}), IMPACTS), *(start.cell(osc) for start in starts)])


def _first_hitting(
    side: Side, path: Sequence[float], initial: Callable[[Model], Cells], lasting: bool = True
) -> Search[tuple[int, Start | None] | None]:
    """Return the first place on a path at which a motion hits, and a state of one that lasts; None if there is none."""
    for first in range(0, len(path), BATCH):
        parts = [initial(side.range.at(value)) for value in path[first : first + BATCH]]
        hit = yield Query(_hitting, Cells.join(parts), lasting)
        of_parts = np.split(np.array(hit), np.cumsum([len(part) for part in parts])[:-1])
        hitting = [
            (first + j, part[np.flatnonzero(of_part)[:TRIED]])
            for j, (part, of_part) in enumerate(zip(parts, of_parts, strict=True))
            if of_part.any()
        ]
        for at in range(0, len(hitting), TOGETHER):
            tried = hitting[at : at + TOGETHER]
            ends = (yield from _lasting([part for _, part in tried])) if lasting else [(True, None)] * len(tried)
            for (place, _), (lasts, start) in zip(tried, ends, strict=True):
                if lasts:
                    return place, start
    return None


def _hitting(runner: Runner, cells: Cells, lasting: bool) -> list[bool]:
    """Return which cells fill a brief window with impacts, or hit at all."""
    runner.measured += len(cells)
    hit = np.zeros(len(cells), bool)
    for which, outcome in runner.sweep(cells, Measurement(BRIEF, runner.tolerances)):
        hit[which] = outcome["status"] != Status.NO_IMPACT
        hit[which] &= (outcome["status"] <= Status.SHORT_WINDOW) | (not lasting)
    return hit.tolist()


def _lasting(parts: Sequence[Cells]) -> Search[list[tuple[bool, Start | None]]]:
    """Return whether one of the cells of each part continues to hit, and its state much later.

    Chaos counts if it lasts from `STATES` of its states; otherwise it is a transient.
    """
    motions = iter((yield measured(Cells.join(parts), LONG)))
    pairs = [[(cell, next(motions)) for cell in range(len(part))] for part in parts]
    first = [next((pair for pair in of_part if pair[1].status.has_indices), None) for of_part in pairs]
    hitting = [(part[pair[0] : pair[0] + 1], pair[1]) for part, pair in zip(parts, first, strict=True) if pair]
    if not hitting:
        return [(False, None)] * len(parts)
    cells = Cells.join([cell for cell, _ in hitting])
    irregular = np.array([not motion.n_periods for _, motion in hitting])
    lasts = np.ones(len(cells), bool)
    if irregular.any():
        later = [cells[np.flatnonzero(irregular)]]
        for _ in range(STATES):
            later.append(_onward(later[-1], (yield followed(later[-1], ONWARD // STATES))))
        ends = [motion.status.has_indices for motion in (yield measured(Cells.join(later[1:]), LONG))]
        lasts[irregular] = np.reshape(ends, (STATES, -1)).all(axis=0)
    states = iter(zip(lasts.tolist(), (yield followed(cells, ONWARD)), strict=True))
    return [next(states) if pair else (False, None) for pair in first]


def _onward(cells: Cells, states: Sequence[Start | None]) -> Cells:
    """Return the cells from the states that their motions have reached, if these could be followed."""
    pairs = zip(states, cells, strict=True)
    rows = [state or Start(cell["clearance"], cell["velocity"], cell["phase"]) for state, cell in pairs]
    clearance, velocity, phase = np.array(rows).T
    return cells.replace(clearance=clearance, velocity=velocity, periods=0.0, phase=phase)
