"""Does a planned recording decide more than a random one? ``python -m benchmarks.plan [CASES] [CONDITION]``.

Each case of the exam hides one effect. It is diagnosed; then 60 s are recorded on the same hidden rig: as planned, as a
random programme within the same limits, and as a repetition of what was recorded. Each is taken in and diagnosed again.
Prints for each how often the hidden effect is in the answer (named, or indistinguishable from a named one), and how
many false effects are named. ``--size 0.33`` hides effects of a third of the usual size, ``--seed N`` draws others,
``--hidden NAME`` leaves only cases that hide this effect, and ``--kind friction`` those of one kind of rig.
``--open yes`` records only where the hidden effect is not in the first answer.

``--out DIR`` keeps the folder of each case; a case that is finished there is not run again, and ``--table DIR`` prints
the table of the finished ones.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import small
from benchmarks.plan_limits import limit_rig
from pneucli.exam.case_plan import PlannedCase, plan_cases
from pneucli.exam.cases import Case, generate_case, prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.laboratory import RecordingPlan
from pneucli.exam.planned_recordings import drive_gain, planned_recordings, read_commands
from pneucli.exam.rig.excitations import closed_loop
from pneucli.exam.rig.imposed_motion import MotionMachine
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import Excitation
from pneucli.physics.sides import declared_name
from pneucli.plan.information import Information
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.selection import Chosen
from pneucli.stages.plan_answer import recordings_answer
from pneucli.stages.plan_files import commands_csv

Array = NDArray[np.float64]
SECONDS = 60.0
PROGRAMMES = ("planned", "random", "repeated")
ROW_FILE = "row.json"  # of a finished case
EXTREME_SHARE = 0.3  # of the stroke, the largest amplitude of a random motion
MAX_DRAWN = 200  # cases that are drawn for each one of a stated effect or kind
MIN_LENGTH = 4.0  # s, of a random recording


@dataclass(frozen=True)
class Answer:
    """A graded answer: whether the hidden effects are in it, and how many false ones are named."""

    found: bool
    named: bool
    false: int

    @classmethod
    def of(cls, diagnosis: Mapping[str, Any], truth: Mapping[str, Any]) -> Answer:
        """Grade a diagnosis."""
        hidden = {declared_name(name) for name in truth["hidden"]}
        sets = [
            {declared_name(n) for n in (c["effect"], *c["indistinguishable_from"])}
            for c in diagnosis["candidates"]
            if c["effect"] in diagnosis["missing"]
        ]
        named = {declared_name(n) for n in diagnosis["missing"]}
        answered = set().union(*sets) if sets else set()
        return cls(bool(hidden) and hidden <= answered, bool(hidden) and hidden <= named,
                   sum(not (one & hidden) for one in sets))  # fmt: skip


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    if small.SMALL in arguments:
        main_small()
        return
    options = dict(pairwise(arguments))
    if "--table" in options:
        print_table(finished(Path(options["--table"])))
        return
    plain = [a for i, a in enumerate(arguments) if not a.startswith("--") and not arguments[i - 1].startswith("--")]
    cases, condition = int(plain[0]) if plain else 12, plain[1] if len(plain) > 1 else "messy"
    if options.get("--open", "yes") != "yes":
        sys.exit(f"--open {options['--open']}: wanted yes, or no --open at all")
    size, seed = float(options.get("--size", "1")), int(options.get("--seed", "1"))
    with tempfile.TemporaryDirectory() as temporary:
        out = Path(options.get("--out", temporary))
        wanted = planned_cases(cases, condition, seed, options.get("--hidden"), options.get("--kind"))
        print_table(list(run_cases(out, wanted, size, only_open="--open" in options)))


def print_table(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print how often the hidden effect is in the answer, and the false names, before and after each programme."""
    print("\n| recordings | in the answer | named | false names |\n| --- | --- | --- | --- |")
    for name in ("before", *PROGRAMMES):
        answers = [row[name] for row in rows if isinstance(row.get(name), Answer)]
        found, named, false = (sum(getattr(a, key) for a in answers) for key in ("found", "named", "false"))
        print(f"| {name} | {found} of {len(answers)} | {named} | {false} |")
    seconds = [row["plan_seconds"] for row in rows if "plan_seconds" in row]
    if seconds:
        print(f"\nplanning takes {np.median(seconds):.0f} s (median), {np.max(seconds):.0f} s at most")


def planned_cases(
    cases: int, condition: str, seed: int, hidden: str | None = None, kind: str | None = None
) -> list[PlannedCase]:
    """Return cases that hide one effect: any, or a stated one, on any kind of rig or a stated one."""
    few = hidden is None and kind is None
    drawn = plan_cases((4 if few else MAX_DRAWN) * cases, 0, parse(condition), seed)
    single = (p for p in drawn if len(p.hidden) == 1 and hidden in (None, *p.hidden) and kind in (None, p.kind))
    return list(islice(single, cases))


