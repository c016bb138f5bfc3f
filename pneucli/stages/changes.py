"""The baseline of each diagnosis, and the changes since an earlier one."""

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.changes.baseline import Baseline, Coordinate, TypicalEffect, align, fit_baseline
from pneucli.changes.comparison import (
    ALARM_RATE,
    NO_DRIFT,
    Repeatability,
    RepeatDifferences,
    VariancePrior,
    estimate_repeatability,
    quantity_names,
    repeat_differences,
)
from pneucli.changes.selection import attribute_changes
from pneucli.config import load
from pneucli.diagnose.data import DiagnosisData
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import NO_ITERATION, Fit, fit
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.identify.residuals import ResidualModel
from pneucli.io.artifacts import read_table, sha256_of, write_table
from pneucli.messages import changes as messages
from pneucli.messages.changes import Change, Since
from pneucli.messages.design import Quantity
from pneucli.physics.effects import select_effects
from pneucli.pipeline import manifest as staleness
from pneucli.pipeline.graph import STAGES, Context
from pneucli.simulate.model import Model
from pneucli.stages.pipeline_data import PipelineData, load_model, save_model

SOURCE_FILE = "source.json"  # the pipeline file's path from the folder of artifacts
REFERENCE_FILE = "reference.parquet"
SCHEMA = "pneucli/diagnose/reference/1"


def baseline_options(
    folder: Path,
    alarm_rate: float | None = None,
    repeats: Sequence[RepeatDifferences] = (),
    prior: Mapping[str, VariancePrior] | None = None,
) -> dict[str, Any]:
    """Return the options of ``diagnose`` that ask for the changes since the diagnosis in ``folder``.

    They contain the digest of the baseline: another one makes the answer stale. ``repeats`` are differences of healthy
    dates, ``prior`` the repeatability of such rigs. A baseline that the folder does not have yet is written. Raises
    InputError where the folder has no diagnosis.
    """
    write_missing_baseline(folder)
    if not (folder / REFERENCE_FILE).is_file():
        mend = "run pneucli diagnose on the old pipeline first"
        raise InputError(
            f"--since {folder}",
            f"no {REFERENCE_FILE} in it",
            "what an earlier diagnosis has written",
            mend,
            code="E007",
        )
    rate = ALARM_RATE if alarm_rate is None else alarm_rate
    options = {"folder": str(folder.absolute()), "sha256": sha256_of(folder / REFERENCE_FILE), "alarm_rate": rate}
    effects = {"repeats": [dict(one) for one in repeats], "prior": None if prior is None else dict(prior)}
    return {"since": options | (effects if repeats else {})}


def read_repeat(folder: Path, options: Mapping[str, Any]) -> RepeatDifferences:
    """Return the differences of a healthy date from the baseline of :func:`baseline_options`.

    Raises InputError where the diagnosis in ``folder`` was not compared with that baseline.
    """
    manifest = staleness.read_manifest(folder)
    answer = (manifest.answer or {}).get("since", {}) if manifest else {}
    if answer.get("sha256") != options["since"]["sha256"]:
        fit = "it was not held against this old model" if answer else "no comparison in it"
        mend = "run pneucli diagnose REPEAT --since OLD first"
        raise InputError(f"--repeat {folder}", fit, "a healthy repeat of OLD", mend, code="E007")
    return dict(answer["repeat"])


def compare_with_baseline(
    pipeline: PipelineData, data: DiagnosisData, options: Mapping[str, Any]
) -> tuple[Since, Sequence[Change]]:
    """Return the entries ``since`` and ``changes`` of the answer."""
    folder, rate = Path(options["folder"]), float(options["alarm_rate"])
    model, old = _baseline_model(pipeline, folder)
    residual_models: list[ResidualModel] = [*data.train, *data.held_out]
    own = replace(data, modelled_parts=model.excluded_parts)
    fit, new = fit_baseline(model, residual_models, own.absent_effects(model), old.typical_effects)
    whole, (old, new) = old, align(old, new)
    if not old.coordinates:
        found_text = "these recordings show none of the parameters of the old model"
        raise InputError(f"--since {folder}", found_text, "recordings of the same kind of test", code="E062")
    repeats = options.get("repeats", [])
    repeatability = estimate_repeatability(repeats, options.get("prior")) if repeats else NO_DRIFT
    changes = attribute_changes(
        old, new, fit, residual_models, data.effects, rate, repeatability, quantity_names(whole, old)
    )
    differences, typical = repeat_differences(whole, old, new), _repeatability(repeatability, old, repeats)
    since = Since(str(folder), rate, changes.p_value, changes.limits, options["sha256"], differences, typical)
    return since, changes.changes


