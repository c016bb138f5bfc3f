"""Run many jobs: in threads or processes of this machine, or on a Dask cluster that runs the same program."""

import importlib
import logging
import multiprocessing
import os
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence, Sized
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
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, Generic, TypeVar
from urllib.parse import urlsplit

from pneucli.document import read_toml
from pneucli.errors import InputError
from pneucli.imports import library_of_extra

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


ANSWER_TIMEOUT = 5.0  # s, for the first answer of a cluster
START_TIMEOUT = 600.0  # s, for the first worker of a queue
LOCAL_NAME = "local"
DASK_LOGGERS = ("distributed", "distributed.client", "distributed.core", "tornado.application", "asyncio")
CLUSTER_KEYS = ("class", "workers", "minimum", "maximum", "options")
Identity = Callable[[], Mapping[str, str]]


class DaskCluster(Engine):
    """Workers of a Dask cluster by its own executor; another worker repeats the jobs of a dead one."""

    def __init__(self, client: Any, name: str, identity: Identity | None) -> None:
        super().__init__(0, lambda: client.get_executor(pure=False))
        self._client, self._name = client, name
        self._identity, self._seen = identity, set[str]()
        self.check_versions()

    @property
    def slots(self) -> int:
        """The number of jobs that run at once at present."""
        return max(sum(int(w["nthreads"]) for w in self._client.scheduler_info(n_workers=-1)["workers"].values()), 1)

    def replace_workers(self) -> None:
        """Check the versions of new workers; Dask's nannies start them."""
        self.check_versions()

    def require_alive(self) -> None:
        """Raise InputError where the scheduler does not run any more."""
        if self._client.status != "running":
            found = f"the cluster at {self._name} went away"
            mend = "finished results are stored: start the cluster and repeat the command"
            raise InputError("--executor", found, "a Dask scheduler that answers", mend, code="E080")

    def check_versions(self) -> None:
        """Raise InputError where a new worker runs another program than this client."""
        if self._identity is None:
            return
        there = set(self._client.scheduler_info(n_workers=-1)["workers"]) - self._seen
        if not there:
            return
        try:
            answers = self._client.run(self._identity, workers=sorted(there), on_error="return")
        except (OSError, TimeoutError):  # the scheduler ended meanwhile
            return
        require_same_identity(self._identity(), answers, self._name)
        self._seen |= there


def require_same_identity(own: Mapping[str, str], answers: Mapping[str, Any], name: str) -> None:
    """Raise InputError that lists the differences between this client's identity and the workers' ``answers``."""
    faults = []
    for worker, theirs in sorted(answers.items()):
        if isinstance(theirs, OSError):
            continue  # it died before it answered
        where = f"--executor {name}, worker {worker}"
        if isinstance(theirs, BaseException):
            found = f"it cannot run this program: {type(theirs).__name__}: {theirs}"
            faults.append(
                InputError(where, found, "the same pneucli as here", "install this version there", code="E080")
            )
            continue
        for what in {**own, **theirs}:
            if own.get(what) != theirs.get(what):
                found = f"{what} is {theirs.get(what, 'not there')}"
                wanted = f"as on this client: {own.get(what, 'not there')}"
                faults.append(
                    InputError(
                        where, found, wanted, "install the same on both, then start the worker again", code="E080"
                    )
                )
    if faults:
        raise (
            faults[0]
            if len(faults) == 1
            else InputError(f"--executor {name}", "workers differ", faults=faults, code="E080")
        )


@contextmanager
def connect_cluster(address: str, identity: Identity | None = None) -> Iterator[DaskCluster]:
    """Yield the cluster at ``dask://host:port``.

    Raises InputError for another address, without an answer, without workers, or where a worker differs.
    """
    require_cluster(address)
    with _silenced_loggers(), _client(address) as client:
        if not client.scheduler_info()["workers"]:
            mend = "start one: dask worker HOST:PORT"
            raise InputError(
                "--executor", f"the cluster at {address} has no workers", "at least one", mend, code="E080"
            )
        yield DaskCluster(client, address, identity)


