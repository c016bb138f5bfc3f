"""What runs jobs: threads or processes of this machine, or a Dask cluster. One seam for all who have many jobs."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any, Protocol

from pneucli.executors.dask_cluster import Identity, connect_cluster, start_cluster

LOCAL_NAME = "local"
THREADS_VARIABLE = (
    "PNEUCLI_THREADS"  # the environment variable that says how many threads simulations of one process take
)
WORKER_DEATH_ERRORS: tuple[type[BaseException], ...] = (BrokenExecutor,)  # what a job raises whose worker died


def thread_count() -> int:
    """Return how many threads run simulations: the cores this process may use, or ``PNEUCLI_THREADS``."""
    if (said := os.environ.get(THREADS_VARIABLE, "")).isdigit() and int(said) > 0:
        return int(said)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Engine(Protocol):
    """What :func:`pneucli.executors.job_stream` needs; ``slots`` is how many jobs run at once."""

    @property
    def slots(self) -> int:
        """How many jobs run at once, now: a cluster may grow and shrink."""

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Run ``work(*arguments)`` somewhere."""

    def is_worker_death(self, error: BaseException) -> bool:
        """Whether a job raised this because its worker died, so that it may be tried again."""

    def replace_workers(self) -> None:
        """Make good what a worker's death broke."""

    def require_alive(self) -> None:
        """Raise InputError where nothing will ever be done again."""


class LocalEngine:
    """Workers of this machine in a pool that is made anew when one of them dies."""

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self._pool = self._new_pool()

    def _new_pool(self) -> Executor:
        raise NotImplementedError

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Run ``work(*arguments)`` in a worker; where the pool is broken already, the future says so."""
        try:
            return self._pool.submit(work, *arguments)
        except BrokenExecutor as error:
            failed: Future[Any] = Future()
            failed.set_exception(error)
            return failed

    def is_worker_death(self, error: BaseException) -> bool:
        """Whether the worker died."""
        return isinstance(error, WORKER_DEATH_ERRORS)

    def replace_workers(self) -> None:
        """Start new workers."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = self._new_pool()

    def require_alive(self) -> None:
        """Nothing: this machine is there."""

    def close(self) -> None:
        """End the workers; what has not begun is dropped."""
        self._pool.shutdown(wait=True, cancel_futures=True)


class ThreadEngine(LocalEngine):
    """Threads of this process: for jobs that hold the interpreter's lock for a small part of their time."""

    def _new_pool(self) -> Executor:
        return ThreadPoolExecutor(self.slots)


class ProcessEngine(LocalEngine):
    """Processes of this machine, each with one thread: whole pipelines hold the interpreter's lock most of the time.

    Where they can be forked, a server loads the module ``preload`` once for all, so that a new worker is there at once.
    """

    def __init__(self, slots: int, preload: str | None = None) -> None:
        self._preload = preload
        super().__init__(slots)

    def _new_pool(self) -> Executor:
        forks = "forkserver" in multiprocessing.get_all_start_methods()
        context = multiprocessing.get_context("forkserver" if forks else "spawn")
        if forks and self._preload:
            context.set_forkserver_preload([self._preload])
        return ProcessPoolExecutor(self.slots, context, initializer=_initialize_worker)


def _initialize_worker() -> None:
    """Let a worker use one core, as many of them run as there are, and end when its client does, however that ends."""
    os.environ[THREADS_VARIABLE] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    Thread(target=_exit_with_client, daemon=True).start()


def _exit_with_client() -> None:
    if (client := multiprocessing.parent_process()) is not None:
        client.join()
        os._exit(1)


@contextmanager
def engine_from(
    name: str | None, identity: Identity | None = None, *, threads: bool = False, preload: str | None = None
) -> Iterator[Engine]:
    """Yield what ``--executor`` names: ``local`` (or None), ``dask://host:port``, or a TOML file of a cluster.

    Locally jobs run in processes that have loaded the module ``preload``, in threads where all is ``threads``. On a
    cluster, ``identity`` is run here and on every worker and must say the same. Raises InputError for a name that is
    none of these, where the extra ``cluster`` is missing, where no cluster answers, and where a worker differs.
    """
    if name is None or name == LOCAL_NAME:
        engine = ThreadEngine(thread_count()) if threads else ProcessEngine(thread_count(), preload)
        try:
            yield engine
        finally:
            engine.close()
        return
    manager = start_cluster(Path(name), identity) if name.endswith(".toml") else connect_cluster(name, identity)
    with manager as cluster:
        yield cluster
