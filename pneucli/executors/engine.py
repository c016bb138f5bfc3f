"""Engines: an executor of the standard library's kind, or that of a Dask cluster, which gets few jobs at a time."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence, Sized
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass
from functools import cache
from threading import Thread
from typing import Any, Generic, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

_thread = threading.local()


def map_in_threads(work: Callable[[Job], Result], jobs: Sequence[Job], threads: int) -> list[Result]:
    """Return the result of each job.

    Each thread, of which the caller's is one, takes every n-th job, since handing over single jobs costs as much. Jobs
    that ask for threads themselves get none.

    >>> map_in_threads(abs, [-1, 2, -3], 2)
    [1, 2, 3]
    """
    shares = [jobs[n::threads] for n in range(min(threads, len(jobs)))]
    if len(shares) <= 1 or getattr(_thread, "is_worker", False):
        return [work(job) for job in jobs]

    def run_all(share: Sequence[Job]) -> list[Result]:
        return [work(job) for job in share]

    futures = [_pool(threads - 1).submit(run_all, share) for share in shares[1:]]
    try:
        parts = [run_all(shares[0])]
    finally:
        wait(futures)  # they may write to arrays of the caller
    parts += [future.result() for future in futures]
    return [parts[n % len(parts)][n // len(parts)] for n in range(len(jobs))]


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(workers, initializer=_mark)


def _mark() -> None:
    _thread.is_worker = True


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not outlive a fork


# the environment variable with the number of threads for the simulations of one process
THREADS_VARIABLE = "PNEUCLI_THREADS"
SIMULATION_MEMORY = 256 << 20  # bytes of all simulations that run at once
BYTES_PER_SAMPLE = 200  # of one simulation
WORKER_DEATH_ERRORS: tuple[type[BaseException], ...] = (BrokenExecutor,)  # raised by a job whose worker died
JOBS_PER_SLOT = 2  # submitted jobs for each running one: a worker that is done has the next one at hand
MAX_ATTEMPTS = 3  # deaths of a job's worker, while no other job runs, until the job is given up
POLL_INTERVAL = 2.0  # s, between checks whether the engine is alive
WORKER_DIED = "its worker died each time it was tried; it may need more memory than there is"


def thread_count() -> int:
    """Return the number of threads for simulations: the cores this process may use, or ``PNEUCLI_THREADS``."""
    if (stated := os.environ.get(THREADS_VARIABLE, "")).isdigit() and int(stated) > 0:
        return int(stated)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def simulations_at_once(recordings: Sequence[Sized]) -> int:
    """Return how many simulations of recordings run at once: one a core, fewer for very long recordings."""
    longest = max(map(len, recordings), default=1)
    return max(min(SIMULATION_MEMORY // (BYTES_PER_SAMPLE * longest), thread_count()), 1)


class Engine:
    """An executor, and how it is made; it is made anew where one of its workers dies."""

    def __init__(self, slots: int, make: Callable[[], Executor]) -> None:
        self._slots, self._make = slots, make
        self._executor = make()

    @property
    def slots(self) -> int:
        """The number of jobs that run at once at present: a cluster may grow and shrink."""
        return self._slots

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Run ``work(*arguments)`` in a worker; where no worker is left, the future has the error."""
        try:
            return self._executor.submit(work, *arguments)
        except BrokenExecutor as error:
            failed: Future[Any] = Future()
            failed.set_exception(error)
            return failed

    def replace_workers(self) -> None:
        """Start new workers after one died."""
        self.close()
        self._executor = self._make()

    def require_alive(self) -> None:
        """Raise InputError where the engine cannot run any more jobs; this machine can."""

    def close(self) -> None:
        """End the workers; jobs that have not begun are dropped."""
        self._executor.shutdown(wait=True, cancel_futures=True)


class ThreadEngine(Engine):
    """Threads of this process, for jobs that rarely hold the interpreter's lock."""

    def __init__(self, slots: int) -> None:
        super().__init__(slots, lambda: ThreadPoolExecutor(slots))


class ProcessEngine(Engine):
    """Processes of this machine, one thread each, because pipelines hold the interpreter's lock most of the time.

    Where processes can be forked, a server loads the module ``preload`` once, so that a new worker starts at once.
    """

    def __init__(self, slots: int, preload: str | None = None) -> None:
        forks = "forkserver" in multiprocessing.get_all_start_methods()
        context = multiprocessing.get_context("forkserver" if forks else "spawn")
        if forks and preload:
            context.set_forkserver_preload([preload])
        super().__init__(slots, lambda: ProcessPoolExecutor(slots, context, initializer=_initialize_worker))


def _initialize_worker() -> None:
    """Let a worker use one core, since there is one for each, and end when its client ends or is killed."""
    os.environ[THREADS_VARIABLE] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    Thread(target=_exit_with_client, daemon=True).start()


def _exit_with_client() -> None:
    if (client := multiprocessing.parent_process()) is not None:
        client.join()
        os._exit(1)


@dataclass(frozen=True)
class Outcome(Generic[Job]):
    """The result of a job, or the error that it raised; the death of its worker is a ``ChildProcessError``."""

    job: Job
    result: Any = None
    error: BaseException | None = None


def run_jobs(engine: Engine, work: Callable[[Job], Any], jobs: deque[Job]) -> Iterator[Outcome[Job]]:
    """Yield the outcome of ``work(job)`` for each of ``jobs``, in the order of completion.

    The caller may append to ``jobs`` between two outcomes. At most JOBS_PER_SLOT jobs for each worker are submitted.
    A job whose worker died is repeated while no other job runs, so that a job that kills its worker destroys no other
    job's work; after ``MAX_ATTEMPTS`` deaths it is given up.
    """
    flying: dict[Future[Any], tuple[Job, int]] = {}  # with the number of times that a job runs alone
    suspects: deque[tuple[Job, int]] = deque()
    while jobs or flying or suspects:
        if suspects and not flying:
            engine.replace_workers()
            job, alone = suspects.popleft()
            flying[engine.submit(work, job)] = job, alone + 1
        while jobs and not suspects and len(flying) < JOBS_PER_SLOT * engine.slots:
            if any(alone for _, alone in flying.values()):
                break
            job = jobs.popleft()
            flying[engine.submit(work, job)] = job, 0
        done, _ = wait(flying, timeout=POLL_INTERVAL, return_when=FIRST_COMPLETED)
        if not done:
            engine.require_alive()
        for future in [one for one in flying if one in done]:  # of those done together, the earliest first
            job, alone = flying.pop(future)
            if not _lost_worker(engine, future):
                yield Outcome(job, None if (error := future.exception()) else future.result(), error)
            elif alone < MAX_ATTEMPTS:
                suspects.appendleft((job, alone)) if alone else suspects.append((job, alone))
            else:
                yield Outcome(job, error=ChildProcessError(WORKER_DIED))


def _lost_worker(engine: Engine, future: Future[Any]) -> bool:
    """Return whether a job's worker died; ``KilledWorker`` of Dask: several did, ``ComputeError``: with the result."""
    error = CancelledError() if future.cancelled() else future.exception()
    if isinstance(error, (*WORKER_DEATH_ERRORS, CancelledError)) or type(error).__name__ in {
        "KilledWorker",
        "ComputeError",
    }:
        engine.require_alive()  # if the engine ended, the job's worker did not die of the job
        return True
    if error is not None and not isinstance(error, Exception):
        raise error
    return False
