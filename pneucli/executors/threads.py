"""Short jobs on threads that the process keeps: a simulation takes about as long as the start of a thread."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

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
