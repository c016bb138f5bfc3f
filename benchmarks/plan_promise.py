"""Does a plan keep its promise? ``python -m benchmarks.plan_promise DIR...`` or ``... KIND CONDITION RIGS [SEED]``.

DIR is a folder of ``python -m benchmarks.plan --out DIR``. A plan promises how far each rival differs from the best
model in units of the expected deviation. In its recordings, the residuals of the best model are then projected on that
difference, the parameters adjusting within what they were known to and the hidden effect at any size: for a rival that
is not true, the result is normal with variance 1 if the expected deviation is right, and larger where the plan trusts
the recording too much. Prints its rms for each kind of manoeuvre, the rms deviation of the channels relative to the
expected one, and for each case the promised power of the hidden effect and whether the answer has it.

With KIND (valve, friction, axis) and CONDITION, healthy rigs of the exam play manoeuvres within their limits, and the
rivals are the effects of the catalogue at typical sizes, none of which is true. ``--without-lags`` expects no lag that
the model lacks.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import small
from benchmarks.cases import study_of
from benchmarks.plan import ROW_FILE, read_row, stated_load
from benchmarks.plan_limits import limit_rig
from pneucli.config import load
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.exam.cases import generate_case, prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.planned_recordings import planned_recordings, read_commands
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import ResidualModel, residual_models
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue
from pneucli.physics.sides import declared_name
from pneucli.pipeline.context import Context
from pneucli.pipeline.manifest import read_manifest
from pneucli.plan.bench import Bench, recorded_benches
from pneucli.plan.deviation import DeviationByChannel, ExpectedDeviation, LagDifference, accumulated_change
from pneucli.plan.information import Information, covariance_root, deviations_of, expected_scale, model_differences
from pneucli.plan.limits import limits_of, violations
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.rivals import lagged_models, with_typical_effect
from pneucli.plan.selection import Chosen
from pneucli.plan.simulation import simulate_manoeuvre, synthetic_recording
from pneucli.simulate.model import Model, parameter_value
from pneucli.simulate.preparation import prepare
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.plan_answer import recordings_answer
from pneucli.stages.plan_files import commands_csv
from pneucli.stages.plan_study import PlanStudy

Array = NDArray[np.float64]

SEED = 4919
WITHOUT_LAGS = "--without-lags"
OUT = "out"  # the artifacts of benchmarks.plan
MAX_ALIKE = 0.9  # cosine to the hidden effect's difference, above which a rival is not told from it
MIN_DIFFERENCE = 1.0  # expected deviations, below which a rival's difference is not judged


@dataclass(frozen=True)
class Promise:
    """What a plan expected of its recordings.

    Attributes:
        best: The best model before the plan.
        others: Its rivals by name.
        hidden: Names of the rivals that contain, or lack, what is hidden.
        free: The parameters of the best model.
        covariance: Their covariance, shape (p, p).
        deviations: The expected deviation by subsystem and channel.
        lags: The best model with each lag that it lacks.
    """

    best: Model
    others: Mapping[str, Model]
    hidden: frozenset[str]
    free: Sequence[FreeParameter]
    covariance: Array
    deviations: DeviationByChannel
    lags: Sequence[Model] = ()

    def judged(self, models: Sequence[ResidualModel]) -> dict[str, Any]:
        """Return the deviation of each channel relative to the expected one, and each rival's projected residual."""
        current = [replace(f, start=parameter_value(self.best, f.name)) for f in self.free]
        problem = LeastSquaresProblem(self.best, models, current)
        residual = np.concatenate(problem.data_residuals(self.best))
        lags = model_differences(problem, self.lags, residual)
        scale = expected_scale(models, self.deviations, lags)
        differences = model_differences(problem, list(self.others.values()), residual)
        with np.errstate(all="ignore"):
            jacobian = problem.jacobian(problem.start)[: residual.size]
        columns = np.nan_to_num(np.column_stack([residual, *differences, jacobian]), posinf=0.0, neginf=0.0)
        columns /= scale[:, None]
        y, d, j = np.split(columns, [1, 1 + len(self.others)], axis=1)
        nuisance = j @ covariance_root(self.covariance)
        hidden = d[:, [name in self.hidden for name in self.others]]
        y, hidden, d = (adjusted(part, nuisance) for part in (y, hidden, d))
        y, apart = (without(part, hidden) for part in (y, d))
        return {
            "channels": list(channel_rows(models, residual, self.deviations, lags)),
            "rivals": {
                name: -float(own @ y[:, 0]) / size
                for name, own, whole in zip(self.others, apart.T, d.T, strict=True)
                if name not in self.hidden
                and (size := float(np.linalg.norm(own))) > MIN_DIFFERENCE
                and size > np.sqrt(1.0 - MAX_ALIKE**2) * np.linalg.norm(whole)
            },
        }


def adjusted(columns: Array, nuisance: Array) -> Array:
    """Return columns (n, k) in units in which they are white beside errors of parameters with unit variance (n, r)."""
    vectors, values, _ = np.linalg.svd(nuisance, full_matrices=False)
    return np.asarray(columns - vectors @ ((1.0 - 1.0 / np.sqrt(1.0 + values**2))[:, None] * (vectors.T @ columns)))


