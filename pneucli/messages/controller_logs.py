"""Logs of a running controller: the predicted and the measured performance of the loop."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_quantity

Row = Mapping[str, Any]
FIGURES = (
    ("steady_um", "error at rest", "m", 1e-6),
    ("cycle_um", "moves at rest", "m", 1e-6),
    ("tracking_rms_um", "error on the way, rms", "m", 1e-6),
    ("overshoot_um", "overshoot", "m", 1e-6),
    ("settling_s", "settles in", "s", 1.0),
    ("fast_v", "command above 50 Hz, rms", "V", 1.0),
    ("load_estimate_n", "estimate of the load, mean", "N", 1.0),
)
COLUMN_TITLES = ("figure", "predicted", "measured")


def figure_rows(log: Row) -> Iterator[tuple[str, str, str]]:
    """Yield title, prediction and measurement of the figures that the log shows."""
    for name, title, unit, scale in FIGURES:
        predicted, measured = log["foretold"].get(name), log["measured"].get(name)
        if predicted is not None or measured is not None:
            yield title, _shown(predicted, unit, scale), _shown(measured, unit, scale)


def _shown(value: float | None, unit: str, scale: float) -> str:
    return "never" if value is None else format_quantity(scale * value, unit, 3)


def lines(answer: Row) -> Iterator[str]:
    """Yield a sentence for each log."""
    for log in answer.get("closed_loop", ()):
        figures = "; ".join(
            f"{title} {measured} ({predicted} predicted)" for title, predicted, measured in figure_rows(log)
        )
        yield f"{log['recording']}, {log['controller']}: {figures}"
