"""The widgets beside the plane: sliders, menus, ticks and buttons, as Bokeh makes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Button, Checkbox, Div, Dropdown, InlineStyleSheet, NumericInput, Select, Slider

from vibroimpact.explorer.state import MOTION, Range, parameter_label
from vibroimpact.indices import INDICES

STEPS = 500
EXPORTS = (
    ("Picture (.png)", "png"), ("Plane's data (.nc)", "nc"), ("Point's motion (.csv)", "csv"),
    ("Study file (.toml)", "toml"), ("Python lines (.py)", "py"),
)  # fmt: skip
WIDE: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
_TIGHT = (
    ":host{font-size:12px} .bk-input{height:24px;min-height:24px;padding:1px 5px;font-size:12px}"
    " .bk-input-group>label,.bk-slider-title,.bk-input-group>.bk-label{margin:0;font-size:12px}"
    " .bk-btn{padding:3px 9px;font-size:12px} .noUi-target{margin-top:2px}"
)
_BAR = ":host{font-size:12px} .bk-btn{padding:3px 9px;font-size:12px;white-space:nowrap}"


class Kit:
    """Makes widgets in the page's style."""

    def __init__(self) -> None:
        self._tight, self._bar = InlineStyleSheet(css=_TIGHT), InlineStyleSheet(css=_BAR)

    def parameter(self, name: str, value: float, ends: Range) -> tuple[Slider, NumericInput, Any]:
        """Return a slider, a field to type into, and both below the parameter's name."""
        low, high = ends
        slider = Slider(
            start=low, end=high, value=value, step=(high - low) / STEPS, title=None, show_value=False,
            margin=(0, 6, 3, 8), sizing_mode="stretch_width", stylesheets=[self._tight], name=f"slider_{name}",
            bar_color="#9cc3dd",
        )  # fmt: skip
        number = NumericInput(
            value=value, mode="float", width=82, margin=(0, 4, 0, 0), stylesheets=[self._tight], name=f"number_{name}"
        )
        text = Div(
            text=parameter_label(name), margin=(4, 0, 0, 4), sizing_mode="stretch_width", stylesheets=[self._tight]
        )
        return slider, number, column(row(text, number, **WIDE), slider, **WIDE)

    def menu(self, name: str, title: str, options: list[tuple[str, str]]) -> Select:
        """Return a menu of values and their words."""
        return Select(
            title=title, options=options, value=options[0][0], name=f"menu_{name}", stylesheets=[self._tight],
            margin=(1, 4, 1, 4), sizing_mode="stretch_width",
        )  # fmt: skip

    def tick(self, name: str, label: str) -> Checkbox:
        """Return a box to tick."""
        return Checkbox(label=label, active=False, name=f"tick_{name}", margin=(2, 4, 0, 4), stylesheets=[self._tight])

    def button(self, name: str, label: str, act: Callable[[], Any]) -> Button:
        """Return a button."""
        button = Button(label=label, name=f"button_{name}", margin=(2, 3, 2, 0), stylesheets=[self._bar])
        button.on_click(lambda: act())
        return button

    def exports(self, act: Callable[[str], Any]) -> Dropdown:
        """Return the menu of files that can be had."""
        menu = Dropdown(
            label="Export", menu=list(EXPORTS), name="menu_export", margin=(2, 3, 2, 0), stylesheets=[self._bar]
        )
        menu.on_click(lambda event: act(event.item))
        return menu


def index_options() -> list[tuple[str, str]]:
    """Return names and words of what the plane can show."""
    named = [(MOTION, "name of the motion")]
    return named + [
        (index.name, f"{index.long_name}" + ("" if index.units == "1" else f" [{index.units}]"))
        for index in INDICES.values()
    ]
