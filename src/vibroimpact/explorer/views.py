"""The messages to the page for the plane, the point's motion and the diagram."""

from __future__ import annotations

from html import escape
from itertools import starmap
from typing import Any

import numpy as np

from vibroimpact.cells import FASTEST
from vibroimpact.coexistence import Attractor
from vibroimpact.coexistence.measuring import SPREAD
from vibroimpact.dataset import bifurcation_name
from vibroimpact.explorer.limits import FINEST
from vibroimpact.explorer.plane import FOLLOWED, ONLY_OTHERS, OTHERS, TRANSIENT, WORST, Curves, Line, Plane
from vibroimpact.explorer.point import Point, index_text
from vibroimpact.explorer.shades import name_of, shades
from vibroimpact.explorer.state import (
    LETTERS,
    View,
    index_label,
    parameter_label,
    shown_unit,
    symbol,
    table,
    values_of,
    with_minus,
    written,
)
from vibroimpact.indices import INDICES
from vibroimpact.plotting.diagrams import UNRANKED
from vibroimpact.plotting.style import BOUNDARY_COLORS, GREEN, RED, STATUS_COLORS
from vibroimpact.plotting.style import view as limits
from vibroimpact.plotting.ticks import quantity
from vibroimpact.status import Status

MOST_LISTED = 5  # motions
TRIED_THERE = f"impacts spread over phases 0 to 1 and velocities 0 to {FASTEST:g} V, V = max(f, k |g|)/√(km)"
PINS = (RED, GREEN)
COLORS = ("blue", "red", "green")  # of the present and the pinned motions: as in figures, lighter on a dark page
SHOWN_PERIODS = 6  # driving periods of the time history, at least


Parts = dict[str, dict[str, Any]]  # by names that the page's script knows; "#numbers" is the HTML of that element


