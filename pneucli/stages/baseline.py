"""The model that a diagnosis fits to all recordings, and its baseline, written when a comparison asks for it."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pneucli.config import load
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit, StoppingRule, fit
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.pipeline import manifest as staleness
from pneucli.pipeline.context import Context
from pneucli.pipeline.graph import STAGES
from pneucli.simulate.model import Model
from pneucli.stages.model_file import load_model, save_model
from pneucli.stages.pipeline_data import PipelineData

SOURCE_FILE = "source.json"  # the pipeline file's path from the folder of artifacts
NO_ITERATION = StoppingRule(0, 0.0)


def fit_all_recordings(pipeline: PipelineData, data: DiagnosisData, model: Model) -> Fit:
    """Fit the model to all recordings, save it, and return the fit."""
    out, artifacts = pipeline.context.out, pipeline.context.artifacts
    residual_models = [*data.train, *data.held_out]
    fitted = fit(model, residual_models, free_parameters(model, residual_models))
    save_model(fitted.model, out, pipeline.provenance("ingest/signals.parquet"))
    source = {"pipeline": os.path.relpath(pipeline.context.path, artifacts)}
    (out / SOURCE_FILE).write_text(json.dumps(source), encoding="utf-8")
    return fitted


def write_baseline(pipeline: PipelineData, data: DiagnosisData, fitted: Fit) -> None:
    """Write the baseline of a model that is fitted to all recordings."""
    from pneucli.changes.baseline import baseline_at_fit  # noqa: PLC0415 - few diagnoses write one
    from pneucli.stages.tables.baseline import write_baseline_table  # noqa: PLC0415

    residual_models = [*data.train, *data.held_out]
    baseline = baseline_at_fit(fitted, residual_models, data.absent_effects(fitted.model))
    write_baseline_table(pipeline, baseline)


def write_missing_baseline(folder: Path) -> None:
    """Write the baseline of an earlier diagnosis into its folder, where it has none, from the model in it.

    Raises:
        InputError: The pipeline file of the diagnosis has changed since then, or is not there any more.

    """
    from pneucli.stages.tables.baseline import REFERENCE_FILE  # noqa: PLC0415 - brings the comparison of two dates

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
        path, config, folder, folder.parent, answers=_answers(folder.parent), options=manifest.inputs.options
    )
    pipeline = PipelineData(context, max_samples=MAX_SAMPLES)
    model = load_model(folder, pipeline.rig, pipeline.effects)
    effects = {n: e for n, e in pipeline.available_effects.items() if n not in pipeline.excluded_effects}
    train, held_out = (pipeline.residual_models(use) for use in ("train", "test"))
    data = DiagnosisData(train, held_out, effects, modelled_parts=model.valve.covers)
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


def _answers(artifacts: Path) -> dict[str, dict[str, Any]]:
    """Return the answer of ``ingest``, on which the recordings depend."""
    manifest = staleness.read_manifest(artifacts / "ingest")
    return {} if manifest is None or manifest.answer is None else {"ingest": manifest.answer}
