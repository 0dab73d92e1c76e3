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
from vibroimpact.verdict.carried import BRIEF, LONG, NARROW, PLACES, SECTIONS, STATES, UNSURE, Track, carry
from vibroimpact.verdict.edges import NOISE, Onset, Side
from vibroimpact.verdict.present import CROWDED, measure

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
    brackets: list[tuple[float, float] | None] = []
    for side, path, one in zip(sides, paths, found, strict=True):
        before = None if one is None else path[one[0] - 1] if one[0] else side.range.value
        brackets.append(None if one is None or before is None else (before, path[one[0]]))
    starts = [one and one[1] for one in found]
    for _ in range(ROUNDS if lasting else PASSING):
        open_ = [(i, *bracket) for i, bracket in enumerate(brackets) if bracket is not None]
        inner = [sides[i].range.cut(before, after, SECTIONS) for i, before, after in open_]
        firsts = first([sides[i] for i, _, _ in open_], [cuts[1:-1] for cuts in inner])
        for (i, _, _), cuts, one in zip(open_, inner, firsts, strict=True):
            at = len(cuts) - 1 if one is None else one[0] + 1
            brackets[i] = cuts[at - 1], cuts[at]
            starts[i] = one[1] if one else starts[i]
    onsets: list[Onset | None] = []
    for side, path, one, bracket, start in zip(sides, paths, found, brackets, starts, strict=True):
        if bracket is None or one is None or one[0] == len(path) - 1:
            exact = math.isfinite(side.value)
            onsets.append(side.onset(side.value, start=side.start) if exact else None)
            continue
        half = 0.5 * abs(bracket[1] - bracket[0])
        onsets.append(side.onset(0.5 * (bracket[0] + bracket[1]), half, _widest(side, path[: one[0] + 1]), start))
    return onsets


def from_some(sides: Sequence[Side], rest: Sequence[Onset | None], runner: Runner) -> list[Onset | None]:
    """Return from where on some initial condition settles to impacts; where one at rest does, at the latest."""
    paths = []
    for side, known in zip(sides, rest, strict=True):
        most = abs(side.range.change(known.value)) if known else math.inf
        paths.append([value for value in _path(side) if abs(side.range.change(value)) < most])
    found = _first(sides, paths, _spread, runner)
    tracks: list[Track | None] = []
    for side, path, first, known in zip(sides, paths, found, rest, strict=True):
        if first is not None:
            origin, start = path[first[0]], first[1]
        elif known is not None and abs(known.change) > NOISE:
            exact = known.half_width == 0.0
            origin = side.beyond_at() if exact else known.value + side.direction * known.half_width
            start = known.start
        else:
            tracks.append(None)
            continue
        tracks.append(
            None if math.isnan(origin) else Track(side.range, origin, side.range.value, surely_hits, start, lasts=True)
        )
    carry([track for track in tracks if track], runner)
    onsets: list[Onset | None] = []
    for side, path, first, known, track in zip(sides, paths, found, rest, tracks, strict=True):
        spacing = _widest(side, path[: first[0] + 1] if first else path)
        onsets.append(known if track is None else _carried_back(side, known, track, spacing))
    return onsets


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
    known = (z for n in range(1, ORBITS + 1) for z in impact_1_orbits(osc, n)[0])
    starts = [Start(0.0, float(z[1]), float(z[0]) % 1.0) for z in known if z[1] > 0.0]
    return Cells.join([spread_cells(osc.cells({}), SPREAD), *(start.cell(osc) for start in starts)])


Begin = Callable[[Model], Cells]


def _first(
    sides: Sequence[Side], paths: Sequence[Sequence[float]], begin: Begin, runner: Runner, lasting: bool = True
) -> list[tuple[int, Start | None] | None]:
    """Return of each path the first value at which a motion hits, and a state of one that lasts; None without one."""
    found: list[tuple[int, Start | None] | None] = [None] * len(paths)
    next_ = [0] * len(paths)
    while left := [i for i, path in enumerate(paths) if found[i] is None and next_[i] < len(path)]:
        places = [(i, j) for i in left for j in range(next_[i], min(next_[i] + BATCH, len(paths[i])))]
        cells = [begin(sides[i].range.changed(paths[i][j])) for i, j in places]
        waiting: dict[int, list[tuple[int, Cells]]] = {i: [] for i in left}
        for (i, j), own, hit in zip(places, cells, _hitting(cells, runner, lasting), strict=True):
            next_[i] = j + 1
            if hit.any():
                waiting[i].append((j, own[np.flatnonzero(hit)[:TRIED]]))
        while some := [(i, j, own) for i, all_ in waiting.items() if not found[i] for j, own in all_[:TOGETHER]]:
            parts = [own for _, _, own in some]
            ends = _lasting(parts, runner) if lasting else [(True, None)] * len(parts)
            for (i, j, _), (hits_on, start) in zip(some, ends, strict=True):
                found[i] = found[i] or ((j, start) if hits_on else None)
            waiting = {i: all_[TOGETHER:] for i, all_ in waiting.items()}
    return found


def _hitting(parts: Sequence[Cells], runner: Runner, lasting: bool) -> list[np.ndarray]:
    """Return of the cells of each part which of them fill a brief window with impacts, or hit at all."""
    cells = Cells.join(parts)
    runner.measured += len(cells)
    hit = np.zeros(len(cells), bool)
    wanted = Measurement(BRIEF, runner.tolerances)
    for which, outcome in runner.sweep(cells, wanted):
        hit[which] = outcome["status"] <= (Status.SHORT_WINDOW if lasting else 99)
        hit[which] &= outcome["status"] != Status.NO_IMPACT
    return np.split(hit, np.cumsum([len(part) for part in parts])[:-1])


def _lasting(parts: Sequence[Cells], runner: Runner) -> list[tuple[bool, Start | None]]:
    """Return whether one of the cells of each part keeps hitting, and where it is much later.

    Chaos counts if it lasts from `STATES` of its states: else it is a transient.
    """
    motions = iter(measure(runner, Cells.join(parts), LONG))
    seen = [[(at, motion) for at in range(len(part)) if hits(motion := next(motions))] for part in parts]
    first = [part[np.array([own[0][0]])] for part, own in zip(parts, seen, strict=True) if own]
    if not first:
        return [(False, None)] * len(parts)
    one = Cells.join(first)
    irregular = np.array([not own[0][1].n_periods for own in seen if own])
    lasts = np.ones(len(one), bool)
    wild = [one[np.flatnonzero(irregular)]]
    for _ in range(STATES if irregular.any() else 0):
        wild.append(_onward(wild[-1], runner))
    if irregular.any():
        ends = [hits(motion) for motion in measure(runner, Cells.join(wild[1:]), LONG)]
        lasts[irregular] = np.reshape(ends, (STATES, -1)).all(axis=0)
    states = iter(zip(lasts.tolist(), runner.follow(one, ONWARD), strict=True))
    return [next(states) if own else (False, None) for own in seen]


def _onward(cells: Cells, runner: Runner) -> Cells:
    """Return the states of motions some impacts later."""
    states = zip(runner.follow(cells, ONWARD // STATES), cells, strict=True)
    rows = [state or Start(cell["clearance"], cell["velocity"], cell["phase"]) for state, cell in states]
    clearance, velocity, phase = np.array(rows).T
    return cells.replace(clearance=clearance, velocity=velocity, periods=0.0, phase=phase)
