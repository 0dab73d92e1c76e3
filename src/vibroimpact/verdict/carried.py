"""Motions carried along many paths at once, in small steps, until each becomes another.

A step after which the motion is another is bisected. Whether it truly ends there is then seen from close by and over
many more impacts: a motion that merely missed its own basin in a large step, or that had not settled, goes on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.coexistence.measuring import Measured, Runner, Start, cells_of
from vibroimpact.motion import MotionClass
from vibroimpact.verdict.present import PLACES, Range, measure

HALVINGS = 12  # of the step in which the motion changes
NARROW = 0.5**HALVINGS / PLACES  # of a path
SECTIONS, ROUNDS = 16, 4  # of a step that is searched from one state, and how often
STATES, APART = 4, 317  # of a motion from which it may go on, and how many impacts lie between two of them
MISSED = 3  # times that a motion may miss its own basin along a path, before it is given up
BRIEF = ImpactWindow(100, 1500)  # enough for a name, and an exponent to a few per cent
LONG = ImpactWindow(5000, 5000)  # close to a boundary motions settle slowly, and chaos may be a transient
LONGEST = ImpactWindow(35_000, 5000)  # of one state, as long as of `STATES` of them
UNSURE = (MotionClass.UNDECIDED, MotionClass.BUDGET)


@dataclass
class Track:
    """A path, how far along it the motion has been followed, and a place further on at which it is another.

    Places are shares of the way from `first` to `end`, taken to the power `crowded`. A motion that `lasts` is the same
    only if it is so from all states that are tried: else it is a transient.
    """

    range: Range
    first: float
    end: float
    same: Callable[[Measured], bool]
    start: Start | None
    crowded: float = 1.0
    lasts: bool = False
    place: float = 0.0
    barrier: float = math.nan
    step: float = 1.0 / PLACES
    widest: float = 0.0
    missed: int = 0
    done: bool = False
    beyond: Measured | None = None
    behind: list[tuple[float, Start | None]] = field(default_factory=list)

    def at(self, place: float) -> float:
        """Return the value at a place."""
        return self.range.between(self.first, self.end, place**self.crowded) if place < 1.0 else self.end

    @property
    def next(self) -> float:
        """The place to look at next."""
        if math.isnan(self.barrier):
            return min(self.place + self.step, 1.0)
        return 0.5 * (self.place + self.barrier)

    @property
    def close(self) -> bool:
        """Whether the motion has been followed close to where it is another."""
        return self.barrier - self.place <= NARROW

    @property
    def ends(self) -> bool:
        """Whether the motion was seen to become another."""
        return self.beyond is not None

    @property
    def inside(self) -> float:
        """The last value up to which it was followed."""
        return self.at(self.place)

    @property
    def outside(self) -> float:
        """The value at which it is another."""
        return self.at(self.barrier)

    def go(self, place: float, start: Start | None) -> None:
        """Take the motion to a place."""
        self.widest = max(self.widest, abs(self.range.change(self.at(place)) - self.range.change(self.inside)))
        self.behind.append((self.place, self.start))
        self.place, self.start = place, start or self.start
        self.done = place >= 1.0

    def go_on(self, start: Start | None) -> None:
        """Take the motion past a place at which it only seemed to be another."""
        self.go(self.barrier, start)
        self.barrier, self.step = math.nan, 8.0 * NARROW
        self.missed += 1
        self.done = self.done or self.missed > MISSED


def carry(tracks: Sequence[Track], runner: Runner) -> None:
    """Carry the motion of each track to where it becomes another, or to the end of its path."""
    while active := [track for track in tracks if not track.done]:
        if going := [track for track in active if not track.close]:
            _go(going, runner)
        else:
            _look_closely(active, runner)


def _cells(tracks: Sequence[Track], places: Sequence[float]) -> Cells:
    there = [track.range.changed(track.at(place)) for track, place in zip(tracks, places, strict=True)]
    return cells_of(there, [track.start for track in tracks])


def _go(tracks: Sequence[Track], runner: Runner) -> None:
    """Carry each motion to its next place, and see whether it is still the same."""
    places = [track.next for track in tracks]
    cells = _cells(tracks, places)
    same = [still(track, motion) for track, motion in zip(tracks, measure(runner, cells, BRIEF), strict=True)]
    kept = np.flatnonzero(same)
    states = iter(runner.follow(cells[kept]) if kept.size else [])
    for track, place, is_same in zip(tracks, places, same, strict=True):
        if not is_same:
            track.barrier = place
            continue
        track.go(place, next(states))
        if math.isnan(track.barrier):
            track.step = min(2.0 * track.step, 1.0 / PLACES)


def still(track: Track, motion: Measured) -> bool:
    """Return whether a motion may be the one that is followed."""
    return motion.motion_class in UNSURE or track.same(motion)


def _look_closely(tracks: Sequence[Track], runner: Runner) -> None:
    """Decide from the nearest states, and over many impacts, whether each motion does end where it seemed to.

    One state may miss the motion's own basin where another of the same motion does not.
    """
    behind = [track.behind[-1] if track.behind else (track.place, track.start) for track in tracks]
    before = _states(tracks, behind, runner)
    chosen = _same_from(tracks, [track.place for track in tracks], before, runner)
    for track, (start, _) in zip(tracks, chosen, strict=True):
        track.start = track.start if start is None else start
    _look_back([track for track, (start, _) in zip(tracks, chosen, strict=True) if start is None], runner)
    if not (left := [track for track in tracks if not track.done and track.close]):
        return
    inside = _states(left, [(track.place, track.start) for track in left], runner)
    for track, (start, there) in zip(
        left, _same_from(left, [track.barrier for track in left], inside, runner, still), strict=True
    ):
        if start is None:
            track.beyond, track.done = there, True
            continue
        (state,) = runner.follow(start.cell(track.range.changed(track.outside)))
        track.go_on(state)


def _states(
    tracks: Sequence[Track], places: Sequence[tuple[float, Start | None]], runner: Runner
) -> list[list[Start | None]]:
    """Return for each track some states of the motion at a place, the given one first."""
    there = [track.range.changed(track.at(place)) for track, (place, _) in zip(tracks, places, strict=True)]
    states = [[start] for _, start in places]
    for _ in range(STATES - 1):
        onward = runner.follow(cells_of(there, [of_track[-1] for of_track in states]), APART)
        for of_track, state in zip(states, onward, strict=True):
            of_track.append(state or of_track[-1])
    return states


def _same_from(
    tracks: Sequence[Track],
    places: Sequence[float],
    states: Sequence[Sequence[Start | None]],
    runner: Runner,
    judge: Callable[[Track, Measured], bool] = lambda track, motion: track.same(motion),
) -> list[tuple[Start | None, Measured]]:
    """Return for each track the first of some states from which the motion is the same at a place, or None.

    With it comes the motion from there, or from the first state.
    """
    there = [track.range.changed(track.at(place)) for track, place in zip(tracks, places, strict=True)]
    cells = cells_of([design for design in there for _ in range(STATES)], [one for some in states for one in some])
    measured = iter(measure(runner, cells, LONG))
    found: list[tuple[Start | None, Measured]] = []
    for track, some in zip(tracks, states, strict=True):
        motions = [next(measured) for _ in some]
        right = [judge(track, motion) for motion in motions]
        good = right.index(True) if any(right) and (all(right) or not track.lasts) else None
        found.append((None, motions[0]) if good is None else (some[good], motions[good]))
    return found


def _look_back(tracks: Sequence[Track], runner: Runner) -> None:
    """Narrow down where motions end of which only a long window shows that they are transients, or settle slowly.

    A motion is followed as far as it surely is the same, and ends where it surely is another.
    """
    left = [(track, [*track.behind, (track.place, track.start), (track.barrier, track.start)]) for track in tracks]
    window = LONGEST if any(track.lasts for track in tracks) else LONG
    for _ in range(ROUNDS if window == LONG else ROUNDS // 2):
        if not left:
            return
        there = [track.range.changed(track.at(place)) for track, states in left for place, _ in states]
        cells = cells_of(there, [start for _, states in left for _, start in states])
        measured = iter(measure(runner, cells, window))
        looked, left = left, []
        for track, states in looked:
            motions = [next(measured) for _ in states]
            ended = next((i for i, motion in enumerate(motions) if i and not still(track, motion)), None)
            if ended is None:  # nowhere is it surely another
                if track.beyond is None:
                    track.go_on(track.start)
                continue
            sure = next((i for i in range(ended - 1, 0, -1) if track.same(motions[i])), 0)
            (track.place, track.start), (track.barrier, _), track.beyond = states[sure], states[ended], motions[ended]
            part = (track.barrier - track.place) / SECTIONS
            inner = [(track.place + part * j, track.start) for j in range(SECTIONS)]
            left.append((track, [*inner, (track.barrier, track.start)]))
            track.done = True
