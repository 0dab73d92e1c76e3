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

from vibroimpact.distributed import worker_count
from vibroimpact.refinement.lattice import Flags, Floats, Places, widen
from vibroimpact.refinement.marking import Rule, mixed_squares
from vibroimpact.refinement.picture import Picture

# The power of each parameter in omega/omega_n = omega sqrt(mass/stiffness).
POWERS = {"omega": 1.0, "frequency": 1.0, "mass": 0.5, "stiffness": -0.5}
STRIDE = 4  # the quadtree hands over to the curves at this lattice
REACH = 24  # rows on either side whose cells have a say
PART = 4  # of the doubtful cells one in so many is computed at a time: each settles its neighbours along the curve
SURVEYS = 4  # of all cells near boundaries; each may find what the ones before overlooked
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
    """Of each doubtful place the nearest computed cells below and above its curve (-1: none), and how far off."""

    at: Places
    found: Places
    distance: Floats

    def doubtful(self, picture: Picture, rule: Rule) -> Places:
        """Return the places of which the two disagree, or that have none."""
        below, above = self.found
        motion = picture.motion.ravel()
        differ: Flags = motion[below] != motion[above]
        for name, most in rule.jumps.items():
            values = picture.values[name].ravel()
            with np.errstate(invalid="ignore"):
                differ |= np.abs(values[below] - values[above]) > most
        differ &= (below >= 0) & (above >= 0)
        left: Places = self.at[differ | ((below < 0) & (above < 0))]
        return left

    def fill(self, picture: Picture) -> None:
        """Give every place the motion of the nearer cell, and indices in proportion where both agree."""
        told = (self.found >= 0).any(axis=0)
        at, (below, above), (down, up) = self.at[told], self.found[:, told], self.distance[:, told]
        nearer = np.where(down <= up, below, above)
        motion = picture.motion.ravel()
        same = (below >= 0) & (above >= 0) & (motion[below] == motion[above])
        with np.errstate(invalid="ignore"):
            weight = np.where(same, down / (down + up), 0.0)
        for field in picture.values.values():
            flat = field.ravel()
            guess = flat[nearer]
            if flat.dtype.kind == "f":
                between = same & np.isfinite(flat[below]) & np.isfinite(flat[above])
                low, high = flat[below[between]], flat[above[between]]
                guess[between] = low + weight[between] * (high - low)
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


def ask(picture: Picture, at: Places, parts: tuple[Floats, Floats]) -> Opinions:
    """Return what the computed cells beside say of the cells `at`."""
    first, second = parts
    i, j = np.divmod(at, picture.shape[1])
    steep = np.abs(np.gradient(first))[i] >= np.abs(np.gradient(second))[j]
    found, distance = np.full((2, len(at)), -1, np.int64), np.full((2, len(at)), np.inf)
    which = np.flatnonzero(steep)
    (rows, columns), distance[:, which] = _search(picture.level, first, second, i[which], j[which])
    found[:, which] = np.where(rows >= 0, rows * picture.shape[1] + columns, -1)
    which = np.flatnonzero(~steep)
    (columns, rows), distance[:, which] = _search(picture.level.T, second, first, j[which], i[which])
    found[:, which] = np.where(rows >= 0, rows * picture.shape[1] + columns, -1)
    return Opinions(at, found, distance)


def _search(
    level: NDArray[np.int8], height: Floats, along: Floats, rows: Places, columns: Places
) -> tuple[NDArray[np.int64], Floats]:
    """Return rows and columns of the nearest computed cells on both sides of the curves, and how far off they are."""
    from vibroimpact.refinement.neighbours import nearest

    number = len(rows)
    found, distance = np.full((2, 2, number), -1, np.int64), np.full((2, number), np.inf)

    def search(low: int) -> None:
        high = min(low + SHARE, number)
        nearest(level, height, along, rows, columns, REACH, low, high, found, distance)

    with ThreadPoolExecutor(worker_count(None)) as pool:
        deque(pool.map(search, range(0, number, SHARE)), maxlen=0)
    return found, distance


def doubtful(picture: Picture, cells: Iterable[Places], parts: tuple[Floats, Floats], rule: Rule) -> Places:
    """Return those of the cells of which their neighbours along the curves disagree."""
    return np.concatenate([ask(picture, at, parts).doubtful(picture, rule) for at in cells])


def fill(picture: Picture, cells: Iterable[Places], parts: tuple[Floats, Floats]) -> None:
    """Fill the cells in from computed ones along the curves."""
    for at in cells:
        ask(picture, at, parts).fill(picture)


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
