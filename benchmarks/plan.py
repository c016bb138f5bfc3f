"""Does a plan keep the limits of a rig, and does it decide? ``python -m benchmarks.plan limits [PROGRAMMES] [SEED]``.

``limits`` draws programmes on axes of the exam, within limits so narrow that many manoeuvres come close to one, and
plays them on rigs whose parameters are off by up to two standard errors; prints how many limits are exceeded.

``python -m benchmarks.plan decide OUT CASES CONDITION [SEED] [KIND]``: each case of the exam hides one effect. It is
diagnosed, the plan of a minute is recorded on the same hidden rig, and the case is diagnosed again. Prints how often
the hidden effect is in the answer (named, or indistinguishable from a named one) before and after, and how many false
effects are named. Finished cases in OUT are read, not run again.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import small
from benchmarks.answers import essence, measured
from benchmarks.planned_recordings import planned_recordings, read_commands
from benchmarks.rigs import model_of
from benchmarks.truths import judged, truth_of
from pneucli.exam.cases import PlannedCase, generate_case, plan_cases, prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import Excitation, simulate_rig
from pneucli.plan.bench import LOOP_RANGE, Bench, described_benches
from pneucli.plan.limits import Limits, limits_of, violations
from pneucli.plan.manoeuvre import Manoeuvre, Outcome
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.programme import draw_programme
from pneucli.plan.safety import SHIFTED_BEST, Safety
from pneucli.stages.plan_answer import recordings_answer
from pneucli.stages.plan_files import commands_csv

SECONDS = 60.0
SEED = 4919
LIMIT_CONDITIONS = ("usual", "5/3")
RELATIVE_ERRORS = {  # standard errors of what a user's pipeline identifies or states, relative to the value
    "coulomb": 0.1, "viscous": 0.1, "effective_area": 0.03, "effective_area_2": 0.03, "mass": 0.02,
    "dead_volume_1": 0.05, "dead_volume_2": 0.05, "supply": 0.01,
}  # fmt: skip
TOLERANCE = 0.02  # of a limit: the model's integrator and the rig's agree that closely
ROW_FILE = "row.json"  # of a finished case
MAX_DRAWN = 200  # cases that are drawn for each one of a stated kind


def main(arguments: Sequence[str]) -> None:
    """Print one of the tables."""
    if small.SMALL in arguments:
        print_limits(2)
    elif arguments[0] == "limits":
        print_limits(*map(int, arguments[1:]))
    else:
        out, cases, condition, *rest = arguments[1:]
        seed, kind = int(rest[0]) if rest else SEED, rest[1] if len(rest) > 1 else None
        print_decided(Path(out), planned_cases(int(cases), condition, seed, kind))


def print_limits(programmes: int = 300, seed: int = 49) -> None:
    """Play programmes on the exam's rig with parameters off by their intervals, and count exceeded limits."""
    rng, exceeded, played, refused = np.random.default_rng(seed), Counter[str](), 0, 0
    rigs = [small.laboratory(condition) for condition in LIMIT_CONDITIONS]
    for number in range(programmes):
        laboratory = rigs[number % len(rigs)]
        benches, limits, safety = benches_within_limits(laboratory, rng)
        listed = [m for bench in benches for m in candidate_manoeuvres(bench, limits)]
        drawn = draw_programme(listed, SECONDS, safety, seed + number)
        real = replace(laboratory, parameters=off_by_interval(laboratory.parameters, rng))
        exceeded.update(played_violations(real, drawn, limits))
        played, refused = played + len(drawn), refused + len(safety.refused)
    print("| programmes | manoeuvres played | refused before | exceeded limits |\n| ---: | ---: | ---: | ---: |")
    kinds = ", ".join(f"{count} of {name}" for name, count in exceeded.items())
    print(f"| {programmes} | {played} | {refused} | {sum(exceeded.values())}{f' ({kinds})' if kinds else ''} |")


def benches_within_limits(laboratory: Laboratory, rng: np.random.Generator) -> tuple[list[Bench], Limits, Safety]:
    """Return the benches of a healthy axis, limits as a user may state them, and the check of its manoeuvres."""
    par = laboratory.parameters
    model = model_of(par)
    rig = replace(model.rig, valve_arrangement=model.rig.valve_arrangement or "one-chamber")
    benches = [replace(b, loop_range=LOOP_RANGE) for b in described_benches(rig, par.command_range)]
    stated = {
        "end_margin": par.stroke * rng.uniform(0.05, 0.3),
        "max_speed": rng.uniform(0.1, 1.0),
        "max_pressure": par.supply * rng.uniform(0.7, 1.1),
        "max_force": (par.supply - par.ambient) * par.piston_area_1 * rng.uniform(0.1, 1.0),
    }
    limits = limits_of(rig, benches, stated)
    off = {str(i): model_of(off_by_interval(par, rng)) for i in range(SHIFTED_BEST)}
    return benches, limits, Safety(rig, limits, {"exact": model} | off)


