"""What the page shows of the pipeline: the model as a list, its parameters, the ladder, the diagnosis."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pneucli.figure import Figure, named
from pneucli.messages import answer_of, compare, diagnose, ingest
from pneucli.messages.compare import evaluation_error
from pneucli.messages.diagnose import probability_clause
from pneucli.messages.formatting import (
    format_figure,
    format_noise_ratio,
    format_parameters,
    format_percent,
    in_display_unit,
    unit_symbol,
)
from pneucli.messages.history import bar_share, models_on_current_data
from pneucli.physics.declaration import Effect
from pneucli.pipeline.runner import Pipeline
from pneucli.simulate.model import has_parameter, parameter_value
from pneucli.stages.history import compared_models
from pneucli.workbench.live_model import LiveModel
from pneucli.workbench.prediction import Place

Answers = Mapping[str, Mapping[str, Any]]
SHOWN_STAGES = ("ingest", "identify", "compare", "diagnose")
MAX_LOG_WIDTH = 1.5  # of the logarithm of an area: a slider goes from a thirtieth to thirty times its value
INTERVAL_WIDTHS = 3.0  # half intervals on each side of a value, over which a slider goes
VALUE_SHARE = 0.6  # of a value, over which it goes at least


def digest_of(path: Path) -> str:
    """Return the digest of a pipeline file's text, by which a page says what it has seen; empty without a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path.is_file() else ""


def overview(pipeline: Pipeline, answers: Answers) -> dict[str, Any]:
    """Return name, verdict, errors and what is out of date."""
    status = pipeline.stage_status(["compare", "diagnose"])
    diagnosis = answer_of(diagnose.Answer, answers)
    compared = answer_of(compare.Answer, answers)
    return {
        "name": pipeline.name,
        "file": pipeline.path.name,
        "stale": {name: list(status[name].reasons) for name in ("compare", "diagnose") if status[name].reasons},
        "error": compared.error,
        "lacks": bool(compared.lack_of_fit and compared.lack_of_fit.present),
        "diagnosis": named(diagnosis, "verdict sentence missing") | {"next": diagnosis.next_experiment or ""},
    }


def effects(catalogue: Mapping[str, Effect], present: Sequence[str], answers: Answers) -> list[dict[str, Any]]:
    """Return every effect: whether it is in the model, and what the last diagnosis says of it."""
    diagnosis = answer_of(diagnose.Answer, answers)
    candidates = {c.effect: c for c in diagnosis.candidates}
    names = list(dict.fromkeys([*present, *diagnosis.missing, *candidates, *catalogue]))
    found = []
    for name in names:
        candidate, effect = candidates.get(name), catalogue.get(name)
        verdict = "named" if name in diagnosis.missing else "rejected" if candidate else ""
        found.append(
            {
                "name": name,
                "title": effect.title if effect else candidate.title if candidate else "",
                "part": effect.part if effect else "",
                "in_model": name in present,
                "verdict": verdict,
                "probability": probability_clause(candidate).strip() if candidate else "",
                "share": _share(candidate),
                "size": format_parameters(candidate.parameters) if candidate else "",
                "why": candidate.why if candidate else "",
            }
        )
    return found


def _share(candidate: diagnose.CandidateAnswer | None) -> str:
    share = candidate.share if candidate else None
    return "" if share is None else f"explains {format_percent(share)} of the squared error beyond noise"


def parameters(answers: Answers, live: LiveModel | None) -> list[dict[str, Any]]:
    """Return the model's parameters with value, interval, unit, lock, and the range of a slider."""
    found = []
    for name, one in answer_of(compare.Answer, answers).model.parameters.items():
        row = {
            "name": name,
            **one.answer,
            "unit": unit_symbol(one.unit),
            "si": one.unit,
            "factor": in_display_unit(1.0, one.unit),
            "text": format_figure(one),
            "fixed": False,
            "range": None,
            "logarithmic": False,
        }
        found.append(row | _slider(name, one, live))
    return found


def _slider(name: str, one: Figure, live: LiveModel | None) -> dict[str, Any]:
    """Return the range of a parameter's slider, and whether the pipeline file fixes it; nothing without the model."""
    if live is None or math.isnan(one.value) or not has_parameter(live.model, name):
        return {}
    prior = live.model.rig.priors.get(name)
    fixed = prior is not None and prior.fixed is not None
    value, free = parameter_value(live.model, name), live.free.get(name)
    lower, upper = (free.lower, free.upper) if free else (-math.inf, math.inf)
    if (free and free.logarithmic) and value > 0.0:
        ends = value * 10.0**-MAX_LOG_WIDTH, value * 10.0**MAX_LOG_WIDTH
        return {
            "fixed": fixed,
            "range": [max(ends[0], lower), min(ends[1], upper)],
            "logarithmic": True,
            "value": value,
        }
    half = max((abs(end - value) for end in (one.low, one.high) if math.isfinite(end)), default=0.0)
    width = max(INTERVAL_WIDTHS * half, VALUE_SHARE * abs(value), 0.1 * free.scale if free else 0.0)
    ends = max(value - width, lower), min(value + width, upper)
    return {"fixed": fixed, "range": list(ends) if ends[1] > ends[0] else None, "value": value}


def ladder(artifacts: Path) -> list[dict[str, Any]]:
    """Return every model that was compared on the present data, oldest first."""
    models = compared_models(artifacts / "compare")
    shown = [(one, evaluation_error(one.error)[1]) for one in (models_on_current_data(models) if models else ())]
    most = max((error or 0.0 for _, error in shown), default=0.0)
    return [
        named(one, "number effects error data when current")
        | {"text": format_noise_ratio(error), "bar": bar_share(error, most)}
        for one, error in shown
    ]


def recordings(answers: Answers, places: Mapping[str, Place]) -> list[dict[str, Any]]:
    """Return the recordings with largest error and place in time: those held out, then in the file's order."""
    worst: dict[str, float] = {}
    uses: dict[str, str] = {}
    for channel in answer_of(compare.Answer, answers).channels:
        uses[channel.recording] = channel.use
        ratio = 0.0 if math.isnan(channel.ratio_to_noise) else channel.ratio_to_noise
        worst[channel.recording] = max(worst.get(channel.recording, 0.0), ratio)
    rows = [
        {
            **named(one, "name experiment samples"),
            "use": uses[one.name],
            "error": worst[one.name],
            "text": format_noise_ratio(worst[one.name]),
            "place": asdict(places[one.name]) if one.name in places else None,
        }
        for one in answer_of(ingest.Answer, answers).recordings
        if one.name in uses
    ]
    return sorted(rows, key=lambda one: bool(one["use"] != "test"))
