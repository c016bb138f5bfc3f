"""The tables that ``diagnose`` writes: candidates, the ladder, and the residual over the telling variable."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.compare.error_regions import locator_signals
from pneucli.diagnose.adequacy import bins_of
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.diagnosis import Diagnosis
from pneucli.diagnose.discrepancy import UnexplainedResidual
from pneucli.diagnose.score import FittedModel
from pneucli.identify.residuals import ResidualModel
from pneucli.io.artifacts import write_table
from pneucli.physics.declaration import Effect
from pneucli.quantities import SIGNALS
from pneucli.stages.pipeline_data import PipelineData

Array = NDArray[np.float64]
SHAPE_BINS = 40
SHAPE_FILE = "shape.parquet"
MAX_SHAPE_RECORDINGS = 3  # recordings a picture is drawn of


def write_diagnosis(study: PipelineData, bench: DiagnosisData, found: Diagnosis, answer: dict[str, Any]) -> None:
    """Write ``candidates``, ``ladder``, ``shape`` and ``law`` into the stage's folder."""
    inputs = ("ingest/signals.parquet",)
    candidates = [
        (
            *(c["effect"], c["error_before"], c["error_after"], name, p["value"], p["unit"], *p["ci95"]),
            *(c["supported"], c["effect"] in answer["missing"], ", ".join(c["indistinguishable_from"])),
            *(c["reason"], c["why"]),
        )
        for c in answer["candidates"]
        for name, p in (c["parameters"] or NOT_FITTED).items()
    ]
    _write(
        study,
        "candidates",
        "effect error_before error_after parameter value unit ci_low ci_high supported missing "
        "indistinguishable_from reason why",
        candidates,
        {"error_before": "1", "error_after": "1"} | dict.fromkeys(("value", "ci_low", "ci_high"), "see column unit"),
        inputs,
    )
    ladder = [(s["add"] or "", s["error_train"], s["error_test"]) for s in answer["ladder"]]
    _write(study, "ladder", "add error_train error_test", ladder, {"error_train": "1", "error_test": "1"}, inputs)
    shapes = [row for i, name in enumerate(found.path.added) for row in _residual_shapes(bench, found, i, name)]
    columns = "effect recording channel variable unit value residual_before residual_after expected"
    values = dict.fromkeys(("residual_before", "residual_after", "expected"), "see column unit")
    _write(study, "shape", columns, shapes, values | {"value": "SI"}, inputs)
    columns = "channel acts_as variable unit value law"
    _write(
        study,
        "law",
        columns,
        list(_smooth_term_rows(found.unexplained)),
        {"value": "SI", "law": "see column unit"},
        inputs,
    )


TEXT_COLUMNS = {"effect", "parameter", "unit", "indistinguishable_from", "reason", "why", "add"} | {
    "recording",
    "channel",
    "variable",
    "acts_as",
}
NOT_FITTED: dict[str, Any] = {"": {"value": None, "unit": "", "ci95": (None, None)}}
BOOLEAN_COLUMNS = {"supported", "missing"}


def _write(
    study: PipelineData,
    name: str,
    columns: str,
    rows: Sequence[tuple[Any, ...]],
    units: dict[str, str],
    inputs: tuple[str],
) -> None:
    table: dict[str, Any] = {}
    for i, column in enumerate(columns.split()):
        cells = [row[i] for row in rows]
        if column in TEXT_COLUMNS:
            table[column] = cells
        elif column in BOOLEAN_COLUMNS:
            table[column] = np.array(cells, dtype=bool)
        else:
            table[column] = np.array([np.nan if c is None else c for c in cells], dtype=np.float64)
    write_table(
        study.context.out / f"{name}.parquet",
        table,
        units=units,
        schema=f"pneucli/diagnose/{name}/1",
        provenance=study.provenance(*inputs),
    )


def _smooth_term_rows(unknown: UnexplainedResidual | None) -> Iterable[tuple[Any, ...]]:
    """Yield the law of what remains, over its signal."""
    law = None if unknown is None else unknown.smooth_term
    if unknown is not None and law is not None:
        for place, value in zip(np.linspace(law.low, law.high, law.values.size), law.values, strict=True):
            yield unknown.channel, law.acts_as, law.signal, law.unit, float(place), float(value)


def _residual_shapes(bench: DiagnosisData, found: Diagnosis, i: int, name: str) -> Iterable[tuple[Any, ...]]:
    """Yield the residual before and after, and what the effect changes, over the variable in which it shows."""
    before, after = found.path.models[i], found.path.models[i + 1]
    effect = bench.effects[name]
    falls = []
    for view in [*bench.held_out, *bench.train]:
        if view.is_sensitive_to(effect):
            falls += [_residual_reduction(view, channel, effect, before, after) for channel in view.channels]
    known = [f for f in falls if f is not None]
    for _, rows in sorted(known, key=lambda f: -f[0])[:MAX_SHAPE_RECORDINGS]:
        yield from rows


def _residual_reduction(
    view: ResidualModel, channel: str, effect: Effect, before: FittedModel, after: FittedModel
) -> tuple[float, list[tuple[Any, ...]]] | None:
    old, new = view.residual(before.model)[channel], view.residual(after.model)[channel]
    variables = locator_signals(view.experiment)
    variable = effect.shows_over if effect.shows_over in variables else "time"
    q = variables[variable]
    seen = np.isfinite(q) & ((old != 0.0) | (new != 0.0))
    if np.count_nonzero(seen) < SHAPE_BINS:
        return None
    q, old, new = q[seen], old[seen], new[seen]
    place = bins_of(q, SHAPE_BINS)
    count = np.maximum(np.bincount(place), 1)
    mean = [np.bincount(place, part) / count for part in (q, old, new, old - new)]
    head = (effect.name, view.experiment.recording.name, channel, variable, SIGNALS[channel].unit)
    fall = float(np.sum(old**2) - np.sum(new**2)) / view.noise[channel] ** 2
    return fall, [(*head, *(float(part[b]) for part in mean)) for b in range(count.size)]
