"""What changes together, sent to the page in one message."""

from __future__ import annotations

from typing import Any

from bokeh.models import ColumnDataSource


class Parcel:
    """Parts of what the page shows, sent in one message; the page draws once what came since its last frame.

    A browser that comes later finds the last one of each name: what must not be lost has a parcel of its own.
    """

    def __init__(self, name: str) -> None:
        self.source = ColumnDataSource({"part": [], "content": []}, name=f"{name}_parcel")
        self._packed: dict[str, dict[str, Any]] = {}

    def pack(self, part: str, **content: Any) -> None:
        """Add a part that the page's script knows, or html of an element ("#numbers")."""
        self._packed[part] = content

    def send(self) -> None:
        """Send what was packed."""
        self.source.data = {"part": list(self._packed), "content": list(self._packed.values())}
        self._packed = {}