class PlaneView:
    """The plane, its legend, and its overlays."""

    def __init__(self) -> None:
        self._hatched: Plane | None = None

    def show_view(self, view: View) -> Parts:
        """Update ranges, labels, the point and the pins from the view."""
        both = [view.table[name] for name in (view.x, view.y)]
        home = {
            "x": view.x_range,
            "y": view.y_range,
            "labels": [parameter_label(parameter) for parameter in both],
            "symbols": [symbol(parameter) for parameter in both],
        }
        places = [values_of(pin, view.hertz) for pin in view.pins]
        pins = [
            (place[view.x], place[view.y], color, letter)
            for place, color, letter in zip(places, PINS, LETTERS, strict=False)
        ]
        marks = {"x": view.osc_value("x"), "y": view.osc_value("y"), "along": view.line, "pins": pins}
        return {"plane_home": home, "marks": marks}

    def show_plane(self, plane: Plane) -> Parts:
        """Show the cells of a plane computed so far."""
        colours, view = shades(plane), plane.view
        named = not colours.scale
        motions, names = np.unique(colours.name, return_inverse=True)
        picture = {
            "side": plane.side,
            "shape": colours.number.shape,
            "x": view.x_range,
            "y": view.y_range,
            "cells": colours.number[::-1].ravel(),  # upper row first, as in pictures
            "values": [] if named else colours.value.ravel(),
            "names": names.ravel().astype(np.uint16),
            "motions": [name_of(code) for code in motions.tolist()],
            "index": "" if named else index_label(INDICES[view.index], units=False),
            "unit": "" if named else shown_unit(INDICES[view.index].units),
            "colors": colours.colors,
            "scale": colours.scale,
            "origin": plane.origin,
            "low": colours.low,
            "high": colours.high,
            "ticks": colours.ticks,
        }
        cells = f"stored sweep {escape(plane.stored)}" if plane.stored else f"{plane.side} × {plane.side} cells"
        took = f"computed in {plane.seconds:.1f} s" if plane.seconds else ""
        whence = WORST if view.worst and view.index not in UNRANKED else plane.origin
        head = f"<b>{escape(colours.title)}</b> {whence} <span title='{took}'>{cells}</span>"
        legend = " ".join(_legend_entry(color, label) for color, label in colours.legend)
        parts: Parts = {"plane": picture, "#plane-head": {"html": head}, "#colours": {"html": legend}}
        if self._hatched is not None and plane is not self._hatched:  # hatching belongs to its plane
            parts |= self.show_hatch(None)
        return parts

    def show_hatch(self, plane: Plane | None) -> Parts:
        """Hatch the cells with impacts only from initial conditions other than rest, as far as known."""
        self._hatched, side, words = plane, 0, ""
        if plane is not None:
            side = FINEST if plane.tried is not None and (plane.elsewhere > 0.0).any() else 0
            words = f"{OTHERS} other initial conditions tried in grey cells: no impacts"
            if plane.tried is None:
                words = f"{OTHERS} other initial conditions are being tried in grey cells"
            elif side:
                key = f"<span class='key hatch' style='background-color:{STATUS_COLORS[Status.NO_IMPACT]}'></span>"
                words = f"{key} {ONLY_OTHERS}"
            words += ", not in all" if plane.tried is False else ""
            words = f"<span class='entry' title='{TRANSIENT + plane.view.samples} impacts each'>{words}</span>"
        hatch: dict[str, Any] = {"side": side, "speeds": plane.elsewhere.T.ravel() if plane and side else []}
        return {"hatch": hatch, "#hatch": {"html": words}}

    @staticmethod
    def show_late(late: bool) -> Parts:
        """Offer to resume a plane that was suspended for lack of time."""
        button = "<button type='button' value='go_on' title='Compute for the same time again'>Continue</button>"
        return {"#late": {"html": button if late else ""}}

    def show_curves(self, curves: Curves | None) -> Parts:
        """Draw boundaries over the plane, or remove them."""
        curves = curves or Curves([], [], [])
        colors = [BOUNDARY_COLORS[kind] for kind in curves.kinds]
        drawn = {
            "lengths": [len(points) for points in curves.points],
            "places": np.concatenate([np.empty((0, 2)), *curves.points]).ravel(),
            "colors": colors,
            "words": curves.descriptions,
        }
        kinds = [kind for kind in BOUNDARY_COLORS if kind in curves.kinds]
        entries = " ".join(_line_entry(*BOUNDARY_COLORS[kind], bifurcation_name(kind)) for kind in kinds)
        counts = ", ".join(map(str, FOLLOWED))
        of = f"of motions of n = {counts} driving periods with one impact, or sticking; others are not drawn"
        html = f"<span title='{of}'>boundaries of n = {counts}:</span> {entries}"
        return {"curves": drawn, "#boundaries": {"html": html if entries else ""}}


def _line_entry(color: str, halo: str, label: str) -> str:
    look = f"background:{color};border-color:{halo}"
    return f"<span class='entry'><span class='key line' style='{look}'></span> {escape(label)}</span>"


def _legend_entry(color: str, label: str) -> str:
    return f"<span class='entry'><span class='key' style='background:{color}'></span> {escape(label)}</span>"


