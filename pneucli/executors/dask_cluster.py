"""Connect to a Dask cluster, or start one from a TOML file; every worker must run the same program."""

from __future__ import annotations

import importlib
import logging
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

from pneucli.document import read_toml
from pneucli.errors import InputError
from pneucli.executors.engine import Engine, ProcessEngine, ThreadEngine, thread_count
from pneucli.imports import library_of_extra

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
