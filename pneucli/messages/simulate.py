"""What the controller holds on the identified model, and where it fails."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled, table, warnings
from pneucli.messages.formatting import format_number, format_plain, format_quantity, join_names

Answer = Mapping[str, Any]
METRIC_TITLES = {  # of pneucli.closed_loop.metrics.Metrics, as people read them
    "steady_um": "error at rest, µm",
    "cycle_um": "movement at rest, µm",
    "tracking_rms_um": "error on the way, rms, µm",
    "tracking_max_um": "error on the way, largest, µm",
    "overshoot_um": "overshoot, µm",
    "rise_s": "rise from 10 to 90 %, s",
    "settling_s": "within 50 µm after, s",
    "recovery_s": "load rejected to 50 µm after, s",
    "peak_um": "largest error after a change of load, µm",
    "load_error": "load's estimate off by, share",
    "switching_hz": "reversals of the command, 1/s",
    "fast_share": "command above 50 Hz, share",
    "fast_v": "command above 50 Hz, rms, V",
    "air_kg": "air drawn, kg",
    "pressure_rest_pa": "error of the pressure at rest, Pa",
    "pressure_rms_pa": "error of the pressure, rms, Pa",
    "pressure_settling_s": "settling time of the pressure to 2 %, s",
    "sliding_load": "share of samples in sliding, load observer",
    "sliding_flow": "share of samples in sliding, flow observer",
}
MAX_NAMED_EFFECTS = 3  # effects that are named where a check does not always hold


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield what is held and where it fails; behind ``-v`` the figures of every scenario."""
    if "closed_loop" in answer:
        yield from labelled("holds", performance_line(answer))
        yield from (line for text in failures(answer) for line in labelled("fails", text))
    else:
        yield from labelled("found", f"{len(answer['open_loop'])} open-loop scenarios; no controller was designed")
    if verbose:
        yield from _open_loop(answer)
        yield from _closed_loop(answer)
    yield from warnings(answer)
    yield from labelled("do", f"pneucli report {file}")


def performance_line(answer: Answer) -> str:
    """Return the worst figures of the closed loop in one line."""
    return ", ".join(worst_metrics(answer)) or "nothing that the scenarios measure"


def worst_metrics(answer: Answer) -> list[str]:
    """Return the worst figures of the closed loop: at rest, on the way, under load."""
    worst = {name: max(of, key=lambda one: one[0]) for name in METRIC_TITLES if (of := _known(answer, name))}
    parts = []
    if "steady_um" in worst:
        tolerance = f" (tolerance {format_number(answer['tolerance_um'], 2)} µm)" if answer.get("tolerance_um") else ""
        parts.append(f"{format_number(worst['steady_um'][0], 2)} µm at rest{tolerance}")
    if "tracking_rms_um" in worst:
        parts.append(
            f"{format_number(worst['tracking_rms_um'][0], 2)} µm rms on the way ({worst['tracking_rms_um'][1]})"
        )
    if "recovery_s" in worst:
        parts.append(f"a load is rejected to 50 µm in {format_number(worst['recovery_s'][0], 2)} s")
    return parts


def failures(answer: Answer) -> list[str]:
    """Return the scenarios that miss the tolerance, and how often each check of the Monte Carlo study fails."""
    parts = [f"scenario {join_names(failed_scenarios(answer))}"] if failed_scenarios(answer) else []
    robust = answer.get("robust", {})
    for name, check in robust.get("checks", {}).items():
        if check["held"] < check["runs"]:
            limit = f"{METRIC_TITLES.get(name, name)} ≤ {format_plain(check['limit'])}"
            count = (
                f"missed in {check['runs'] - check['held']} of {check['runs']} runs with an effect outside its model"
            )
            parts.append(f"{limit}: {count}, most with {join_names(_harmful(robust['by_effect'], name))}")
    return parts


def failed_scenarios(answer: Answer) -> list[str]:
    """Return the scenarios that end beyond the tolerance, or never come back from a load."""
    tolerance = answer.get("tolerance_um") or math.inf
    return [name for name, figures in answer["closed_loop"].items() if _misses(figures, tolerance)]


def harmful_effects(answer: Answer) -> list[str]:
    """Return the effects that make the controller miss most checks because its model lacks them, worst first."""
    robust = answer.get("robust", {})
    worst = [name for check in robust.get("checks", {}) for name in _harmful(robust["by_effect"], check)]
    return sorted(dict.fromkeys(worst), key=lambda name: -worst.count(name))[:MAX_NAMED_EFFECTS]


def _known(answer: Answer, figure: str) -> list[tuple[float, str]]:
    values = ((figures.get(figure), name) for name, figures in answer["closed_loop"].items())
    return [(value, name) for value, name in values if value is not None]


def _misses(figures: Answer, tolerance: float) -> bool:
    """Whether a scenario ends beyond the tolerance, or never comes back from a load."""
    at_rest = max(figures.get("steady_um") or 0.0, figures.get("cycle_um") or 0.0)
    return at_rest > tolerance or (figures.get("peak_um") is not None and figures.get("recovery_s") is None)


def _harmful(rates: list[Answer], check: str) -> list[str]:
    """Return the effects with which most runs fail a check, worst first."""
    mine = [r for r in rates if r["check"] == check and r["effect"] not in ("", "all") and r["held"] < r["runs"]]
    return [r["effect"] for r in sorted(mine, key=lambda r: r["held"] / r["runs"])[:MAX_NAMED_EFFECTS]]


def _open_loop(answer: Answer) -> Iterator[str]:
    rows = [
        (
            *(one["scenario"], m["channel"]),
            *(format_quantity(m[key], m["unit"], 3) for key in ("from", "to", "rmsd")),
        )
        for one in answer["open_loop"]
        for m in one["channels"]
    ]
    yield from table(("open loop", "channel", "least", "largest", "rms error"), rows, texts=2)


def _closed_loop(answer: Answer) -> Iterator[str]:
    for name, figures in answer.get("closed_loop", {}).items():
        pid = answer["pid_alone"][name]
        rows = [(METRIC_TITLES.get(n, n), _figure(v), _figure(pid[n])) for n, v in figures.items() if v is not None]
        yield ""
        yield from table((f"closed loop, {name}", "with compensation", "PIDs only"), rows, texts=1)


def _figure(value: float | None) -> str:
    return "∞" if value is None else format_number(value, 3)
