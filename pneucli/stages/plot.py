"""The answer of ``plot``: which recording and channels are shown, with their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pneucli.errors import InputError, did_you_mean
from pneucli.messages.compare import evaluation_error
from pneucli.stages.diff import error_changes

Answer = Mapping[str, Any]
SCHEMA = "pneucli/plot/1"
SHOWN = ("channel", "unit", "rmsd", "noise", "ratio_to_noise", "fit_percent")


def plot_answer(compared: Answer, recording: str | None, channels: Sequence[str] | None) -> dict[str, Any]:
    """Return the answer for one recording, by default the one with the largest error that judges the model.

    Raises InputError where the recording, or one of the channels, was not compared.
    """
    name = worst_recording(compared) if recording is None else recording
    rows = [row for row in compared["channels"] if row["recording"] == name]
    if not rows:
        known = {row["recording"] for row in compared["channels"]}
        raise InputError(
            "plot, recording", f'"{name}" was not compared', mend=did_you_mean(str(name), known), code="E091"
        )
    for channel in channels or ():
        if channel not in (known := {row["channel"] for row in rows}):
            raise InputError(
                "plot, channel", f'"{channel}" was not compared', mend=did_you_mean(channel, known), code="E091"
            )
    return {
        "schema": SCHEMA,
        "pipeline": compared["pipeline"],
        "recording": name,
        "use": rows[0]["use"],
        "channels": [
            {key: row.get(key) for key in SHOWN} for row in rows if not channels or row["channel"] in channels
        ],
    }


def worst_recording(compared: Answer) -> str | None:
    """Return the recording with the largest error over noise among those that judge the model."""
    use, _ = evaluation_error(compared["error"])
    rows = [row for row in error_changes([], compared["channels"]) if row["use"] == use]
    worst = max(rows, key=lambda row: row["after"] or 0.0, default=None)
    return None if worst is None else str(worst["recording"])
