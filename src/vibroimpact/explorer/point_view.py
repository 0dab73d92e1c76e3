"""The motion at the point: four plots, its sentence and its numbers, as the page is sent them."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from vibroimpact.dataset import VARIABLES
from vibroimpact.explorer.parcel import Parcel
from vibroimpact.explorer.plane_view import LETTERS, PINS
from vibroimpact.explorer.point import Point, fields
from vibroimpact.explorer.searches import Other
from vibroimpact.explorer.state import GREEK, LABELS
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


class PointView:
    """Four plots of the present motion, with those of up to two pinned ones beside it."""

    def __init__(self) -> None:
        self.parcels = {name: Parcel(name) for name in ("point", "pins", "others")}
        self._point: Point | None = None
        self._pins: list[Point] = []
        self._others = ""

    def show_point(self, point: Point) -> None:
        """Draw the present motion."""
        self._point = point
        parcel, osc = self.parcels["point"], point.osc
        parcel.pack("motion_0", slot=0, **_motion(point))
        y = point.history["displacement"]
        parcel.pack(
            "facts",
            gap=osc.gap,
            period=osc.period,
            force=1.0 if osc.amplitude else 0.0,
            low=min(float(y.min()) if y.size else osc.gap, osc.gap - 1e-12 * (abs(osc.gap) or 1.0)),
            begin=point.rests["begin"].tolist(),
            end=point.rests["end"].tolist(),
            colors=COLORS,
        )
        self._frame(parcel)
        parcel.pack("#sentence", html=escape(point.sentence[0].upper() + point.sentence[1:]))
        parcel.pack("#numbers", html=numbers_table(point, self._pins))
        parcel.send()

    def show_pins(self, pins: list[Point]) -> None:
        """Draw the pinned motions beside it."""
        self._pins = pins
        parcel = self.parcels["pins"]
        for slot in (1, 2):
            parcel.pack(f"motion_{slot}", slot=slot, **_motion(pins[slot - 1] if slot <= len(pins) else None))
        if self._point is not None:
            self._frame(parcel)
            parcel.pack("#numbers", html=numbers_table(self._point, pins))
        parcel.send()

    def show_others(self, others: list[Other]) -> None:
        """Tell which motions coexist."""
        told = _coexistence(others)
        if told != self._others:
            self._others = told
            self.parcels["others"].pack("#others", html=told)
            self.parcels["others"].send()

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
        parcel.pack(
            "home",
            history=[(begin, min(begin + shown, last)), y_limits],
            portrait=[y_limits, v_limits],
            poincare=[y_limits, v_limits],
            impact_map=[(0.0, 1.0), (-0.03 * most, 1.08 * most)],
        )


def _coexistence(others: list[Other]) -> str:
    if not others:
        return ""
    if len(others) == 1:
        return "All starts that were tried lead to this motion."
    listed = ", ".join(f"{escape(other.name)} ({100 * other.share:.0f} %)" for other in others[:5])
    return f"Starts lead to {len(others)} motions: {listed}."


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


def _motion(point: Point | None) -> dict[str, Any]:
    """Return the columns of a motion's plots, laid end to end since each array costs a message; None is nothing."""
    if point is None:
        return {"gap": 0.0, "begin": 0.0, "turn": 0, "lengths": {}, "values": []}
    time = point.history["time"]
    begin = float(time[0]) if time.size else 0.0
    columns = {
        "time": time - begin,
        "displacement": point.history["displacement"],
        "velocity": point.history["velocity"],
        "hits": point.impacts["time"] - begin,
        "looks_y": point.poincare["displacement"],
        "looks_v": point.poincare["velocity"],
        "phases": point.impact_map["phase"],
        "speeds": point.impact_map["velocity"],
    }
    lengths = {name: len(values) for name, values in columns.items()}
    values = np.concatenate(list(columns.values())).astype(np.float32)
    return {"gap": point.osc.gap, "begin": begin, "turn": one_turn(point), "lengths": lengths, "values": values}


def one_turn(point: Point) -> int:
    """Return how many samples tell all of the orbit: those of a cycle where the history is nothing but cycles."""
    time = point.history["time"]
    if not (point.settled and point.n_periods and time.size):
        return int(time.size)
    after = int(np.searchsorted(time, time[0] + point.n_periods * point.osc.period, "right"))
    return min(after + 1, time.size)
