"""Short labels written on curves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from vibroimpact.plotting.style import INK, Floats

PLACES = 60  # places along a curve tried for its label
BESIDE = (0.0, 1.0, -1.0, 2.0, -2.0)  # heights above the curve that are tried, in line heights; on the curve first
ROOM = 3.0  # pixels between a label and other labels or the frame
HALO = withStroke(linewidth=2.4, foreground="white")


def name_along(ax: Axes, named: Iterable[tuple[Line2D, str]]) -> None:
    """Write its label on each curve, inside the axes, clear of other labels and, if possible, of other curves.

    A curve without room gets no label. The figure is laid out first, because sizes depend on its canvas.
    """
    figure: Any = ax.get_figure(root=True)
    figure.draw_without_rendering()
    frame = ax.get_window_extent().padded(-ROOM)
    taken = [text.get_window_extent().padded(ROOM) for text in ax.texts if text.get_visible()]
    curves = [(_places(ax, line), text) for line, text in named]
    for at, (places, text) in enumerate(curves):
        if not len(places):
            continue
        look: dict[str, Any] = {"fontsize": 7.5, "color": INK, "ha": "center", "va": "center", "path_effects": [HALO]}
        label = ax.text(0.0, 0.0, text, zorder=6, **look)
        size = label.get_window_extent()
        others = [one for i, (one, _) in enumerate(curves) if i != at]
        box = _free(places, (size.width, size.height), frame, taken, others)
        if box is None:
            label.remove()
            continue
        x, y = ax.transData.inverted().transform((0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1)))
        label.set_position((float(x), float(y)))
        taken.append(box.padded(ROOM))


def _places(ax: Axes, line: Line2D) -> Floats:
    """Return equally spaced points of the visible part of a curve in pixels, those in the middle first."""
    points: Floats = ax.transData.transform(np.asarray(line.get_xydata(), dtype=float))
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return points
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    wanted = np.linspace(0.0, lengths[-1], PLACES)
    dense = np.column_stack([np.interp(wanted, lengths, column) for column in points.T])
    frame = ax.get_window_extent()
    shown = dense[[frame.contains(*point) for point in dense]]
    middle = np.abs(np.arange(len(shown)) - 0.5 * len(shown))
    return shown[np.argsort(middle, kind="stable")]


def _free(
    places: Floats, size: tuple[float, float], frame: Bbox, taken: Sequence[Bbox], others: Sequence[Floats]
) -> Bbox | None:
    """Return a rectangle for a label that overlaps no other label, and as few points of other curves as possible."""
    width, height = size
    room = frame.width - width, frame.height - height
    if min(room) < 0.0:
        return None
    points = np.concatenate(others) if others else np.empty((0, 2))
    best: tuple[int, Bbox] | None = None
    for lines in BESIDE:
        for x, y in places + np.array([0.0, lines * height]):
            left = min(max(x - 0.5 * width, frame.x0), frame.x0 + room[0])
            low = min(max(y - 0.5 * height, frame.y0), frame.y0 + room[1])
            box = Bbox.from_bounds(left, low, width, height)
            if any(box.overlaps(other) for other in taken):
                continue
            inside = (points >= box.min).all(axis=1) & (points <= box.max).all(axis=1)
            if best is None or inside.sum() < best[0]:
                best = int(inside.sum()), box
            if best[0] == 0:
                return best[1]
    return best[1] if best else None
