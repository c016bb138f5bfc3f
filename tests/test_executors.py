"""Engines: what is no cluster is refused, few jobs are under way at once, and a worker's death loses nothing."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from pneucli import executors
from pneucli.errors import InputError
from pneucli.executors import (
    JOBS_PER_SLOT,
    MAX_ATTEMPTS,
    ProcessEngine,
    ThreadEngine,
    engine_from,
    map_in_threads,
    require_cluster,
    require_same_identity,
    run_jobs,
)


@pytest.mark.parametrize("address", ["ray://here:8786", "dask://here", "dask://here:port", "dask://", "here:8786"])
def test_an_invalid_cluster_address_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="dask://host:port"), engine_from(address):
        pass


def test_a_closed_port_is_refused_before_any_work() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match="no cluster answers"):
        require_cluster(f"dask://127.0.0.1:{port}")


def test_a_port_that_never_answers_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "ANSWER_TIMEOUT", 0.3)
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        address = f"dask://127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(InputError, match="no cluster answers"), engine_from(address):
            pass


def double(number: int) -> int:
    if number < 0:
        raise ValueError("below zero")
    return 2 * number


def die_once(mark: str) -> str:
    """Kill the worker, but for the second time that it is asked."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return mark


def die(_: str) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_job_that_fails_stops_no_other() -> None:
    found = {o.job: o for o in run_jobs(ThreadEngine(2), double, deque([3, -1, 4]))}
    assert (found[3].result, found[4].result) == (6, 8)
    assert isinstance(found[-1].error, ValueError)


def test_jobs_that_are_added_meanwhile_run_too() -> None:
    ready = deque([1])
    seen = []
    for outcome in run_jobs(ThreadEngine(1), double, ready):
        seen.append(outcome.result)
        if outcome.job < 3:
            ready.append(outcome.job + 1)
    assert seen == [2, 4, 6]


class Watched(ThreadEngine):
    """Counts how many jobs are under way."""

    most = now = 0

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        self.now += 1
        self.most = max(self.most, self.now)
        future = super().submit(work, *arguments)
        future.add_done_callback(self._less)
        return future

    def _less(self, _: object) -> None:
        self.now -= 1


def test_however_many_jobs_wait_few_are_under_way() -> None:
    engine = Watched(2)
    assert sum(1 for _ in run_jobs(engine, time.sleep, deque([0.001] * 200))) == 200
    assert engine.most <= JOBS_PER_SLOT * engine.slots


def test_a_job_whose_worker_died_is_done_by_another_and_its_neighbours_too(tmp_path: Path) -> None:
    engine = ProcessEngine(2)
    jobs = [str(tmp_path / name) for name in "abcd"]
    try:
        found = [o.result for o in run_jobs(engine, die_once, deque(jobs))]
    finally:
        engine.close()
    assert sorted(found) == jobs


def test_a_job_that_kills_every_worker_is_given_up(tmp_path: Path) -> None:
    engine = ProcessEngine(1)
    try:
        (outcome,) = run_jobs(engine, die, deque([str(tmp_path)]))
    finally:
        engine.close()
    assert "worker died" in str(outcome.error)
    assert MAX_ATTEMPTS > 1


def test_a_worker_with_another_program_is_an_error_that_says_what_differs() -> None:
    answers: Mapping[str, Any] = {"tcp://a": {"pneucli": "0.1.0 abc"}, "tcp://b": {"pneucli": "0.2.0 def"}}
    with pytest.raises(InputError, match=r"tcp://b: pneucli is 0\.2\.0 def \[E080\]\n.*0\.1\.0 abc"):
        require_same_identity({"pneucli": "0.1.0 abc"}, answers, "dask://here:1")
    with pytest.raises(InputError, match="No module named"):
        require_same_identity({}, {"tcp://c": ModuleNotFoundError("No module named 'pneucli'")}, "dask://here:1")


CLUSTER = """\
[cluster]
class = "distributed.LocalCluster"
workers = 1
options = { n_workers = 0, threads_per_worker = 1, processes = false, dashboard_address = ":0", protocol = "tcp" }
"""


def full(queue: str) -> None:
    raise RuntimeError(f"the queue {queue} is full")


def here() -> dict[str, str]:
    return {"process": str(os.getpid())}


def test_a_cluster_starts_from_a_file_and_reports_its_versions(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    file = tmp_path / "cluster.toml"
    file.write_text(CLUSTER)
    with engine_from(str(file), here) as engine:
        assert [o.result for o in run_jobs(engine, double, deque([21]))] == [42]


@pytest.mark.parametrize(
    ("text", "says"),
    [('[cluster]\nclass = "nowhere.Cluster"', "nowhere"), ("[cluster]\nkind = 1", "unknown key"),
     ('[cluster]\nclass = "tests.test_executors.full"\noptions = { queue = "long" }', "long is full")],
)  # fmt: skip
def test_a_file_of_a_cluster_that_cannot_be_is_refused(tmp_path: Path, text: str, says: str) -> None:
    pytest.importorskip("distributed")
    file = tmp_path / "cluster.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=says), engine_from(str(file)):
        pass


DYING = """\
[cluster]
class = "distributed.LocalCluster"
options = { n_workers = 1, threads_per_worker = 1, dashboard_address = ":0", host = "127.0.0.1" }
"""


def test_a_worker_of_a_cluster_that_dies_loses_nothing(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    file = tmp_path / "cluster.toml"
    file.write_text(DYING)
    marks = [str(tmp_path / name) for name in "ab"]
    with engine_from(str(file)) as engine:
        assert sorted(o.result for o in run_jobs(engine, die_once, deque(marks))) == marks


ORPHANS = """
import os, time
from pneucli.executors import ProcessEngine
if __name__ == "__main__":
    engine = ProcessEngine(1)
    print(engine.submit(os.getpid).result(), flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks at processes as Linux shows them")
def test_workers_end_when_their_client_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "client.py"
    script.write_text(ORPHANS)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as client:
        assert client.stdout is not None
        process = client.stdout.readline().strip()
        assert process.isdecimal()
        worker = Path("/proc") / process
        assert worker.exists()
        client.kill()
    for _ in range(100):
        if not worker.exists() or " Z " in (worker / "stat").read_text(encoding="utf-8"):
            return
        time.sleep(0.1)
    pytest.fail("the worker still runs")


def test_threads_are_kept_give_results_in_order_and_start_none_of_their_own() -> None:
    def inner(job: int) -> tuple[int, int]:
        return job, threading.get_ident()

    def outer(job: int) -> list[tuple[int, int]]:
        return map_in_threads(inner, [job, job + 1], 2)

    nested = map_in_threads(outer, range(6), 2)
    assert [[job for job, _ in one] for one in nested] == [[n, n + 1] for n in range(6)]
    workers = [{thread for _, thread in one} for one in nested[1::2]]
    assert all(len(one) == 1 for one in workers)  # a worker does its inner jobs itself
    map_in_threads(inner, range(4), 2)
    before = threading.active_count()
    map_in_threads(inner, range(4), 2)
    assert threading.active_count() == before


def test_an_error_in_a_thread_is_raised_after_all_have_ended() -> None:
    ended: list[int] = []

    def work(job: int) -> None:
        if job == 0:
            raise ValueError("first")
        time.sleep(0.05)
        ended.append(job)

    with pytest.raises(ValueError, match="first"):
        map_in_threads(work, [0, 1], 2)
    assert ended == [1]
