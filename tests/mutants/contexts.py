"""A plug-in for pytest: which lines each test runs, and how long it takes; written to the file ``MUTANTS_CONTEXTS``."""

from __future__ import annotations

import json
import os
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import coverage
import pytest

_cover = coverage.Coverage(data_file=None, source=os.environ["MUTANTS_SOURCE"].split(","))
_cover.start()
_seconds: dict[str, float] = defaultdict(float)
_failed: list[str] = []


def name(nodeid: str) -> str:
    """Return a test's function; its parameters may depend on the code that is mutated."""
    return nodeid.partition("[")[0]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    _cover.switch_context(name(item.nodeid))
    return (yield)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _seconds[name(report.nodeid)] += report.duration
    if report.failed:
        _failed.append(report.nodeid)


def pytest_sessionfinish() -> None:
    _cover.stop()
    data = _cover.get_data()
    here = Path.cwd()
    lines = {
        Path(file).relative_to(here).as_posix(): {
            line: [c for c in contexts if c] for line, contexts in data.contexts_by_lineno(file).items()
        }
        for file in data.measured_files()
    }
    found = {"seconds": _seconds, "lines": lines, "failed": _failed}
    Path(os.environ["MUTANTS_CONTEXTS"]).write_text(json.dumps(found))
