"""The vote of computed cells beside a curve, compiled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.kernels.compilation import compiled

FARTHEST = 16  # cells from the curve within a row
SLANT = 0.001  # what a cell along the curve counts, beside one across it
BLUR = 0.02  # cells: nearer ones than that have about the same say
CANDIDATES = 64  # motions told apart around a cell


def _poll(
    level: Any,
    motion: Any,
    strides: Any,
    height: Any,
    along: Any,
    rows: Any,
    columns: Any,
    reach: int,
    begin: int,
    end: int,
    found: Any,
    distance: Any,
    share: Any,
) -> None:
    """Let computed cells say which motion the cells `begin` to `end` show; write what speaks for it.

    In each column that the curve height[i] + along[j] = constant through a cell crosses, the nearest computed cell on
    either side has a vote of (BLUR + distance)^-4, distances in cells. `level` is indexed by column, row; `motion` is
    flat, with `strides` of a row and a column. Of the motion with most votes `found`, of shape (side, n), gets the
    nearest cells, `distance` how far off they are, `share` its part of all votes.
    """
    motions, votes = np.zeros(CANDIDATES, np.uint32), np.zeros(CANDIDATES)
    nearest, where = np.zeros((CANDIDATES, 2)), np.zeros((CANDIDATES, 2), np.int64)
    width, last = level.shape[0], level.shape[1] - 1
    for k in range(begin, end):
        i, j = rows[k], columns[k]
        low, high = max(i - 1, 0), min(i + 1, last)
        left, right = max(j - 1, 0), min(j + 1, width - 1)
        sign = 1.0 if height[high] > height[low] else -1.0
        cell = math.hypot((height[high] - height[low]) / (high - low), (along[right] - along[left]) / (right - left))
        curve = height[i] + along[j]
        candidates = 0
        for turn in range(2 * reach + 1):
            d = turn if turn <= reach else reach - turn
            column = j + d
            if turn == 0 or turn == reach + 1:
                at = i
            if column < 0 or column >= width:
                continue
            target = curve - along[column]
            while at < last and sign * (height[at + 1] - target) <= 0.0:
                at += 1
            while at >= 0 and sign * (height[at] - target) > 0.0:
                at -= 1
            for side in range(2):
                row = at + side
                stop = row + FARTHEST * (2 * side - 1)
                while row != stop and 0 <= row <= last and level[column, row] < 0:
                    row += 2 * side - 1
                if row == stop or row < 0 or row > last:
                    continue
                off = math.hypot((height[row] - target) / cell, SLANT * math.hypot(row - i, d))
                place = row * strides[0] + column * strides[1]
                which = 0
                while which < candidates and motions[which] != motion[place]:
                    which += 1
                if which == CANDIDATES:
                    continue
                if which == candidates:
                    motions[which], votes[which] = motion[place], 0.0
                    nearest[which] = math.inf
                    where[which] = -1
                    candidates += 1
                votes[which] += (BLUR + off) ** -4.0
                if off < nearest[which, side]:
                    nearest[which, side], where[which, side] = off, place
        if candidates > 0:
            best = np.argmax(votes[:candidates])
            share[k] = votes[best] / np.sum(votes[:candidates])
            found[0, k], found[1, k] = where[best, 0], where[best, 1]
            distance[0, k], distance[1, k] = nearest[best, 0], nearest[best, 1]


poll = compiled(_poll)
