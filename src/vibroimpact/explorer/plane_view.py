"""The plane, as Bokeh shows it."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from bokeh.models import (
    ColorBar,
    ColumnDataSource,
    CustomJSHover,
    CustomJSTickFormatter,
    Div,
    FixedTicker,
    HoverTool,
    Image,
    LinearColorMapper,
    MultiLine,
    Range1d,
    Scatter,
    Span,
    Text,
)
from bokeh.palettes import RdBu11, Viridis256, interp_palette
from bokeh.plotting import figure

from vibroimpact.explorer.parcel import Parcel
from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.searches import Curves
from vibroimpact.explorer.shades import NOTHING, Shades, shades
from vibroimpact.explorer.state import Range, View, offset, parameter_label
from vibroimpact.plotting.style import GREEN, INK, RED, STICKING

PINS = (RED, GREEN)
LETTERS = ("A", "B")
CURVES = {"fold": "#e7298a", "period_doubling": "#ffffff", "grazing": "#ff9d2e", "end_of_sticking": "#f0e442"}
LEFT, RIGHT = 74, 92  # pixels beside the plane, and beside the diagram below it
_NAME = """
const kind = Math.floor(value / 1e10), rest = value - kind * 1e10, n = Math.floor(rest / 1e5), p = rest - n * 1e5 - 1;
return ["undecided", "no impact", `period-${n} impact-${p}`, `period-${n} sticking`, "chaotic"][kind];
"""
_VALUE = """
if (Number.isNaN(value)) return "no value";
if (!Number.isFinite(value)) return value < 0 ? "−∞" : "none";
return String(Number(value.toPrecision(9)));
"""
_PLACE = """
const size = Math.max(Math.abs(range.start), Math.abs(range.end));
const digits = Math.ceil(Math.log10(size / (range.end - range.start))) + 4;
return String(Number(value.toPrecision(Math.min(Math.max(digits, 4), 17))));
"""
_TICK = """
if (base === 0) return String(Number(tick.toPrecision(7))).replace("-", "−");
return String(Number((tick - base).toPrecision(2))).replace(/-/g, "−");
"""


def style(plot: Any) -> Any:
    """Give a figure the house style: quiet frame, readable labels, a toolbar that hides."""
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.outline_line_color = None
    plot.min_border = 4
    plot.grid.grid_line_color = "#e8e8e8"
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.axis_label_text_font_size = "12px"
    plot.axis.axis_label_text_color = plot.axis.major_label_text_color = INK
    plot.axis.axis_label_standoff = 4
    plot.axis.major_label_text_font_size = "11px"
    plot.axis.minor_tick_line_color = None
    for axis in plot.axis:
        axis.ticker.desired_num_ticks = 5
        axis.formatter = CustomJSTickFormatter(code=_TICK, args={"base": 0})
    plot.axis.axis_line_color = plot.axis.major_tick_line_color = "#555555"
    plot.title.text_font_size = "12px"
    plot.title.text_font_style = "normal"
    plot.title.text_color = INK
    plot.title.standoff = 2
    return plot


def range_of(ends: Range, name: str | None = None) -> Range1d:
    """Return a range of an axis."""
    return Range1d(start=ends[0], end=ends[1], name=name)


def _tips(x: str, y: str, index: str) -> Any:
    """Return what is told of a cell below the pointer."""
    tips = [(x, "$x{custom}"), (y, "$y{custom}"), (index, "@value{custom}"), ("motion", "@name{custom}")]
    return [tip for tip in tips if tip[0]]


def label_axis(axis: Any, parameter: str, ends: Range) -> None:
    """Label an axis; one that is zoomed in deeply tells the distance from a round value."""
    base = offset(ends)
    label = parameter_label(parameter)
    if base:
        name, bracket, units = label.partition(" [")
        label = f"{name} − {base!r}{bracket}{units}"
    if axis.axis_label != label:
        axis.axis_label = label
    if axis.formatter.args["base"] != base:
        axis.formatter.args = {"base": base}


class PlaneView:
    """The plane and its legend."""

    def __init__(self, view: View) -> None:
        self.x_range, self.y_range = range_of(view.x_range), range_of(view.y_range)
        self.source = ColumnDataSource(_picture(None), name="plane_source")
        # what the page's script alone changes, as parcels tell it
        self.mark = ColumnDataSource({"x": [], "y": []}, name="mark")
        self.pins = ColumnDataSource({"x": [], "y": [], "color": [], "letter": []}, name="pins")
        self.curves = ColumnDataSource({"xs": [], "ys": [], "color": [], "words": []})
        self.head = Div(text="", sizing_mode="stretch_width", margin=(0, 4, 0, 4), styles={"min-height": "18px"})
        self.legend = Div(text="", sizing_mode="stretch_width", margin=(0, 4, 0, 4))
        self._mapper = LinearColorMapper(palette=list(Viridis256), low=0.0, high=1.0, nan_color=NOTHING)
        self._signed = list(interp_palette(RdBu11, 255))
        self.figure = self._plane()
        self._legend = ""

    def _plane(self) -> Any:
        plot = style(
            figure(
                x_range=self.x_range, y_range=self.y_range, sizing_mode="stretch_both", tools="pan,wheel_zoom,box_zoom",
                active_scroll="wheel_zoom", active_drag="pan", toolbar_location="right", name="plane",
            )
        )  # fmt: skip
        plot.toolbar.autohide = False
        plot.min_border_left, plot.min_border_right = LEFT, RIGHT
        plot.grid.grid_line_color = None
        plot.background_fill_color = "#eef0f2"
        self._glyph = Image(image="shade", x="x", y="y", dw="dw", dh="dh", color_mapper=self._mapper)
        image = plot.add_glyph(self.source, self._glyph, level="image")
        self._ticker = FixedTicker(ticks=[])
        self._bar = ColorBar(
            color_mapper=self._mapper, ticker=self._ticker, width=10, padding=4, label_standoff=6,
            major_label_text_font_size="11px", title="",
        )  # fmt: skip
        plot.add_layout(self._bar, "right")
        curves = plot.add_glyph(self.curves, MultiLine(xs="xs", ys="ys", line_color="color", line_width=2.6))
        plot.add_glyph(self.curves, MultiLine(xs="xs", ys="ys", line_color=INK, line_width=0.8))
        plot.add_tools(HoverTool(renderers=[curves], tooltips="@words", line_policy="interp", visible=False))
        self._hover = HoverTool(
            renderers=[image],
            tooltips=_tips("x", "y", "index"),
            formatters={
                "$x": CustomJSHover(code=_PLACE, args={"range": self.x_range}),
                "$y": CustomJSHover(code=_PLACE, args={"range": self.y_range}),
                "@value": CustomJSHover(code=_VALUE), "@name": CustomJSHover(code=_NAME),
            },
        )  # fmt: skip
        plot.add_tools(self._hover)
        across = Span(
            location=0.0, dimension="width", line_dash="dashed", line_color="#ffffff", line_width=1.2, level="overlay",
            name="across",
        )  # fmt: skip
        plot.add_layout(across)
        plot.add_glyph(
            self.pins, Scatter(x="x", y="y", size=17, fill_color="color", line_color="white", line_width=1.5)
        )
        plot.add_glyph(
            self.pins,
            Text(x="x", y="y", text="letter", text_align="center", text_baseline="middle", text_color="white",
                 text_font_size="11px", text_font_style="bold"),
        )  # fmt: skip
        for color, width in (("white", 4.0), (INK, 1.8)):
            plot.add_glyph(
                self.mark,
                Scatter(
                    x="x", y="y", size=15, marker="circle_cross", fill_color=None, line_color=color, line_width=width
                ),
                level="overlay",
            )
        return plot

    def show_view(self, view: View, parcel: Parcel) -> None:
        """Put ranges, labels, the point and the pins where the view has them."""
        self.x_range.update(start=view.x_range[0], end=view.x_range[1])
        self.y_range.update(start=view.y_range[0], end=view.y_range[1])
        label_axis(self.figure.xaxis[0], view.x, view.x_range)
        label_axis(self.figure.yaxis[0], view.y, view.y_range)
        upright = view.line != "x"
        place = {"x": view.osc_value("x"), "y": view.osc_value("y")}
        parcel.pack("=mark", data={axis: [value] for axis, value in place.items()})
        parcel.pack("=across", dimension="height" if upright else "width", location=place["x" if upright else "y"])
        pins = {
            "x": [getattr(pin, view.x) for pin in view.pins],
            "y": [getattr(pin, view.y) for pin in view.pins],
            "color": list(PINS[: len(view.pins)]),
            "letter": list(LETTERS[: len(view.pins)]),
        }
        parcel.pack("=pins", data=pins)

    def show_plane(self, plane: Plane) -> None:
        """Show a plane as far as it is known."""
        seen = shades(plane)
        self._colour(seen)
        self.source.data = _picture(plane, seen)
        origin = f"stored study {escape(plane.stored)}" if plane.stored else f"{plane.side} × {plane.side} cells"
        took = f", {plane.seconds:.1f} s" if plane.seconds >= 0.05 else ""
        self.head.text = f"<b>{escape(seen.title)}</b> <span style='color:#5b6470'>{origin}{took}</span>"
        self._legend = " ".join(
            f"<span style='white-space:nowrap;margin-right:8px'><span style='display:inline-block;width:10px;"
            f"height:10px;border:1px solid #999;background:{color}'></span> {escape(words)}</span>"
            for color, words in seen.legend
        )
        self._show_legend()
        tips = _tips(plane.view.x, plane.view.y, "" if seen.palette == "names" else plane.view.index)
        if self._hover.tooltips != tips:
            self._hover.tooltips = tips

    def _show_legend(self) -> None:
        kinds = dict(zip(self.curves.data["color"], self.curves.data["words"], strict=True))
        lines = " ".join(
            f"<span style='white-space:nowrap;margin-right:8px'><span style='display:inline-block;width:16px;"
            f"height:4px;vertical-align:middle;border:1px solid #222;background:{color}'></span> "
            f"{escape(words.split(',')[0])}</span>"
            for color, words in kinds.items()
        )
        text = f"{self._legend} {lines}".strip()
        if self.legend.text != text:
            self.legend.text = text

    def _colour(self, seen: Shades) -> None:
        colors: list[str]
        if seen.palette == "names":
            colors = list(seen.colors)
        else:
            colors = self._signed if seen.palette == "signed" else list(Viridis256)
        if self._mapper.palette != colors:
            self._mapper.palette = colors
        self._mapper.update(low=seen.low, high=seen.high, low_color=STICKING if seen.palette == "signed" else None)
        told = dict(seen.ticks)
        if self._bar.major_label_overrides != told:
            self._bar.major_label_overrides = told
            self._ticker.ticks = list(told)
        self._bar.visible = bool(told)

    def show_curves(self, curves: Curves | None) -> None:
        """Draw boundaries over the plane, or take them away."""
        if curves is None:
            curves = Curves([], [], [], [])
        self.curves.data = {
            "xs": curves.x,
            "ys": curves.y,
            "color": [CURVES.get(kind, "#ffffff") for kind in curves.kinds],
            "words": curves.words,
        }
        self._show_legend()


def _picture(plane: Plane | None, seen: Shades | None = None) -> dict[str, Any]:
    if plane is None or seen is None:
        nothing: dict[str, Any] = {name: [] for name in ("shade", "value", "name", "x", "y", "dw", "dh", "side")}
        return nothing
    (x0, x1), (y0, y1) = plane.view.x_range, plane.view.y_range
    return {
        "shade": [np.ascontiguousarray(seen.shade)],
        "value": [np.ascontiguousarray(seen.value)],
        "name": [np.ascontiguousarray(seen.name)],
        "x": [x0], "y": [y0], "dw": [x1 - x0], "dh": [y1 - y0], "side": [plane.side],
    }  # fmt: skip
