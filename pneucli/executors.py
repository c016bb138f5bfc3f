"""Where many runs of one kind are done: threads of this process, or a Dask cluster."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

from pneucli.errors import InputError

PATIENCE = 5.0  # s, until a cluster has answered


def workers() -> int:
    """Return how many threads run simulations: the cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def executor_from(address: str | None) -> Iterator[Executor]:
    """Yield an executor: threads of this process, or a Dask cluster's for ``dask://host:port``.

    Raises InputError for another address, where the extra ``cluster`` is missing, and where no cluster answers.
    """
    if address is None:
        with ThreadPoolExecutor(workers()) as threads:
            yield threads
        return
    require_cluster(address)
    with _client(address) as client:
        if not client.scheduler_info()["workers"]:
            mend = "start one: dask worker HOST:PORT"
            raise InputError("--executor", f"the cluster at {address} has no workers", "at least one", mend)
        yield client.get_executor()


def _client(address: str) -> Any:
    """Connect in a thread of its own: who listens and never answers is waited for without end."""
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError(
            "--executor", "dask.distributed is not installed", "the extra cluster", "pip install 'pneucli[cluster]'"
        ) from error
    clients: SimpleQueue[Any] = SimpleQueue()

    def connect() -> None:
        with suppress(Exception):  # what answers may be anything
            clients.put(Client(address.replace("dask://", "tcp://", 1), timeout=PATIENCE))  # type: ignore[no-untyped-call]

    Thread(target=connect, daemon=True).start()
    try:
        return clients.get(timeout=PATIENCE)
    except Empty as error:
        raise _no_answer(address) from error


def require_cluster(address: str) -> None:
    """Raise InputError where nobody listens at ``address``: cheap, so that it is known before long work is begun."""
    host, port = _host_and_port(address)
    try:
        socket.create_connection((host, port), timeout=PATIENCE).close()
    except OSError as error:
        raise _no_answer(address) from error


def _host_and_port(address: str) -> tuple[str, int]:
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:  # a port that is no number
        host, port = None, None
    if not address.startswith("dask://") or not host or not port:
        raise InputError("--executor", f'"{address}"', '"dask://host:port"')
    return host, port


def _no_answer(address: str) -> InputError:
    mend = "start it (dask scheduler), check the address, or leave --executor out"
    return InputError("--executor", f"no cluster answers at {address} within {PATIENCE:g} s", "a Dask scheduler", mend)
