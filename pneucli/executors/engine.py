"""Engines that run jobs: threads or processes of this machine, or a Dask cluster."""

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
    "PNEUCLI_THREADS"  # the environment variable with the number of threads for the simulations of one process
)
WORKER_DEATH_ERRORS: tuple[type[BaseException], ...] = (BrokenExecutor,)  # raised by a job whose worker died


def thread_count() -> int:
    """Return the number of threads for simulations: the cores this process may use, or ``PNEUCLI_THREADS``."""
    if (stated := os.environ.get(THREADS_VARIABLE, "")).isdigit() and int(stated) > 0:
        return int(stated)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Engine(Protocol):
    """What :func:`pneucli.executors.job_stream.run_jobs` needs."""

    @property
    def slots(self) -> int:
        """The number of jobs that run at once at present: a cluster may grow and shrink."""

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Run ``work(*arguments)`` somewhere."""

    def is_worker_death(self, error: BaseException) -> bool:
        """Return whether a job raised this because its worker died, so that the job may be repeated."""

    def replace_workers(self) -> None:
        """Restore the workers after one died."""

    def require_alive(self) -> None:
        """Raise InputError where the engine cannot run any more jobs."""


class LocalEngine:
    """Workers of this machine in a pool, which is created again when one of them dies."""

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self._pool = self._new_pool()

    def _new_pool(self) -> Executor:
        raise NotImplementedError

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Run ``work(*arguments)`` in a worker; if the pool is broken, the future has the error."""
        try:
            return self._pool.submit(work, *arguments)
        except BrokenExecutor as error:
            failed: Future[Any] = Future()
            failed.set_exception(error)
            return failed

    def is_worker_death(self, error: BaseException) -> bool:
        """Return whether the worker died."""
        return isinstance(error, WORKER_DEATH_ERRORS)

    def replace_workers(self) -> None:
        """Start new workers."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = self._new_pool()

    def require_alive(self) -> None:
        """Do nothing: this machine is alive."""

    def close(self) -> None:
        """End the workers; jobs that have not begun are dropped."""
        self._pool.shutdown(wait=True, cancel_futures=True)


class ThreadEngine(LocalEngine):
    """Threads of this process, for jobs that rarely hold the interpreter's lock."""

    def _new_pool(self) -> Executor:
        return ThreadPoolExecutor(self.slots)


class ProcessEngine(LocalEngine):
    """Processes of this machine, one thread each, because pipelines hold the interpreter's lock most of the time.

    Where processes can be forked, a server loads the module ``preload`` once, so that a new worker starts at once.
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
    """Let a worker use one core, since there is one for each, and end when its client ends or is killed."""
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
    """Yield the engine that ``--executor`` names: ``local`` (or None), ``dask://host:port``, or a cluster's TOML file.

    Local jobs run in processes that have loaded the module ``preload``, or in threads. On a cluster, ``identity`` runs
    here and on every worker and must return the same. Raises InputError for another name, without the extra
    ``cluster``, where no cluster answers, and where a worker differs.
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
