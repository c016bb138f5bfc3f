"""Does an exam find the sizes of ``plan --first``?

``python -m benchmarks.plan_power OUT [SEEDS] [CONDITION] [EFFECT...]``.

On rigs of the exam that are only described, ``plan --first`` writes a first programme and the size of each effect that
it shows with a power of 80 %. The programme is recorded on the rig with an effect of that size, of half and of twice
the size, and diagnosed. Prints how often the effect is then in the answer, and what the best model of the healthy rig
leaves in each channel: its rms over the noise, and the correlation time. Finished parts in OUT are read, not run again.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import small
from benchmarks.cases import study_of
from benchmarks.plan import pneucli
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.exam.cases import Case, prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.planned_recordings import planned_recordings, read_commands
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.physics.sides import declared_name
from pneucli.plan.deviation import ExpectedDeviation, expected_deviations

EFFECTS = ("chamber-leak", "valve-lag", "pressure-offset", "constant-force")
FACTORS = (0.5, 1.0, 2.0)  # times the size with a predicted power of 80 %
SEED = 4919
RESULT_FILE = "result.json"  # of a finished part


def main(arguments: Sequence[str]) -> None:
    """Print both tables."""
    if small.SMALL in arguments:
        main_small()
        return
    out, seeds = Path(arguments[0]), int(arguments[1]) if len(arguments) > 1 else 3
    condition = arguments[2] if len(arguments) > 2 else "usual"
    effects = arguments[3:] or EFFECTS
    rows = [row for k in range(seeds) for row in rig_rows(out / f"{condition}-{k}", condition, SEED + k, effects)]
    print_rates([row for row in rows if "effect" in row])
    print_deviations([row for row in rows if "channel" in row])


def rig_rows(folder: Path, condition: str, seed: int, effects: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Yield the rows of one rig: what its best model leaves, then whether each effect is found at each size."""
    case = described_case(condition, seed)
    plan = first_programme(folder / "described", case)
    commands = folder / "described" / "out" / "plan" / "commands.csv"
    yield from result(folder / "healthy", lambda at: left_over(record(at, case.laboratory, plan, commands, seed)))
    sizes = {p["effect"]: p["size"] for p in plan["power"] if not p["typical"] and p["size"] is not None}
    for name in effects:
        for factor in FACTORS:
            laboratory = with_effect_of_size(case.laboratory, name, factor * sizes[name], seed)

            def found(at: Path, hidden: Laboratory = laboratory, name: str = name) -> list[dict[str, Any]]:
                return [answered(record(at, hidden, plan, commands, seed), name)]

            for row in result(folder / f"{name}-{factor:g}", found):
                print({"seed": seed, "factor": factor, "size": factor * sizes[name]} | row, flush=True)
                yield row | {"factor": factor}


def described_case(condition: str, seed: int) -> Case:
    """Return the first healthy axis from a seed on whose valve has a map."""
    cases = (prepare_case("rig", "axis", (), "", 1.0, seed + 1000 * k, parse(condition)) for k in range(20))
    return next(c for c in cases if not c.laboratory.linear_valve)


def result(folder: Path, made: Any) -> list[dict[str, Any]]:
    """Return the rows of a part; it is made only where its folder has none."""
    file = folder / RESULT_FILE
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(made(folder)), encoding="utf-8")
    return list(json.loads(file.read_text(encoding="utf-8")))


