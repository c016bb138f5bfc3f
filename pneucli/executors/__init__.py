"""Run many jobs: in threads or processes of this machine, or on a Dask cluster.

The rigs of a fleet, the cases of an exam and the runs of a Monte Carlo study go through :func:`run_jobs`.
"""

from __future__ import annotations

from pneucli.executors.dask_cluster import Identity, engine_from, require_cluster
from pneucli.executors.engine import (
    Engine,
    Outcome,
    ProcessEngine,
    ThreadEngine,
    run_jobs,
    thread_count,
)
from pneucli.executors.threads import map_in_threads

__all__ = [
    "Engine",
    "Identity",
    "Outcome",
    "ProcessEngine",
    "ThreadEngine",
    "engine_from",
    "map_in_threads",
    "require_cluster",
    "run_jobs",
    "thread_count",
]
