"""The exam's rig as plain Python: small pieces of it are run without waiting for a compiler."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from pneucli.exam.rig import gas, kernel, simulation


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """All functions of the kernel and of its loop, not compiled; they call each other uncompiled too."""
    for module in (gas, kernel, simulation):
        for name, value in list(vars(module).items()):
            if hasattr(value, "py_func"):
                monkeypatch.setattr(module, name, value.py_func)
    return SimpleNamespace(**{**vars(gas), **vars(kernel), **vars(simulation)})