class PointView:
    """Four plots of the present motion and up to two pinned motions."""

    def __init__(self) -> None:
        self._point: Point | None = None
        self._pins: list[Point] = []
        self._others: list[Attractor] = []
        self.hertz = False  # unit of frequencies

    def show_point(self, point: Point) -> Parts:
        """Draw the present motion."""
        self._point, system = point, point.system
        reached = np.concatenate([point.history["displacement"], *_places(point), [0.0]])
        single = system.coordinates == 1 and bool(np.max(system.stiffness) > 0.0)
        facts = {
            "period": system.period,
            "single": single,  # whether it is one mass on a spring, and if so, driven by a sine
            "force": 1.0 if single and _sine(system) else 0.0,
            "label": point.shown.name,
            "low": float(reached.min()),
            "high": float(reached.max()),
        }
        return {
            "motion_0": {"slot": 0, **_motion(point)},
            "facts": facts,
            "home": self._frame(),
            "#sentence": {"html": escape(with_minus(point.sentence[0].upper() + point.sentence[1:]))},
            "#numbers": {"html": numbers_table(point, self._pins, self.hertz)},
            **self.show_others(self._others),
        }

    def show_pins(self, pins: list[Point]) -> Parts:
        """Draw the pinned motions."""
        self._pins, parts = pins, {}
        for slot in (1, 2):
            parts[f"motion_{slot}"] = {"slot": slot, **_motion(pins[slot - 1] if slot <= len(pins) else None)}
        if self._point is not None:
            parts |= {"home": self._frame(), "#numbers": {"html": numbers_table(self._point, pins, self.hertz)}}
        return parts

    def show_others(self, others: list[Attractor]) -> Parts:
        """List the motions reached from other initial conditions."""
        self._others = others
        return {"#others": {"html": _coexistence(others, self._point)}}

    def _frame(self) -> dict[str, Any]:
        """Fit the axes to the data, without zooming into rounding errors."""
        assert self._point is not None
        drawn, system = [self._point, *self._pins], self._point.system
        y = np.concatenate([point.history["displacement"] for point in drawn])
        v = np.concatenate([point.history["velocity"] for point in drawn])
        speeds = np.concatenate([point.impact_map["velocity"] for point in drawn])
        y_limits = limits(
            np.concatenate([y, *(place for point in drawn for place in _places(point))]), self._point.size
        )
        v_limits = limits(v, system.velocity_scale or 1.0)
        time = self._point.history["time"]
        begin, last = (float(time[0]), float(time[-1])) if time.size else (0.0, system.period)
        shown = max(SHOWN_PERIODS, 2 * min(self._point.n_periods, 16)) * system.period
        most = float(speeds.max(initial=0.0)) or 1.0
        return {
            "history": [(begin, min(begin + shown, last)), y_limits],
            "portrait": [y_limits, v_limits],
            "poincare": [y_limits, v_limits],
            "impact_map": [(0.0, 1.0), (-0.03 * most, 1.08 * most)],
        }


def _coexistence(others: list[Attractor], point: Point | None) -> str:
    if not others:
        return ""
    if len(others) == 1 and others[0].share == 1.0 and point is not None and point.settles_to(others[0]):
        return f"<span title='{TRIED_THERE}'>All {SPREAD} other initial conditions tried lead to this motion.</span>"
    listed = [f"{_part(other.share)} {escape(other.name)}{_hardest(other)}" for other in others[:MOST_LISTED]]
    undecided = 1.0 - sum(other.share for other in others)
    listed += [f"{len(others) - MOST_LISTED} more motions"] if len(others) > MOST_LISTED else []
    listed += [f"{_part(undecided)} undecided"] if undecided > 0.5 / SPREAD else []
    return f"<span title='{TRIED_THERE}'>From {SPREAD} other initial conditions: {', '.join(listed)}.</span>"


def _part(share: float) -> str:
    """Return a share of the initial conditions as text; an exactly known orbit may attract none of them."""
    if 0.0 < share < 0.01:
        return "<1 %"
    return "none" if not share else f"{100 * min(share, 0.99 if share < 1.0 else 1.0):.0f} %"


def _hardest(other: Attractor) -> str:
    return f" (up to {quantity(other.max_velocity, 'm/s', 3)})" if other.max_velocity > 0.0 else ""


def numbers_table(point: Point, pins: list[Point], hertz: bool = False) -> str:
    """Return all indices of the point and the pins as an HTML table; with pins, names are shorter."""
    points = [point, *pins]
    rows = []
    for name, index in INDICES.items():
        values = [index_text(shown, name, 4 if pins else 5) for shown in points]
        units = any(map(str.isdigit, "".join(values)))
        rows.append((index_label(index, units=units, shorter=bool(pins)), values, index.long_name))
    places = [values_of(shown.osc, hertz) for shown in points]
    for name, parameter in table(point.osc, hertz).items():
        numbers = [place[name] for place in places]
        if len(set(numbers)) > 1:
            rows.append((parameter_label(parameter), list(map(written, numbers)), parameter.long_name))
    head = "" if not pins else "<tr><th></th>" + "".join(
        f"<td style='border-bottom:3px solid var(--{color})'>{name}</td>"
        for name, color in zip(["here", *LETTERS[: len(pins)]], COLORS, strict=False)
    ) + "</tr>"  # fmt: skip
    half = (len(rows) + 1) // 2
    tables = "".join(f"<table>{head}{''.join(starmap(_row, part))}</table>" for part in (rows[:half], rows[half:]))
    return f"<div class='n'>{tables}</div>"


