"""``diagnose --since OLD``: the reference that each diagnosis leaves, and what changed against an earlier one."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.changes.attribution import Change, Changes, attribute_changes
from pneucli.changes.baseline import Baseline, Coordinate, TypicalEffect, align, fit_baseline
from pneucli.changes.comparison import ALARM_RATE
from pneucli.changes.repeatability import (
    NO_DRIFT,
    Repeatability,
    RepeatDifferences,
    VariancePrior,
    estimate_repeatability,
    quantity_names,
    repeat_differences,
)
from pneucli.diagnose.data import DiagnosisData
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import ResidualModel
from pneucli.io.artifacts import read_table, sha256_of, write_table
from pneucli.physics.effects import select_effects
from pneucli.pipeline import manifest as staleness
from pneucli.simulate.model import Model
from pneucli.stages.pipeline_data import PipelineData, load_model, save_model

REFERENCE_FILE = "reference.parquet"
SCHEMA = "pneucli/diagnose/reference/1"


def baseline_options(
    folder: Path,
    alarm_rate: float | None = None,
    repeats: Sequence[RepeatDifferences] = (),
    prior: Mapping[str, VariancePrior] | None = None,
) -> dict[str, Any]:
    """Return the options of ``diagnose`` that ask what changed since the diagnosis in ``folder``.

    Its content is part of them: another old model makes the answer stale. ``repeats``: what healthy dates said of the
    old model, ``prior`` what is known beforehand of how such rigs repeat. Raises InputError where there is none.
    """
    if not (folder / REFERENCE_FILE).is_file():
        mend = "run pneucli diagnose on the old pipeline first"
        raise InputError(
            f"--since {folder}", f"no {REFERENCE_FILE} in it", "what an earlier diagnosis has written", mend
        )
    rate = ALARM_RATE if alarm_rate is None else alarm_rate
    asked = {"folder": str(folder.absolute()), "sha256": sha256_of(folder / REFERENCE_FILE), "alarm_rate": rate}
    known = {"repeats": [dict(one) for one in repeats], "prior": None if prior is None else dict(prior)}
    return {"since": asked | (known if repeats else {})}


def read_repeat(folder: Path, asked: Mapping[str, Any]) -> RepeatDifferences:
    """Return what a healthy date said of the old model of :func:`baseline_options`.

    Raises InputError where the diagnosis in ``folder`` was not held against that one.
    """
    manifest = staleness.read_manifest(folder)
    told = (manifest.answer or {}).get("since", {}) if manifest else {}
    if told.get("sha256") != asked["since"]["sha256"]:
        found = "it was not held against this old model" if told else "no comparison in it"
        mend = "run pneucli diagnose REPEAT --since OLD first"
        raise InputError(f"--repeat {folder}", found, "a healthy repeat of OLD", mend)
    return dict(told["repeat"])


def write_baseline(study: PipelineData, bench: DiagnosisData, model: Model) -> Fit:
    """Fit the model to all recordings and write what later comparisons need; return the fit."""
    views = [*bench.train, *bench.held_out]
    found, made = fit_baseline(model, views, _absent_effects(bench, model))
    write_reference(study, made)
    save_model(found.model, study.context.out, study.provenance("ingest/signals.parquet"))
    return found


def compare_with_baseline(study: PipelineData, bench: DiagnosisData, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``compare_with_baseline`` and ``changes`` of the answer: what differs from the old model as it was."""
    folder, rate = Path(options["folder"]), float(options["alarm_rate"])
    model, old = _baseline_model(study, folder)
    views: list[ResidualModel] = [*bench.train, *bench.held_out]
    own = replace(bench, modelled_parts=model.valve.covers)
    found, new = fit_baseline(model, views, _absent_effects(own, model), old.typical_effects)
    whole, (old, new) = old, align(old, new)
    if not old.coordinates:
        here = "these recordings show none of the parameters of the old model"
        raise InputError(f"--since {folder}", here, "recordings of the same kind of test")
    repeats = options.get("repeats", [])
    drift = estimate_repeatability(repeats, options.get("prior")) if repeats else NO_DRIFT
    changes = attribute_changes(old, new, found, views, bench.effects, rate, drift, quantity_names(whole, old))
    told = _comparison_answer(folder, rate, changes) | {
        "sha256": options["sha256"],
        "repeat": repeat_differences(whole, old, new),
    }
    told["repeatability"] = _repeatability(drift, old, repeats)
    return {"since": told, "changes": [_change_answer(c) for c in changes.changes]}


def _repeatability(drift: Repeatability, old: Baseline, repeats: Sequence[RepeatDifferences]) -> dict[str, Any] | None:
    """Return how well the rig repeats, one standard deviation by parameter; None where no healthy date could tell."""
    if not repeats:
        return None
    sizes = {c.name: float(np.sqrt(drift.variance.get(c.name, 0.0))) for c in old.coordinates}
    own = {c.name: sizes[c.name] * (c.value if c.logarithmic else 1.0) for c in old.coordinates}
    return {
        "dates": len(repeats) + 1,
        "parameters": {c.name: {"value": own[c.name], "unit": c.unit} for c in old.coordinates},
    }


def _absent_effects(bench: DiagnosisData, model: Model) -> list[Any]:
    there = {e.name for e in model.effects}
    return [e for e in bench.effects.values() if e.name not in there and bench.is_observable(e)]