def off_by_interval(par: Parameters, rng: np.random.Generator) -> Parameters:
    """Return a rig whose parameters are off by two standard errors at most."""
    off = {
        name: getattr(par, name) * (1.0 + error * float(np.clip(rng.standard_normal(), -2.0, 2.0)))
        for name, error in RELATIVE_ERRORS.items()
    }
    return par._replace(**off)


def played_violations(laboratory: Laboratory, programme: Sequence[Manoeuvre], limits: Limits) -> Iterator[str]:
    """Play a programme on the rig from its file of commands; yield the quantity of each limit that is exceeded."""
    rows = recordings_answer(programme)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "commands.csv"
        file.write_text(commands_csv(programme, rows), encoding="utf-8")
        takes = planned_recordings(laboratory, rows, read_commands(file)) if programme else []
    for take, one in zip(takes, programme, strict=True):
        assert isinstance(take.excitation, Excitation)
        truth = simulate_rig(laboratory.parameters, take.excitation)
        outcome = Outcome(truth["u"], {}, truth["p1"], truth["p2"], truth["x"], truth["v"])
        for found in violations(outcome, limits, one.bench.rig):
            scale = one.bench.rig.stroke if found.quantity == "x" else abs(found.limit)
            if abs(found.value - found.limit) > TOLERANCE * (scale or 1.0):
                yield found.quantity


def planned_cases(cases: int, condition: str, seed: int, kind: str | None) -> list[PlannedCase]:
    """Return cases that hide one effect, on any kind of rig or a stated one."""
    drawn = plan_cases((4 if kind is None else MAX_DRAWN) * cases, 0, parse(condition), seed)
    return list(islice((p for p in drawn if len(p.hidden) == 1 and kind in (None, p.kind)), cases))


def print_decided(out: Path, wanted: Sequence[PlannedCase]) -> None:
    """Print how often the hidden effect is in the answer, and the false names, before and after a plan."""
    rows = []
    for number, planned in enumerate(wanted, 1):
        folder = out / f"case-{number:03d}"
        if not (folder / ROW_FILE).exists():
            shutil.rmtree(folder, ignore_errors=True)
            row = before_and_after(folder, planned)
            (folder / ROW_FILE).write_text(json.dumps(row), encoding="utf-8")
        rows.append(json.loads((folder / ROW_FILE).read_text(encoding="utf-8")))
        print(number, rows[-1], flush=True)
    print("\n| recordings | in the answer | false names |\n| --- | ---: | ---: |")
    for when in ("before", "after"):
        found, false = (sum(row[when][key] for row in rows) for key in ("found", "false"))
        print(f"| {when} | {found} of {len(rows)} | {false} |")


def before_and_after(folder: Path, planned: PlannedCase) -> dict[str, Any]:
    """Diagnose a case, record its plan on the same rig, and diagnose again."""
    asked = (planned.kind, planned.hidden, planned.outside, 1.0, planned.seed, planned.conditions)
    truth = truth_of(generate_case(folder, *asked))
    before = answer(folder, "diagnose")
    plan = json.loads(answer(folder, "plan", "--minutes", str(SECONDS / 60.0)))
    laboratory = prepare_case("case", *asked).laboratory
    par, commands = laboratory.parameters, read_commands(folder / "out" / "plan" / "commands.csv")
    load = par.constant_force + par.spring_stiffness * (0.5 * par.stroke - par.spring_rest)
    takes = planned_recordings(laboratory, plan["recordings"], commands, load)
    laboratory.record(folder / "raw", takes, np.random.default_rng([planned.seed, 49]))
    answer(folder, "plan", "--take", *(str(folder / "raw" / f"{take.name}.csv") for take in takes))
    after = answer(folder, "diagnose")
    counts = [judged(truth, {"exit": 0} | essence("diagnose", text)) for text in (before, after)]
    found = {when: {"found": c.right, "false": c.false} for when, c in zip(("before", "after"), counts, strict=True)}
    return {"hidden": planned.hidden, "plan": [r["kind"] for r in plan["recordings"]]} | found


def answer(folder: Path, command: str, *words: str) -> str:
    """Return what a command of the program answers to the pipeline of a folder, as JSON."""
    program = [sys.executable, "-m", "pneucli", command, str(folder / "pipeline.toml"), *words]
    code, text, *_ = measured([*program, "--out", str(folder / "out"), "--quiet", "--json"])
    if code not in (0, 1):
        raise RuntimeError(text)
    return text


if __name__ == "__main__":
    main(sys.argv[1:])
