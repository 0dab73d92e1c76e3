"""Boundaries by bisection of motion classes: one motion followed along many paths at once, its state carried along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.verdict.edges import Found
from vibroimpact.verdict.present import Present
from vibroimpact.verdict.reach import Reach
from vibroimpact.verdict.readings import BRIEF, Laboratory, Start

PLACES = 36  # values along a path
HALVINGS = 12  # of the step in which the class changes


@dataclass
class Track:
    """A path, how far the motion was followed along it, and the step in which it became another."""

    reach: Reach
    direction: int
    inside: float
    start: Start | None
    outside: float | None = None
    ahead: list[float] = field(default_factory=list)

    @property
    def next(self) -> float:
        """The value to look at now: the next one outwards, or the middle of the step with the change."""
        return self.ahead[0] if self.outside is None else self.reach.between(self.inside, self.outside, 0.5)


def bisected_boundaries(present: Present, wanted: Sequence[tuple[Reach, int]], laboratory: Laboratory) -> list[Found]:
    """Return, for each parameter and direction, where the motion that is followed first changes its class."""
    tracks = [
        Track(reach, direction, reach.value, present.state, ahead=reach.path(direction, PLACES))
        for reach, direction in wanted
    ]
    while active := [track for track in tracks if track.outside is None and track.ahead]:
        _step(present, active, laboratory)
        for track in active:
            track.ahead.pop(0)
    changed = [track for track in tracks if track.outside is not None]
    for _ in range(HALVINGS if changed else 0):
        _step(present, changed, laboratory)
    return [_found(track) for track in tracks]


def _step(present: Present, tracks: Sequence[Track], laboratory: Laboratory) -> None:
    """Carry each motion to its next value, and see whether it is still the same."""
    values = [track.next for track in tracks]
    there = [_at(present.oscillator, track, value) for track, value in zip(tracks, values, strict=True)]
    starts = [track.start for track in tracks]
    readings = laboratory.read(there, starts, BRIEF)
    same = [reading.group == present.reading.group or reading.kind == "undecided" for reading in readings]
    kept = [i for i, is_same in enumerate(same) if is_same]
    carried = laboratory.carry([there[i] for i in kept], [starts[i] for i in kept])
    for i, state in zip(kept, carried, strict=True):
        tracks[i].inside, tracks[i].start = values[i], state
    for track, value, is_same in zip(tracks, values, same, strict=True):
        if not is_same:
            track.outside = value


def _at(osc: ImpactOscillator, track: Track, value: float) -> ImpactOscillator:
    return track.reach.at(osc, value)


def _found(track: Track) -> Found:
    if track.outside is None:
        return Found(track.reach, track.direction)
    middle, half = 0.5 * (track.inside + track.outside), 0.5 * abs(track.outside - track.inside)
    return Found(track.reach, track.direction, "change", middle, half, track.start)