@contextmanager
def start_cluster(path: Path, identity: Identity | None = None) -> Iterator[DaskCluster]:
    """Start the cluster that a TOML file describes, yield it, and end it.

    ``class`` is a dotted name such as ``dask_jobqueue.SLURMCluster``, ``options`` its arguments; ``workers`` is the
    number of workers, or ``minimum`` and ``maximum`` limit it according to the work. Raises InputError where the
    cluster cannot be started.
    """
    _, tables = read_toml(path)
    table = tables.get("cluster", {})
    if unknown := set(table) - set(CLUSTER_KEYS):
        raise InputError(
            f"{path}, key cluster.{min(unknown)}", "unknown key", f"one of {', '.join(CLUSTER_KEYS)}", code="E021"
        )
    make = _class(str(table.get("class", "")), f"{path}, key cluster.class")
    client_of = _distributed().Client
    try:
        cluster = make(**table.get("options", {}))
    except Exception as error:  # a queueing system may raise anything
        raise InputError(f"{path}, key cluster.options", f"{type(error).__name__}: {error}", code="E023") from error
    with _silenced_loggers(), cluster, client_of(cluster) as client:
        _scale(cluster, table)
        _wait(client, path)
        yield DaskCluster(client, str(path), identity)


@contextmanager
def _silenced_loggers() -> Iterator[None]:
    """Silence Dask's loggers meanwhile: lost jobs are repeated, and errors that matter are raised."""
    loggers = [logging.getLogger(name) for name in DASK_LOGGERS]
    before = [one.level for one in loggers]
    for one in loggers:
        one.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for one, level in zip(loggers, before, strict=True):
            one.setLevel(level)


def _scale(cluster: Any, table: Mapping[str, Any]) -> None:
    if "maximum" in table:
        cluster.adapt(minimum=int(table.get("minimum", 0)), maximum=int(table["maximum"]))
    elif "workers" in table:
        cluster.scale(int(table["workers"]))


def _wait(client: Any, path: Path) -> None:
    try:
        client.wait_for_workers(1, timeout=START_TIMEOUT)
    except TimeoutError as error:
        raise InputError(
            str(path), f"no worker started within {START_TIMEOUT:g} s", "at least one", code="E080"
        ) from error


def _class(name: str, where: str) -> Callable[..., Any]:
    module, _, last = name.rpartition(".")
    try:
        return getattr(importlib.import_module(module), last)  # type: ignore[no-any-return]
    except (ImportError, AttributeError, ValueError) as error:
        wanted = 'a class such as "dask_jobqueue.SLURMCluster"'
        raise InputError(
            where, f'no "{name}" here ({error})', wanted, "pip install dask-jobqueue", code="E080"
        ) from error


def _distributed() -> Any:
    return library_of_extra("distributed", "cluster", "--executor", "dask.distributed")


def _client(address: str) -> Any:
    """Connect in a separate thread, because Dask waits for ever for a port that never answers."""
    client_of = _distributed().Client
    clients: SimpleQueue[Any] = SimpleQueue()

    def connect() -> None:
        with suppress(Exception):  # another program may answer at this port
            clients.put(client_of(address.replace("dask://", "tcp://", 1), timeout=ANSWER_TIMEOUT))

    Thread(target=connect, daemon=True).start()
    try:
        return clients.get(timeout=ANSWER_TIMEOUT)
    except Empty as error:
        raise _no_answer(address) from error


def require_cluster(address: str) -> None:
    """Raise InputError where nothing listens at ``address``; this is quick, before long work begins.

    Executors without an address are not checked.
    """
    if address == LOCAL_NAME or address.endswith(".toml"):
        return
    host, port = _host_and_port(address)
    try:
        socket.create_connection((host, port), timeout=ANSWER_TIMEOUT).close()
    except OSError as error:
        raise _no_answer(address) from error


def _host_and_port(address: str) -> tuple[str, int]:
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:  # a port that is no number
        host, port = None, None
    if not address.startswith("dask://") or not host or not port:
        raise InputError(
            "--executor", f'"{address}"', '"local", "dask://host:port", or a TOML file of a cluster', code="E001"
        )
    return host, port


def _no_answer(address: str) -> InputError:
    mend = "start it (dask scheduler), check the address, or leave --executor out"
    return InputError(
        "--executor",
        f"no cluster answers at {address} within {ANSWER_TIMEOUT:g} s",
        "a Dask scheduler",
        mend,
        code="E080",
    )


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