def _baseline_model(study: PipelineData, folder: Path) -> tuple[Model, Baseline]:
    manifest = staleness.read_manifest(folder)
    effects = (manifest.answer or {}).get("model", {}).get("effects", []) if manifest else []
    known = select_effects(effects, study.available_effects, f"--since {folder}")
    model = load_model(folder, study.rig, known)
    return model, read_reference(folder / REFERENCE_FILE)


def _comparison_answer(folder: Path, rate: float, found: Changes) -> dict[str, Any]:
    return {
        "folder": str(folder),
        "alarm_rate": rate,
        "p_value": found.p_value,
        "unseen": [asdict(limit) for limit in found.limits],
    }


def _change_answer(one: Change) -> dict[str, Any]:
    return {
        "name": one.name,
        "effect": one.effect,
        "before": _number(one.before),
        "after": _number(one.after),
        "unit": one.unit,
        "ci95": None if one.ci95 is None else [_number(end) for end in one.ci95],
        "confidence": one.confidence,
        "confidence_alone": one.confidence_alone,
        "indistinguishable_from": list(one.equivalents),
    }


def _number(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


def write_reference(study: PipelineData, made: Baseline) -> None:
    """Write a reference: a row for each parameter and each start of an effect."""
    k, m = len(made.coordinates), len(made.typical_effects)
    nothing = np.full(m, np.nan)
    vectors = [*made.white_noise_covariance, *made.bias.T]
    blocks = [*made.influence.T, *made.step_influence.T, made.levels]
    write_table(
        study.context.out / REFERENCE_FILE,
        {
            "kind": ["parameter"] * k + ["effect"] * m + ["levels"],
            "name": [*(c.name for c in made.coordinates), *(s.effect for s in made.typical_effects), ""],
            "unit": [*(c.unit for c in made.coordinates), *[""] * (m + 1)],
            "value": np.array([*(c.value for c in made.coordinates), *nothing, np.nan], dtype=np.float64),
            "logarithmic": np.array([*(c.logarithmic for c in made.coordinates), *[False] * (m + 1)]),
            "at_bound": np.array([*(c.at_bound for c in made.coordinates), *[False] * (m + 1)]),
            "one_sided": np.array([*[False] * k, *(s.one_sided for s in made.typical_effects), False]),
            "values": [*["{}"] * k, *(json.dumps(dict(s.values)) for s in made.typical_effects), "{}"],
            "step": np.array([*[np.nan] * k, *made.steps, np.nan], dtype=np.float64),
            "power": np.array([*[np.nan] * k, *made.power, np.nan], dtype=np.float64),
            "vector": [*(list(map(float, v)) for v in vectors), []],
            "blocks": [list(map(float, b)) for b in blocks],
            "gram": [*[[]] * k, *(list(map(float, row[: i + 1])) for i, row in enumerate(_gram(made))), []],
        },
        units={"value": "see column unit", "step": "1", "power": "1"},
        schema=SCHEMA,
        provenance=study.provenance("ingest/signals.parquet"),
    )


def read_reference(path: Path) -> Baseline:
    """Return the reference that :func:`write_reference` wrote."""
    table = read_table(path)
    kind = np.array(table["kind"])
    mine, theirs = np.flatnonzero(kind == "parameter"), np.flatnonzero(kind == "effect")
    (levels,) = np.flatnonzero(kind == "levels")

    def stacked(column: str, rows: NDArray[np.int64], width: int) -> NDArray[np.float64]:
        return np.array([np.asarray(table[column][i], dtype=np.float64) for i in rows]).reshape(len(rows), width)

    level = np.asarray(table["blocks"][levels], dtype=np.float64)
    k = mine.size
    return Baseline(
        coordinates=tuple(_coordinate(table, int(i)) for i in mine),
        typical_effects=tuple(_start(table, int(i)) for i in theirs),
        influence=stacked("blocks", mine, level.size).T,
        white_noise_covariance=stacked("vector", mine, k),
        steps=np.asarray(table["step"], dtype=np.float64)[theirs],
        step_influence=stacked("blocks", theirs, level.size).T,
        power=np.asarray(table["power"], dtype=np.float64)[theirs],
        bias=stacked("vector", theirs, k).T,
        levels=level,
        gram=_symmetric_matrix([np.asarray(table["gram"][i], dtype=np.float64) for i in theirs])
        if "gram" in table
        else None,
    )


def _gram(made: Baseline) -> NDArray[np.float64]:
    return np.zeros((0, 0)) if made.gram is None else made.gram


def _symmetric_matrix(rows: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return a symmetric matrix from its lower triangle."""
    lower = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        lower[i, : i + 1] = row
    return lower + np.tril(lower, -1).T


def _start(table: Mapping[str, Any], i: int) -> TypicalEffect:
    return TypicalEffect(str(table["name"][i]), json.loads(str(table["values"][i])), bool(table["one_sided"][i]))


def _coordinate(table: Mapping[str, Any], i: int) -> Coordinate:
    return Coordinate(
        str(table["name"][i]),
        str(table["unit"][i]),
        float(table["value"][i]),
        bool(table["logarithmic"][i]),
        bool(table["at_bound"][i]),
    )
