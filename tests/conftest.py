"""Compiled kernels are shared by all tests and runs of them, and kept apart from the user's own."""

from __future__ import annotations

import getpass
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("PNEUCLI_CACHE", str(Path(tempfile.gettempdir(), f"pneucli-tests-{getpass.getuser()}")))

# the same examples each time: a run that fails says that something changed
settings.register_profile("pneucli", derandomize=True, deadline=None, max_examples=40)
settings.load_profile("pneucli")

# simulations with a controller; together, so that one of the processes of a run compiles their large kernels
WITH_CONTROLLER = ("closed_loop", "controller", "design", "export", "stages/test_design", "test_benchmarks", "exam")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests that simulate a controller first; processes get contiguous shares of all tests."""
    here = Path(__file__).parent
    items.sort(key=lambda item: not item.path.relative_to(here).as_posix().startswith(WITH_CONTROLLER))
