"""The fleet as OpenMetrics text, for the textfile collector of Prometheus' node exporter."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

PREFIX = "pneucli_fleet"


def to_openmetrics(answer: Mapping[str, Any], results: Sequence[Mapping[str, Any]]) -> str:
    """Return gauges by fleet: rigs, rows by verdict, rigs changed by name, failures by cause, seconds."""
    return "\n".join([*_lines(answer, results), "# EOF", ""])


def _lines(answer: Mapping[str, Any], results: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    fleet = answer["fleet"]
    plain = {"rigs": "Rigs in the table.", "rows": "Rows in the table: a rig at a date.", "failed": "Rows that failed.",
             "changed": "Rigs in which something changed.", "done": "Rows that were done in the last run."}  # fmt: skip
    for name, about in plain.items():
        yield from _gauge(name, about, [({"fleet": fleet}, answer[name])])
    latest = {r["rig"]: r for r in sorted(results, key=lambda r: str(r["date"]))}.values()
    verdicts = Counter(r["verdict"] or "failed" for r in latest)
    yield from _gauge("verdict", "Rigs by the verdict at their last date.", _by(fleet, "verdict", verdicts))
    changes = Counter(one["name"] for r in latest for one in r["changes"])
    yield from _gauge("change", "Rigs by what changed in them, at their last date.", _by(fleet, "name", changes))
    causes = {one["cause"]: one["rows"] for one in answer["failures"]}
    yield from _gauge("failure", "Rows that failed, by cause.", _by(fleet, "cause", causes))
    for name, about in {"seconds": "Seconds", "core_seconds": "Processor seconds"}.items():
        busy = sum(float(r.get(name) or 0.0) for r in results)
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
