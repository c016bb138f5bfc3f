"""Default checks of the closed loop for continuous integration; their limits are the requirements of ``[design]``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pneucli.export.replay_check import MAX_DIFFERENCE
from pneucli.messages.acceptance import violations
from pneucli.messages.formatting import format_plain
from pneucli.messages.law_comparison import worst_value
from pneucli.report import Check

Answers = Mapping[str, Mapping[str, Any]]
MICROMETRES_PER_METRE = 1e6


def closed_loop_checks(answers: Answers) -> list[Check]:
    """Return the checks of the selected controller: rest, limit cycle, recovery, sine, gate, C against simulation.

    A check without a stated requirement is skipped and says what was found. Empty without a designed controller.

    Args:
        answers: Answers of the stages by name; ``simulate`` and ``design`` are read.

    """
    design, simulation = answers.get("design"), answers.get("simulate") or {}
    if not design:
        return []
    figures = simulation.get("closed_loop") or design["compare"].get(design["requirements"]["controller"]) or {}
    checks = [_gate(design["gate"])] if design.get("gate") else []
    if figures:
        checks += _figure_checks(figures, design["requirements"], design["tolerance_um"])
    if "exported_c" in simulation:
        checks.append(_exported_c(simulation["exported_c"]))
    return checks


def _figure_checks(figures: Any, requirements: Mapping[str, Any], tolerance_um: float) -> list[Check]:
    tracking = requirements.get("tracking_error")
    limit = None if tracking is None else MICROMETRES_PER_METRE * tracking
    return [
        _limited("rest", worst_value(figures, "steady_um"), tolerance_um, "um"),
        _limited("limit-cycle", worst_value(figures, "cycle_um"), tolerance_um, "um"),
        _recovery(figures, requirements.get("settling_time")),
        _limited("sine", worst_value(figures, "tracking_rms_um"), limit, "um", "tracking_error"),
    ]


def _limited(name: str, value: float | None, limit: float | None, unit: str, key: str = "") -> Check:
    """Return a check of a largest value; skipped without a limit or where no scenario shows the value."""
    path = f"closed-loop.{name}"
    if value is None:
        return Check(path, "", None, skipped="no scenario shows it")
    if limit is None:
        return Check(path, "", value, skipped=f"[design] {key} is not stated; found {format_plain(value, 3)} {unit}")
    wanted = f"max {format_plain(limit, 6)} {unit}"
    failure = f"{path} = {format_plain(value, 3)} {unit} ({wanted}): FAILED"
    return Check(path, wanted, value, "" if value <= limit else failure)


def _recovery(figures: Any, limit: float | None) -> Check:
    """Return the check of the time after which a load is rejected to 50 um; without a stated limit, that it is."""
    path, wanted = "closed-loop.recovery", "finite" if limit is None else f"max {format_plain(limit, 6)} s"
    loaded = [f["recovery_s"] for f in figures.values() if f["peak_um"] is not None]
    if not loaded:
        return Check(path, wanted, None, skipped="no scenario has a load")
    if None in loaded:
        return Check(path, wanted, None, f"{path}: a load is never rejected to 50 um ({wanted}): FAILED")
    value = max(loaded)
    failed = limit is not None and value > limit
    return Check(path, wanted, value, f"{path} = {format_plain(value, 3)} s ({wanted}): FAILED" if failed else "")


def _gate(gate: Mapping[str, Any]) -> Check:
    failure = "" if gate["passed"] else "; ".join(violations(gate)) or "a requirement is missed"
    return Check("closed-loop.gate", "equals True", gate["passed"], failure)


def _exported_c(found: Mapping[str, Any]) -> Check:
    path, wanted, value = "closed-loop.exported-c", f"max {format_plain(MAX_DIFFERENCE)} V", found["difference_v"]
    if value is None:
        return Check(path, wanted, None, skipped=found["reason"])
    failure = f"{path} = {format_plain(value, 3)} V ({wanted}): FAILED"
    return Check(path, wanted, value, "" if value <= MAX_DIFFERENCE else failure)