def _repeatability(
    repeatability: Repeatability, old: Baseline, repeats: Sequence[RepeatDifferences]
) -> messages.Repeatability | None:
    """Return the standard deviation of each parameter from date to date; None without healthy dates."""
    if not repeats:
        return None
    sizes = {c.name: float(np.sqrt(repeatability.variance.get(c.name, 0.0))) for c in old.coordinates}
    own = {c.name: sizes[c.name] * (c.value if c.logarithmic else 1.0) for c in old.coordinates}
    return messages.Repeatability(len(repeats) + 1, {c.name: Quantity(own[c.name], c.unit) for c in old.coordinates})


def _baseline_model(pipeline: PipelineData, folder: Path) -> tuple[Model, Baseline]:
    manifest = staleness.read_manifest(folder)
    effects = (manifest.answer or {}).get("model", {}).get("effects", []) if manifest else []
    effects = select_effects(effects, pipeline.available_effects, f"--since {folder}")
    model = load_model(folder, pipeline.rig, effects)
    return model, read_baseline(folder / REFERENCE_FILE)


def fit_all_recordings(pipeline: PipelineData, data: DiagnosisData, model: Model) -> Fit:
    """Fit the model to all recordings, save it, and return the fit."""
    out, artifacts = pipeline.context.out, pipeline.context.artifacts
    residual_models = [*data.train, *data.held_out]
    fitted = fit(model, residual_models, free_parameters(model, residual_models))
    save_model(fitted.model, pipeline.tables("identify", "ingest/signals.parquet"))
    source = {"pipeline": os.path.relpath(pipeline.context.path, artifacts)}
    (out / SOURCE_FILE).write_text(json.dumps(source), encoding="utf-8")
    return fitted


def write_baseline(pipeline: PipelineData, data: DiagnosisData, fitted: Fit) -> None:
    """Write the baseline of a model that is fitted to all recordings."""
    from pneucli.changes.baseline import baseline_at_fit  # noqa: PLC0415 - few diagnoses write one

    residual_models = [*data.train, *data.held_out]
    baseline = baseline_at_fit(fitted, residual_models, data.absent_effects(fitted.model))
    write_baseline_table(pipeline, baseline)


def write_missing_baseline(folder: Path) -> None:
    """Write the baseline of an earlier diagnosis into its folder, where it has none, from the model in it.

    Raises:
        InputError: The pipeline file of the diagnosis has changed since then, or is not there any more.

    """
    manifest = staleness.read_manifest(folder)
    if (folder / REFERENCE_FILE).is_file() or not (folder / SOURCE_FILE).is_file() or manifest is None:
        return
    source = json.loads((folder / SOURCE_FILE).read_text(encoding="utf-8"))
    path = Path(os.path.normpath(folder.parent.absolute() / source["pipeline"]))
    if not path.is_file():
        wanted = "the pipeline file that was diagnosed"
        raise InputError(
            f"--since {folder.parent}", f"no {path}", wanted, "give OLD as a pipeline file instead", code="E007"
        )
    config = load(path)
    if _has_changed(config.document, folder.parent):
        found, mend = f"{path} has changed since that diagnosis", f"run pneucli diagnose {path} first"
        raise InputError(f"--since {folder.parent}", found, "", mend, code="E007")
    context = Context(
        path,
        config,
        folder,
        folder.parent,
        answers=staleness.read_answers(folder.parent, ["ingest"]),
        options=manifest.inputs.options,
    )
    pipeline = PipelineData.for_search(context)
    model = load_model(folder, pipeline.rig, pipeline.effects)
    effects = {n: e for n, e in pipeline.available_effects.items() if n not in pipeline.excluded_effects}
    train, held_out = (pipeline.residual_models(use) for use in ("train", "test"))
    data = DiagnosisData(train, held_out, effects, modelled_parts=model.excluded_parts)
    residual_models = [*train, *held_out]
    free = free_parameters(model, residual_models)
    write_baseline(pipeline, data, fit(model, residual_models, free, stopping=NO_ITERATION))
    replace(manifest, outputs=staleness.stamp_files(folder, manifest.outputs)).write(folder)


