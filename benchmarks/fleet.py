"""What a fleet costs, what it finds, and that nothing is lost where workers and the client are killed.

`python -m benchmarks.fleet find RIGS`: writes a fleet with the exam's rig (5 % with a change at the last of `--dates`),
does it, and prints seconds, core-hours, what was found, false alarms and bytes. `... scale RIGS`: the same rows in a
loop, with 1 and 2 processes, and with 2 threads. `... kill RIGS`: with a worker killed every 20 s and the client killed
once and resumed; the datasets must be identical but for times. `--folder DIR` keeps the fleet, and uses one that is
there already.

A fleet is a template, a table and, sealed, what changed in which rig. Each rig is drawn as in an exam and recorded for
some seconds at every date: the same test programme, new noise. Some rigs differ at the last date: an effect of the
catalogue appeared, or friction grew.
"""

import argparse
import csv
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import date, timedelta
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow.dataset as ds
from threadpoolctl import threadpool_limits

from pneucli.config import load_fleet
from pneucli.exam.cases import SEALED_FOLDER, prepare_case
from pneucli.exam.conditions import Conditions
from pneucli.exam.hidden_effects import BY_NAME, RIGS_WITH_PISTON
from pneucli.exam.laboratory import RecordingPlan
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import Excitation
from pneucli.executors import Engine, ProcessEngine, ThreadEngine, run_jobs
from pneucli.fleet import row as fleet_row
from pneucli.fleet.run import Fleet

Rows = list[dict[str, str]]

FIRST_DATE = date(2026, 1, 1)
RECORDING_SAMPLES = {"stickslip": 3000, "driven": 2500}  # ms of a take
WEAR_PARAMETERS = ("friction.coulomb", "friction.viscous")
WEAR_FACTORS = (1.15, 1.5)  # times, of friction that wears
CHANGES = (*WEAR_PARAMETERS, *(e.name for e in BY_NAME.values() if e.kinds == RIGS_WITH_PISTON and not e.part))
TABLE_FILE, TEMPLATE_FILE, FLEET_FILE, TRUTH_FILE = "rigs.csv", "template.toml", "fleet.toml", "fleet.json"
STATED_KEYS = {
    "rig.supply_pressure": ("supply", 1e-5, "bar"),
    "rig.cylinder.piston_area_1": ("piston_area_1", 1e4, "cm^2"),
    "rig.cylinder.piston_area_2": ("piston_area_2", 1e4, "cm^2"),
    "rig.cylinder.dead_volume_1": ("dead_volume_1", 1e6, "cm^3"),
    "rig.cylinder.dead_volume_2": ("dead_volume_2", 1e6, "cm^3"),
    "rig.cylinder.moving_mass": ("mass", 1.0, "kg"),
}


@dataclass(frozen=True)
class FleetRig:
    """One rig: its number in the fleet, what changes at the last date, and by how much.

    ``drift`` is the relative standard deviation of its friction from date to date.
    """

    number: int
    changes: tuple[str, ...]
    size: float
    seed: int
    drift: float = 0.0

    @property
    def name(self) -> str:
        """Name of the rig."""
        return f"rig-{self.number:05d}"


MapFunction = Callable[[Callable[[FleetRig], Rows], Iterable[FleetRig]], Iterable[Rows]]


