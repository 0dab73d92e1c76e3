"""Sweeps that outlive the process that computes them."""

from vibroimpact.stores.request import SweepRequest
from vibroimpact.stores.run import in_threads, run_into_store
from vibroimpact.stores.store import StoreBusy, SweepStore, summary
from vibroimpact.stores.writer import settle

__all__ = ["StoreBusy", "SweepRequest", "SweepStore", "in_threads", "run_into_store", "settle", "summary"]
