"""The controls: what a person asks for by menus, buttons, keys and fields, and how they show what the session has."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Button, Div, InlineStyleSheet, Select

from vibroimpact import models
from vibroimpact.explorer.address import BY_NAME, PRESETS, Preset, case_of, ranges_for
from vibroimpact.explorer.limits import Range, allowed_range
from vibroimpact.explorer.models import first_view
from vibroimpact.explorer.point import Other
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import CHOICES, MOTION, View, parameter_label, rounded, symbol
from vibroimpact.indices import INDICES

MOST_OTHERS = 12  # offered as initial conditions
TICKS = ("log", "boundaries", "settled")  # choices that are made or not
NUDGE = 1.0 / 64.0  # of the plane, per arrow key
ZOOM = 0.5
DECADES = 100.0  # end over end from which a slider is logarithmic
EXPORTS = (
    ("Picture (.png)", "png"), ("Plane's data (.nc)", "nc"), ("Point's motion (.csv)", "csv"),
    ("Study file (.toml)", "toml"), ("Python lines (.py)", "py"),
)  # fmt: skip
_WIDE: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
_COLORS = (
    ":host{font-size:12px} .bk-input,.bk-btn{background-color:var(--paper)!important;color:var(--ink)!important;"
    "border-color:var(--edge)!important} .bk-btn:hover{background-color:var(--hover)!important}"
)
_TIGHT = _COLORS + (
    " .bk-input{height:24px;min-height:24px;padding:1px 5px;font-size:12px}"
    " .bk-input-group>label,.bk-input-group>.bk-label{margin:0;font-size:12px}"
)
_BAR = _COLORS + (" .bk-btn{padding:3px 9px;font-size:12px;white-space:nowrap}")
_UNSEEN = "label{position:absolute;overflow:hidden;width:1px;height:1px;clip-path:inset(50%)}"  # but read out
_ABOUT = (
    "<p style='font-size:11.5px;color:var(--soft);margin:6px 0'>Click a point of the plane to see its motion. Drag "
    "to move, scroll to zoom. Choose a case above; Help explains terms and keys.</p>"
)


class Controls:
    """The widgets of a page, and the ranges of its sliders.

    Parameters
    ----------
    explorer : Explorer
        The session.
    """

    def __init__(self, explorer: Explorer) -> None:
        self.explorer = explorer
        self._quiet = False
        self._tight, self._bar = InlineStyleSheet(css=_TIGHT), InlineStyleSheet(css=_BAR)
        self._case = case_of(explorer.view)
        self.ranges: dict[str, Range] = ranges_for(explorer.view)
        self._reach: dict[str, Range] = {}  # of sliders, lately
        cases = [("", "Choose a case …"), *((preset.name, preset.title) for preset in PRESETS)]
        names = [explorer.view.model] * (explorer.view.model not in ("", *models.__all__)) + list(models.__all__)
        cases += [(f"model:{name}", f"Model: {name.replace('_', ' ')}") for name in names]
        self.preset = self._menu("preset", "case", cases)
        self.preset.stylesheets.append(InlineStyleSheet(css=_UNSEEN))
        self.preset.on_change("value", self._to_preset)
        self.about = Div(text="", sizing_mode="stretch_width", margin=(2, 2, 0, 2))
        self.column = self._controls()
        self.buttons = self._buttons()

    # ---- making them

    def _menu(self, name: str, title: str, options: list[tuple[str, str]]) -> Select:
        """Return a menu of values and their labels."""
        return Select(
            title=title, options=options, value=options[0][0], name=f"menu_{name}", stylesheets=[self._tight],
            margin=(1, 4, 1, 4), sizing_mode="stretch_width",
        )  # fmt: skip

    def _controls(self) -> Any:
        names = self._names()
        self.x, self.y = self._menu("x", "x axis", names), self._menu("y", "y axis", names)
        self.start = self._menu("start", "initial condition", [("rest", "at rest")])
        self.menus = {
            name: self._menu(name, CHOICES[name].label, options)
            for name, options in {
                "index": _index_options(),
                "samples": [(text, text) for text in CHOICES["samples"].texts],
                "line": [("x", "x axis"), ("y", "y axis")],
                "coordinate": [("0", "towards the stop")],
                "stop": [("0", "at all stops")],
            }.items()
        }
        self._of_system = row(self.menus["coordinate"], self.menus["stop"], **_WIDE)
        for axis in (self.x, self.y):
            axis.on_change("value", self._to_axes)
        for name, chosen in self.menus.items():
            chosen.on_change("value", lambda a, o, new, name=name: self._chosen(name, new))
        self.start.on_change("value", self._to_start)
        return column(
            row(self.x, self.y, **_WIDE),
            self.menus["index"],
            row(self.menus["samples"], self.menus["line"], **_WIDE),
            self._of_system,
            self.start,
            self.about,
            **_WIDE,
        )

    def _names(self) -> list[tuple[str, str]]:
        table = self.explorer.view.table
        return [(name, f"{name} {symbol(one)}" if one.symbol != name else name) for name, one in table.items()]

    def _buttons(self) -> Any:
        explorer = self.explorer
        style: dict[str, Any] = {"margin": (2, 3, 2, 0), "stylesheets": [self._bar]}
        made: list[Any] = []
        for name, label, act in (
            ("undo", "↶ Undo", explorer.undo), ("redo", "↷ Redo", explorer.redo), ("home", "Reset view", self.home),
            ("pin", "Pin point", explorer.pin), ("unpin", "Unpin", explorer.unpin),
        ):  # fmt: skip
            made.append(Button(label=label, name=f"button_{name}", **style))
            made[-1].on_click(lambda act=act: act())
        return row(*made, margin=0, styles={"flex-wrap": "wrap"})

    # ---- what a person did

    def _chosen(self, name: str, value: Any) -> None:
        if not self._quiet:
            self.explorer.set(**{name: CHOICES[name].texts.get(value, value)})
            self.show_view(self.explorer.view)

    def _to_axes(self, attr: str, old: str, new: str) -> None:
        if self._quiet:
            return
        view, x, y = self.explorer.view, self.x.value, self.y.value
        if x == y:  # the other axis takes the place of the one chosen
            x, y = (x, view.x) if x != view.x else (view.y, y)
        if {x, y} <= set(view.table):
            self.explorer.set_axes(x, y, self.axis_range(x), self.axis_range(y))
        self.show_view(self.explorer.view)

    def _to_preset(self, attr: str, old: str, new: str) -> None:
        if not self._quiet:
            with contextlib.suppress(ValueError):
                if new.startswith("model:"):
                    name = new.removeprefix("model:")
                    self.explorer.show(first_view(self.explorer.find(name), name))
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
        """Return the range of a parameter along an axis: its slider's, without a zero that is not allowed."""
        return allowed_range(self.explorer.view.table[name], self.ranges[name])

    # ---- what the session answers

    def fit(self, view: View) -> None:
        """Let the sliders reach as far as suits a view."""
        self._case, self.ranges, self._reach = case_of(view), ranges_for(view), {}
        with self._silently():
            self.x.options = self.y.options = self._names()
            toward = [("0", "towards the stop"), *((str(one), f"coordinate {one}") for one in view.coordinates)]
            self.menus["coordinate"].options = toward
            self.menus["stop"].options = [
                ("0", "at all stops"),
                *((str(at), f"at {name}") for at, name in enumerate(view.stops, 1)),
            ]
            self._of_system.visible = bool(view.stops)

    @contextlib.contextmanager
    def _silently(self) -> Iterator[None]:
        before, self._quiet = self._quiet, True
        try:
            yield
        finally:
            self._quiet = before

    def show_view(self, view: View) -> None:
        """Put every widget where the view has it."""
        case = case_of(view)
        if case != self._case or list(self.ranges) != list(view.table):
            self.fit(view)
        with self._silently():
            chosen = f"model:{view.model}" if view.model else case.name if case else ""
            menus = [(menu, str(getattr(view, name))) for name, menu in self.menus.items()]
            for widget, value in ((self.x, view.x), (self.y, view.y), (self.preset, chosen), *menus):
                if widget.value != value:
                    widget.value = value
            text = _about(view) if case is None else _description(case)
            if self.about.text != text:
                self.about.text = text
        self.show_others(self.explorer.others)

    def rows(self) -> dict[str, tuple[float, float, float]]:
        """Return every parameter as it is now, and the ends of its slider."""
        rows = {}
        for name, value in self.explorer.view.osc.values.items():
            low, high = self.ranges[name]
            if not low <= value <= high:  # ends that made room for a value stay as long as one is beyond its range
                low, high = self._reach.get(name, (low, high))
            self._reach[name] = min(low, value), max(high, value)
            rows[name] = (value, *self._reach[name])
        return rows

    def labels(self) -> list[tuple[str, str, bool]]:
        """Return the parameters in order: their names, labels with units, and whether sliders are logarithmic."""
        table = self.explorer.view.table
        return [(name, parameter_label(parameter), self.logarithmic(name)) for name, parameter in table.items()]

    def logarithmic(self, name: str) -> bool:
        """Whether the range of a parameter spans decades."""
        low, high = self.ranges[name]
        return low > 0.0 and high >= DECADES * low

    def show_others(self, others: list[Other]) -> None:
        """Offer the motions that coexist as initial conditions of the point's motion."""
        start = self.explorer.view.start
        options, chosen = [("rest", "at rest")], "rest"
        for at, other in enumerate(others[:MOST_OTHERS]):
            options.append((str(at), f"on {other.name} ({100 * other.share:.0f} %)"))
            chosen = str(at) if start == other.start else chosen
        if start is not None and chosen == "rest":
            options.append(("kept", "as in the link"))
            chosen = "kept"
        with self._silently():
            if self.start.options != options:
                self.start.options = options
            if self.start.value != chosen:
                self.start.value = chosen


