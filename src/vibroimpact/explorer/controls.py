"""Sliders, menus and buttons: they tell the session what a person did, and show what it answers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Button, Checkbox, Div, Dropdown, InlineStyleSheet, NumericInput, Select, Slider

from vibroimpact.dataset import VARIABLES
from vibroimpact.explorer.presets import BY_NAME, PRESETS, ranges_for
from vibroimpact.explorer.searches import Other
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import GREEK, MOTION, SAMPLES, Range, View, parameter_label
from vibroimpact.indices import INDICES
from vibroimpact.oscillator import PARAMETERS

STEPS = 500
EXPORTS = (
    ("Picture (.png)", "png"), ("Plane's data (.nc)", "nc"), ("Point's motion (.csv)", "csv"),
    ("Study file (.toml)", "toml"), ("Python lines (.py)", "py"),
)  # fmt: skip
_TIGHT = (
    ":host{font-size:12px} .bk-input{height:24px;min-height:24px;padding:1px 5px;font-size:12px}"
    " .bk-input-group>label,.bk-slider-title,.bk-input-group>.bk-label{margin:0;font-size:12px}"
    " .bk-btn{padding:3px 9px;font-size:12px} .noUi-target{margin-top:2px}"
)
_BAR = ":host{font-size:12px} .bk-btn{padding:3px 9px;font-size:12px;white-space:nowrap}"


def index_options() -> list[tuple[str, str]]:
    """Return names and words of what the plane can show."""
    named = [(MOTION, "name of the motion")]
    return named + [
        (index.name, f"{index.long_name}" + ("" if index.units == "1" else f" [{index.units}]"))
        for index in INDICES.values()
    ]


class Controls:
    """The widgets of a page."""

    def __init__(self, explorer: Explorer, preset: str | None, export: Any) -> None:
        self.explorer, self._export = explorer, export
        self._tight, self._bar = InlineStyleSheet(css=_TIGHT), InlineStyleSheet(css=_BAR)
        self._quiet = False
        self._preset_name = preset
        self.ranges: dict[str, Range] = ranges_for(explorer.view, preset)
        self.sliders: dict[str, Slider] = {}
        self.numbers: dict[str, NumericInput] = {}
        self.preset = self._menu("preset", "", [("", "Choose a case …"), *((p.name, p.title) for p in PRESETS)])
        self.preset.on_change("value", self._to_preset)
        self.about = Div(text="", sizing_mode="stretch_width", margin=(2, 2, 0, 2))
        self.column = self._controls(explorer.view)
        self.buttons = self._buttons()

    # ---- making them

    def _controls(self, view: View) -> Any:
        rows = [self._parameter(view, name) for name in PARAMETERS]
        names = [(name, f"{name} {GREEK.get(VARIABLES[name][2], VARIABLES[name][2])}") for name in PARAMETERS]
        self.x = self._menu("x", "across", names)
        self.y = self._menu("y", "upwards", names)
        self.index = self._menu("index", "colour tells", index_options())
        self.samples = self._menu("samples", "impacts a cell", [(str(n), str(n)) for n in SAMPLES])
        self.line = self._menu("line", "diagram along", [("x", "across"), ("y", "upwards")])
        self.start = self._menu("start", "point's motion starts", [("rest", "from rest")])
        self.log = self._tick("log", "logarithmic colours")
        self.boundaries = self._tick("boundaries", "exact boundaries (some seconds)")
        self.settled = self._tick("settled", "show the settled motion")
        for axis in (self.x, self.y):
            axis.on_change("value", self._to_axes)
        self.index.on_change("value", lambda a, o, new: self._said(index=new))
        self.samples.on_change("value", lambda a, o, new: self._said(samples=int(new)))
        self.line.on_change("value", lambda a, o, new: self._said(line=new))
        self.start.on_change("value", self._to_start)
        self.log.on_change("active", lambda a, o, new: self._said(log=new))
        self.boundaries.on_change("active", lambda a, o, new: self._said(boundaries=new))
        self.settled.on_change("active", lambda a, o, new: self._said(settled=new))
        pair: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
        return column(
            *rows,
            row(self.x, self.y, **pair),
            self.index,
            row(self.samples, self.line, **pair),
            self.start,
            self.log,
            self.boundaries,
            self.settled,
            self.about,
            **pair,
        )

    def _parameter(self, view: View, name: str) -> Any:
        low, high = self.ranges[name]
        value = getattr(view.osc, name)
        slider = Slider(
            start=low, end=high, value=value, step=(high - low) / STEPS, title=None, show_value=False,
            margin=(0, 6, 3, 8), sizing_mode="stretch_width", stylesheets=[self._tight], name=f"slider_{name}",
            bar_color="#9cc3dd",
        )  # fmt: skip
        number = NumericInput(
            value=value, mode="float", width=82, margin=(0, 4, 0, 0), stylesheets=[self._tight], name=f"number_{name}"
        )
        slider.on_change("value", lambda a, o, new, name=name: self._to_parameter(name, new))
        number.on_change("value", lambda a, o, new, name=name: self._to_parameter(name, new))
        self.sliders[name], self.numbers[name] = slider, number
        text = Div(
            text=parameter_label(name), margin=(4, 0, 0, 4), sizing_mode="stretch_width", stylesheets=[self._tight]
        )
        return column(
            row(text, number, sizing_mode="stretch_width", margin=0), slider, sizing_mode="stretch_width", margin=0
        )

    def _menu(self, name: str, title: str, options: list[tuple[str, str]]) -> Select:
        return Select(
            title=title, options=options, value=options[0][0], name=f"menu_{name}", stylesheets=[self._tight],
            margin=(1, 4, 1, 4), sizing_mode="stretch_width",
        )  # fmt: skip

    def _tick(self, name: str, label: str) -> Checkbox:
        return Checkbox(label=label, active=False, name=f"tick_{name}", margin=(2, 4, 0, 4), stylesheets=[self._tight])

    def _buttons(self) -> Any:
        made = [
            ("undo", "↶ Undo", self.explorer.undo), ("redo", "↷ Redo", self.explorer.redo),
            ("home", "Whole plane", self.home),
            ("pin", "Pin point", self.explorer.pin), ("unpin", "Unpin", self.explorer.unpin),
        ]  # fmt: skip
        buttons: list[Any] = []
        for name, label, act in made:
            button = Button(label=label, name=f"button_{name}", margin=(2, 3, 2, 0), stylesheets=[self._bar])
            button.on_click(lambda act=act: act())
            buttons.append(button)
        menu = Dropdown(
            label="Export", menu=list(EXPORTS), name="menu_export", margin=(2, 3, 2, 0), stylesheets=[self._bar]
        )
        menu.on_click(lambda event: self._export(event.item))
        return row(*buttons, menu, margin=0)

    # ---- what a person did

    def _said(self, **changes: Any) -> None:
        if not self._quiet:
            self.explorer.set(**changes)
            self.show_view(self.explorer.view)

    def _to_parameter(self, name: str, value: Any) -> None:
        if self._quiet or value is None:
            return
        if not self.explorer.set_parameter(name, value):
            self.show_view(self.explorer.view)

    def _to_axes(self, attr: str, old: str, new: str) -> None:
        if self._quiet:
            return
        view, x, y = self.explorer.view, self.x.value, self.y.value
        if x == y:  # the other axis takes the place of the one chosen
            x, y = (x, view.x) if x != view.x else (view.y, y)
        self.explorer.set_axes(x, y, self.axis_range(x), self.axis_range(y))
        self.show_view(self.explorer.view)

    def _to_preset(self, attr: str, old: str, new: str) -> None:
        if not self._quiet and new in BY_NAME:
            self._preset_name = new
            self.ranges = ranges_for(BY_NAME[new].view, new)
            self.explorer.show(BY_NAME[new].view)
            self.show_view(self.explorer.view)

    def _to_start(self, attr: str, old: str, new: str) -> None:
        if self._quiet:
            return
        others = self.explorer.others
        number = int(new) if new.isdigit() else -1
        self.explorer.follow(others[number] if 0 <= number < len(others) else None)

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
        self.ranges = ranges_for(view)

    @contextmanager
    def _silently(self) -> Iterator[None]:
        before, self._quiet = self._quiet, True
        try:
            yield
        finally:
            self._quiet = before

    def show_view(self, view: View) -> None:
        """Put every widget where the view has it."""
        with self._silently():
            for name in PARAMETERS:
                value = getattr(view.osc, name)
                slider, number = self.sliders[name], self.numbers[name]
                low, high = self.ranges[name]
                low, high = min(low, value), max(high, value)
                if (slider.start, slider.end) != (low, high):
                    slider.update(start=low, end=high, step=(high - low) / STEPS)
                if slider.value != value:
                    slider.value = value
                if number.value != value:
                    number.value = value
            for widget, value in (
                (self.x, view.x), (self.y, view.y), (self.index, view.index), (self.samples, str(view.samples)),
                (self.line, view.line), (self.preset, self._preset_of(view)),
            ):  # fmt: skip
                if widget.value != value:
                    widget.value = value
            for tick, on in ((self.log, view.log), (self.boundaries, view.boundaries), (self.settled, view.settled)):
                if tick.active != on:
                    tick.active = on
            self._tell_about()

    def _preset_of(self, view: View) -> str:
        for preset in PRESETS:
            if preset.view == view:
                self._preset_name = preset.name
        known = BY_NAME.get(self._preset_name or "")
        if known is None or ((known.view.x, known.view.y) != (view.x, view.y) and known.ranges != self.ranges):
            self._preset_name = None
        return self._preset_name or ""

    def _tell_about(self) -> None:
        known = BY_NAME.get(self._preset_name or "")
        text = (
            "<p style='font-size:11.5px;color:#5b6470;margin:6px 0'>Click a point of the plane to see its motion. Drag "
            "to move, scroll to zoom. Cases above; keys and words under Help.</p>"
        )
        if known is not None:
            text = (
                f"<div style='font-size:11.5px;line-height:1.35;color:#3c4450'><p style='margin:6px 0 3px'>"
                f"<b>{known.title}.</b> {known.source}</p>"
                f"<p style='margin:0'><b>Idealised:</b> {known.idealised}</p></div>"
            )
        if self.about.text != text:
            self.about.text = text

    def show_others(self, others: list[Other]) -> None:
        """Offer the motions that coexist as starts of the point's motion."""
        options = [("rest", "from rest")]
        options += [(str(at), f"on {other.name} ({100 * other.share:.0f} %)") for at, other in enumerate(others[:12])]
        start = self.explorer.view.start
        chosen = next(
            (str(at) for at, other in enumerate(others) if start is not None and other.start == start), "rest"
        )
        if start is not None and chosen == "rest":
            options.append(("kept", "as the link tells"))
            chosen = "kept"
        with self._silently():
            if self.start.options != options:
                self.start.options = options
            if self.start.value != chosen:
                self.start.value = chosen