def first_programme(folder: Path, case: Case) -> dict[str, Any]:
    """Return the first programme of a rig that is only described."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "pipeline.toml").write_text(case.laboratory.pipeline([], "raw"), encoding="utf-8")
    return result(folder, lambda at: [pneucli(at, "plan", "pipeline.toml", "--first")])[0]


def record(folder: Path, laboratory: Laboratory, plan: Mapping[str, Any], commands: Path, seed: int) -> Path:
    """Record a programme on a rig; return the folder with its pipeline file."""
    takes = planned_recordings(laboratory, plan["recordings"], read_commands(commands))
    laboratory.record(folder / "raw", takes, np.random.default_rng([seed, 49]))
    (folder / "pipeline.toml").write_text(laboratory.pipeline(takes, "raw"), encoding="utf-8")
    return folder


def with_effect_of_size(laboratory: Laboratory, name: str, size: float, seed: int) -> Laboratory:
    """Return the laboratory of the same rig with an effect whose leading parameter has this distance from its null."""
    effect, par = BY_NAME[name], laboratory.parameters
    full = effect.apply(par, 1.0, np.random.default_rng(seed))
    field, factor = next((f, k) for f, k in effect.fields.values() if f in effect.null_values)
    null = par.coulomb if field == "static" else effect.null_values[field]
    share = size / (abs(getattr(full, field) - null) / factor)
    return replace(laboratory, parameters=effect.apply(par, share, np.random.default_rng(seed)))


def answered(folder: Path, name: str) -> dict[str, Any]:
    """Return whether a diagnosis names an effect, or one that is indistinguishable from it."""
    answer = pneucli(folder, "diagnose", "pipeline.toml")
    named = {c["effect"]: c for c in answer["candidates"] if c["effect"] in answer["missing"]}
    alike = {declared_name(n) for c in named.values() for n in (c["effect"], *c["indistinguishable_from"])}
    entry = next((c for c in answer["candidates"] if declared_name(c["effect"]) == name), {})
    return {"effect": name, "found": name in alike, "missing": answer["missing"], "reason": entry.get("reason")}


def left_over(folder: Path) -> list[dict[str, Any]]:
    """Return what the best model leaves in each channel of each subsystem of recordings."""
    with tempfile.TemporaryDirectory() as out:
        study = study_of(folder, Path(out), MAX_SAMPLES)
        train = study.residual_models("train")
        guess = guess_base_model([one.experiment for one in train], study.rig, study.valve)
        fit = fit_model(guess, train, study.effects)
    found = expected_deviations(train, fit.residual)
    return [
        {"subsystem": title, "channel": channel, "ratio": one.ratio, "time": one.time_constant}
        for (title, channel), one in found.items()
    ]


def print_rates(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print how often each effect is found at each multiple of the predicted size."""
    print("\n| effect |" + "".join(f" {f:g} times the size |" for f in FACTORS))
    print("| --- |" + " --- |" * len(FACTORS))
    for name in [*dict.fromkeys(row["effect"] for row in rows), "all"]:
        groups = [[r["found"] for r in rows if r["factor"] == f and name in ("all", r["effect"])] for f in FACTORS]
        print(f"| {name} |" + "".join(f" {sum(g)}/{len(g)} |" for g in groups))


def print_deviations(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print the median over rigs of what the best model leaves in each channel."""
    print("\n| subsystem | channel | rms over noise | correlation time in s | divisor at 1 kHz |")
    print("| --- | --- | --- | --- | --- |")
    for key in dict.fromkeys((r["subsystem"], r["channel"]) for r in rows):
        own = [r for r in rows if (r["subsystem"], r["channel"]) == key]
        ratio, time = (np.array([r[k] for r in own]) for k in ("ratio", "time"))
        divisors = [ExpectedDeviation(a, b).divisor(1e-3) for a, b in zip(ratio, time, strict=True)]
        spread = f"{np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})"
        print(f"| {key[0]} | {key[1]} | {spread} | {np.median(time):.3f} | {np.median(divisors):.1f} |")


def main_small() -> None:
    """Hide a leak of a stated size, and print the deviation of a channel."""
    hidden = with_effect_of_size(small.laboratory(), "chamber-leak", 1e-8, 1)
    print(f"leak {hidden.parameters.leak_area:.3g} m^2")
    print_deviations([{"subsystem": "gas", "channel": "p1", "ratio": 1.1, "time": 0.02}])


if __name__ == "__main__":
    main(sys.argv[1:])
