"""The explorer: a page that shows the stability map, and the motion at the point that is clicked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact.explorer.serve import explore
    from vibroimpact.explorer.session import Explorer
    from vibroimpact.explorer.state import View

__all__ = ["Explorer", "View", "explore"]

_HOMES = {"Explorer": "session", "View": "state", "explore": "serve"}


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in _HOMES:
        return getattr(import_module(f"vibroimpact.explorer.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'vibroimpact.explorer' has no attribute {name!r}")
