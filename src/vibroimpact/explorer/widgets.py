"""The widgets beside the plane: menus, ticks and buttons, as Bokeh makes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bokeh.models import Button, Checkbox, Dropdown, InlineStyleSheet, Select

from vibroimpact.explorer.state import MOTION
from vibroimpact.indices import INDICES

EXPORTS = (
    ("Picture (.png)", "png"), ("Plane's data (.nc)", "nc"), ("Point's motion (.csv)", "csv"),
    ("Study file (.toml)", "toml"), ("Python lines (.py)", "py"),
)  # fmt: skip
WIDE: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
_TIGHT = (
    ":host{font-size:12px} .bk-input{height:24px;min-height:24px;padding:1px 5px;font-size:12px}"
    " .bk-input-group>label,.bk-input-group>.bk-label{margin:0;font-size:12px}"
)
_BAR = ":host{font-size:12px} .bk-btn{padding:3px 9px;font-size:12px;white-space:nowrap}"


class Kit:
    """Makes widgets in the page's style."""

    def __init__(self) -> None:
        self._tight, self._bar = InlineStyleSheet(css=_TIGHT), InlineStyleSheet(css=_BAR)

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
