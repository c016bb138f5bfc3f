"""Write the page of a fleet, JUnit for CI, and metrics for a monitor."""

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pneucli.config import FleetConfig
from pneucli.figure import to_answer, to_json
from pneucli.fleet.row_files import RowResult, Trend
from pneucli.io.artifacts import write_text
from pneucli.messages.changes import Change
from pneucli.messages.fleet import Answer
from pneucli.pipeline.checks import CheckResult, evaluate
from pneucli.report.page import as_data, render_template
from pneucli.report.report_data import Check
from pneucli.report.summaries import to_junit

MAX_TREND_BYTES = 2_000_000  # of the trends: those of the first rigs of the list, as far as they fit
MAX_TREND_POINTS = 40  # of one trend: the last dates
MAX_FAILURE_CHARACTERS = 240
PREFIX = "pneucli_fleet"
PAGE, JUNIT, METRICS, ANSWER = "report.html", "junit.xml", "metrics.txt", "fleet.json"


def to_html(answer: Answer, results: Sequence[RowResult], trends: Sequence[Trend]) -> str:
    """Return the page: changed rigs, missing effects over the fleet, trends, failures by cause."""
    content = {"answer": answer, "data": as_data(page_data(answer, results, trends))}
    return render_template("pneucli.fleet", "fleet.html.j2", ("fleet.css",), ("fleet.js",), content)


def page_data(answer: Answer, results: Sequence[RowResult], trends: Sequence[Trend]) -> dict[str, Any]:
    """Return the page's data: a list for each rig, the most changed first, with texts by their number."""
    by_rig: dict[str, list[RowResult]] = {}
    for one in sorted(results, key=lambda r: r.date):
        by_rig.setdefault(one.rig, []).append(one)
    texts: dict[str, int] = {}
    trends_by_rig: dict[str, list[Trend]] = {}
    for trend in trends:
        trends_by_rig.setdefault(trend.rig, []).append(trend)
    broken = {t.rig for t in trends if t.change_points}
    ranked = sorted(by_rig, key=lambda rig: (-_log_evidence(by_rig[rig]), rig not in broken, rig))
    rows = [_rig(rig, by_rig[rig], texts, trends_by_rig.get(rig, [])) for rig in ranked]
    panels = _trend_panels(ranked, trends_by_rig, texts)  # before the list of texts, to which it adds
    return {"rigs": rows, "words": list(texts), "trends": panels, "failures": to_json(answer.failures),
            "missing": answer.missing, "changes": _rigs_by_change(results)}  # fmt: skip


def _rigs_by_change(results: Sequence[RowResult]) -> dict[str, int]:
    counts: dict[str, set[str]] = {}
    for result in results:
        for one in result.changes:
            counts.setdefault(one.name, set()).add(result.rig)
    return {name: len(rigs) for name, rigs in sorted(counts.items(), key=lambda c: -len(c[1]))}


def _log_evidence(results: Sequence[RowResult]) -> float:
    """Return -log10 of a rig's smallest p-value, 0 where nothing changed."""
    p_values = [max(r.p_value or 0.0, 1e-99) for r in results if r.changes]
    return -math.log10(min(p_values)) if p_values else 0.0


def _rig(rig: str, results: Sequence[RowResult], texts: dict[str, int], trends: Sequence[Trend]) -> list[Any]:
    """Return a rig's row in the order of the columns in fleet.js."""
    last = results[-1]
    changed = next((r for r in reversed(results) if r.changes), None)
    failure = next((r for r in reversed(results) if r.failure), None)
    report = (changed or last).report
    return [
        rig,
        _text_number(last.date, texts),
        len(results),
        _text_number(last.verdict or "failed", texts),
        [_text_number(name, texts) for name in last.missing],
        [] if changed is None else [_change(one, texts) for one in changed.changes],
        round(_log_evidence(results), 1),
        None if last.error_test is None else float(f"{last.error_test:.3g}"),
        None
        if failure is None
        else [_text_number(str(failure.cause), texts), str(failure.failure)[:MAX_FAILURE_CHARACTERS]],
        None if report is None else quote(report),
        [_text_number(t.name, texts) for t in trends if t.change_points],
    ]


def _change(one: Change, texts: dict[str, int]) -> list[Any]:
    sizes = (one.before, one.after.value)
    numbers = [None if size is None or math.isnan(size) else float(f"{size:.4g}") for size in sizes]
    return [_text_number(one.name, texts), *numbers, _text_number(one.after.unit, texts)]


def _text_number(text: str, texts: dict[str, int]) -> int:
    return texts.setdefault(str(text), len(texts))