def write_fleet(
    directory: Path,
    rigs: int,
    dates: int = 2,
    changed: float = 0.05,
    size: float = 1.0,
    seed: int = 1,
    changes_per_rig: int = 1,
    drift: float = 0.0,
    map_function: MapFunction = map,
) -> dict[str, list[str]]:
    """Write table, template, fleet file and raw files; return the changes by rig, which are sealed as well.

    A share ``changed`` of the rigs (at least one, unless it is 0) has ``changes_per_rig`` changes of ``size`` times
    the usual. The friction of all rigs differs from date to date with the relative standard deviation ``drift``.
    ``map_function`` applies the recording to every rig: ``map``, or that of a pool of processes.
    """
    rng = np.random.default_rng(seed)
    number = max(round(changed * rigs), 1) if changed > 0 else 0
    chosen = {int(k): _draw_changes(rng, changes_per_rig) for k in rng.permutation(rigs)[:number]}
    axes = [FleetRig(k, chosen.get(k, ()), size, int(rng.integers(2**31)), drift) for k in range(rigs)]
    rows = [row for rig in map_function(partial(_record, directory, dates), axes) for row in rig]
    with (directory / TABLE_FILE).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    (directory / TEMPLATE_FILE).write_text(_template(axes[0]), encoding="utf-8")
    fleet = f'[fleet]\nname = "{directory.name}"\ntemplate = "{TEMPLATE_FILE}"\ntable = "{TABLE_FILE}"\n'
    (directory / FLEET_FILE).write_text(fleet, encoding="utf-8")
    truth = {axis.name: list(axis.changes) for axis in axes if axis.changes}
    sealed = directory / SEALED_FOLDER / TRUTH_FILE
    sealed.parent.mkdir(parents=True, exist_ok=True)
    sealed.write_text(json.dumps(truth, indent=1), encoding="utf-8")
    return truth


def _draw_changes(rng: np.random.Generator, at_once: int) -> tuple[str, ...]:
    return tuple(map(str, np.atleast_1d(rng.choice(CHANGES, at_once if at_once > 1 else None, replace=False))))


def _record(directory: Path, dates: int, axis: FleetRig) -> Rows:
    case = prepare_case(axis.name, "friction", [], "", 1.0, axis.seed, Conditions())
    takes = [_shortened(take) for take in case.plans[:4]]
    rows = []
    for k in range(dates):
        is_last = k == dates - 1 and k > 0
        parameters = apply_changes(axis, case.laboratory.parameters) if is_last else case.laboratory.parameters
        parameters = _with_daily_scatter(axis, parameters, k)
        day = (FIRST_DATE + timedelta(days=k)).isoformat()
        folder = Path("raw") / axis.name / day
        laboratory = replace(case.laboratory, parameters=parameters)
        laboratory.record(directory / folder, takes, np.random.default_rng([axis.seed, 2, k]))
        rows.append(_row(axis, case.laboratory.parameters, day, folder, takes))
    return rows


def _shortened(take: RecordingPlan) -> RecordingPlan:
    samples, manoeuvre = RECORDING_SAMPLES[take.name.split("_")[0]], take.excitation
    assert isinstance(manoeuvre, Excitation)
    return replace(take, excitation=replace(manoeuvre, command=manoeuvre.command[:samples]))


def apply_changes(axis: FleetRig, par: Parameters) -> Parameters:
    """Return the rig with its changes."""
    rng = np.random.default_rng([axis.seed, 3])
    for change in axis.changes:
        if change in WEAR_PARAMETERS:
            field = change.partition(".")[2]
            par = par._replace(**{field: getattr(par, field) * (1.0 + axis.size * (rng.uniform(*WEAR_FACTORS) - 1.0))})
        else:
            par = BY_NAME[change].apply(par, axis.size, rng)
    return par


def _with_daily_scatter(axis: FleetRig, par: Parameters, day: int) -> Parameters:
    """Return the rig on a day: lubrication, temperature and rest differ from day to day."""
    rng = np.random.default_rng([axis.seed, 4, day])
    factors = {name.partition(".")[2]: float(np.exp(axis.drift * rng.standard_normal())) for name in WEAR_PARAMETERS}
    return par._replace(**{field: getattr(par, field) * factor for field, factor in factors.items()})


def _row(axis: FleetRig, par: Parameters, day: str, folder: Path, takes: Sequence[RecordingPlan]) -> dict[str, str]:
    stated = {key: f"{getattr(par, f) * factor:.4f} {unit}" for key, (f, factor, unit) in STATED_KEYS.items()}
    files = {f"recordings.{take.name}.file": f"{folder.as_posix()}/{take.name}.csv" for take in takes}
    return {"rig": axis.name, "date": day, **stated, **files}


def _template(axis: FleetRig) -> str:
    case = prepare_case("template", "friction", [], "", 1.0, axis.seed, Conditions())
    return case.laboratory.pipeline(_with_uses(case.plans[:4]), "raw")


