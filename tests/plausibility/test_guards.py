"""No guard contradicts a true recording, at any rate of logging; see also ``python -m benchmarks.guards``."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from .worlds import FIXTURES, SHARED, at_rate, read, world_pipelines

WORLDS = {world: paths for world, paths in world_pipelines().items() if world != "fixtures"}
EVERY = 6  # of each world; the others in "make test-all", and in benchmarks.guards
PATHS = [
    pytest.param(path, id=f"{path.parent.name}-{path.stem}", marks=[pytest.mark.slow] if number % EVERY else [])
    for paths in WORLDS.values()
    for number, path in enumerate(paths)
]
SMALL = [path for path in FIXTURES if path.parent.name != "demo"]
fixture = cache(read)  # each at several rates


@pytest.mark.parametrize("path", FIXTURES, ids=lambda path: path.parent.name)
def test_nothing_is_found_in_the_fixtures(path: Path) -> None:
    assert fixture(path).alarms() == {}


@pytest.mark.parametrize("rate", [100.0, 3e3])
@pytest.mark.parametrize("path", SMALL, ids=lambda path: path.parent.name)
def test_nothing_is_found_in_the_fixtures_at_another_rate(path: Path, rate: float) -> None:
    assert at_rate(fixture(path), rate).alarms() == {}


@pytest.mark.real
@pytest.mark.skipif(not SHARED.is_dir(), reason="the worlds of others are not here (PNEUCLI_SHARED)")
@pytest.mark.parametrize("path", PATHS)
def test_nothing_is_contradicted_in_the_worlds_of_others(path: Path) -> None:
    """As recorded, and at 100 Hz; a doubt is allowed."""
    bench = read(path)
    for one in (bench, at_rate(bench, 100.0)):
        assert not [check for check, weight in one.alarms() if weight == "contradiction"]
