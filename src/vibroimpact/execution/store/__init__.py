"""Sweeps that outlive the process that computes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact.execution.store.run import in_threads, run_into_store
    from vibroimpact.execution.store.store import StoreBusy, SweepStore, summary
    from vibroimpact.execution.store.writer import settle

__all__ = ["StoreBusy", "SweepStore", "in_threads", "run_into_store", "settle", "summary"]

# Whoever imports one name does not wait for what the others need.
_HOMES = {
    "StoreBusy": "store",
    "SweepStore": "store",
    "in_threads": "run",
    "run_into_store": "run",
    "settle": "writer",
    "summary": "store",
}


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in _HOMES:
        return getattr(import_module(f"vibroimpact.execution.store.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'vibroimpact.execution.store' has no attribute {name!r}")
