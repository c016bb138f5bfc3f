"""Run many jobs on an engine: few at once, results in the order of completion, with repeats after a worker's death."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pneucli.executors.engine import Engine

JOBS_PER_SLOT = 2  # submitted jobs for each running one: a worker that is done has the next one at hand
MAX_ATTEMPTS = 3  # deaths of a job's worker, while no other job runs, until the job is given up
POLL_INTERVAL = 2.0  # s, between checks whether the engine is alive
WORKER_DIED = "its worker died each time it was tried; it may need more memory than there is"
Job = TypeVar("Job")


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
    flying: dict[Future[Any], Job] = {}
    suspects: deque[Job] = deque()
    while jobs or flying or suspects:
        if suspects and not flying:
            engine.replace_workers()
            yield from _one_by_one(engine, work, suspects)
        while jobs and not suspects and len(flying) < JOBS_PER_SLOT * engine.slots:
            job = jobs.popleft()
            flying[engine.submit(work, job)] = job
        done = _wait_for_done(engine, flying)
        for future in [one for one in flying if one in done]:  # of those done together, the earliest first
            job = flying.pop(future)
            outcome = _outcome(engine, job, future)
            if outcome is None:
                suspects.append(job)
            else:
                yield outcome


def _one_by_one(engine: Engine, work: Callable[[Job], Any], suspects: deque[Job]) -> Iterator[Outcome[Job]]:
    """Run each job while no other runs, until it is done or its worker has died too often."""
    while suspects:
        job = suspects.popleft()
        for _ in range(MAX_ATTEMPTS):
            future = engine.submit(work, job)
            while not _wait_for_done(engine, {future: job}):
                pass
            if (outcome := _outcome(engine, job, future)) is not None:
                yield outcome
                break
            engine.replace_workers()
        else:
            yield Outcome(job, error=ChildProcessError(WORKER_DIED))


def _wait_for_done(engine: Engine, flying: dict[Future[Any], Job]) -> set[Future[Any]]:
    """Return the finished futures; after POLL_INTERVAL without any, check that the engine is alive."""
    done, _ = wait(flying, timeout=POLL_INTERVAL, return_when=FIRST_COMPLETED)
    if not done:
        engine.require_alive()
    return done


def _outcome(engine: Engine, job: Job, future: Future[Any]) -> Outcome[Job] | None:
    """Return the outcome of a job, None where its worker died."""
    try:
        return Outcome(job, result=future.result())
    except BaseException as error:
        if engine.is_worker_death(error):
            engine.require_alive()  # if the engine ended, the job's worker did not die of the job
            return None
        if isinstance(error, Exception):
            return Outcome(job, error=error)
        raise