def run_cases(
    out: Path, wanted: Sequence[PlannedCase], size: float, *, only_open: bool = False
) -> Iterator[dict[str, Any]]:
    """Yield the graded answers of each case, and print them; a case that is finished in ``out`` is read."""
    for number, planned in enumerate(wanted, 1):
        folder = out / f"case-{number:03d}"
        if not (folder / ROW_FILE).exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            row = run_case(folder, planned, size, only_open=only_open)
            text = json.dumps({n: asdict(v) if isinstance(v, Answer) else v for n, v in row.items()}, indent=1)
            (folder / ROW_FILE).write_text(text + "\n", encoding="utf-8")
        row = read_row(folder / ROW_FILE)
        shown = {n: f"{'+' if v.found else '-'}{v.false}" if isinstance(v, Answer) else v for n, v in row.items()}
        print(number, shown, flush=True)
        yield row


def finished(out: Path) -> list[dict[str, Any]]:
    """Return the graded answers of the cases that are finished in a folder."""
    return [read_row(path) for path in sorted(out.glob(f"case-*/{ROW_FILE}"))]


def read_row(path: Path) -> dict[str, Any]:
    """Return the graded answers of one case."""
    row = json.loads(path.read_text(encoding="utf-8"))
    return {n: Answer(**v) if isinstance(v, dict) else v for n, v in row.items()}


def run_case(folder: Path, planned: PlannedCase, size: float, *, only_open: bool = False) -> dict[str, Any]:
    """Diagnose a case, record each programme on its rig, and diagnose again; ``only_open``: only where the hidden
    effect is not in the first answer.
    """
    asked = (planned.kind, planned.hidden, planned.outside, size, planned.seed, planned.conditions)
    case_folder = folder / "case"
    truth = generate_case(case_folder, *asked)
    case = prepare_case("case", *asked)
    row: dict[str, Any] = {"kind": planned.kind, "hidden": ", ".join(planned.hidden)}
    try:
        before = pneucli(case_folder, "diagnose", "pipeline.toml")
        row["before"] = first = Answer.of(before, truth)
        if only_open and first.found:
            return row
        begun = time.perf_counter()
        plan = pneucli(case_folder, "plan", "pipeline.toml", "--minutes", str(SECONDS / 60.0))
        row["plan_seconds"] = time.perf_counter() - begun
        row["plan"] = [f"{r['kind']} {r['frequency'] or ''}".strip() for r in plan["recordings"]]
    except RuntimeError as error:
        return row | {"failed": str(error)[-300:]}
    row["weights"] = sum(1 for r in plan["recordings"] if r["force"])
    for number, name in enumerate(PROGRAMMES):
        copy = folder / name
        shutil.copytree(case_folder, copy)
        rng = np.random.default_rng([planned.seed, 49, number])
        try:
            takes, uses = programme(name, case, plan, copy, rng)
            case.laboratory.record(copy / "raw", takes, rng)
            files = [f"raw/{take.name}.csv" for take in takes]
            if name == "planned":
                pneucli(copy, "plan", "pipeline.toml", "--take", *files)
            else:
                add_recordings(copy / "pipeline.toml", case, takes, uses)
            row[name] = Answer.of(pneucli(copy, "diagnose", "pipeline.toml"), truth)
        except RuntimeError as error:
            row[f"{name}_failed"] = str(error)[-300:]
    return row


def programme(
    name: str, case: Case, plan: Mapping[str, Any], folder: Path, rng: np.random.Generator
) -> tuple[list[RecordingPlan], list[str]]:
    """Return the recordings of a programme, and their uses."""
    if name == "planned":
        commands = read_commands(folder / "out" / "plan" / "commands.csv")
        takes = planned_recordings(
            case.laboratory, plan["recordings"], commands, stated_load(case.laboratory.parameters)
        )
        return takes, [take.use for take in takes]
    if name == "repeated":
        takes = [replace(t, name=f"again_{t.name}") for t in repeated(case.plans, rng)]
        return takes, [take.use for take in takes]
    lengths = [r["end"] - r["begin"] for r in plan["recordings"] if r["force"] or not r["by_hand"]]
    takes = random_recordings(case, [max(length, MIN_LENGTH) for length in lengths], rng)
    return takes, [take.use for take in takes]


def repeated(plans: Sequence[RecordingPlan], rng: np.random.Generator) -> list[RecordingPlan]:
    """Return recordings in random order, those of the main experiment first, up to SECONDS, the last for testing."""
    main_kind = plans[-1].experiment
    chosen: list[RecordingPlan] = []
    left = SECONDS
    for i in rng.permutation(len(plans)):
        one = plans[i]
        length = 20.0 if isinstance(one.excitation, MotionMachine) else 1e-3 * one.excitation.command.size + 2.0
        if one.experiment == main_kind and length <= left:
            chosen.append(replace(one, use="train"))
            left -= length
    return [*chosen[:-1], replace(chosen[-1], use="test")] if len(chosen) > 1 else chosen