def without(columns: Array, others: Array) -> Array:
    """Return columns (n, k) without their part along others (n, m)."""
    basis = np.linalg.svd(others, full_matrices=False)[0] if others.size else others
    return np.asarray(columns - basis @ (basis.T @ columns))


def channel_rows(
    models: Sequence[ResidualModel], residual: Array, deviations: DeviationByChannel, lags: Sequence[Array]
) -> Iterator[dict[str, Any]]:
    """Yield for each channel its rms over noise, and the rms that the plan expected."""
    at = 0
    for one in models:
        for channel in one.channels:
            own, period = residual[at : at + one.experiment.time.size], one.experiment.recording.period
            changes = [LagDifference.of([lag[at : at + own.size]], period) for lag in lags]
            at += own.size
            expected = deviations.get((one.title, channel), ExpectedDeviation())
            path = accumulated_change(one.experiment, channel)
            yield {
                "channel": channel,
                "found": float(np.sqrt(np.mean(own**2))),
                "expected": expected.rms(path, changes),
            }


def main(arguments: Sequence[str]) -> None:
    """Print the tables."""
    if small.SMALL in arguments:
        main_small()
        return
    if not Path(arguments[0]).is_dir():
        kind, condition, rigs = arguments[0], arguments[1], int(arguments[2])
        plain = [a for a in arguments if a != WITHOUT_LAGS]
        first, with_lags = int(plain[3]) if len(plain) > 3 else SEED, WITHOUT_LAGS not in arguments
        print_recordings([row for k in range(rigs) for row in healthy_rows(kind, condition, first + k, with_lags)])
        return
    rows: list[dict[str, Any]] = []
    print("| case | hidden | among the rivals | promised power | in the answer before, after |")
    print("| --- | --- | --- | --- | --- |")
    for folder in (Path(a) for a in arguments):
        for file in sorted(folder.glob(f"case-*/{ROW_FILE}")):
            row = read_row(file)
            if "planned" in row:
                answered, kinds = promised_power(file.parent, row["hidden"])
                before, after = (("yes" if row[k].found else "no") for k in ("before", "planned"))
                print(f"| {file.parent} | {row['hidden']} | {answered} | {before}, {after} |", flush=True)
                rows += recording_rows(file.parent, row["hidden"], kinds)
    print_recordings(rows)


def promised_power(folder: Path, hidden: str) -> tuple[str, dict[str, dict[str, str]]]:
    """Return which rivals have the hidden effect, with their powers, and the kind of each recording of the plan."""
    manifest = read_manifest(folder / "case" / OUT / "plan")
    assert manifest is not None
    answer = manifest.answer or {}
    own = [e for e in answer["expected"] if declared_name(e["effect"]) == declared_name(hidden)]
    names = ", ".join(e["rival"] for e in own) or "no"
    powers = ", ".join(f"{e['power']:.0%}" for e in own) or "–"
    kinds = {r["name"]: manoeuvre_kind(r) for r in answer["recordings"]}
    return f"{names} | {powers}", kinds


def recording_rows(folder: Path, hidden: str, kinds: Mapping[str, dict[str, str]]) -> Iterator[dict[str, Any]]:
    """Yield for each recording of a plan what it holds against what was promised."""
    promise = promise_of(folder / "case", hidden)
    with tempfile.TemporaryDirectory() as out:
        recorded = PipelineData(context_of(folder / "planned", Path(out)), max_samples=MAX_SAMPLES)
        for name, kind in kinds.items():
            models = [m for use in ("train", "test") for m in recorded.residual_models(use) if plan_name(m) == name]
            if models:
                yield kind | promise.judged(models)


def context_of(case: Path, out: Path) -> Context:
    """Return the context of a stage after the diagnosis of a case that ``benchmarks.plan`` has run."""
    path, manifest = case / "pipeline.toml", read_manifest(case / OUT / "diagnose")
    answer = (manifest.answer or {}) if manifest is not None else {}
    return Context(path, load(path), out, case / OUT, answers={"diagnose": answer})


def healthy_rows(kind: str, condition: str, seed: int, with_lags: bool = True) -> list[dict[str, Any]]:
    """Return what manoeuvres on a healthy rig hold against what its best model promises of the catalogue's effects."""
    drawn = (kind, (), "", 1.0, seed, parse(condition))
    rng, laboratory = np.random.default_rng([seed, 49]), prepare_case("rig", *drawn).laboratory
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        generate_case(folder / "case", *drawn)
        study = study_of(folder / "case", made(folder / "before"), MAX_SAMPLES)
        train = study.residual_models("train")
        guess = guess_base_model([one.experiment for one in train], study.rig, study.valve)
        best = with_intervals(fit_model(guess, train, study.effects), train)
        chosen = allowed_manoeuvres(best.model, recorded_benches([one.experiment for one in train]), rng)
        rows, file = recordings_answer(chosen), folder / "commands.csv"
        file.write_text(commands_csv(chosen, rows), encoding="utf-8")
        takes = planned_recordings(laboratory, rows, read_commands(file), stated_load(laboratory.parameters))
        laboratory.record(folder / "new" / "raw", takes, rng)
        (folder / "new" / "pipeline.toml").write_text(laboratory.pipeline(takes, "raw"), encoding="utf-8")
        recorded = study_of(folder / "new", made(folder / "after"), MAX_SAMPLES).residual_models("train")
    lags = lagged_models(best.model, study.available_effects.values(), train) if with_lags else []
    rivals = typical_rivals(best.model, study.available_effects.values(), train)
    deviations = deviations_of(best, train, lags)
    promise = Promise(best.model, rivals, frozenset(), best.free, best.covariance, deviations, lags)
    own = {row["name"]: [m for m in recorded if plan_name(m) == row["name"]] for row in rows}
    return [manoeuvre_kind(row) | promise.judged(own[row["name"]]) for row in rows if own[row["name"]]]


