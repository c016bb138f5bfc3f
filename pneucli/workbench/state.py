"""What the page shows of the pipeline: the model as a list, its parameters, the ladder, the diagnosis."""

from __future__ import annotations

import hashlib
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pneucli.figure import read
from pneucli.messages.diagnose import CandidateAnswer, probability_clause
from pneucli.messages.formatting import (
    format_interval,
    format_noise_ratio,
    format_parameters,
    format_percent,
    in_display_unit,
    unit_symbol,
)
from pneucli.physics.declaration import Effect
from pneucli.pipeline.manifest import read_manifest
from pneucli.pipeline.runner import Pipeline
from pneucli.simulate.model import has_parameter, parameter_value
from pneucli.stages.history import recorded_models
from pneucli.workbench.live_model import LiveModel
from pneucli.workbench.timeline import Place

Answers = Mapping[str, dict[str, Any]]
SHOWN_STAGES = ("ingest", "identify", "compare", "diagnose")
MAX_LOG_WIDTH = 1.5  # of the logarithm of an area: a slider goes from a thirtieth to thirty times its value
INTERVAL_WIDTHS = 3.0  # half intervals on each side of a value, over which a slider goes
VALUE_SHARE = 0.6  # of a value, over which it goes at least


def read_answers(artifacts: Path) -> dict[str, dict[str, Any]]:
    """Return the answers of the stages that have run, whether or not they are up to date."""
    manifests = {name: read_manifest(artifacts / name) for name in SHOWN_STAGES}
    return {name: one.answer for name, one in manifests.items() if one is not None and one.answer is not None}


def digest_of(path: Path) -> str:
    """Return the digest of a pipeline file's text, by which a page says what it has seen; empty without a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path.is_file() else ""


def overview(pipeline: Pipeline, answers: Answers) -> dict[str, Any]:
    """Return name, verdict, errors and what is out of date."""
    status = pipeline.stage_status(["compare", "diagnose"])
    diagnosis = answers.get("diagnose", {})
    compared = answers.get("compare", {})
    return {
        "name": pipeline.name,
        "file": pipeline.path.name,
        "stale": {name: list(status[name].reasons) for name in ("compare", "diagnose") if status[name].reasons},
        "error": compared.get("error", {}),
        "lacks": bool((compared.get("lack_of_fit") or {}).get("present")),
        "diagnosis": {
            "verdict": diagnosis.get("verdict", ""),
            "sentence": diagnosis.get("sentence", ""),
            "missing": diagnosis.get("missing", []),
            "next": diagnosis.get("next_experiment") or "",
        },
    }


def effects(
    catalogue: Mapping[str, Effect], present: Sequence[str], diagnosis: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return every effect: whether it is in the model, and what the last diagnosis says of it."""
    candidates = {c["effect"]: c for c in diagnosis.get("candidates", [])}
    missing = diagnosis.get("missing", [])
    names = list(dict.fromkeys([*present, *missing, *candidates, *catalogue]))
    found = []
    for name in names:
        candidate, effect = candidates.get(name), catalogue.get(name)
        verdict = "named" if name in missing else "rejected" if candidate else ""
        found.append(
            {
                "name": name,
                "title": effect.title if effect else candidate["title"] if candidate else "",
                "part": effect.part if effect else "",
                "in_model": name in present,
                "verdict": verdict,
                "probability": _probability(candidate),
                "share": _share(candidate),
                "size": format_parameters(read(CandidateAnswer, candidate).parameters) if candidate else "",
                "why": candidate["why"] if candidate else "",
            }
        )
    return found


def _probability(candidate: Mapping[str, Any] | None) -> str:
    return probability_clause(read(CandidateAnswer, candidate)).strip() if candidate else ""


def _share(candidate: Mapping[str, Any] | None) -> str:
    share = candidate.get("share") if candidate else None
    return "" if share is None else f"explains {format_percent(share)} of the squared error beyond noise"


def parameters(compared: Mapping[str, Any], live: LiveModel | None) -> list[dict[str, Any]]:
    """Return the model's parameters with value, interval, unit, lock, and the range of a slider."""
    found = []
    for name, one in compared.get("model", {}).get("parameters", {}).items():
        ci95 = one.get("ci95") or [None, None]
        row = {
            "name": name,
            "value": one["value"],
            "ci95": ci95,
            "unit": unit_symbol(one["unit"]),
            "si": one["unit"],
            "factor": in_display_unit(1.0, one["unit"]),
            "text": format_interval(one["value"], one["unit"], ci95),
            "fixed": False,
            "range": None,
            "logarithmic": False,
        }
        found.append(row | _slider(name, one, live))
    return found