def _trend_panels(
    ranked: Sequence[str], trends_by_rig: Mapping[str, Sequence[Trend]], texts: dict[str, int]
) -> list[Any]:
    """Return the trends of the first rigs of the list, as many as MAX_TREND_BYTES allow."""
    out: list[Any] = []
    room = MAX_TREND_BYTES
    for number, rig in enumerate(ranked):
        for t in trends_by_rig.get(rig, ()):
            first = max(len(t.values) - MAX_TREND_POINTS, 0)
            values = [float(f"{v:.4g}") for v in t.values[first:]]
            errors = [float(f"{e:.2g}") for e in t.errors[first:]]
            breaks = [b - first for b in t.change_points if b >= first]
            names = [
                _text_number(t.name, texts),
                _text_number(t.unit, texts),
                _text_number(t.dates[first], texts),
                _text_number(t.dates[-1], texts),
            ]
            one = [number, *names, values, errors, breaks]
            room -= len(json.dumps(one, separators=(",", ":")))
            if room < 0:
                return out
            out.append(one)
    return out


def to_openmetrics(answer: Answer, results: Sequence[RowResult]) -> str:
    """Return gauges by fleet: rigs, rows by verdict, rigs changed by name, failures by cause, seconds."""
    return "\n".join([*_lines(answer, results), "# EOF", ""])


def _lines(answer: Answer, results: Sequence[RowResult]) -> Iterator[str]:
    fleet = answer.fleet
    plain = {"rigs": "Rigs in the table.", "rows": "Rows in the table: a rig at a date.", "failed": "Rows that failed.",
             "changed": "Rigs in which something changed.", "done": "Rows that were done in the last run."}  # fmt: skip
    for name, about in plain.items():
        yield from _gauge(name, about, [({"fleet": fleet}, getattr(answer, name))])
    latest = {r.rig: r for r in sorted(results, key=lambda r: r.date)}.values()
    verdicts = Counter(r.verdict or "failed" for r in latest)
    yield from _gauge("verdict", "Rigs by the verdict at their last date.", _by(fleet, "verdict", verdicts))
    changes = Counter(one.name for r in latest for one in r.changes)
    yield from _gauge("change", "Rigs by what changed in them, at their last date.", _by(fleet, "name", changes))
    causes = {one.cause: one.rows for one in answer.failures}
    yield from _gauge("failure", "Rows that failed, by cause.", _by(fleet, "cause", causes))
    for name, about in {"seconds": "Seconds", "core_seconds": "Processor seconds"}.items():
        busy = sum(float(getattr(r, name)) for r in results)
        yield from _gauge(f"worker_{name}", f"{about} that workers took for all rows.", [({"fleet": fleet}, busy)])


def _by(fleet: str, label: str, counts: Mapping[str, int]) -> list[tuple[dict[str, str], float]]:
    return [({"fleet": fleet, label: name}, number) for name, number in sorted(counts.items())]


def _gauge(name: str, about: str, samples: Sequence[tuple[Mapping[str, str], float]]) -> Iterator[str]:
    yield f"# TYPE {PREFIX}_{name} gauge"
    yield f"# HELP {PREFIX}_{name} {about}"
    for labels, value in samples:
        inside = ",".join(f'{key}="{_escaped(text)}"' for key, text in labels.items())
        yield f"{PREFIX}_{name}{{{inside}}} {value:g}"


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def write_outputs(
    out: Path,
    config: FleetConfig,
    answer: Answer,
    results: Sequence[RowResult],
    trends: Sequence[Trend],
) -> dict[str, Any]:
    """Write these files and the answer into the folder ``out``, each file atomically; return the answer as JSON."""
    stated = to_answer(answer)
    texts = {
        PAGE: to_html(answer, results, trends),
        JUNIT: to_junit(config.fleet.name, [*map(_of_row, results), *map(_of_check, evaluate_checks(config, stated))]),
        METRICS: to_openmetrics(answer, results),
        ANSWER: json.dumps(stated, indent=1, allow_nan=False) + "\n",
    }
    for name, text in texts.items():
        write_text(out / name, text)
    return stated


def evaluate_checks(config: FleetConfig, answer: Mapping[str, Any]) -> list[CheckResult]:
    """Evaluate ``[checks]`` of the fleet file, whose paths begin with ``fleet``.

    Raises InputError where a path leads nowhere.
    """
    tables = {path: table.model_dump(exclude_none=True) for path, table in config.checks.items()}
    return evaluate(tables, {"fleet": answer}, f"{config.path}, [checks]")


def _of_row(result: RowResult) -> Check:
    changed = ", ".join(one.name for one in result.changes)
    failure = result.failure or (f"changed since {result.since}: {changed}" if changed else "")
    return Check(f"{result.rig}.{result.date}", "unchanged", result.verdict or "failed", failure)


def _of_check(result: CheckResult) -> Check:
    wanted = ", ".join(f"{kind} {limit}" for kind, limit in result.limit.items())
    return Check(result.path, wanted, result.value, "" if result.passed else str(result))
