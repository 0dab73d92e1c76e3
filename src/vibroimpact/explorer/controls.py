"""The controls: menus, buttons, keys and fields, their commands, and the state of the session that they show."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from vibroimpact import models
from vibroimpact.explorer.address import BY_NAME, PRESETS, case_of, ranges_for
from vibroimpact.explorer.limits import Range, allowed_range, parts_of
from vibroimpact.explorer.models import first_view
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import CHOICES, index_label, parameter_label, rounded
from vibroimpact.figures import MOTION
from vibroimpact.indices import INDICES

MOST_OTHERS = 12  # coexisting motions offered as initial conditions
TICKS = ("hertz", "log", "worst", "boundaries", "settled")  # choices between on and off
MENUS = ("index", "samples", "line", "coordinate", "stop")  # choices among several values
NUDGE = 1.0 / 64.0  # share of the plane per press of an arrow key
ZOOM = 0.5  # of the plane, that a press of the button leaves
DECADES = 100.0  # ratio of the ends from which a slider is logarithmic
EXPORTS = (
    ("Picture (.png)", "png"), ("Plane's data (.nc)", "nc"), ("Point's motion (.csv)", "csv"),
    ("Study file (.toml)", "toml"), ("Python lines (.py)", "py"),
)  # fmt: skip
BUTTONS = (
    ("↶ Undo", "undo"), ("↷ Redo", "redo"), ("Reset view", "home"), ("Pin point", "pin"), ("Unpin", "unpin"),
)  # fmt: skip
_ABOUT = (
    "<p>Click a point of the plane to see its motion. Drag to move, scroll to zoom. Choose a case above; Help explains "
    "terms and keys.{}</p>"
)
_OF_SEVERAL = " Colours refer to all stops together; plots show one displacement and the stops that act on it."


class Menu(NamedTuple):
    """The entries of a menu, as values and labels, and the value chosen."""

    options: list[tuple[str, str]]
    value: str


class Controls:
    """The entries of a page's menus, and the ranges of its sliders.

    Parameters
    ----------
    explorer : Explorer
        The session.
    """

    def __init__(self, explorer: Explorer) -> None:
        self.explorer = explorer
        model = explorer.view.model
        self._models = [model] * (model not in ("", *models.__all__)) + list(models.__all__)
        self.fit()

    # ---- user actions

    def choose(self, name: str, value: str) -> None:
        """Apply the chosen entry of a menu; the view is sent again so that a refused entry is reset."""
        if name in ("x", "y"):
            self._choose_axis(name, value)
        elif name == "case":
            self._choose_case(value)
        elif name == "start":
            self._choose_start(value)
        elif name in MENUS:
            self.explorer.set(**{name: CHOICES[name].texts.get(value, value)})
        self.explorer.resend()

    def _choose_axis(self, axis: str, name: str) -> None:
        view = self.explorer.view
        if name not in view.table:
            return
        x, y = (name, view.y) if axis == "x" else (view.x, name)
        if x == y:  # the axes exchange their parameters
            x, y = view.y, view.x
        self.explorer.set_axes(x, y, self.axis_range(x), self.axis_range(y))

    def _choose_case(self, name: str) -> None:
        if name in BY_NAME:
            self.explorer.show(BY_NAME[name].view)
        elif name.startswith("model:"):
            with contextlib.suppress(ValueError):
                model = name.removeprefix("model:")
                self.explorer.show(first_view(self.explorer.find(model), model))

    def _choose_start(self, name: str) -> None:
        offered = {str(at): other for at, other in enumerate(self.explorer.others[:MOST_OTHERS])}
        if name in offered or name == "rest":
            self.explorer.follow(offered.get(name))

    def home(self) -> None:
        """Show the whole plane."""
        view = self.explorer.view
        self.explorer.set(x_range=self.axis_range(view.x), y_range=self.axis_range(view.y))

    def axis_range(self, name: str) -> Range:
        """Return the range of a parameter along an axis: that of its slider, without zero if zero is not allowed."""
        return allowed_range(self.explorer.view.table[name], self.ranges[name])

    # ---- answers of the session

    def fit(self) -> None:
        """Fit the ranges of the sliders to the view."""
        self._case, self._ranges = case_of(self.explorer.view), ranges_for(self.explorer.view)
        self._reach: dict[str, Range] = {}  # recent slider ranges

    @property
    def ranges(self) -> dict[str, Range]:
        """The ranges of the sliders, fitted anew if the case or model of the view has changed."""
        view = self.explorer.view
        if case_of(view) != self._case or list(self._ranges) != list(view.table):
            self.fit()
        return self._ranges

    def menus(self) -> dict[str, Menu]:
        """Return all menus; a menu without a choice is empty."""
        view = self.explorer.view
        names = [(name, parameter_label(parameter, units=False)) for name, parameter in view.table.items()]
        coordinates, names_of_stops = range(1, view.system.coordinates + 1), view.system.stop_names
        toward = [("0", "towards the stop"), *((str(number), f"coordinate {number}") for number in coordinates)]
        stops = [("0", "at all stops"), *((str(at), f"at {name}") for at, name in enumerate(names_of_stops, 1))]
        offered = {
            "index": _index_options(),
            "samples": [(text, text) for text in CHOICES["samples"].texts],
            "line": [("x", "x axis"), ("y", "y axis")],
            "coordinate": toward if self._several else [],
            "stop": stops if self._several else [],
        }
        return {
            "case": self._cases(),
            "x": Menu(names, view.x),
            "y": Menu(names, view.y),
            **{name: Menu(options, str(getattr(view, name))) for name, options in offered.items()},
            "start": self._starts(),
        }

    @property
    def _several(self) -> bool:
        """Whether there are several coordinates or stops to choose from."""
        system = self.explorer.view.system
        return bool(system.coordinates + len(system.stops) > 2)

    def _cases(self) -> Menu:
        view = self.explorer.view
        case = case_of(view)
        cases = [("", "Choose a case …"), *((preset.name, preset.title) for preset in PRESETS)]
        cases += [(f"model:{name}", f"Model: {name.replace('_', ' ')}") for name in self._models]
        return Menu(cases, f"model:{view.model}" if view.model else case.name if case else "")

    def _starts(self) -> Menu:
        """Return the menu of initial conditions, which includes the coexisting motions."""
        start = self.explorer.view.start
        options, chosen = [("rest", "at rest")], "rest"
        for at, other in enumerate(self.explorer.others[:MOST_OTHERS]):
            options.append((str(at), f"on {other.name} ({100 * other.share:.0f} %)"))
            chosen = str(at) if start is not None and parts_of(start) == parts_of(other.start) else chosen
        if start is not None and chosen == "rest":
            options.append(("kept", "as in the link"))
            chosen = "kept"
        return Menu(options, chosen)

    def about(self) -> str:
        """Return the source of a case's numbers; without a case, instructions, and notes on systems."""
        case = case_of(self.explorer.view)
        if case is not None:
            return f"<p><b>{case.title}.</b> {case.source}</p><p><b>Idealised:</b> {case.idealised}</p>"
        return _ABOUT.format(_OF_SEVERAL if self._several else "")

    def rows(self) -> dict[str, tuple[float, float, float]]:
        """Return the present value of every parameter, and the ends of its slider."""
        rows = {}
        for name, value in self.explorer.view.values.items():
            low, high = self.ranges[name]
            if not low <= value <= high:  # ends extended for a value are kept as long as a value is beyond the range
                low, high = self._reach.get(name, (low, high))
            self._reach[name] = min(low, value), max(high, value)
            rows[name] = (value, *self._reach[name])
        return rows

    def labels(self) -> list[tuple[str, str, bool]]:
        """Return name, label with unit, and whether the slider is logarithmic, for each parameter in order."""
        table = self.explorer.view.table
        return [(name, parameter_label(parameter), self.logarithmic(name)) for name, parameter in table.items()]

    def logarithmic(self, name: str) -> bool:
        """Whether the range of a parameter spans decades."""
        low, high = self.ranges[name]
        return low > 0.0 and high >= DECADES * low