def _slider(name: str, one: Mapping[str, Any], live: LiveModel | None) -> dict[str, Any]:
    """Return the range of a parameter's slider, and whether the pipeline file fixes it; nothing without the model."""
    if live is None or one["value"] is None or not has_parameter(live.model, name):
        return {}
    prior = live.model.rig.priors.get(name)
    fixed = prior is not None and prior.fixed is not None
    value, free = parameter_value(live.model, name), live.free.get(name)
    lower, upper = (free.lower, free.upper) if free else (-math.inf, math.inf)
    low, high = one.get("ci95") or (None, None)
    if (free and free.logarithmic) and value > 0.0:
        ends = value * 10.0**-MAX_LOG_WIDTH, value * 10.0**MAX_LOG_WIDTH
        return {
            "fixed": fixed,
            "range": [max(ends[0], lower), min(ends[1], upper)],
            "logarithmic": True,
            "value": value,
        }
    half = max((abs(end - value) for end in (low, high) if end is not None and math.isfinite(end)), default=0.0)
    width = max(INTERVAL_WIDTHS * half, VALUE_SHARE * abs(value), 0.1 * free.scale if free else 0.0)
    ends = max(value - width, lower), min(value + width, upper)
    return {"fixed": fixed, "range": list(ends) if ends[1] > ends[0] else None, "value": value}


def ladder(artifacts: Path) -> list[dict[str, Any]]:
    """Return every model that was compared on the present data, oldest first."""
    records = recorded_models(artifacts / "compare")
    rows = [
        {
            "number": one.answer["number"],
            "effects": one.answer["model"]["effects"],
            "error": one.answer["error"],
            "data": one.answer["data"],
            "when": one.answer["when"],
            "current": one.current,
        }
        for one in records
    ]
    now = next((one for one in rows if one["current"]), rows[-1] if rows else {})
    shown = [*(one for one in rows if one["data"] == now["data"] and one is not now), *([now] if now else [])]
    most = max((_error(one) or 0.0 for one in shown), default=0.0)
    return [
        dict(one) | {"text": format_noise_ratio(_error(one)), "bar": bar_length(_error(one), most)} for one in shown
    ]


def bar_length(error: float | None, largest: float) -> float:
    """Return the length of a bar down to 1, the noise floor, as a share of the longest, on a logarithmic scale.

    >>> bar_length(10.0, 100.0), bar_length(0.9, 100.0)
    (0.5, 0.0)
    """
    return 0.0 if error is None or error <= 1.0 or largest <= 1.0 else math.log(error) / math.log(largest)


def _error(model: Mapping[str, Any]) -> float | None:
    error = model["error"]
    value: float | None = error["train"] if error["test"] is None else error["test"]
    return value


def recordings(answers: Answers, places: Mapping[str, Place]) -> list[dict[str, Any]]:
    """Return the recordings with largest error and place in time: those held out, then in the file's order."""
    worst: dict[str, float] = {}
    uses: dict[str, str] = {}
    for one in answers.get("compare", {}).get("channels", []):
        uses[one["recording"]] = one["use"]
        worst[one["recording"]] = max(worst.get(one["recording"], 0.0), one["ratio_to_noise"] or 0.0)
    listed = answers.get("ingest", {}).get("recordings", [])
    rows = [
        {
            "name": one["name"],
            "use": uses[one["name"]],
            "experiment": one["experiment"],
            "samples": one["samples"],
            "error": worst[one["name"]],
            "text": format_noise_ratio(worst[one["name"]]),
            "place": asdict(places[one["name"]]) if one["name"] in places else None,
        }
        for one in listed
        if one["name"] in uses
    ]
    return sorted(rows, key=lambda one: bool(one["use"] != "test"))


def command_lines(file: str, out: str | None) -> dict[str, str]:
    """Return the command line that does what each button does."""
    rest = [file, *(["--out", out] if out else [])]
    words = {
        "fit": ["compare", *rest],
        "diagnose": ["diagnose", *rest],
        "add": ["add", *rest, "--suggested"],
        "plan": ["plan", *rest],
        "report": ["report", *rest],
    }
    return {name: shlex.join(["pneucli", *one]) for name, one in words.items()}