def _about(view: View) -> str:
    """Return what to do, and what the page cannot do for a system."""
    if not view.stops:
        return _ABOUT
    return _ABOUT.replace(
        "</p>",
        " Colours speak of all stops together; plots show one displacement, and as walls the stops in its way.</p>",
    )


def _description(case: Preset) -> str:
    return (
        f"<div style='font-size:11.5px;line-height:1.35;color:var(--soft)'><p style='margin:6px 0 3px'>"
        f"<b>{case.title}.</b> {case.source}</p>"
        f"<p style='margin:0'><b>Idealised:</b> {case.idealised}</p></div>"
    )


def _index_options() -> list[tuple[str, str]]:
    """Return names and labels of what the plane can show."""
    return [(MOTION, "motion")] + [
        (index.name, index.long_name + ("" if index.units == "1" else f" [{index.units}]"))
        for index in INDICES.values()
    ]


class Commands:
    """Runs the commands of the page's script: a name, its arguments, and the message's serial number.

    Parameters
    ----------
    explorer : Explorer
        The session.
    controls : Controls
        They hold the range of each parameter.
    export : callable
        Gets the kind of file that is asked for.
    """

    def __init__(self, explorer: Explorer, controls: Controls, export: Callable[[str], Any]) -> None:
        self.last = -1  # the serial number of the last message
        self._explorer, self._controls, self._export = explorer, controls, export
        self._simple: dict[str, Callable[[], Any]] = {
            "undo": explorer.undo,
            "redo": explorer.redo,
            "pin": explorer.pin,
            "unpin": explorer.unpin,
            "home": controls.home,
            **{name: partial(self._toggle, name) for name in TICKS},
            "line": lambda: explorer.set(line="y" if explorer.view.line == "x" else "x"),
            "motion": lambda: explorer.set(index=MOTION if explorer.view.index != MOTION else "std"),
            "left": lambda: self._nudge(-1, 0),
            "right": lambda: self._nudge(1, 0),
            "up": lambda: self._nudge(0, 1),
            "down": lambda: self._nudge(0, -1),
            "in": lambda: self._scale(ZOOM),
            "out": lambda: self._scale(1.0 / ZOOM),
        }
        self._placed: dict[str, Callable[..., Any]] = {
            "click": explorer.click,
            "zoom": lambda x0, x1, y0, y1: explorer.zoom((x0, x1), (y0, y1)),
            "along": self._along,
        }
        self._named: dict[str, Callable[[str, str], Any]] = {"slide": self._slide, "type": explorer.set_parameter}

    def run(self, text: str) -> None:
        """Do what a message says; one that the page's own script does not send is ignored."""
        command, *arguments, serial = text.split(" ") if " " in text else (text, "-1")
        with contextlib.suppress(ValueError, TypeError):
            self.last = int(serial)
            if command in self._simple:
                self._simple[command]()
            elif command in self._placed:
                self._placed[command](*map(float, arguments))
            elif command == "export":
                self._export(" ".join(arguments))
            elif command in self._named and arguments[:1] and arguments[0] in self._explorer.view.table:
                self._named[command](arguments[0], " ".join(arguments[1:]))

    def _slide(self, name: str, text: str) -> None:
        """Take a slider's place, with no more digits than its steps distinguish."""
        value, (low, high) = float(text), self._controls.ranges[name]
        low, high = min(low, value), max(high, value)
        kept = float(f"{value:.4g}") if self._controls.logarithmic(name) else rounded(value, (low, high))
        self._explorer.set_parameter(name, min(max(kept, low), high))

    def _toggle(self, name: str) -> None:
        change: dict[str, Any] = {name: not getattr(self._explorer.view, name)}
        self._explorer.set(**change)

    def _along(self, value: float) -> None:
        parameter, ends = self._explorer.view.along
        self._explorer.set_parameter(parameter, rounded(value, ends))

    def _nudge(self, right: int, up: int) -> None:
        view = self._explorer.view
        (x0, x1), (y0, y1) = view.x_range, view.y_range
        self._explorer.click(
            view.osc_value("x") + right * NUDGE * (x1 - x0), view.osc_value("y") + up * NUDGE * (y1 - y0)
        )

    def _scale(self, factor: float) -> None:
        """Zoom about the point, or about the middle where the point lies outside."""
        view, ranges = self._explorer.view, []
        for axis in ("x", "y"):
            low, high = getattr(view, f"{axis}_range")
            middle = view.osc_value(axis)
            middle = middle if low <= middle <= high else 0.5 * (low + high)
            ranges.append((middle - factor * (middle - low), middle + factor * (high - middle)))
        self._explorer.zoom(ranges[0], ranges[1])
