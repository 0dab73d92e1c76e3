"""Sweeps spread over machines, by a Dask cluster."""

from vibroimpact.execution.cluster.connection import check_cluster, connect
from vibroimpact.execution.cluster.run import in_memory, on_cluster

__all__ = ["check_cluster", "connect", "in_memory", "on_cluster"]