def _has_changed(document: Mapping[str, Any], artifacts: Path) -> bool:
    """Return whether a pipeline file has other tables than those of which these are the artifacts."""
    for stage in ("ingest", "diagnose"):
        manifest = staleness.read_manifest(artifacts / stage)
        former = {} if manifest is None else manifest.inputs.tables
        now = {name: staleness.digest(document[name]) for name in STAGES[stage].tables if name in document}
        if now != former:
            return True
    return False


EMPTY_ROW: Mapping[str, Any] = {
    **{"kind": "", "name": "", "unit": "", "value": math.nan, "logarithmic": False, "at_bound": False},
    **{"one_sided": False, "values": "{}", "step": math.nan, "power": math.nan, "vector": [], "blocks": [], "gram": []},
}  # of the table of a baseline


def write_baseline_table(pipeline: PipelineData, baseline: Baseline) -> None:
    """Write a baseline: a row for each parameter and each typical effect, and one for the residual levels."""
    assert baseline.gram is not None
    lower = [row[: i + 1] for i, row in enumerate(baseline.gram.tolist())]
    steps, power = baseline.steps.tolist(), baseline.power.tolist()
    effects = zip(
        baseline.typical_effects, steps, power, baseline.bias.T, baseline.step_influence.T, lower, strict=True
    )
    parameters = zip(baseline.coordinates, baseline.white_noise_covariance, baseline.influence.T, strict=True)
    rows = [
        *({"kind": "parameter", **asdict(c), "vector": v.tolist(), "blocks": b.tolist()} for c, v, b in parameters),
        *(
            {"kind": "effect", "name": e.effect, "one_sided": e.one_sided, "values": json.dumps(dict(e.values))}
            | {"step": step, "power": p, "vector": v.tolist(), "blocks": b.tolist(), "gram": row}
            for e, step, p, v, b, row in effects
        ),
        {"kind": "levels", "blocks": baseline.levels.tolist()},
    ]
    columns = {name: [row.get(name, empty) for row in rows] for name, empty in EMPTY_ROW.items()}
    write_table(
        pipeline.context.out / REFERENCE_FILE,
        {name: np.array(v) if isinstance(EMPTY_ROW[name], bool | float) else v for name, v in columns.items()},
        units={"value": "see column unit", "step": "1", "power": "1"},
        schema=SCHEMA,
        provenance=pipeline.provenance("ingest/signals.parquet"),
    )


def read_baseline(path: Path) -> Baseline:
    """Return the baseline that :func:`write_baseline_table` wrote."""
    columns = read_table(path)
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    parameters, effects, (levels,) = ([r for r in rows if r["kind"] == k] for k in ("parameter", "effect", "levels"))

    def stacked(column: str, rows: Sequence[Mapping[str, Any]], width: int) -> NDArray[np.float64]:
        return np.array([np.asarray(row[column], dtype=np.float64) for row in rows]).reshape(len(rows), width)

    blocks, k = len(levels["blocks"]), len(parameters)
    return Baseline(
        coordinates=tuple(
            Coordinate(str(r["name"]), str(r["unit"]), float(r["value"]), bool(r["logarithmic"]), bool(r["at_bound"]))
            for r in parameters
        ),
        typical_effects=tuple(
            TypicalEffect(str(r["name"]), json.loads(str(r["values"])), bool(r["one_sided"])) for r in effects
        ),
        influence=stacked("blocks", parameters, blocks).T,
        white_noise_covariance=stacked("vector", parameters, k),
        steps=np.array([r["step"] for r in effects], dtype=np.float64),
        step_influence=stacked("blocks", effects, blocks).T,
        power=np.array([r["power"] for r in effects], dtype=np.float64),
        bias=stacked("vector", effects, k).T,
        levels=np.asarray(levels["blocks"], dtype=np.float64),
        gram=_symmetric_matrix([r["gram"] for r in effects]) if "gram" in columns else None,
    )


def _symmetric_matrix(rows: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    """Return a symmetric matrix from its lower triangle."""
    lower = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        lower[i, : i + 1] = row
    return lower + np.tril(lower, -1).T