def _with_uses(takes: Sequence[RecordingPlan]) -> list[RecordingPlan]:
    """Return the recordings with their uses: the last one of each experiment is held out."""
    uses: Mapping[str, str] = {"stickslip_2": "test", "driven_2": "test"}
    return [replace(take, use="test" if uses.get(take.name) else "train") for take in takes]


KILL_EVERY, CLIENT_KILLED = 20.0, 30.0  # s
TIMES = {"seconds", "core_seconds", "stamp"}


def made(folder: Path, rigs: int, dates: int, changed: float, **more: Any) -> dict[str, list[str]]:
    """A fleet without reports, and what changed in it; one that is there already is taken as it is."""
    sealed = folder / SEALED_FOLDER / TRUTH_FILE
    if not sealed.is_file():
        with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            write_fleet(folder, rigs, dates, changed, seed=2026, map_function=partial(pool.map, chunksize=4), **more)
        with (folder / FLEET_FILE).open("a", encoding="utf-8") as file:
            file.write('reports = "none"\n')
    return dict(json.loads(sealed.read_text(encoding="utf-8")))


def find(folder: Path, rigs: int, dates: int, healthy: int = 1, **more: Any) -> None:
    """Do a fleet and hold what it says against what was hidden."""
    truth = made(folder, rigs, dates, **{"changed": 0.05, **more})
    text = [line for line in (folder / FLEET_FILE).read_text(encoding="utf-8").splitlines() if "healthy" not in line]
    (folder / FLEET_FILE).write_text("\n".join([*text, f"healthy = {healthy}", ""]), encoding="utf-8")
    begun, before = time.perf_counter(), _children()
    command = [sys.executable, "-m", "pneucli", "fleet", folder / FLEET_FILE, "--json", "--quiet"]
    answer = json.loads(subprocess.run(command, capture_output=True, text=True, check=False).stdout)
    seconds = time.perf_counter() - begun
    rows = ds.dataset(Path(answer["out"]) / "results", partitioning="hive").to_table().to_pandas()
    client, cores = _children() - before, rows["core_seconds"]
    print(
        f"{answer['rows']} rows in {seconds:.0f} s on {len(os.sched_getaffinity(0))} cores; failed {answer['failed']}"
    )
    print(
        f"workers: {cores.sum() / 3600:.3f} core-hours, {cores.mean():.2f} s a row (median {cores.median():.2f}, "
        f"worst {cores.max():.2f}); client: {client:.0f} s of a core"
    )
    print(f"bytes: {_size(folder / 'raw') / 1e6:.1f} MB read, {_size(Path(answer['out'])) / 1e6:.1f} MB of results")
    _hold(answer, truth, rigs * (dates - max(healthy, 1)), str(rows["date"].max()))


def _children() -> float:
    """Processor seconds of the processes that this one has started and seen end: clients, not their workers."""
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def _hold(answer: dict[str, Any], truth: dict[str, list[str]], comparisons: int, last: str) -> None:
    """Print what was found of the truth, and what was named where nothing had changed."""
    named = {(c["rig"], c["date"]): [(one["name"], one["effect"]) for one in c["changes"]] for c in answer["changes"]}
    sets = {(c["rig"], c["date"]): {n for one in c["changes"] for n in one["indistinguishable_from"]}
            for c in answer["changes"]}  # fmt: skip
    hits = {rig: named[rig, last] for rig in truth if (rig, last) in named}
    said = {rig: {n for one in names for n in one} | sets[rig, last] for rig, names in hits.items()}
    first = [rig for rig, names in hits.items() if set(truth[rig]) & set(names[0])]
    all_named = [rig for rig, names in hits.items() if all(any(t in one for one in names) for t in truth[rig])]
    within = [rig for rig in hits if set(truth[rig]) <= said[rig]]
    false = {key: names for key, names in named.items() if key[0] not in truth or key[1] != last}
    print(f"changed {len(truth)}: found {len(hits)}, named first {len(first)}, all named {len(all_named)}, "
          f"all in the set {len(within)}")  # fmt: skip
    print(f"false alarms: {len(false)} of {comparisons - len(truth)} healthy comparisons")
    for rig, change in truth.items():
        if rig not in all_named:
            print(f"  {rig}: {change} was said to be {hits.get(rig, 'nothing')}, {sets.get((rig, last), '')}")
    for key, names in false.items():
        print(f"  {key}: nothing was said to be {names}")


