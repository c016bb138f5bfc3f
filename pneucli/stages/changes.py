"""The baseline of each diagnosis, and the changes since an earlier one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.changes.attribution import Change, Changes, attribute_changes
from pneucli.changes.baseline import Baseline, align, fit_baseline
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
from pneucli.identify.residuals import ResidualModel
from pneucli.io.artifacts import sha256_of
from pneucli.physics.effects import select_effects
from pneucli.pipeline import manifest as staleness
from pneucli.simulate.model import Model
from pneucli.stages.baseline import write_missing_baseline
from pneucli.stages.model_file import load_model
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.tables.baseline import REFERENCE_FILE, read_baseline


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


def compare_with_baseline(pipeline: PipelineData, data: DiagnosisData, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries ``since`` and ``changes`` of the answer."""
    folder, rate = Path(options["folder"]), float(options["alarm_rate"])
    model, old = _baseline_model(pipeline, folder)
    residual_models: list[ResidualModel] = [*data.train, *data.held_out]
    own = replace(data, modelled_parts=model.valve.covers)
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
    answer = _comparison_answer(folder, rate, changes) | {
        "sha256": options["sha256"],
        "repeat": repeat_differences(whole, old, new),
    }
    answer["repeatability"] = _repeatability(repeatability, old, repeats)
    return {"since": answer, "changes": [_change_answer(c) for c in changes.changes]}


def _repeatability(
    repeatability: Repeatability, old: Baseline, repeats: Sequence[RepeatDifferences]
) -> dict[str, Any] | None:
    """Return the standard deviation of each parameter from date to date; None without healthy dates."""
    if not repeats:
        return None
    sizes = {c.name: float(np.sqrt(repeatability.variance.get(c.name, 0.0))) for c in old.coordinates}
    own = {c.name: sizes[c.name] * (c.value if c.logarithmic else 1.0) for c in old.coordinates}
    return {
        "dates": len(repeats) + 1,
        "parameters": {c.name: {"value": own[c.name], "unit": c.unit} for c in old.coordinates},
    }


def _baseline_model(pipeline: PipelineData, folder: Path) -> tuple[Model, Baseline]:
    manifest = staleness.read_manifest(folder)
    effects = (manifest.answer or {}).get("model", {}).get("effects", []) if manifest else []
    effects = select_effects(effects, pipeline.available_effects, f"--since {folder}")
    model = load_model(folder, pipeline.rig, effects)
    return model, read_baseline(folder / REFERENCE_FILE)


def _comparison_answer(folder: Path, rate: float, fit: Changes) -> dict[str, Any]:
    return {
        "folder": str(folder),
        "alarm_rate": rate,
        "p_value": fit.p_value,
        "unseen": [asdict(limit) for limit in fit.limits],
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