def _row(label: str, values: list[str], title: str) -> str:
    cells = "".join(f"<td>{escape(value)}</td>" for value in values)
    name, bracket, unit = label.partition(" [")
    unit = f" <span>{escape(bracket.strip() + unit)}</span>" if bracket else ""
    return f"<tr><th title='{escape(title)}'>{escape(name)}{unit}</th>{cells}</tr>"


def _motion(point: Point | None) -> dict[str, Any]:
    """Return the data of a motion's plots, concatenated; None gives empty arrays."""
    if point is None:
        return {"walls": [], "begin": 0.0, "turn": 0, "lengths": {}, "values": []}
    time = point.history["time"]
    begin = float(time[0]) if time.size else 0.0
    hits, rests = point.impacts, point.rests
    columns = {
        "time": time - begin,
        "displacement": point.history["displacement"],
        "velocity": point.history["velocity"],
        "hits": hits["time"] - begin,
        "hit_places": point.places(hits["stop"], hits["time"]),
        "rest_begin": rests["begin"] - begin,
        "rest_end": rests["end"] - begin,
        "rest_places": point.places(rests["stop"], rests["begin"]),
        "looks_y": point.poincare["displacement"],
        "looks_v": point.poincare["velocity"],
        "phases": point.impact_map["phase"],
        "speeds": point.impact_map["velocity"],
    }
    columns |= {f"wall_{number}": places for number, places in enumerate(_places(point))}
    lengths = {name: len(values) for name, values in columns.items()}
    values = np.concatenate(list(columns.values())).astype(np.float32)
    walls = [(wall.side, wall.name) for wall in point.shown.walls]
    return {"walls": walls, "begin": begin, "turn": one_turn(point), "lengths": lengths, "values": values}


def _places(point: Point) -> list[Any]:
    """Return the positions of the walls during the history, one value for a fixed wall."""
    shown, time = point.shown, point.history["time"]
    return [shown.place(wall, time if shown.moves(wall) else np.zeros(min(1, len(time)))) for wall in shown.walls]


def _sine(system: Any) -> bool:
    """Whether a single coordinate is driven by a sine in its own direction; the page draws its arrow accordingly."""
    form = system.modal()
    force = form.forces[form.orders == 1]
    return bool(force.real.any() and (force.real >= 0.0).all()) and not force.imag.any()


def one_turn(point: Point) -> int:
    """Return the number of samples that show the whole orbit: those of one cycle if the history only repeats."""
    time = point.history["time"]
    if not (point.settled and point.n_periods and time.size):
        return int(time.size)
    after = int(np.searchsorted(time, time[0] + point.n_periods * point.system.period, "right"))
    return min(after + 1, time.size)


def show_ends(view: View) -> Parts:
    """Update range and label of the diagram from the view."""
    parameter, ends = view.along
    return {
        "line_home": {"x": ends, "label": parameter_label(view.table[parameter])},
        "line": {"here": view.values[parameter]},
    }


def show_line(line: Line) -> Parts:
    """Draw impact velocities along a line through the point."""
    most = float(line.velocities.max(initial=0.0)) or 1.0
    low, high = line.ends
    dots = np.concatenate([(line.values - low) / (high - low), line.velocities]).astype(np.float32)
    return {"line": {"low": low, "high": high, "dots": dots}, "line_home": {"y": (-0.02 * most, 1.05 * most)}}
