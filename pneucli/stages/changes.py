"""``diagnose --since OLD``: the reference that each diagnosis leaves, and what changed against an earlier one."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.changes.attribution import Change, Changes, named_changes
from pneucli.changes.baseline import Coordinate, Reference, Start, aligned, reference
from pneucli.changes.comparison import ALARM_RATE
from pneucli.changes.repeatability import NONE, Drift, Prior, Repeat, drift_of, names_of, repeat_of
from pneucli.diagnose.data import Bench
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import View
from pneucli.io.artifacts import read_table, sha256_of, write_table
from pneucli.physics.effects import select
from pneucli.pipeline import manifest as staleness
from pneucli.simulate.model import Model
from pneucli.stages.pipeline_data import Study, load_model, save_model

FILE = "reference.parquet"
SCHEMA = "pneucli/diagnose/reference/1"


def option(
    folder: Path,
    alarm_rate: float | None = None,
    repeats: Sequence[Repeat] = (),
    prior: Mapping[str, Prior] | None = None,
) -> dict[str, Any]:
    """Return the options of ``diagnose`` that ask what changed since the diagnosis in ``folder``.

    Its content is part of them: another old model makes the answer stale. ``repeats``: what healthy dates said of the
    old model, ``prior`` what is known beforehand of how such rigs repeat. Raises InputError where there is none.
    """
    if not (folder / FILE).is_file():
        mend = "run pneucli diagnose on the old pipeline first"
        raise InputError(f"--since {folder}", f"no {FILE} in it", "what an earlier diagnosis has written", mend)
    rate = ALARM_RATE if alarm_rate is None else alarm_rate
    asked = {"folder": str(folder.absolute()), "sha256": sha256_of(folder / FILE), "alarm_rate": rate}
    known = {"repeats": [dict(one) for one in repeats], "prior": None if prior is None else dict(prior)}
    return {"since": asked | (known if repeats else {})}


def repeat_in(folder: Path, asked: Mapping[str, Any]) -> Repeat:
    """Return what a healthy date said of the old model of :func:`option`.

    Raises InputError where the diagnosis in ``folder`` was not held against that one.
    """
    manifest = staleness.read(folder)
    told = (manifest.answer or {}).get("since", {}) if manifest else {}
    if told.get("sha256") != asked["since"]["sha256"]:
        found = "it was not held against this old model" if told else "no comparison in it"
        mend = "run pneucli diagnose REPEAT --since OLD first"
        raise InputError(f"--repeat {folder}", found, "a healthy repeat of OLD", mend)
    return dict(told["repeat"])


def keep_reference(study: Study, bench: Bench, model: Model) -> Fit:
    """Fit the model to all recordings and write what later comparisons need; return the fit."""
    views = [*bench.train, *bench.held_out]
    found, made = reference(model, views, _lacking(bench, model))
    write_reference(study, made)
    save_model(found.model, study.context.out, study.provenance("ingest/signals.parquet"))
    return found


def since(study: Study, bench: Bench, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``since`` and ``changes`` of the answer: what differs from the old model as it was."""
    folder, rate = Path(asked["folder"]), float(asked["alarm_rate"])
    model, old = _former(study, folder)
    views: list[View] = [*bench.train, *bench.held_out]
    own = replace(bench, covered=model.valve.covers)
    found, new = reference(model, views, _lacking(own, model), old.starts)
    whole, (old, new) = old, aligned(old, new)
    if not old.coordinates:
        here = "these recordings show none of the parameters of the old model"
        raise InputError(f"--since {folder}", here, "recordings of the same kind of test")
    repeats = asked.get("repeats", [])
    drift = drift_of(repeats, asked.get("prior")) if repeats else NONE
    changes = named_changes(old, new, found, views, bench.effects, rate, drift, names_of(whole, old))
    told = _told(folder, rate, changes) | {"sha256": asked["sha256"], "repeat": repeat_of(whole, old, new)}
    told["repeatability"] = _repeatability(drift, old, repeats)
    return {"since": told, "changes": [_change(c) for c in changes.changes]}


def _repeatability(drift: Drift, old: Reference, repeats: Sequence[Repeat]) -> dict[str, Any] | None:
    """Return how well the rig repeats, one standard deviation by parameter; None where no healthy date could tell."""
    if not repeats:
        return None
    sizes = {c.name: float(np.sqrt(drift.variance.get(c.name, 0.0))) for c in old.coordinates}
    own = {c.name: sizes[c.name] * (c.value if c.logarithmic else 1.0) for c in old.coordinates}
    return {
        "dates": len(repeats) + 1,
        "parameters": {c.name: {"value": own[c.name], "unit": c.unit} for c in old.coordinates},
    }