def _index_options() -> list[tuple[str, str]]:
    """Return names and labels of the indices that the plane can show."""
    return [(MOTION, "motion"), *((index.name, index_label(index)) for index in INDICES.values())]


class Commands:
    """Runs commands from the page's script: a name, arguments, and the serial number of the message.

    Parameters
    ----------
    explorer : Explorer
        The session.
    controls : Controls
        The controls, which hold the range of each parameter.
    export : callable
        Called with the kind of file requested.
    """

    def __init__(self, explorer: Explorer, controls: Controls, export: Callable[[str], Any]) -> None:
        self.last = -1  # the serial number of the last message
        self._explorer, self._controls, self._export = explorer, controls, export
        self._simple: dict[str, Callable[[], Any]] = {
            "undo": explorer.undo,
            "go_on": explorer.go_on,
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
        """Run the command of a message; messages that the page's own script does not send are ignored."""
        command, *arguments, serial = text.split(" ") if " " in text else (text, "-1")
        with contextlib.suppress(ValueError, TypeError):
            self.last = int(serial)
            if command in self._simple:
                self._simple[command]()
            elif command in self._placed:
                self._placed[command](*map(float, arguments))
            elif command == "export":
                self._export(" ".join(arguments))
            elif command == "choose" and arguments:
                self._controls.choose(arguments[0], " ".join(arguments[1:]))
            elif command in self._named and arguments[:1] and arguments[0] in self._explorer.view.table:
                self._named[command](arguments[0], " ".join(arguments[1:]))

    def _slide(self, name: str, text: str) -> None:
        """Apply a slider's position, with no more digits than its steps distinguish."""
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
        """Zoom about the point, or about the centre if the point is outside."""
        view, ranges = self._explorer.view, []
        for axis in ("x", "y"):
            low, high = getattr(view, f"{axis}_range")
            middle = view.osc_value(axis)
            middle = middle if low <= middle <= high else 0.5 * (low + high)
            ranges.append((middle - factor * (middle - low), middle + factor * (high - middle)))
        self._explorer.zoom(ranges[0], ranges[1])
