"""The plane as the page is sent it: pixels, exact values, names, a legend, and what lies over it."""

from __future__ import annotations

from html import escape

import numpy as np
from bokeh.palettes import RdBu11, Viridis256, interp_palette
from numpy.typing import NDArray

from vibroimpact.dataset import VARIABLES
from vibroimpact.explorer.parcel import Parcel
from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.searches import Curves
from vibroimpact.explorer.shades import NOTHING, Shades, shades
from vibroimpact.explorer.state import GREEK, View, parameter_label
from vibroimpact.plotting.style import GREEN, RED, STICKING

PINS = (RED, GREEN)
LETTERS = ("A", "B")
CURVES = {"fold": "#e7298a", "period_doubling": "#ffffff", "grazing": "#ff9d2e", "end_of_sticking": "#f0e442"}
SCALES = {"signed": interp_palette(RdBu11, 255), "sequential": Viridis256}
OUTSIDE = (NOTHING, STICKING)  # what has no place on the scale of colours


class PlaneView:
    """The plane and its legend."""

    def __init__(self) -> None:
        self.parcels = {name: Parcel(name) for name in ("plane", "curves")}

    def show_view(self, view: View, parcel: Parcel) -> None:
        """Put ranges, labels, the point and the pins where the view has them."""
        both = (view.x, view.y)
        parcel.pack(
            "plane_home",
            x=view.x_range,
            y=view.y_range,
            labels=[parameter_label(name) for name in both],
            symbols=[GREEK.get(VARIABLES[name][2], VARIABLES[name][2]) for name in both],
        )
        pins = zip(view.pins, PINS, LETTERS, strict=False)
        parcel.pack(
            "marks",
            x=view.osc_value("x"),
            y=view.osc_value("y"),
            along=view.line,
            pins=[(getattr(pin, view.x), getattr(pin, view.y), color, letter) for pin, color, letter in pins],
        )

    def show_plane(self, plane: Plane) -> None:
        """Show a plane as far as it is known."""
        seen, parcel, view = shades(plane), self.parcels["plane"], plane.view
        colors, named = _colors(seen), seen.palette == "names"
        told, names = np.unique(seen.name, return_inverse=True)
        parcel.pack(
            "plane",
            side=plane.side,
            shape=seen.shade.shape,
            x=view.x_range,
            y=view.y_range,
            cells=color_numbers(seen, len(colors) - len(OUTSIDE)),
            values=[] if named else seen.value.ravel(),
            names=names.ravel().astype(np.uint16),
            told=told.tolist(),
            index="" if named else view.index,
            colors=colors,
            low=seen.low,
            high=seen.high,
            ticks=seen.ticks,
        )
        origin = f"stored study {escape(plane.stored)}" if plane.stored else f"{plane.side} × {plane.side} cells"
        took = f", {plane.seconds:.1f} s" if plane.seconds >= 0.05 else ""
        parcel.pack("#plane-head", html=f"<b>{escape(seen.title)}</b> <span>{origin}{took}</span>")
        parcel.pack("#colours", html=" ".join(_entry("key", color, words) for color, words in seen.legend))
        parcel.send()

    def show_curves(self, curves: Curves | None) -> None:
        """Draw boundaries over the plane, or take them away."""
        curves, parcel = curves or Curves([], [], [], []), self.parcels["curves"]
        colors = [CURVES.get(kind, "#ffffff") for kind in curves.kinds]
        places = [np.column_stack([x, y]) for x, y in zip(curves.x, curves.y, strict=True)]
        parcel.pack(
            "curves",
            lengths=[len(points) for points in places],
            places=np.concatenate([np.empty((0, 2)), *places]).ravel(),
            colors=colors,
            words=curves.words,
        )
        kinds = {color: words.split(",")[0] for color, words in zip(colors, curves.words, strict=True)}
        parcel.pack("#boundaries", html=" ".join(_entry("key line", color, word) for color, word in kinds.items()))
        parcel.send()


def _entry(kind: str, color: str, words: str) -> str:
    return f"<span class='entry'><span class='{kind}' style='background:{color}'></span> {escape(words)}</span>"


def _colors(seen: Shades) -> tuple[str, ...]:
    """Return the colours of the scale, and those outside it."""
    return (*SCALES.get(seen.palette, seen.colors), *OUTSIDE)


def color_numbers(seen: Shades, scale: int) -> NDArray[np.uint16]:
    """Return which colour every cell has, the upper row first as pictures have it."""
    shade = seen.shade[::-1].astype(np.float64)
    with np.errstate(invalid="ignore"):
        place = np.clip((shade - seen.low) / (seen.high - seen.low) * scale, 0, scale - 1)
    number = np.nan_to_num(place, nan=scale).astype(np.uint16)
    if seen.palette == "signed":
        number[np.isneginf(seen.value[::-1])] = scale + 1
    return number.ravel()
