"""``report``: one HTML file, a Markdown summary, JUnit XML."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneucli import __version__
from pneucli.errors import InputError
from pneucli.io.artifacts import atomic_path, read_metadata, read_table
from pneucli.pipeline.checks import evaluate
from pneucli.pipeline.context import Context
from pneucli.report import Check, Material, Table, to_html, to_junit, to_markdown

SHOWN = ("ingest/signals", "compare/*", "identify/*", "diagnose/*", "design/*", "simulate/*")


def run(context: Context) -> dict[str, Any]:
    """Write the report of whatever the stages before have left; return what it holds, in brief."""
    context.progress("reading artifacts", 0.1)
    checks = [check(path, limit, context.answers, context.path.name) for path, limit in _limits(context).items()]
    tables = load_tables(context.artifacts)
    about = {"made by": f"pneucli {__version__}", "pipeline file": context.path.name}
    material = Material(context.config.name, context.answers, tables, checks, about)
    context.progress("drawing", 0.3)
    page = to_html(material)
    for name, text in (
        ("report.html", page),
        ("summary.md", to_markdown(material)),
        ("junit.xml", to_junit(material.name, checks)),
    ):
        with atomic_path(context.out / name) as path:
            path.write_text(text, encoding="utf-8")
    return {
        "schema": "pneucli/report/1",
        "pipeline": context.config.name,
        "files": ["report.html", "summary.md", "junit.xml"],
        "bytes": len(page.encode()),
        "checks": [{"path": c.path, "passed": not c.failure} for c in checks],
    }


def load_tables(artifacts: Path) -> dict[str, Table]:
    """Return the artifacts that a report may show, by ``"stage/file"``."""
    paths = sorted({path for pattern in SHOWN for path in artifacts.glob(f"{pattern}.parquet")})
    return {
        path.relative_to(artifacts).with_suffix("").as_posix(): Table(
            read_table(path), read_metadata(path).get("units", {})
        )
        for path in paths
    }


def _limits(context: Context) -> dict[str, dict[str, Any]]:
    return {path: limit.model_dump(exclude_none=True) for path, limit in context.config.checks.items()}


def check(path: str, limit: Mapping[str, Any], answers: Mapping[str, Mapping[str, Any]], where: str) -> Check:
    """Return what became of one check; one whose path leads nowhere has failed, and says so."""
    wanted = ", ".join(f"{kind} {value}" for kind, value in limit.items())
    try:
        (result,) = evaluate({path: limit}, answers, where)
    except InputError as error:
        return Check(path, wanted, None, str(error))
    return Check(path, wanted, result.value, "" if result.passed else str(result))


def describe(answer: dict[str, Any]) -> str:
    """Return a line for a person."""
    failed = [c["path"] for c in answer["checks"] if not c["passed"]]
    more = f"; failed checks: {', '.join(failed)}" if failed else ""
    return f"report/report.html ({answer['bytes'] / 1e6:.1f} MB), summary.md, junit.xml{more}"
