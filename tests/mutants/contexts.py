"""A plug-in for pytest: the lines that each test runs and its processor time, in the file MUTANTS_CONTEXTS.

What several tests share, such as a fixture of their module, is counted by itself: a line that it runs matters to all of
them, and each of them alone would have to make it first.
"""

import json
import os
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import coverage
import pytest

_cover = coverage.Coverage(data_file=None, source=os.environ["MUTANTS_SOURCE"].split(","))
_cover.start()
_seconds: dict[str, float] = defaultdict(float)
_shares: dict[str, list[str]] = {}
_failed: list[str] = []
_stack = [""]
_since = 0.0


def name(nodeid: str) -> str:
    """Return a test's function; its parameters may depend on the code that is mutated."""
    return nodeid.partition("[")[0]


def shared(fixture: pytest.FixtureDef[object]) -> str:
    """Return the name of a fixture that several tests share."""
    return f"{fixture.baseid}:{fixture.argname}"


def _switch() -> float:
    """Count the time from now on for what is on top of the stack; return the time until now."""
    global _since
    now = time.process_time()
    passed, _since = now - _since, now
    _cover.switch_context(_stack[-1])
    return passed


@contextmanager
def _within(context: str) -> Iterator[None]:
    outer = _stack[-1]
    _stack.append(context)
    _seconds[outer] += _switch()
    try:
        yield
    finally:
        _stack.pop()
        _seconds[context] += _switch()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Function) -> Iterator[None]:
    found = [fixtures[-1] for fixtures in item._fixtureinfo.name2fixturedefs.values()]
    _shares[name(item.nodeid)] = sorted({shared(one) for one in found if one.scope != "function"})
    with _within(name(item.nodeid)):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[object]) -> Iterator[None]:
    if fixturedef.scope == "function":
        return (yield)
    with _within(shared(fixturedef)):
        return (yield)


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
    found = {"seconds": _seconds, "shares": _shares, "lines": lines, "failed": _failed}
    Path(os.environ["MUTANTS_CONTEXTS"]).write_text(json.dumps(found))