def _lacking(bench: Bench, model: Model) -> list[Any]:
    there = {e.name for e in model.effects}
    return [e for e in bench.effects.values() if e.name not in there and bench.can_show(e)]


def _former(study: Study, folder: Path) -> tuple[Model, Reference]:
    manifest = staleness.read(folder)
    effects = (manifest.answer or {}).get("model", {}).get("effects", []) if manifest else []
    known = select(effects, study.known_effects, f"--since {folder}")
    model = load_model(folder, study.rig, known)
    return model, read_reference(folder / FILE)


def _told(folder: Path, rate: float, found: Changes) -> dict[str, Any]:
    return {
        "folder": str(folder),
        "alarm_rate": rate,
        "p_value": found.p_value,
        "unseen": [asdict(limit) for limit in found.limits],
    }


def _change(one: Change) -> dict[str, Any]:
    return {
        "name": one.name,
        "effect": one.effect,
        "before": _number(one.before),
        "after": _number(one.after),
        "unit": one.unit,
        "ci95": None if one.ci95 is None else [_number(end) for end in one.ci95],
        "confidence": one.confidence,
        "confidence_alone": one.alone,
        "indistinguishable_from": list(one.twins),
    }


def _number(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


def write_reference(study: Study, made: Reference) -> None:
    """Write a reference: a row for each parameter and each start of an effect."""
    k, m = len(made.coordinates), len(made.starts)
    nothing = np.full(m, np.nan)
    vectors = [*made.working, *made.bias.T]
    blocks = [*made.influence.T, *made.step_influence.T, made.levels]
    write_table(
        study.context.out / FILE,
        {
            "kind": ["parameter"] * k + ["effect"] * m + ["levels"],
            "name": [*(c.name for c in made.coordinates), *(s.effect for s in made.starts), ""],
            "unit": [*(c.unit for c in made.coordinates), *[""] * (m + 1)],
            "value": np.array([*(c.value for c in made.coordinates), *nothing, np.nan], dtype=np.float64),
            "logarithmic": np.array([*(c.logarithmic for c in made.coordinates), *[False] * (m + 1)]),
            "at_bound": np.array([*(c.at_bound for c in made.coordinates), *[False] * (m + 1)]),
            "one_sided": np.array([*[False] * k, *(s.one_sided for s in made.starts), False]),
            "values": [*["{}"] * k, *(json.dumps(dict(s.values)) for s in made.starts), "{}"],
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


def read_reference(path: Path) -> Reference:
    """Return the reference that :func:`write_reference` wrote."""
    table = read_table(path)
    kind = np.array(table["kind"])
    mine, theirs = np.flatnonzero(kind == "parameter"), np.flatnonzero(kind == "effect")
    (levels,) = np.flatnonzero(kind == "levels")

    def stacked(column: str, rows: NDArray[np.int64], width: int) -> NDArray[np.float64]:
        return np.array([np.asarray(table[column][i], dtype=np.float64) for i in rows]).reshape(len(rows), width)

    level = np.asarray(table["blocks"][levels], dtype=np.float64)
    k = mine.size
    return Reference(
        coordinates=tuple(_coordinate(table, int(i)) for i in mine),
        starts=tuple(_start(table, int(i)) for i in theirs),
        influence=stacked("blocks", mine, level.size).T,
        working=stacked("vector", mine, k),
        steps=np.asarray(table["step"], dtype=np.float64)[theirs],
        step_influence=stacked("blocks", theirs, level.size).T,
        power=np.asarray(table["power"], dtype=np.float64)[theirs],
        bias=stacked("vector", theirs, k).T,
        levels=level,
        gram=_whole([np.asarray(table["gram"][i], dtype=np.float64) for i in theirs]) if "gram" in table else None,
    )


def _gram(made: Reference) -> NDArray[np.float64]:
    return np.zeros((0, 0)) if made.gram is None else made.gram


def _whole(rows: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return a symmetric matrix from its lower triangle."""
    lower = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        lower[i, : i + 1] = row
    return lower + np.tril(lower, -1).T


def _start(table: Mapping[str, Any], i: int) -> Start:
    return Start(str(table["name"][i]), json.loads(str(table["values"][i])), bool(table["one_sided"][i]))


def _coordinate(table: Mapping[str, Any], i: int) -> Coordinate:
    return Coordinate(
        str(table["name"][i]),
        str(table["unit"][i]),
        float(table["value"][i]),
        bool(table["logarithmic"][i]),
        bool(table["at_bound"][i]),
    )
