"""The baseline of a diagnosis as a table, for later comparisons."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.changes.baseline import Baseline, Coordinate, TypicalEffect
from pneucli.io.artifacts import read_table, write_table
from pneucli.stages.pipeline_data import PipelineData

REFERENCE_FILE = "reference.parquet"
SCHEMA = "pneucli/diagnose/reference/1"


def write_baseline_table(pipeline: PipelineData, baseline: Baseline) -> None:
    """Write a baseline: a row for each parameter and each typical effect, and one for the residual levels."""
    k, m = len(baseline.coordinates), len(baseline.typical_effects)
    no_values = np.full(m, np.nan)
    vectors = [*baseline.white_noise_covariance, *baseline.bias.T]
    blocks = [*baseline.influence.T, *baseline.step_influence.T, baseline.levels]
    write_table(
        pipeline.context.out / REFERENCE_FILE,
        {
            "kind": ["parameter"] * k + ["effect"] * m + ["levels"],
            "name": [*(c.name for c in baseline.coordinates), *(s.effect for s in baseline.typical_effects), ""],
            "unit": [*(c.unit for c in baseline.coordinates), *[""] * (m + 1)],
            "value": np.array([*(c.value for c in baseline.coordinates), *no_values, np.nan], dtype=np.float64),
            "logarithmic": np.array([*(c.logarithmic for c in baseline.coordinates), *[False] * (m + 1)]),
            "at_bound": np.array([*(c.at_bound for c in baseline.coordinates), *[False] * (m + 1)]),
            "one_sided": np.array([*[False] * k, *(s.one_sided for s in baseline.typical_effects), False]),
            "values": [*["{}"] * k, *(json.dumps(dict(s.values)) for s in baseline.typical_effects), "{}"],
            "step": np.array([*[np.nan] * k, *baseline.steps, np.nan], dtype=np.float64),
            "power": np.array([*[np.nan] * k, *baseline.power, np.nan], dtype=np.float64),
            "vector": [*(list(map(float, v)) for v in vectors), []],
            "blocks": [list(map(float, b)) for b in blocks],
            "gram": [*[[]] * k, *(list(map(float, row[: i + 1])) for i, row in enumerate(_gram(baseline))), []],
        },
        units={"value": "see column unit", "step": "1", "power": "1"},
        schema=SCHEMA,
        provenance=pipeline.provenance("ingest/signals.parquet"),
    )


def read_baseline(path: Path) -> Baseline:
    """Return the baseline that :func:`write_baseline_table` wrote."""
    table = read_table(path)
    kind = np.array(table["kind"])
    parameter_rows, effect_rows = np.flatnonzero(kind == "parameter"), np.flatnonzero(kind == "effect")
    (level_rows,) = np.flatnonzero(kind == "levels")

    def stacked(column: str, rows: NDArray[np.int64], width: int) -> NDArray[np.float64]:
        return np.array([np.asarray(table[column][i], dtype=np.float64) for i in rows]).reshape(len(rows), width)

    levels = np.asarray(table["blocks"][level_rows], dtype=np.float64)
    k = parameter_rows.size
    return Baseline(
        coordinates=tuple(_coordinate(table, int(i)) for i in parameter_rows),
        typical_effects=tuple(_typical_effect(table, int(i)) for i in effect_rows),
        influence=stacked("blocks", parameter_rows, levels.size).T,
        white_noise_covariance=stacked("vector", parameter_rows, k),
        steps=np.asarray(table["step"], dtype=np.float64)[effect_rows],
        step_influence=stacked("blocks", effect_rows, levels.size).T,
        power=np.asarray(table["power"], dtype=np.float64)[effect_rows],
        bias=stacked("vector", effect_rows, k).T,
        levels=levels,
        gram=_symmetric_matrix([np.asarray(table["gram"][i], dtype=np.float64) for i in effect_rows])
        if "gram" in table
        else None,
    )


def _gram(baseline: Baseline) -> NDArray[np.float64]:
    return np.zeros((0, 0)) if baseline.gram is None else baseline.gram


def _symmetric_matrix(rows: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return a symmetric matrix from its lower triangle."""
    lower = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        lower[i, : i + 1] = row
    return lower + np.tril(lower, -1).T


def _typical_effect(table: Mapping[str, Any], i: int) -> TypicalEffect:
    return TypicalEffect(str(table["name"][i]), json.loads(str(table["values"][i])), bool(table["one_sided"][i]))


def _coordinate(table: Mapping[str, Any], i: int) -> Coordinate:
    return Coordinate(
        str(table["name"][i]),
        str(table["unit"][i]),
        float(table["value"][i]),
        bool(table["logarithmic"][i]),
        bool(table["at_bound"][i]),
    )
