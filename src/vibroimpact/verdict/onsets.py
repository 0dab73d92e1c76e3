"""Where others than the present motion begin to hit: a motion from rest, and one from some initial conditions.

A motion without impacts has three edges. The steady motion itself touches the stop where an equation says so. From rest
the mass overshoots, and may settle to impacts long before. From other initial conditions it may do so earlier still:
attractors that hit are looked for from initial conditions spread over the impact surface and on the closed-form orbits
of one impact, and the first one found is carried back to where it ends.
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
from vibroimpact.verdict.present import CROWDED, PLACES, measure

SPREAD = 32  # initial conditions at a value, besides the orbits of one impact
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
    """Return values up to where the motion itself ends, or the range, the last of them a hair inside."""
    shares = [(j / PLACES) ** CROWDED for j in range(1, PLACES)]
    return [side.range.between(side.range.value, side.limit, share) for share in (*shares, 1.0 - NARROW)]


def hits(motion: Measured) -> bool:
    """Return whether a motion fills its window with impacts."""
    return motion.status.has_indices


def surely_hits(motion: Measured) -> bool:
    """Return whether a motion is known to go on hitting, not just slow to end."""
    return hits(motion) and motion.motion_class not in UNSURE


def from_rest(sides: Sequence[Side], runner: Runner, lasting: bool = True) -> list[Onset | None]:
    """Return from where on a start from rest settles to impacts; where the motion itself ends, at the latest.

    Without `lasting`: from where on it strikes the stop, if only in passing.
    """

    def first(some: Sequence[Side], paths: Sequence[Sequence[float]]) -> list[tuple[int, Start | None] | None]:
        return _first(some, paths, lambda model: cells_of([model]), runner, lasting)

    paths = [_path(side) for side in sides]
    found = first(sides, paths)
    begin = {i: one for i, one in enumerate(found) if one is not None}
    steps = {i: ([sides[i].range.value, *paths[i]][at], paths[i][at]) for i, (at, _) in begin.items()}
    starts = {i: start for i, (_, start) in begin.items()}
    for _ in range(ROUNDS if lasting else PASSING):
        cuts = {i: sides[i].range.cut(*step, SECTIONS) for i, step in steps.items()}
        inner = first([sides[i] for i in cuts], [values[1:-1] for values in cuts.values()])
        for (i, values), one in zip(cuts.items(), inner, strict=True):
            at = len(values) - 1 if one is None else one[0] + 1
            steps[i] = values[at - 1], values[at]
            starts[i] = one[1] if one else starts[i]
    onsets: list[Onset | None] = []
    for i, (side, path) in enumerate(zip(sides, paths, strict=True)):
        if i not in begin or begin[i][0] == len(path) - 1:
            onsets.append(side.onset(side.value, start=side.start) if math.isfinite(side.value) else None)
            continue
        (before, after), spacing = steps[i], _widest(side, path[: begin[i][0] + 1])
        onsets.append(side.onset(0.5 * (before + after), 0.5 * abs(after - before), spacing, starts[i]))
    return onsets


def from_some(sides: Sequence[Side], rest: Sequence[Onset | None], runner: Runner) -> list[Onset | None]:
    """Return from where on some initial condition settles to impacts; where one at rest does, at the latest."""
    paths = []
    for side, at_rest in zip(sides, rest, strict=True):
        most = abs(side.range.change(at_rest.value)) if at_rest else math.inf
        paths.append([value for value in _path(side) if abs(side.range.change(value)) < most])
    found = _first(sides, paths, _spread, runner)
    tracks = [
        _track_back(side, None if first is None else (path[first[0]], first[1]), at_rest)
        for side, path, first, at_rest in zip(sides, paths, found, rest, strict=True)
    ]
    carry([track for track in tracks if track], runner)
    onsets: list[Onset | None] = []
    for side, path, first, at_rest, track in zip(sides, paths, found, rest, tracks, strict=True):
        spacing = _widest(side, path[: first[0] + 1] if first else path)
        onsets.append(at_rest if track is None else _carried_back(side, at_rest, track, spacing))
    return onsets


def _track_back(side: Side, first: tuple[float, Start | None] | None, at_rest: Onset | None) -> Track | None:
    """Return the way towards the present value of an attractor that hits: the first one found, or that from rest."""
    if first is None and at_rest is not None and abs(at_rest.change) > NOISE:
        exact = at_rest.half_width == 0.0
        origin = side.beyond_at() if exact else at_rest.value + side.direction * at_rest.half_width
        first = None if math.isnan(origin) else (origin, at_rest.start)
    return first and Track(side.range, first[0], side.range.value, surely_hits, first[1], lasts=True)


def _carried_back(side: Side, rest: Onset | None, track: Track, spacing: float) -> Onset:
    """Return the end of an attractor that hits, carried towards the present value."""
    if track.place >= 1.0:
        return side.onset(side.range.value, start=track.start)
    outside = track.outside if track.ends else track.inside
    value, half = 0.5 * (track.inside + outside), 0.5 * abs(outside - track.inside)
    if rest is not None and abs(value - rest.value) <= 2.0 * (half + rest.half_width):
        return rest
    return side.onset(value, half, spacing, track.start)


def _spread(model: Model) -> Cells:
    """Return the initial conditions from which impacts are looked for."""
    osc = model.at()
    orbits = (z for n in range(1, ORBITS + 1) for z in impact_1_orbits(osc, n)[0])
    starts = [Start(0.0, float(z[1]), float(z[0]) % 1.0) for z in orbits if z[1] > 0.0]
    return Cells.join([spread_cells(osc.cells({}), SPREAD), *(start.cell(osc) for start in starts)])


Begin = Callable[[Model], Cells]


def _first(
    sides: Sequence[Side], paths: Sequence[Sequence[float]], begin: Begin, runner: Runner, lasting: bool = True
) -> list[tuple[int, Start | None] | None]:
    """Return for each path the first value at which a motion hits, and a state of one that lasts; None without one."""
    found: list[tuple[int, Start | None] | None] = [None] * len(paths)
    looked = [0] * len(paths)
    while left := [i for i, path in enumerate(paths) if found[i] is None and looked[i] < len(path)]:
        places = [(i, j) for i in left for j in range(looked[i], min(looked[i] + BATCH, len(paths[i])))]
        cells = [begin(sides[i].range.changed(paths[i][j])) for i, j in places]
        waiting: dict[int, list[tuple[int, Cells]]] = {i: [] for i in left}
        for (i, j), cell, hit in zip(places, cells, _hitting(cells, runner, lasting), strict=True):
            looked[i] = j + 1
            if hit.any():
                waiting[i].append((j, cell[np.flatnonzero(hit)[:TRIED]]))
        while tried := [(i, j, cell) for i, hits in waiting.items() if not found[i] for j, cell in hits[:TOGETHER]]:
            parts = [cell for _, _, cell in tried]
            ends = _lasting(parts, runner) if lasting else [(True, None)] * len(parts)
            for (i, j, _), (hits_on, start) in zip(tried, ends, strict=True):
                found[i] = found[i] or ((j, start) if hits_on else None)
            waiting = {i: hits[TOGETHER:] for i, hits in waiting.items()}
    return found


def _hitting(parts: Sequence[Cells], runner: Runner, lasting: bool) -> list[np.ndarray]:
    """Return which of the cells of each part fill a brief window with impacts, or hit at all."""
    cells = Cells.join(parts)
    runner.measured += len(cells)
    hit = np.zeros(len(cells), bool)
    wanted = Measurement(BRIEF, runner.tolerances)
    for which, outcome in runner.sweep(cells, wanted):
        hit[which] = outcome["status"] != Status.NO_IMPACT
        hit[which] &= (outcome["status"] <= Status.SHORT_WINDOW) | (not lasting)
    return np.split(hit, np.cumsum([len(part) for part in parts])[:-1])


def _lasting(parts: Sequence[Cells], runner: Runner) -> list[tuple[bool, Start | None]]:
    """Return whether one of the cells of each part keeps hitting, and where it is much later.

    Chaos counts if it lasts from `STATES` of its states: else it is a transient.
    """
    motions = iter(measure(runner, Cells.join(parts), LONG))
    hitting = [[(at, motion) for at in range(len(part)) if hits(motion := next(motions))] for part in parts]
    first = [
        (part[np.array([of_part[0][0]])], of_part[0][1])
        for part, of_part in zip(parts, hitting, strict=True)
        if of_part
    ]
    if not first:
        return [(False, None)] * len(parts)
    cells = Cells.join([cell for cell, _ in first])
    irregular = np.array([not motion.n_periods for _, motion in first])
    lasts = np.ones(len(cells), bool)
    if irregular.any():
        wild = [cells[np.flatnonzero(irregular)]]
        for _ in range(STATES):
            wild.append(_onward(wild[-1], runner))
        ends = [hits(motion) for motion in measure(runner, Cells.join(wild[1:]), LONG)]
        lasts[irregular] = np.reshape(ends, (STATES, -1)).all(axis=0)
    states = iter(zip(lasts.tolist(), runner.follow(cells, ONWARD), strict=True))
    return [next(states) if of_part else (False, None) for of_part in hitting]


def _onward(cells: Cells, runner: Runner) -> Cells:
    """Return the states of motions some impacts later."""
    states = zip(runner.follow(cells, ONWARD // STATES), cells, strict=True)
    rows = [state or Start(cell["clearance"], cell["velocity"], cell["phase"]) for state, cell in states]
    clearance, velocity, phase = np.array(rows).T
    return cells.replace(clearance=clearance, velocity=velocity, periods=0.0, phase=phase)
