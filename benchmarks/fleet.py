"""What a fleet costs, what it finds, and that nothing is lost where workers and the client are killed.

`python -m benchmarks.fleet find RIGS [DATES]`: writes a fleet with the exam's rig (5 % with a change), does it, and
prints seconds, core-hours, what was found, false alarms and bytes. `... scale RIGS`: the same rows in a loop, with
1 and 2 processes, and with 2 threads. `... kill RIGS`: with a worker killed every 20 s and the client killed once and
resumed; the datasets must be identical but for times.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from pathlib import Path
from typing import Any

import pyarrow.dataset as ds

from pneucli.config import load_fleet
from pneucli.exam.fleet import FLEET, write_fleet
from pneucli.executors import Engine, Processes, Threads, stream
from pneucli.stages import fleet_row
from pneucli.stages.fleet import Fleet

KILL_EVERY, CLIENT_KILLED = 20.0, 30.0  # s
TIMES = {"seconds", "stamp"}


def made(folder: Path, rigs: int, dates: int, changed: float) -> dict[str, str]:
    """A fleet without reports, and what changed in it."""
    truth = write_fleet(folder, rigs, dates, changed, seed=2026)
    with (folder / FLEET).open("a", encoding="utf-8") as file:
        file.write('reports = "none"\n')
    return truth


def used() -> float:
    """Processor seconds of this process and of all that it has waited for."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def find(folder: Path, rigs: int, dates: int) -> None:
    """Do a fleet and hold what it says against what was hidden."""
    truth = made(folder, rigs, dates, 0.05)
    begun, before = time.perf_counter(), used()
    out = subprocess.run([sys.executable, "-m", "pneucli", "fleet", folder / FLEET, "--json", "--quiet"],
                         capture_output=True, text=True, check=False).stdout  # fmt: skip
    seconds, core = time.perf_counter() - begun, used() - before
    answer = json.loads(out)
    said = {c["rig"]: {n for one in c["changes"] for n in (one["name"], one["effect"], *one["indistinguishable_from"])}
            for c in answer["changes"]}  # fmt: skip
    first = {c["rig"]: {c["changes"][0]["name"], c["changes"][0]["effect"]} for c in answer["changes"]}
    size = sum(p.stat().st_size for p in Path(answer["out"]).rglob("*") if p.is_file())
    print(f"{answer['rows']} rows in {seconds:.0f} s, {core / 3600:.3f} core-hours, {size / 1e6:.1f} MB of results")
    named, in_set = (sum(truth[r] in found.get(r, ()) for r in truth) for found in (first, said))
    print(f"changed {len(truth)}: found {len(truth.keys() & said.keys())}, named {named}, in the set {in_set}")
    print(f"false alarms: {len(said.keys() - truth.keys())} of {rigs * (dates - 1) - len(truth)} healthy comparisons")


def jobs_of(folder: Path, name: str) -> deque[Any]:
    """The first date of each rig, to be done into a folder of its own."""
    fleet = Fleet(load_fleet(folder / FLEET), folder / name)
    fleet.lacking()
    return fleet.ready


def scale(folder: Path, rigs: int) -> None:
    """The same rows in a plain loop and by each engine; the first row of each is not counted: it loads and compiles."""
    made(folder, rigs, 1, 0.0)
    os.environ["PNEUCLI_THREADS"] = "1"
    rows = jobs_of(folder, "loop")
    fleet_row.work(rows.popleft())
    begun = time.perf_counter()
    for job in rows:
        fleet_row.work(job)
    loop = time.perf_counter() - begun
    print(f"plain loop: {loop / len(rows):.2f} s a row")
    engines: dict[str, Any] = {
        "1 process": lambda: Processes(1),
        "2 processes": lambda: Processes(2),
        "2 threads": lambda: Threads(2),
    }
    for name, make in engines.items():
        engine = make()
        took = _timed(engine, jobs_of(folder, name))
        engine.close()
        print(f"{name}: {took / len(rows):.2f} s a row, {loop / took:.2f} times as fast as the loop")


def _timed(engine: Engine, jobs: deque[Any]) -> float:
    warm = deque(jobs.popleft() for _ in range(1))
    for _ in stream(engine, fleet_row.work, warm):
        pass
    begun = time.perf_counter()
    for outcome in stream(engine, fleet_row.work, jobs):
        assert outcome.error is None
    return time.perf_counter() - begun


def kill(folder: Path, rigs: int) -> None:
    """Do a fleet in peace, and a copy of it with workers killed and the client killed and resumed."""
    made(folder, rigs, 2, 0.1)
    command = [sys.executable, "-m", "pneucli", "fleet", str(folder / FLEET), "--quiet", "--out"]
    subprocess.run([*command, str(folder / "peace")], check=False, capture_output=True)
    killed, clients, last = 0, 0, time.monotonic()
    while True:
        begun = time.monotonic()
        client = subprocess.Popen([*command, str(folder / "war")], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        while client.poll() is None:
            time.sleep(0.5)
            if time.monotonic() - last > KILL_EVERY:
                killed, last = killed + _kill_worker(client.pid), time.monotonic()
            if not clients and time.monotonic() - begun > CLIENT_KILLED:
                client.kill()
                clients += 1
        if client.returncode == 0:
            break
        print(f"the client ended with {client.returncode}; it is started again")
    same = all(
        _content(folder / "peace" / name) == _content(folder / "war" / name)
        for name in ("results", "parameters", "changes")
    )
    print(f"{killed} workers and {clients} client killed; datasets identical but for times: {same}")


def _kill_worker(client: int) -> int:
    """Kill one process that computes for this client: a child of its server of forks."""
    pids = [int(p.name) for p in Path("/proc").iterdir() if p.name.isdigit()]
    parents = {pid: _parent(pid) for pid in pids}
    workers = [pid for pid in pids if parents.get(parents.get(pid, 0)) == client]
    if not workers:
        return 0
    os.kill(workers[0], signal.SIGKILL)
    return 1


def _parent(pid: int) -> int:
    try:
        return int((Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[1])
    except (OSError, IndexError):
        return 0


def _content(path: Path) -> list[dict[str, Any]]:
    rows = ds.dataset(path, partitioning="hive").to_table().to_pylist()
    rows = [{k: v for k, v in row.items() if k not in TIMES} for row in rows]
    return sorted(rows, key=lambda row: (row["rig"], row["date"], str(row.get("name"))))


def main(what: str, rigs: str = "20", dates: str = "2") -> None:
    """Run one of the benchmarks in a temporary folder."""
    folder = Path(tempfile.mkdtemp(prefix="pneucli-fleet-"))
    try:
        find(folder, int(rigs), int(dates)) if what == "find" else {"scale": scale, "kill": kill}[what](
            folder, int(rigs)
        )
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