def _size(folder: Path) -> int:
    return sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())


def jobs_of(folder: Path, name: str) -> deque[Any]:
    """The first date of each rig, to be done into a folder of its own."""
    fleet = Fleet(load_fleet(folder / FLEET_FILE), folder / name)
    fleet.queue_pending()
    return fleet.job_queue


def scale(folder: Path, rigs: int) -> None:
    """The same rows in a plain loop and by each engine, wall and processor seconds, after some that compile."""
    made(folder, rigs, 1, 0.0)
    os.environ["PNEUCLI_THREADS"] = "1"
    with threadpool_limits(1, user_api="blas"):  # as every worker has it
        rows = jobs_of(folder, "loop")
        fleet_row.process_row(rows.popleft())
        begun, used = time.perf_counter(), time.process_time()
        for job in rows:
            fleet_row.process_row(job)
        loop, core = (time.perf_counter() - begun) / len(rows), (time.process_time() - used) / len(rows)
        print(f"plain loop: {loop:.2f} s a row, {core:.2f} s of the processor")
        engines: dict[str, Any] = {
            "1 process": lambda: ProcessEngine(1, fleet_row.__name__),
            "2 processes": lambda: ProcessEngine(2, fleet_row.__name__),
            "2 threads": lambda: ThreadEngine(2),
        }
        for name, make in engines.items():
            engine = make()
            wall, worker, client = _timed(engine, jobs_of(folder, name))
            engine.close()
            print(f"{name}: {wall:.2f} s a row, {loop / wall:.2f} times as fast as the loop; processor: workers "
                  f"{worker:.2f} s a row, this process {1e3 * client:.1f} ms a row")  # fmt: skip


def _timed(engine: Engine, jobs: deque[Any]) -> tuple[float, float, float]:
    """Return seconds a row: wall, processor of workers, processor of this process."""
    warm = deque(jobs.popleft() for _ in range(2 * engine.slots))
    for _ in run_jobs(engine, fleet_row.process_row, warm):
        pass
    number, worker = len(jobs), 0.0
    begun, used = time.perf_counter(), time.process_time()
    for outcome in run_jobs(engine, fleet_row.process_row, jobs):
        assert outcome.error is None
        worker += outcome.result["core_seconds"]
    return (time.perf_counter() - begun) / number, worker / number, (time.process_time() - used) / number


def kill(folder: Path, rigs: int) -> None:
    """Do a fleet in peace, and a copy of it with workers killed and the client killed and resumed."""
    made(folder, rigs, 2, 0.1)
    command = [sys.executable, "-m", "pneucli", "fleet", str(folder / FLEET_FILE), "--quiet", "--out"]
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


def main(arguments: list[str]) -> None:
    """Run one of the benchmarks, in a temporary folder where none is named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["find", "scale", "kill"], nargs="?", default="find")
    parser.add_argument("rigs", type=int, nargs="?", default=20)
    parser.add_argument("--dates", type=int, default=2)
    parser.add_argument("--changed", type=float, default=0.05, help="share of the rigs with a change")
    parser.add_argument("--at-once", type=int, default=1, help="changes of such a rig")
    parser.add_argument("--drift", type=float, default=0.0, help="of friction from date to date, relative")
    parser.add_argument("--healthy", type=int, default=1, help="first dates that are stated to be healthy")
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--small", action="store_true", help="one rig")
    asked = parser.parse_args(arguments)
    if asked.small:
        asked.rigs = 1
    with ExitStack() as stack:
        folder = asked.folder or Path(stack.enter_context(TemporaryDirectory(prefix="pneucli-fleet-")))
        folder = folder.absolute()
        if asked.what == "find":
            more = {key: getattr(asked, key) for key in ("healthy", "changed", "drift")}
            find(folder, asked.rigs, asked.dates, changes_per_rig=asked.at_once, **more)
        else:
            {"scale": scale, "kill": kill}[asked.what](folder, asked.rigs)


if __name__ == "__main__":
    main(sys.argv[1:])
