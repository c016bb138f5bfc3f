"""The way of a run: every model that was compared on its data, then what the last diagnosis would add."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pneucli.messages.history import effect_changes, models_on_current_data
from pneucli.stages.history import history_answer

if TYPE_CHECKING:
    from pneucli.notebook.run_data import RunData


@dataclass(frozen=True)
class LadderStep:
    """One model: its ``label``, its ``error`` by use, and whether a diagnosis only suggests it."""

    label: str
    error: Mapping[str, float | None]
    suggested: bool = False


def ladder_steps(run: RunData) -> list[LadderStep]:
    """Return the steps, oldest first; of a run without comparison those of the diagnosis alone."""
    suggested = run.ladder
    rows = [_diagnosed(row) for row in suggested.to_dict("records")]
    history = history_answer(run.artifacts / "compare")
    if not history:
        return rows
    models = models_on_current_data(history)
    return [*(_compared(models, i) for i in range(len(models))), *(row for row in rows if row.suggested)]


def _diagnosed(row: Mapping[Any, Any]) -> LadderStep:
    errors = {use: row[f"error_{use}"] for use in ("test", "train")}
    named = isinstance(row["add"], str)  # pandas has NaN for the present model
    return LadderStep(f"+ {row['add']}" if named else "present model", errors, named)


def _compared(models: Sequence[Mapping[str, Any]], i: int) -> LadderStep:
    one = models[i]
    label = " + ".join(one["effects"]) or "base model"
    if i:
        label = effect_changes(models[i - 1], one) or "other parameters"
        label = label if label.startswith("without") else f"+ {label}"
    return LadderStep(label + (" (present)" if one["current"] else ""), one["error"])
