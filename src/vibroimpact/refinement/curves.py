r"""Filling in along curves on which motions change least: those of equal driving frequency over natural frequency.

Scaled by its own length, time and force, an oscillator is told by :math:`\omega/\omega_n`, damping ratio, restitution
and scaled gap. Over two of frequency, mass and stiffness the first decides: boundaries lie along its curves, and what
is finer than a cell across them is many cells long. So the computed cells of some rows beside, sorted by
:math:`\ln(\omega/\omega_n)`, sample a line far more densely than any row does.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.execution.threads import worker_count
from vibroimpact.refinement.lattice import Flags, Floats, Places, widen
from vibroimpact.refinement.marking import Rule, mixed_squares
from vibroimpact.refinement.picture import Picture
from vibroimpact.refinement.scales import Curves

# The power of each parameter in omega/omega_n = omega sqrt(mass/stiffness).
POWERS = {"omega": 1.0, "frequency": 1.0, "mass": 0.5, "stiffness": -0.5}
STRIDE = 8  # the quadtree hands over to the curves at this lattice
REACH = 96  # rows on either side whose cells have a vote
AGREED = 0.9  # of the votes: where no motion has as many, a cell is computed
PART = 4  # of the doubtful cells one in so many is computed at a time: each settles its neighbours along the curve
SURVEYS = 4  # of all cells near boundaries; each finds what the ones before overlooked
PORTION = 1 << 18  # cells looked at at a time, to save memory: some 30 MB
SHARE = 1 << 14  # cells that a thread looks up at once
FEW = 1e-4  # of the cells may stay in doubt


def heights(axes: Mapping[str, Floats]) -> tuple[Floats, Floats] | None:
    """Return ln(omega/omega_n) as the sum of what each axis gives; None where one of the two gives nothing."""
    if not all(name in POWERS and values[0] > 0.0 for name, values in axes.items()):
        return None
    first, second = (POWERS[name] * np.log(values) for name, values in axes.items())
    return first, second


@dataclass(frozen=True)
class Opinions:
    """What computed cells say of some places: the nearest below and above the curve (-1: none) that show the motion
    with most votes, how far off they are, and its share of the votes (0: nobody was found).
    """

    at: Places
    found: Places
    distance: Floats
    share: Floats

    def doubtful(self, picture: Picture, rule: Rule, curves: Curves) -> Places:
        """Return the places of which opinions differ, or nobody has one."""
        below, above = self.found
        differ: Flags = self.share < AGREED
        for name, most in rule.jumps.items():
            values, here = picture.values[name].ravel(), curves.scale(name, self.at)
            low, high = (values[side] / curves.scale(name, side) * here for side in (below, above))
            with np.errstate(invalid="ignore"):
                differ |= (below >= 0) & (above >= 0) & (np.abs(low - high) > most)
        left: Places = self.at[differ]
        return left

    def fill(self, picture: Picture, curves: Curves) -> None:
        """Give every place the motion with most votes; indices, in their scales, in proportion between the nearest."""
        told = self.share > 0.0
        at, (below, above), (down, up) = self.at[told], self.found[:, told], self.distance[:, told]
        nearer = np.where(down <= up, below, above)
        motion = picture.motion.ravel()
        with np.errstate(invalid="ignore"):
            weight = np.where((below >= 0) & (above >= 0), down / (down + up), 0.0)
        for name, field in picture.values.items():
            flat = field.ravel()
            guess = flat[nearer]
            if flat.dtype.kind == "f":
                guess = guess / curves.scale(name, nearer)
                between = (below >= 0) & (above >= 0) & np.isfinite(flat[below]) & np.isfinite(flat[above])
                low, high = (flat[side[between]] / curves.scale(name, side[between]) for side in (below, above))
                guess[between] = low + weight[between] * (high - low)
                guess *= curves.scale(name, at)
            flat[at] = guess
        motion[at] = motion[nearer]


def doubtful_area(picture: Picture, stride: int, rule: Rule) -> Flags:
    """Return the cells near a boundary, as far as the lattice of `stride` can tell."""
    squares = widen(mixed_squares(picture, stride, rule), 1)
    area = np.zeros(picture.shape, bool)
    area[:-1, :-1] = np.repeat(np.repeat(squares, stride, axis=0), stride, axis=1)
    area[1:] |= area[:-1]
    area[:, 1:] |= area[:, :-1]
    return area


class Poll:
    """Asks the computed cells of a picture, as they are now, about others."""

    def __init__(self, picture: Picture, curves: Curves) -> None:
        self.picture, self.parts = picture, curves.parts
        self.across = np.ascontiguousarray(picture.level.T)  # neighbours in memory are looked through faster

    def about(self, at: Places) -> Opinions:
        """Return what the computed cells beside say of the cells `at`."""
        first, second = self.parts
        width = self.picture.shape[1]
        i, j = np.divmod(at, width)
        steep = np.abs(np.gradient(first))[i] >= np.abs(np.gradient(second))[j]
        opinions = Opinions(at, *_nothing(len(at)))
        ways = (
            (steep, self.across, (width, 1), first, second, i, j),
            (~steep, self.picture.level, (1, width), second, first, j, i),
        )
        for chosen, level, strides, height, along, rows, columns in ways:
            which = np.flatnonzero(chosen)
            answer = self._ask(level, strides, height, along, rows[which], columns[which])
            for kept, told in zip((opinions.found, opinions.distance, opinions.share), answer, strict=True):
                kept[..., which] = told
        return opinions

    def _ask(
        self,
        level: NDArray[np.int8],
        strides: tuple[int, int],
        height: Floats,
        along: Floats,
        rows: Places,
        columns: Places,
    ) -> tuple[Places, Floats, Floats]:
        """Ask about cells in threads; rows are those along which the curves are steepest."""
        from vibroimpact.refinement.neighbours import poll

        number = len(rows)
        answer = _nothing(number)
        motion = self.picture.motion.ravel()

        def ask(low: int) -> None:
            poll(level, motion, strides, height, along, rows, columns, REACH, low, min(low + SHARE, number), *answer)

        with ThreadPoolExecutor(worker_count(None)) as pool:
            deque(pool.map(ask, range(0, number, SHARE)), maxlen=0)
        return answer


def _nothing(number: int) -> tuple[Places, Floats, Floats]:
    """Return the opinions about so many cells of nobody: places found, distances, share."""
    return np.full((2, number), -1, np.int64), np.full((2, number), np.inf), np.zeros(number)


def doubtful(picture: Picture, cells: Iterable[Places], curves: Curves, rule: Rule) -> Places:
    """Return those of the cells about which their neighbours along the curves disagree."""
    poll = Poll(picture, curves)
    return np.concatenate([poll.about(at).doubtful(picture, rule, curves) for at in cells])


def fill(picture: Picture, cells: Iterable[Places], curves: Curves) -> None:
    """Fill the cells in from computed ones along the curves."""
    poll = Poll(picture, curves)
    for at in cells:
        poll.about(at).fill(picture, curves)


def unknown(picture: Picture, area: Flags) -> Iterator[Places]:
    """Yield the cells of an area that are not computed, some rows at a time: all their places would fill the memory."""
    width = picture.shape[1]
    rows = max(PORTION // width, 1)
    for low in range(0, picture.shape[0], rows):
        band = slice(low, low + rows)
        yield low * width + np.flatnonzero(area[band] & (picture.level[band] < 0))


def still_unknown(picture: Picture, at: Places) -> Iterator[Places]:
    """Yield those of the cells `at` that are not computed, some at a time."""
    level = picture.level.ravel()
    for low in range(0, max(len(at), 1), PORTION):
        part = at[low : low + PORTION]
        yield part[level[part] < 0]


def thinned(at: Places, turn: int) -> Places:
    """Return one in PART of the places, scattered evenly; each has its turn once in PART."""
    scattered = at.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    chosen: Places = at[(scattered >> np.uint64(40)) % np.uint64(PART) == np.uint64(turn)]
    return chosen
