"""Sweeps that outlive the process that computes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact.execution.store.request import SweepRequest
    from vibroimpact.execution.store.run import in_threads, run_into_store
    from vibroimpact.execution.store.store import StoreBusy, SweepStore, summary
    from vibroimpact.execution.store.writer import settle

__all__ = ["StoreBusy", "SweepRequest", "SweepStore", "in_threads", "run_into_store", "settle", "summary"]

# A request alone, which every map makes, does not wait for Zarr.
_HOMES = {
    "StoreBusy": "store",
    "SweepRequest": "request",
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
