"""Two finished runs side by side: effects, errors, parameters beyond their intervals, verdicts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pneucli.changes.interval_difference import interval_difference
from pneucli.errors import InputError
from pneucli.pipeline import manifest as staleness
from pneucli.pipeline.manifest import Manifest

Answer = Mapping[str, Any]
SCHEMA = "pneucli/diff/1"


@dataclass(frozen=True)
class RunAnswers:
    """What a run found: the answer of ``compare``, and that of ``diagnose`` if it diagnosed the same model and data."""

    path: str
    compare: Answer
    diagnose: Answer | None

    @property
    def model(self) -> Answer:
        """The model that was compared."""
        model: Answer = self.compare["model"]
        return model


def read_answers(path: str, folder: Path) -> RunAnswers:
    """Read the answers of a run from the folder of its artifacts; ``path`` is what the user calls it.

    Raises InputError where no model was compared there.
    """
    compared = staleness.read_manifest(folder / "compare")
    if compared is None or compared.answer is None:
        why = (compared.skipped or {}).get("found") if compared else None
        found = f"no model was compared there{(why and f': {why}') or ''}"
        raise InputError(
            path, found, "a pipeline file, or the artifacts of a compared pipeline", "pneucli compare FILE", code="E007"
        )
    diagnosed = staleness.read_manifest(folder / "diagnose")
    same = diagnosed is not None and diagnosed.answer is not None and _same_basis(folder, diagnosed, compared.answer)
    return RunAnswers(path, compared.answer, diagnosed.answer if same and diagnosed else None)


def _same_basis(folder: Path, diagnosed: Manifest, compared: Answer) -> bool:
    """Return whether a diagnosis belongs to the recordings and the effects of ``compare``."""
    parents = diagnosed.inputs.parents
    now = {name: manifest.inputs.key for name in parents if (manifest := staleness.read_manifest(folder / name))}
    effects = (diagnosed.answer or {}).get("model", {}).get("effects", compared["model"]["effects"])
    return now == dict(parents) and effects == compared["model"]["effects"]


def difference(a: RunAnswers, b: RunAnswers) -> dict[str, Any]:
    """Return the answer of ``diff``: what b has that a has not, and where both differ."""
    was, now = a.model["effects"], b.model["effects"]
    return {
        "schema": SCHEMA,
        "a": _side(a),
        "b": _side(b),
        "same_data": a.compare["data"] == b.compare["data"],
        "effects": {
            "only_a": [name for name in was if name not in now],
            "only_b": [name for name in now if name not in was],
        },
        "parameters": _parameters(a.model.get("parameters", {}), b.model.get("parameters", {})),
        "recordings": error_changes(a.compare["channels"], b.compare["channels"]),
    }


def _side(one: RunAnswers) -> dict[str, Any]:
    found = one.diagnose or {}
    return {
        "path": one.path,
        "pipeline": one.compare["pipeline"],
        "effects": one.model["effects"],
        "error": one.compare["error"],
        "data": one.compare["data"],
        "verdict": found.get("verdict"),
        "missing": found.get("missing"),
        "sentence": found.get("sentence"),
    }


def _parameters(a: Answer, b: Answer) -> list[dict[str, Any]]:
    """Return every parameter of either model; those beyond their intervals first, the most distant one first."""
    rows = [_parameter(name, a.get(name), b.get(name)) for name in dict.fromkeys([*a, *b])]
    return sorted(rows, key=lambda row: -row["distance"] if row["distance"] is not None else 0.0)


def _parameter(name: str, a: Answer | None, b: Answer | None) -> dict[str, Any]:
    sides = {"a": a and _estimate(a), "b": b and _estimate(b)}
    unit = (a or b or {})["unit"]
    if a is None or b is None or a["unit"] != b["unit"]:
        return {"name": name, "unit": unit, **sides, "difference": None, "ci95": None, "distance": None, "beyond": None}
    found = interval_difference(a["value"], a.get("ci95"), b["value"], b.get("ci95"))
    return {
        "name": name,
        "unit": unit,
        **sides,
        "difference": b["value"] - a["value"],
        "ci95": found and [found.low, found.high],
        "distance": None if found is None else _distance(**asdict(found)),
        "beyond": found and found.beyond,
    }


def _estimate(parameter: Answer) -> dict[str, Any]:
    return {"value": parameter["value"], "ci95": parameter.get("ci95")}


def _distance(value: float, low: float, high: float) -> float | None:
    """Return the difference over the half width of its interval toward zero: beyond 1 it excludes zero."""
    half = value - low if value > 0.0 else high - value
    return abs(value) / half if half > 0.0 else (0.0 if value == 0.0 else None)


def error_changes(before: Sequence[Answer], after: Sequence[Answer]) -> list[dict[str, Any]]:
    """Return the error of each recording over noise, in two answers of ``compare``; test recordings first.

    Args:
        before: ``channels`` of the first answer.
        after: ``channels`` of the second answer.

    Returns:
        A row a recording: recording, use, before, after; None where an answer does not have it.

    """
    was, now = _errors_by_recording(before), _errors_by_recording(after)
    keys = sorted(dict.fromkeys([*now, *was]), key=lambda key: key[1])
    return [{"recording": key[0], "use": key[1], "before": was.get(key), "after": now.get(key)} for key in keys]


def _errors_by_recording(channels: Sequence[Answer]) -> dict[tuple[str, str], float | None]:
    """Return the error of each recording over noise: the root mean square over its channels."""
    squares: dict[tuple[str, str], list[float]] = {}
    for c in channels:
        ratio = c["ratio_to_noise"]
        squares.setdefault((c["recording"], c["use"]), []).extend([] if ratio is None else [ratio**2])
    return {key: math.sqrt(sum(of) / len(of)) if of else None for key, of in squares.items()}
