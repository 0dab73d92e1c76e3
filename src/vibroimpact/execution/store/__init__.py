"""Sweeps on disk that outlive the process which computes them."""

from vibroimpact.execution.store.layout import StoreBusy
from vibroimpact.execution.store.store import SweepStore, open_or_create, run_into_store
from vibroimpact.execution.store.writer import settle

__all__ = ["StoreBusy", "SweepStore", "open_or_create", "run_into_store", "settle"]
