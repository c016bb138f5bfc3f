"""Where many runs of one kind are done: processes of this machine, or a Dask cluster.

Everything that is many (rigs of a fleet, cases of an exam, runs of a Monte Carlo study) goes through :func:`stream`.
"""

from __future__ import annotations

from pneucli.executors.dask_cluster import DaskCluster, Identity, require_cluster
from pneucli.executors.engine import WORKER_DEATH_ERRORS, Engine, ProcessEngine, ThreadEngine, engine_from, thread_count
from pneucli.executors.job_stream import WORKER_DIED, Outcome, run_jobs

__all__ = [
    "WORKER_DEATH_ERRORS",
    "WORKER_DIED",
    "DaskCluster",
    "Engine",
    "Identity",
    "Outcome",
    "ProcessEngine",
    "ThreadEngine",
    "engine_from",
    "require_cluster",
    "run_jobs",
    "thread_count",
]
