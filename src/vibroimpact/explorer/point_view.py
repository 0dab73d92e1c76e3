"""The motion at the point: four plots, its sentence and its numbers, as Bokeh shows them."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from bokeh.models import BoxAnnotation, ColumnDataSource, Line, Scatter, Segment, Span
from bokeh.plotting import figure

from vibroimpact.dataset import VARIABLES
from vibroimpact.explorer.plane_view import LETTERS, PINS, range_of, style
from vibroimpact.explorer.point import Point, fields
from vibroimpact.explorer.searches import Other
from vibroimpact.explorer.state import GREEK, LABELS, View
from vibroimpact.oscillator import PARAMETERS
from vibroimpact.plotting.style import BLUE
from vibroimpact.plotting.style import view as limits

SHORT = {
    "largest Lyapunov exponent": "Lyapunov exponent λ",
    "largest Lyapunov exponent per impact": "λ per impact",
    "energy lost at the stop per driving period": "energy lost a period",
    "impacts per driving period": "impacts a period",
    "share of time at rest at the stop": "share of time at rest",
    "gap left by the closest near-miss": "closest near-miss",
    "standard deviation of impact velocities": "Std of impact velocities",
    "spread of the impact phases": "spread of phases",
    "driving periods in a cycle": "periods in a cycle",
}
COLORS = (BLUE, *PINS)
SHOWN_PERIODS = 6
TOOLS = "pan,wheel_zoom,box_zoom,reset,save"
PLOTS = ("history", "portrait", "poincare", "impact_map")


class Parcel:
    """Properties of many models sent in one message, set by the page at once, so that each plot is drawn once.

    A browser that comes later finds the last one of each name: what must not be lost has a parcel of its own.
    """

    def __init__(self, name: str) -> None:
        self.source = ColumnDataSource({"model": [], "set": []}, name=name)
        self._packed: dict[str, dict[str, Any]] = {}

    def pack(self, model: str, **properties: Any) -> None:
        """Add properties of the model of that name, or the html of an element such as "#numbers"."""
        self._packed.setdefault(model, {}).update(properties)

    def send(self) -> None:
        """Send what was packed."""
        self.source.data = {"model": list(self._packed), "set": list(self._packed.values())}
        self._packed = {}


class PointView:
    """Four plots of the present motion, with those of up to two pinned ones beside it."""

    def __init__(self) -> None:
        empty: dict[str, Any] = {"time": [], "displacement": [], "velocity": []}
        self.sources = [
            {
                "history": ColumnDataSource(dict(empty), name=f"history_{slot}"),
                "impacts": ColumnDataSource({"time": [], "gap": []}, name=f"impacts_{slot}"),
                "poincare": ColumnDataSource({"displacement": [], "velocity": []}, name=f"poincare_{slot}"),
                "impact_map": ColumnDataSource({"phase": [], "velocity": []}, name=f"impact_map_{slot}"),
            }
            for slot in range(len(COLORS))
        ]
        self.parcels = {name: Parcel(f"{name}_parcel") for name in ("point", "pins", "others")}
        self.rests = ColumnDataSource({"begin": [], "end": [], "gap": []}, name="rests")
        self.facts = ColumnDataSource({"gap": [0.0], "period": [1.0], "force": [1.0], "low": [-1.0]}, name="facts")
        self.ranges = {name: tuple(range_of((0.0, 1.0), f"{name}_{axis}") for axis in "xy") for name in PLOTS}
        self.figures = {
            "history": self._figure("history", "Time history", "time [s]", "displacement y [m]"),
            "portrait": self._figure("portrait", "Phase portrait", "displacement y [m]", "velocity [m/s]"),
            "poincare": self._figure(
                "poincare", "Poincaré map: once a driving period", "displacement y [m]", "velocity [m/s]"
            ),
            "impact_map": self._figure(
                "impact_map", "Impact map: when and how hard", "phase of the driving period", "impact velocity [m/s]"
            ),
        }
        for name in ("history", "portrait", "poincare"):
            self._stop(name)
        self.now = Span(
            location=0.0, dimension="height", line_color="#d55e00", visible=False, name="now", level="overlay"
        )
        self.figures["history"].add_layout(self.now)
        for slot in (1, 2, 0):
            self._draw(slot)
        rest = Segment(x0="begin", y0="gap", x1="end", y1="gap", line_color="#e0c800", line_width=5)
        self.figures["history"].add_glyph(self.rests, rest)
        self._point: Point | None = None
        self._pins: list[Point] = []
        self._others: list[Other] = []

    def _figure(self, name: str, title: str, x: str, y: str) -> Any:
        x_range, y_range = self.ranges[name]
        plot = figure(
            title=title, x_range=x_range, y_range=y_range, tools=TOOLS, toolbar_location="right", name=name,
            sizing_mode="stretch_both", x_axis_label=x, y_axis_label=y, active_scroll="wheel_zoom", lod_threshold=None,
        )  # fmt: skip
        return style(plot)

    def _stop(self, name: str) -> None:
        upright = name != "history"
        sides: dict[str, Any] = {"left" if upright else "bottom": 0.0}
        box = BoxAnnotation(
            fill_color="#dddddd", fill_alpha=0.9, hatch_pattern="/", hatch_color="#b8b8b8", hatch_scale=7.0,
            line_color=None, level="underlay", name=f"{name}_stop", **sides,
        )  # fmt: skip
        self.figures[name].add_layout(box)

    def _draw(self, slot: int) -> None:
        color, sources = COLORS[slot], self.sources[slot]
        alpha, width = (1.0, 1.4) if slot == 0 else (0.75, 1.2)
        for name, x, y in (("history", "time", "displacement"), ("portrait", "displacement", "velocity")):
            line = Line(x=x, y=y, line_color=color, line_width=width, line_alpha=alpha)
            self.figures[name].add_glyph(sources["history"], line)
        hits = Scatter(
            x="time",
            y="gap",
            marker="inverted_triangle",
            size=7,
            fill_color=color,
            line_color="white",
            fill_alpha=alpha,
        )
        self.figures["history"].add_glyph(sources["impacts"], hits)
        for name, x, y in (("poincare", "displacement", "velocity"), ("impact_map", "phase", "velocity")):
            dots = Scatter(x=x, y=y, size=4, line_color=None, fill_color=color, fill_alpha=alpha)
            self.figures[name].add_glyph(sources[name], dots)

    def show_point(self, point: Point, view: View) -> None:
        """Draw the present motion."""
        self._point = point
        parcel, gap = self.parcels["point"], point.osc.gap
        self._fill(parcel, 0, point)
        for name in ("history", "portrait", "poincare"):
            parcel.pack(f"{name}_stop", **{"bottom" if name == "history" else "left": gap})
        parcel.pack("rests", data={**point.rests, "gap": np.full(len(point.rests["begin"]), gap)})
        y = point.history["displacement"]
        low = min(float(y.min()) if y.size else gap, gap - 1e-12 * (abs(gap) or 1.0))
        force = 1.0 if point.osc.amplitude else 0.0
        parcel.pack("facts", data={"gap": [gap], "period": [point.osc.period], "force": [force], "low": [low]})
        self._frame(parcel)
        parcel.pack("#sentence", html=self._sentence())
        parcel.pack("#numbers", html=numbers_table(point, self._pins))
        parcel.send()

    def show_pins(self, pins: list[Point]) -> None:
        """Draw the pinned motions beside it."""
        self._pins = pins
        parcel = self.parcels["pins"]
        for slot in (1, 2):
            self._fill(parcel, slot, pins[slot - 1] if slot <= len(pins) else None)
        if self._point is not None:
            self._frame(parcel)
            parcel.pack("#numbers", html=numbers_table(self._point, pins))
        parcel.send()

    def show_others(self, others: list[Other]) -> None:
        """Tell which motions coexist."""
        if not others and not self._others:
            return
        self._others = others
        if others and self._point is not None:  # else the point's own turn is to come
            self.parcels["others"].pack("#sentence", html=self._sentence())
        self.parcels["others"].send()

    def _fill(self, parcel: Parcel, slot: int, point: Point | None) -> None:
        if point is None:
            for name, source in self.sources[slot].items():
                parcel.pack(f"{name}_{slot}", data={column: [] for column in source.data})
            return
        history = {name: values.astype(np.float32) for name, values in point.history.items() if name != "time"}
        parcel.pack(f"history_{slot}", data={"time": point.history["time"], **history})
        hits = point.impacts["time"]
        parcel.pack(f"impacts_{slot}", data={"time": hits, "gap": np.full(len(hits), point.osc.gap)})
        parcel.pack(f"poincare_{slot}", data=_small(point.poincare))
        parcel.pack(f"impact_map_{slot}", data=_small(point.impact_map))

    def _frame(self, parcel: Parcel) -> None:
        """Fit the axes to what is drawn, without zooming into rounding."""
        assert self._point is not None
        drawn, osc = [self._point, *self._pins], self._point.osc
        y = np.concatenate([point.history["displacement"] for point in drawn])
        v = np.concatenate([point.history["velocity"] for point in drawn])
        speeds = np.concatenate([point.impact_map["velocity"] for point in drawn])
        size = max(osc.amplitude / osc.stiffness, abs(osc.gap)) or 1.0
        y_limits, v_limits = limits(np.append(y, osc.gap), size), limits(v, osc.velocity_scale or 1.0)
        time = self._point.history["time"]
        begin, last = (float(time[0]), float(time[-1])) if time.size else (0.0, osc.period)
        shown = max(SHOWN_PERIODS, 2 * min(self._point.n_periods, 16)) * osc.period
        most = float(speeds.max(initial=0.0)) or 1.0
        for name, x, y_range in (
            ("history", (begin, min(begin + shown, last)), y_limits),
            ("portrait", y_limits, v_limits),
            ("poincare", y_limits, v_limits),
            ("impact_map", (0.0, 1.0), (-0.03 * most, 1.08 * most)),
        ):
            for axis, (low, high) in (("x", x), ("y", y_range)):
                parcel.pack(f"{name}_{axis}", start=low, end=high, reset_start=low, reset_end=high)

    def _sentence(self) -> str:
        assert self._point is not None
        told = self._point.sentence
        others = ""
        if len(self._others) > 1:
            listed = ", ".join(f"{escape(other.name)} ({100 * other.share:.0f} %)" for other in self._others[:5])
            others = f"<br><span style='color:#5b6470'>Starts lead to {len(self._others)} motions: {listed}.</span>"
        elif self._others:
            others = "<br><span style='color:#5b6470'>All starts that were tried lead to this motion.</span>"
        return f"<b class='told'>{escape(told[0].upper() + told[1:])}</b>{others}"


def numbers_table(point: Point, pins: list[Point]) -> str:
    """Return all indices of the point, and of the pins beside them, as HTML."""
    columns = [fields(one) for one in (point, *pins)]
    heads = ["here", *LETTERS[: len(pins)]]
    rows = []
    for row in zip(*columns, strict=True):
        symbol, long_name, _, units = row[0]
        short = SHORT.get(long_name, long_name)
        cells = "".join(f"<td>{escape(cell[2])}</td>" for cell in row)
        rows.append(f"<tr><th title='{escape(long_name)}'>{escape(short)}</th>{cells}<td class='u'>{units}</td></tr>")
    if pins:
        for name in PARAMETERS:
            values = [getattr(one.osc, name) for one in (point, *pins)]
            if len(set(values)) > 1:
                long_name, units, symbol = VARIABLES[name]
                cells = "".join(f"<td>{value:.5g}</td>" for value in values)
                unit = "" if units == "1" else units
                label = f"{LABELS.get(name, long_name)} {GREEK.get(symbol, symbol)}"
                rows.append(f"<tr><th>{escape(label)}</th>{cells}<td class='u'>{unit}</td></tr>")
    head = "" if not pins else "<tr><th></th>" + "".join(
        f"<td style='color:{color};font-weight:bold'>{name}</td>" for name, color in zip(heads, COLORS, strict=False)
    ) + "<td></td></tr>"  # fmt: skip
    half = (len(rows) + 1) // 2
    tables = "".join(f"<table>{head}{''.join(part)}</table>" for part in (rows[:half], rows[half:]))
    return f"<div class='n'>{tables}</div>"


def _small(columns: dict[str, Any]) -> dict[str, Any]:
    return {name: values.astype(np.float32) for name, values in columns.items()}
