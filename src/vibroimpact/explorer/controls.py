"""The controls tell the session what a person did, and show what it answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Div

from vibroimpact.dataset import VARIABLES
from vibroimpact.explorer.presets import BY_NAME, PRESETS, Preset, case_of, ranges_for
from vibroimpact.explorer.searches import Other
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import GREEK, SAMPLES, Range, View
from vibroimpact.explorer.widgets import WIDE, Kit, index_options
from vibroimpact.oscillator import PARAMETERS

MOST_OTHERS = 12  # offered as starts
_COUNTS = {str(samples): samples for samples in SAMPLES}
_ABOUT = (
    "<p style='font-size:11.5px;color:#5b6470;margin:6px 0'>Click a point of the plane to see its motion. Drag "
    "to move, scroll to zoom. Cases above; keys and words under Help.</p>"
)


class Controls:
    """The widgets of a page.

    Parameters
    ----------
    explorer : Explorer
        The session.
    export : callable
        Gets the kind of file that is asked for.
    """

    def __init__(self, explorer: Explorer, export: Callable[[str], Any]) -> None:
        self.explorer = explorer
        self._kit, self._quiet = Kit(), False
        self._case = case_of(explorer.view)
        self.ranges: dict[str, Range] = ranges_for(explorer.view)
        self._reach: dict[str, Range] = {}  # of sliders, lately
        cases = [("", "Choose a case …"), *((preset.name, preset.title) for preset in PRESETS)]
        self.preset = self._kit.menu("preset", "", cases)
        self.preset.on_change("value", self._to_preset)
        self.about = Div(text="", sizing_mode="stretch_width", margin=(2, 2, 0, 2))
        self.column = self._controls()
        self.buttons = self._buttons(export)

    # ---- making them

    def _controls(self) -> Any:
        menu, tick = self._kit.menu, self._kit.tick
        names = [(name, f"{name} {GREEK.get(VARIABLES[name][2], VARIABLES[name][2])}") for name in PARAMETERS]
        self.x, self.y = menu("x", "across", names), menu("y", "upwards", names)
        self.start = menu("start", "point's motion starts", [("rest", "from rest")])
        self.menus = {
            "index": menu("index", "colour tells", index_options()),
            "samples": menu("samples", "impacts a cell", [(text, text) for text in _COUNTS]),
            "line": menu("line", "diagram along", [("x", "across"), ("y", "upwards")]),
        }
        self.ticks = {
            "log": tick("log", "logarithmic colours"),
            "boundaries": tick("boundaries", "exact boundaries (some seconds)"),
            "settled": tick("settled", "show the settled motion"),
        }
        for axis in (self.x, self.y):
            axis.on_change("value", self._to_axes)
        for name, chosen in self.menus.items():
            chosen.on_change("value", lambda a, o, new, name=name: self._said(name, new))
        for name, box in self.ticks.items():
            box.on_change("active", lambda a, o, new, name=name: self._said(name, new))
        self.start.on_change("value", self._to_start)
        return column(
            row(self.x, self.y, **WIDE),
            self.menus["index"],
            row(self.menus["samples"], self.menus["line"], **WIDE),
            self.start,
            *self.ticks.values(),
            self.about,
            **WIDE,
        )

    def _buttons(self, export: Callable[[str], Any]) -> Any:
        explorer = self.explorer
        made = [
            ("undo", "↶ Undo", explorer.undo), ("redo", "↷ Redo", explorer.redo), ("home", "Whole plane", self.home),
            ("pin", "Pin point", explorer.pin), ("unpin", "Unpin", explorer.unpin),
        ]  # fmt: skip
        return row(*(self._kit.button(*one) for one in made), self._kit.exports(export), margin=0)

    # ---- what a person did

    def _said(self, name: str, value: Any) -> None:
        if not self._quiet:
            changes: dict[str, Any] = {name: _COUNTS.get(value, value) if name == "samples" else value}
            self.explorer.set(**changes)
            self.show_view(self.explorer.view)

    def _to_axes(self, attr: str, old: str, new: str) -> None:
        if self._quiet:
            return
        view, x, y = self.explorer.view, self.x.value, self.y.value
        if x == y:  # the other axis takes the place of the one chosen
            x, y = (x, view.x) if x != view.x else (view.y, y)
        if {x, y} <= set(PARAMETERS):
            self.explorer.set_axes(x, y, self.axis_range(x), self.axis_range(y))
        self.show_view(self.explorer.view)

    def _to_preset(self, attr: str, old: str, new: str) -> None:
        if not self._quiet:
            if new in BY_NAME:
                self.explorer.show(BY_NAME[new].view)
            self.show_view(self.explorer.view)

    def _to_start(self, attr: str, old: str, new: str) -> None:
        if self._quiet:
            return
        offered = {str(at): other for at, other in enumerate(self.explorer.others[:MOST_OTHERS])}
        if new in offered or new == "rest":
            self.explorer.follow(offered.get(new))

    def home(self) -> None:
        """Show the whole plane."""
        view = self.explorer.view
        self.explorer.set(x_range=self.axis_range(view.x), y_range=self.axis_range(view.y))

    def axis_range(self, name: str) -> Range:
        """Return the range that a parameter has along an axis: its slider's, without a zero that is not allowed."""
        low, high = self.ranges[name]
        if name in ("mass", "stiffness", "omega") and low <= 0.0:
            low = high / 500.0
        return low, high

    # ---- what the session answers

    def fit(self, view: View) -> None:
        """Let the sliders reach as far as suits a view."""
        self._case, self.ranges, self._reach = case_of(view), ranges_for(view), {}

    @contextmanager
    def _silently(self) -> Iterator[None]:
        before, self._quiet = self._quiet, True
        try:
            yield
        finally:
            self._quiet = before

    def show_view(self, view: View) -> None:
        """Put every widget where the view has it."""
        case = case_of(view)
        if case != self._case:
            self.fit(view)
        with self._silently():
            menus = {name: str(getattr(view, name)) for name in self.menus}
            shown = [(self.x, view.x), (self.y, view.y), (self.preset, case.name if case else "")]
            for widget, value in (*shown, *((self.menus[name], value) for name, value in menus.items())):
                if widget.value != value:
                    widget.value = value
            for name, tick in self.ticks.items():
                if tick.active != getattr(view, name):
                    tick.active = getattr(view, name)
            self._tell_about(case)
        self.show_others(self.explorer.others)

    def rows(self) -> dict[str, tuple[float, float, float]]:
        """Return every parameter as it is now, and the ends of its slider."""
        told = {}
        for name in PARAMETERS:
            value, (low, high) = getattr(self.explorer.view.osc, name), self.ranges[name]
            if not low <= value <= high:  # ends that made room for a value stay as long as one is beyond its range
                low, high = self._reach.get(name, (low, high))
            self._reach[name] = min(low, value), max(high, value)
            told[name] = (value, *self._reach[name])
        return told

    def _tell_about(self, case: Preset | None) -> None:
        text = _ABOUT
        if case is not None:
            text = (
                f"<div style='font-size:11.5px;line-height:1.35;color:#3c4450'><p style='margin:6px 0 3px'>"
                f"<b>{case.title}.</b> {case.source}</p>"
                f"<p style='margin:0'><b>Idealised:</b> {case.idealised}</p></div>"
            )
        if self.about.text != text:
            self.about.text = text

    def show_others(self, others: list[Other]) -> None:
        """Offer the motions that coexist as starts of the point's motion."""
        start = self.explorer.view.start
        options, chosen = [("rest", "from rest")], "rest"
        for at, other in enumerate(others[:MOST_OTHERS]):
            options.append((str(at), f"on {other.name} ({100 * other.share:.0f} %)"))
            chosen = str(at) if start == other.start else chosen
        if start is not None and chosen == "rest":
            options.append(("kept", "as the link tells"))
            chosen = "kept"
        with self._silently():
            if self.start.options != options:
                self.start.options = options
            if self.start.value != chosen:
                self.start.value = chosen
