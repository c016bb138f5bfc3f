"""The warnings about an identified valve."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pneucli.messages.formatting import (
    format_interval,
    format_noise_ratio,
    format_percent,
    format_plain,
    format_quantity,
)

MISSING_PHYSICS = (
    "no static map can describe this: heat transfer, valve lag, hysteresis or supply droop, which the model lacks, "
    "or a vessel that is full within some samples"
)


def valve_warning(code: str, **values: Any) -> str:
    """Return a warning of ``pneucli.stages.tables.valve.valve_findings`` by its code, with its numbers."""
    return f"{code}: {_TEXTS[code](**values)}"


def _not_described(largest: float, measured: float) -> str:
    return (
        f"the map of the valve reaches {format_quantity(largest, 'Pa/s')}, its curves show no more than "
        f"{format_quantity(measured, 'Pa/s')}; do not use it, and see what ingest finds implausible"
    )


def _resampled(count: int, error: float, recording: str) -> str:
    return (
        f"{count} recordings are sampled unevenly and were put on an even clock for the map, which adds an error of up "
        f"to {format_quantity(error, 'Pa')} to p1 ({recording})"
    )


def _curves_not_followed(residual: float) -> str:
    return f"the map leaves {format_noise_ratio(residual)} × noise on its own curves; {MISSING_PHYSICS}"


def _not_foreseen(residual: float) -> str:
    return (
        f"the map leaves {format_noise_ratio(residual)} × noise on held-out curves; take commands between those that "
        "were fitted, or record more of them"
    )


def _lack_of_fit(reference: str, median: float | None, p95: float | None, outside: float | None) -> str:
    shares = [format_percent(share or 0.0) for share in (median, p95, outside)]
    return (
        f"the model's valve is off the measured {reference} by {shares[0]} in the median, {shares[1]} at the 95th "
        f"percentile, outside both 95 % intervals at {shares[2]} of the points: pneucli diagnose says what it may lack"
    )


def _critical_ratio(
    count: int, commands: int, model: float, command: float, measured: tuple[float, float, float]
) -> str:
    value, low, high = measured
    return (
        f"at {count} of {commands} commands the curve shows another critical ratio than the model has, "
        f"{format_plain(model, 3)}; most at {format_plain(command, 4)} V: {format_interval(value, '1', (low, high))}"
    )


_TEXTS: dict[str, Callable[..., str]] = {
    "valve-not-described": _not_described,
    "valve-resampled": _resampled,
    "valve-curves-not-followed": _curves_not_followed,
    "valve-not-foreseen": _not_foreseen,
    "valve-lack-of-fit": _lack_of_fit,
    "valve-critical-ratio": _critical_ratio,
}
