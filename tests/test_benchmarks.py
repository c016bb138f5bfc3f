"""Every benchmark runs to its end in its small mode; what it then prints is no measurement."""

from __future__ import annotations

import importlib
import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SHARED = {"cases", "measure", "rigs", "small"}  # what benchmarks share: no benchmark of their own
TESTED_ELSEWHERE = {"simulate"}  # tests/simulate/test_benchmark.py
NEED_GCC = {"exam_loop", "gate", "laws", "level", "machine_logs", "plant_fmu", "precision"}
SLOW = {
    "arrangements",
    "fleet",
    "foreign_rigs",
    "learning",
    "machine_logs",
    "periods",
    "thesis_friction",
    "thesis_laws",
}
BENCHMARKS = sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py") if path.stem not in SHARED)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else [])
        for name in BENCHMARKS
        if name not in TESTED_ELSEWHERE
    ],
)
def test_a_benchmark_finishes_in_its_small_mode(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    if name in NEED_GCC and shutil.which("gcc") is None:
        pytest.skip("no gcc")
    assert importlib.import_module(f"benchmarks.{name}").main(["--small"]) in (None, 0)
    printed = capsys.readouterr().out
    assert re.search(r"\d", printed), printed
    assert "Error" not in printed


def test_the_page_of_benchmarks_lists_each_of_them() -> None:
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == BENCHMARKS
