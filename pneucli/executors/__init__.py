"""Where many runs of one kind are done: processes of this machine, or a Dask cluster.

Everything that is many (rigs of a fleet, cases of an exam, runs of a Monte Carlo study) goes through :func:`stream`.
"""

from __future__ import annotations

from pneucli.executors.dask_cluster import Cluster, Identity, require_cluster
from pneucli.executors.engine import DIED, Engine, Processes, Threads, engine_from, workers
from pneucli.executors.job_stream import WORKER_DIED, Outcome, stream

__all__ = [
    "DIED",
    "WORKER_DIED",
    "Cluster",
    "Engine",
    "Identity",
    "Outcome",
    "Processes",
    "Threads",
    "engine_from",
    "require_cluster",
    "stream",
    "workers",
]