def random_recordings(case: Case, lengths: Sequence[float], rng: np.random.Generator) -> list[RecordingPlan]:
    """Return recordings with random sines, steps and rests within the range that the rig allows."""
    par, kind = case.laboratory.parameters, case.plans[-1].experiment
    takes = []
    for number, length in enumerate(lengths, 1):
        use = "test" if number == len(lengths) else "train"
        if isinstance(case.plans[-1].excitation, MotionMachine):
            made: Excitation | MotionMachine = replace(
                case.plans[-1].excitation, pressure=par.ambient + rng.uniform(0.1, 0.9) * (par.supply - par.ambient)
            )
        elif kind == "valve":
            made = random_commands(par, length, rng)
        else:
            made = random_motion(case, length, rng)
        takes.append(RecordingPlan(f"random_{number}", kind, use, made))
    return takes


def random_commands(par: Parameters, length: float, rng: np.random.Generator) -> Excitation:
    """Return random levels of the command, each held for a random time."""
    levels, times = [0.0], [0.2]
    while sum(times) < length:
        levels.append(float(rng.uniform(-1.0, 1.0)) * par.command_range)
        times.append(float(rng.uniform(0.05, 1.0)))
    command = np.concatenate([np.full(round(1e3 * t), u) for u, t in zip(levels, times, strict=True)])
    return Excitation(command[: round(1e3 * length)], pressure_1=par.ambient, pressure_2=par.ambient)


def random_motion(case: Case, length: float, rng: np.random.Generator) -> Excitation:
    """Return a sine of random place, amplitude and frequency as reference of the position loop."""
    par, usual = case.laboratory.parameters, case.plans[-1].excitation
    assert isinstance(usual, Excitation)
    t = 1e-3 * np.arange(round(1e3 * length))
    frequency = float(np.exp(rng.uniform(np.log(0.25), np.log(5.0))))
    amplitude = min(EXTREME_SHARE * par.stroke, 0.3 / (2.0 * np.pi * frequency)) * rng.uniform(0.3, 1.0)
    centre = par.stroke * rng.uniform(0.35, 0.65)
    envelope = np.clip(np.minimum(t, t[-1] - t) * frequency, 0.0, 1.0)
    reference = centre + amplitude * envelope * np.sin(2.0 * np.pi * frequency * t)
    gauge = usual.pressure_1 - par.ambient
    return replace(
        closed_loop(par, reference, drive_gain(par), gauge, stated_load(par)), chamber_2_open=usual.chamber_2_open
    )


def stated_load(par: Parameters) -> float:
    """Return the force in N toward x = 0 at half the stroke."""
    return par.constant_force + par.spring_stiffness * (0.5 * par.stroke - par.spring_rest)


def add_recordings(file: Path, case: Case, takes: Sequence[RecordingPlan], uses: Sequence[str]) -> None:
    """Append recordings to a pipeline file, as the laboratory writes them."""
    parts = [
        case.laboratory._recording(replace(take, use=use), "raw")
        for take, use in zip(takes, uses, strict=True)  # type: ignore[arg-type]
    ]
    text = file.read_text(encoding="utf-8")
    begin = text.index("[model]")
    file.write_text(text[:begin] + "\n".join(parts) + "\n" + text[begin:], encoding="utf-8")


def pneucli(folder: Path, *command: str) -> dict[str, Any]:
    """Run a command of the program in a folder; return its JSON answer."""
    told = subprocess.run(
        [sys.executable, "-m", "pneucli", *command, "--out", "out", "--quiet", "--json"],
        check=False,
        cwd=folder,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])},
    )
    if told.returncode not in (0, 1):
        raise RuntimeError(told.stderr.strip())
    return dict(json.loads(told.stdout))


def main_small() -> None:
    """Play two manoeuvres of a plan on the rig of the exam through its file."""
    laboratory, benches, limits, _ = limit_rig("usual")
    listed = [m for b in benches for m in candidate_manoeuvres(b, limits) if m.duration < 9.0]
    nothing = Information(np.zeros((0, 0)), 0, np.zeros(0))
    chosen = [Chosen(m, nothing, 0.0) for m in (listed[4], listed[-1])]
    rows = recordings_answer(chosen)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "commands.csv"
        file.write_text(commands_csv(chosen, rows), encoding="utf-8")
        takes = planned_recordings(laboratory, rows, read_commands(file))
        laboratory.record(Path(folder), takes, np.random.default_rng(1))
        for take in takes:
            lines = (Path(folder) / f"{take.name}.csv").read_text(encoding="utf-8").splitlines()
            print(f"| {take.name} | {len(lines) - 3} samples |")


if __name__ == "__main__":
    main(sys.argv[1:])