def made(folder: Path) -> Path:
    """Return a new folder."""
    folder.mkdir()
    return folder


def plan_name(model: ResidualModel) -> str:
    """Return the name of the planned recording of a residual model; parts of long recordings are numbered."""
    return model.experiment.recording.name.partition("#")[0]


def manoeuvre_kind(recording: Mapping[str, Any]) -> dict[str, str]:
    """Return what kind of manoeuvre a planned recording is, with its frequency."""
    return {"kind": f"{recording['drive']}: {recording['kind']} {recording['frequency'] or ''}".strip()}


def allowed_manoeuvres(model: Model, benches: Sequence[Bench], rng: np.random.Generator) -> list[Chosen]:
    """Return one manoeuvre of each kind and frequency that keeps the limits with the best model, of random size."""
    limits = limits_of(model.rig, benches)
    listed = [m for b in benches for m in candidate_manoeuvres(b, limits)]
    nothing, found = Information(np.zeros((0, 0)), 0, np.zeros(0)), {}
    for m in (listed[i] for i in rng.permutation(len(listed))):
        key = (m.bench.setup, m.kind, m.frequency)
        if key not in found and not violations(simulate_manoeuvre(m, model), limits.with_reserve(), model.rig):
            found[key] = Chosen(m, nothing, 0.0)
    return list(found.values())


def typical_rivals(model: Model, effects: Iterable[Effect], train: Sequence[ResidualModel]) -> dict[str, Model]:
    """Return the model with each effect that it lacks and the recordings can show, at its typical size, by name."""
    there = {e.name for e in model.effects}
    absent = [e for e in effects if e.side is None and e.name not in there and e.part not in model.valve.covers]
    shown = [e for e in absent if any(m.is_sensitive_to(e) for m in train)]
    return {e.name: m for e in shown if (m := with_typical_effect(model, e, train)) is not None}


def promise_of(case: Path, hidden: str) -> Promise:
    """Return what the plan of a case expects, from its diagnosis."""
    with tempfile.TemporaryDirectory() as out:
        study = PlanStudy(PipelineData(context_of(case, Path(out)), max_samples=MAX_SAMPLES))
        rivals = study.rivals[1:]
        return Promise(
            study.best.model,
            {r.name: r.model for r in rivals},
            frozenset(
                r.name for r in rivals if r.effect is not None and declared_name(r.effect.name) == declared_name(hidden)
            ),
            study.best.free,
            study.best.covariance,
            study.deviations,
            study.lags,
        )


def print_recordings(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print for each kind of manoeuvre the projected residuals of untrue rivals, and the channels' deviations."""
    print("\n| manoeuvre | recordings | rivals | rms (1: as promised) | beyond 3 | deviation over the expected one |")
    print("| --- | ---: | ---: | ---: | ---: | --- |")
    for kind in [*sorted({row["kind"] for row in rows}), "all"]:
        own = [row for row in rows if kind in ("all", row["kind"])]
        z = np.array([value for row in own for value in row["rivals"].values()])
        ratios = np.array([c["found"] / c["expected"] for row in own for c in row["channels"]])
        rms = f"{np.sqrt(np.mean(z**2)):.2f} | {np.mean(np.abs(z) > 3.0):.0%}" if z.size else "– | –"
        spread = f"{np.median(ratios):.2f} ({np.quantile(ratios, 0.1):.2f} to {np.quantile(ratios, 0.9):.2f})"
        print(f"| {kind} | {len(own)} | {z.size} | {rms} | {spread} |")


def main_small() -> None:
    """Judge a manoeuvre that a model itself has recorded."""
    _, benches, limits, model = limit_rig("usual")
    manoeuvre = next(m for m in candidate_manoeuvres(benches[-1], limits) if m.kind == "pulses")
    recording = synthetic_recording(manoeuvre, simulate_manoeuvre(manoeuvre, model), "plan", 1)
    models = residual_models([prepare(recording, model.rig, 0.5)], whiten_initial_state=True)
    leak = with_typical_effect(model, catalogue()["chamber-leak"], models)
    assert leak is not None
    promise = Promise(model, {"chamber-leak": leak}, frozenset(), [], np.zeros((0, 0)), {})
    print_recordings([{"kind": manoeuvre.kind} | promise.judged(models)])


if __name__ == "__main__":
    main(sys.argv[1:])
