"""The search for computed cells beside a curve, compiled."""

from __future__ import annotations

import math
from typing import Any

from vibroimpact.kernels.compilation import compiled

FARTHEST = 16  # cells from the curve within a row
SLANT = 0.002  # what a cell along the curve counts, beside one across it


def _nearest(
    level: Any,
    height: Any,
    along: Any,
    rows: Any,
    columns: Any,
    reach: int,
    begin: int,
    end: int,
    found: Any,
    distance: Any,
) -> None:
    """Write where the nearest computed cells on either side of the curve through the cells `begin` to `end` lie.

    The curve is height[i] + along[j] = constant; it crosses each column j at most once. Distances are in cells,
    across the curve. `found` has shape (row or column, side, n), `distance` (side, n).
    """
    last, width = level.shape[0] - 1, level.shape[1]
    for k in range(begin, end):
        i, j = rows[k], columns[k]
        low, high = max(i - 1, 0), min(i + 1, last)
        left, right = max(j - 1, 0), min(j + 1, width - 1)
        sign = 1.0 if height[high] > height[low] else -1.0
        cell = math.hypot((height[high] - height[low]) / (high - low), (along[right] - along[left]) / (right - left))
        curve = height[i] + along[j]
        for way in (-1, 1):
            at = i
            for d in range(reach + 1):
                column = j + way * d
                if column < 0 or column >= width:
                    break
                target = curve - along[column]
                while at < last and sign * (height[at + 1] - target) <= 0.0:
                    at += 1
                while at >= 0 and sign * (height[at] - target) > 0.0:
                    at -= 1
                for side in (0, 1):
                    row = at + side
                    for _ in range(FARTHEST):
                        if row < 0 or row > last:
                            break
                        if level[row, column] >= 0:
                            off = abs(height[row] - target) / cell + SLANT * math.hypot(row - i, d)
                            if off < distance[side, k]:
                                distance[side, k] = off
                                found[0, side, k] = row
                                found[1, side, k] = column
                            break
                        row += 2 * side - 1


nearest = compiled(_nearest)
