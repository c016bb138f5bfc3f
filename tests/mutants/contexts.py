"""A plug-in for pytest: the lines that each test runs and its processor time, in the file MUTANTS_CONTEXTS."""

from __future__ import annotations

import json
import os
import time
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
    began = time.process_time()
    try:
        return (yield)
    finally:
        _seconds[name(item.nodeid)] += time.process_time() - began


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
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
