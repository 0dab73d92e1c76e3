"""A motion carried along a path, in small steps, until it becomes another motion.

A step after which the motion is another is bisected. Whether it really ends there is then tested close by and over many
more impacts: a motion that only left its own basin in a large step, or that had not settled, continues.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.coexistence.measuring import Measured, Start, cells_of
from vibroimpact.motion import MotionClass
from vibroimpact.verdict.ranges import PLACES, Range
from vibroimpact.verdict.searches import Search, followed, measured

NARROW = 0.5**12 / PLACES  # of a path: how closely the end of a motion is bisected
SECTIONS, ROUNDS = 16, 4  # of a step that is searched from one state, and how often
STATES, APART = 4, 317  # of a motion from which it may go on, and how many impacts lie between two of them
FURTHER = 300  # impacts after which a motion is carried on from its state
MISSED = 3  # times that a motion may miss its own basin along a path, before it is given up
BRIEF = ImpactWindow(100, 1500)  # enough for a name, and an exponent to a few per cent
LONG = ImpactWindow(5000, 5000)  # close to a boundary motions settle slowly, and chaos may be a transient
LONGEST = ImpactWindow(35_000, 5000)  # of one state, as long as of `STATES` of them
UNSURE = (MotionClass.UNDECIDED, MotionClass.BUDGET)


@dataclass
class Track:
    """A path, the place up to which the motion has been followed, and a place further on at which it is another motion.

    Places are fractions of the way from `first` to `end`; the power `crowded` concentrates them near `first`. With
    `lasts`, the motion must be the same from all states that are tried; otherwise it is a transient.
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
    missed_basins: int = 0
    done: bool = False
    beyond: Measured | None = None
    history: list[tuple[float, Start | None]] = field(default_factory=list)

    def at(self, place: float) -> float:
        """Return the value at a place."""
        return self.range.between(self.first, self.end, place**self.crowded) if place < 1.0 else self.end

    @property
    def close(self) -> bool:
        """Whether the motion has been followed close to the place where it is another."""
        return self.barrier - self.place <= NARROW

    @property
    def inside(self) -> float:
        """The last value up to which the motion was followed."""
        return self.at(self.place)

    @property
    def outside(self) -> float:
        """The value at which the motion is another."""
        return self.at(self.barrier)

    def move_to(self, place: float, start: Start | None) -> None:
        """Move the motion to a place."""
        self.widest = max(self.widest, abs(self.range.change(self.at(place)) - self.range.change(self.inside)))
        self.history.append((self.place, self.start))
        self.place, self.start = place, start or self.start
        self.done = place >= 1.0

    def pass_barrier(self, start: Start | None) -> None:
        """Move the motion past a place at which it only seemed to be another."""
        self.move_to(self.barrier, start)
        self.barrier, self.step = math.nan, 8.0 * NARROW
        self.missed_basins += 1
        self.done = self.done or self.missed_basins > MISSED

    def cells(self, states: Sequence[tuple[float, Start | None]]) -> Cells:
        """Return the cells with given states as initial conditions, one per place."""
        designs = [self.range.at(self.at(place)) for place, _ in states]
        return cells_of(designs, [start for _, start in states])

    def may_be_same(self, motion: Measured) -> bool:
        """Return whether a motion may be the one that is followed."""
        return motion.motion_class in UNSURE or self.same(motion)


def carry(track: Track) -> Search[None]:
    """Carry a motion to the place where it becomes another, or to the end of its path."""
    while not track.done:
        yield from (_look_closely if track.close else _step)(track)


def _step(track: Track) -> Search[None]:
    """Carry a motion to its next place, and check whether it is still the same."""
    bisecting = not math.isnan(track.barrier)
    place = 0.5 * (track.place + track.barrier) if bisecting else min(track.place + track.step, 1.0)
    cell = track.cells([(place, track.start)])
    (motion,) = yield measured(cell, BRIEF)
    if not track.may_be_same(motion):
        track.barrier = place
        return
    (state,) = yield followed(cell, FURTHER)
    track.move_to(place, state)
    if not bisecting:
        track.step = min(2.0 * track.step, 1.0 / PLACES)


def _look_closely(track: Track) -> Search[None]:
    """Decide from the nearest states, and over many impacts, whether a motion really ends.

    One state may leave the motion's own basin while another of the same motion does not.
    """
    before = track.history[-1] if track.history else (track.place, track.start)
    states = yield from _states(track, *before)
    start, _ = yield from _same_from(track, track.place, states, track.same)
    if start is None:
        yield from _look_back(track)
    else:
        track.start = start
    if track.done or not track.close:
        return
    states = yield from _states(track, track.place, track.start)
    start, motion = yield from _same_from(track, track.barrier, states, track.may_be_same)
    if start is None:
        track.beyond, track.done = motion, True
        return
    (state,) = yield followed(track.cells([(track.barrier, start)]), FURTHER)
    track.pass_barrier(state)


def _states(track: Track, place: float, start: Start | None) -> Search[list[Start | None]]:
    """Return some states of the motion at a place, the given one first."""
    states = [start]
    for _ in range(STATES - 1):
        (state,) = yield followed(track.cells([(place, states[-1])]), APART)
        states.append(state or states[-1])
    return states


def _same_from(
    track: Track, place: float, states: Sequence[Start | None], same: Callable[[Measured], bool]
) -> Search[tuple[Start | None, Measured]]:
    """Return the first of some states from which the motion is the same at a place, or None.

    With it comes the motion from there, or from the first state.
    """
    motions = yield measured(track.cells([(place, state) for state in states]), LONG)
    are_same = [same(motion) for motion in motions]
    if not any(are_same) or (track.lasts and not all(are_same)):
        return None, motions[0]
    first = are_same.index(True)
    return states[first], motions[first]


def _look_back(track: Track) -> Search[None]:
    """Locate the end of a motion that only a long window shows to be a transient, or to settle slowly.

    It is followed as far as it is certainly the same, and ends where it is certainly another.
    """
    states = [*track.history, (track.place, track.start), (track.barrier, track.start)]
    window, rounds = (LONGEST, ROUNDS // 2) if track.lasts else (LONG, ROUNDS)
    for _ in range(rounds):
        motions = yield measured(track.cells(states), window)
        ended = next((i for i, motion in enumerate(motions) if i and not track.may_be_same(motion)), None)
        if ended is None:  # nowhere is it surely another
            if track.beyond is None:
                track.pass_barrier(track.start)
            return
        sure = next((i for i in range(ended - 1, 0, -1) if track.same(motions[i])), 0)
        (track.place, track.start), (track.barrier, _), track.beyond = states[sure], states[ended], motions[ended]
        part = (track.barrier - track.place) / SECTIONS
        states = [(track.place + part * j, track.start) for j in range(SECTIONS)] + [(track.barrier, track.start)]
        track.done = True
