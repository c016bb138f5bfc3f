"""Write the page of a fleet, JUnit for CI, and metrics for a monitor."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pneucli.config import FleetConfig
from pneucli.fleet.openmetrics import to_openmetrics
from pneucli.fleet.page import to_html
from pneucli.fleet.trends import Trend
from pneucli.io.artifacts import atomic_path
from pneucli.pipeline.checks import CheckResult, evaluate
from pneucli.report.junit import to_junit
from pneucli.report.report_data import Check

PAGE, JUNIT, METRICS, ANSWER = "report.html", "junit.xml", "metrics.txt", "fleet.json"


def write_outputs(
    out: Path,
    config: FleetConfig,
    answer: Mapping[str, Any],
    results: Sequence[Mapping[str, Any]],
    trends: Sequence[Trend],
) -> None:
    """Write these files and the answer into the folder ``out``, each file atomically."""
    texts = {
        PAGE: to_html(answer, results, trends),
        JUNIT: to_junit(config.fleet.name, [*map(_of_row, results), *map(_of_check, evaluate_checks(config, answer))]),
        METRICS: to_openmetrics(answer, results),
        ANSWER: json.dumps(answer, indent=1, allow_nan=False) + "\n",
    }
    for name, text in texts.items():
        with atomic_path(out / name) as path:
            path.write_text(text, encoding="utf-8")


def evaluate_checks(config: FleetConfig, answer: Mapping[str, Any]) -> list[CheckResult]:
    """Evaluate ``[checks]`` of the fleet file, whose paths begin with ``fleet``.

    Raises InputError where a path leads nowhere.
    """
    tables = {path: table.model_dump(exclude_none=True) for path, table in config.checks.items()}
    return evaluate(tables, {"fleet": answer}, f"{config.path}, [checks]")


def _of_row(result: Mapping[str, Any]) -> Check:
    changed = ", ".join(one["name"] for one in result["changes"])
    failure = result["failure"] or (f"changed since {result['since']}: {changed}" if changed else "")
    return Check(f"{result['rig']}.{result['date']}", "unchanged", result["verdict"] or "failed", failure)


def _of_check(result: CheckResult) -> Check:
    wanted = ", ".join(f"{kind} {limit}" for kind, limit in result.limit.items())
    return Check(result.path, wanted, result.value, "" if result.passed else str(result))
