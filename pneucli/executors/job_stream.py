"""Many jobs through an engine: few of them under way at once, results as they come, a worker's death survived."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pneucli.executors.engine import Engine

JOBS_PER_SLOT = 2  # jobs under way for each that runs: a worker that is done has the next one at hand
MAX_ATTEMPTS = 3  # of a job that runs alone, until it is what kills its worker
POLL_INTERVAL = 2.0  # s, after which somebody asks whether the engine is still there
WORKER_DIED = "its worker died each time it was tried; it may need more memory than there is"
Job = TypeVar("Job")


@dataclass(frozen=True)
class Outcome(Generic[Job]):
    """What became of a job: its result, or the error that it raised; its worker's death is a ``ChildProcessError``."""

    job: Job
    result: Any = None
    error: BaseException | None = None


def run_jobs(engine: Engine, work: Callable[[Job], Any], jobs: deque[Job]) -> Iterator[Outcome[Job]]:
    """Yield what ``work(job)`` gives for all that is ``jobs``, in the order in which it is done.

    More may be put into ``jobs`` between two outcomes. No more than a few jobs for each worker are under way, however
    many wait. A job whose worker died is tried again, from then on with no other beside it, so that a job that kills
    its worker takes nobody else's work with it; after ``MAX_ATTEMPTS`` such deaths it is given up.
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
        for future in [one for one in flying if one in done]:  # together done, first begun
            job = flying.pop(future)
            outcome = _outcome(engine, job, future)
            if outcome is None:
                suspects.append(job)
            else:
                yield outcome


def _one_by_one(engine: Engine, work: Callable[[Job], Any], suspects: deque[Job]) -> Iterator[Outcome[Job]]:
    """Try each job with no other beside it, until it is done or its worker has died too often."""
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
    """Return the futures that are done, after some time none: then the engine is asked whether it is still there."""
    done, _ = wait(flying, timeout=POLL_INTERVAL, return_when=FIRST_COMPLETED)
    if not done:
        engine.require_alive()
    return done


def _outcome(engine: Engine, job: Job, future: Future[Any]) -> Outcome[Job] | None:
    """Return what became of a job, None where its worker died."""
    try:
        return Outcome(job, result=future.result())
    except BaseException as error:
        if engine.is_worker_death(error):
            engine.require_alive()  # where all is gone, no worker in particular died
            return None
        if isinstance(error, Exception):
            return Outcome(job, error=error)
        raise
