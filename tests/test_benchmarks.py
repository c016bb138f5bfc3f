"""Every benchmark runs to its end in its small mode; what it then prints is no measurement."""

import importlib
import re
import shutil
from pathlib import Path

import pytest

from benchmarks import loop, robust
from benchmarks.cost import IMPORTS, PHASES

ROOT = Path(__file__).parents[1]
SHARED = {"axis", "cases", "door_pages", "rigs"}
TESTED_ELSEWHERE = {("simulate", "kernel")}  # tests/simulate/test_benchmark.py
NEED_GCC = {
    ("simulate", "fmu"),
    ("robust", "faults"),
    *(("loop", name) for name in loop.TABLES if name not in ("periods", "benefit")),
}
SLOW = {("door", ""), ("fleet", ""), ("score", ""), ("loop", "logs"), ("loop", "periods"), ("loop", "benefit"),
        *(("robust", name) for name in robust.TABLES), ("thesis", ""),
        ("thesis", "friction"), ("thesis", "laws"), ("valve", "maps"),
        ("workbench", "speed"), ("workbench", "clicks")}  # fmt: skip
BENCHMARKS = sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py") if path.stem not in SHARED)


def tables() -> list[tuple[str, str]]:
    """Every benchmark with each of its tables; "" where it has one."""
    modules = [(name, importlib.import_module(f"benchmarks.{name}")) for name in BENCHMARKS]
    named = [(name, table) for name, module in modules for table in getattr(module, "TABLES", [""])]
    return [one for one in named if one not in TESTED_ELSEWHERE]


@pytest.mark.parametrize(
    ("name", "table"), [pytest.param(*one, marks=[pytest.mark.slow] if one in SLOW else []) for one in tables()]
)
def test_a_benchmark_finishes_in_its_small_mode(name: str, table: str, capsys: pytest.CaptureFixture[str]) -> None:
    if (name, table) in NEED_GCC and shutil.which("gcc") is None:
        pytest.skip("no gcc")
    arguments = [*([table] if table else []), "--small"]
    assert importlib.import_module(f"benchmarks.{name}").main(arguments) in (None, 0)
    printed = capsys.readouterr().out
    assert re.search(r"\d", printed), printed
    assert "Error" not in printed


def test_each_phase_is_a_function_of_the_program() -> None:
    places = [place for phase, those in PHASES.items() if phase != IMPORTS for place in those]
    files = {path.as_posix(): path.read_text(encoding="utf-8") for path in (ROOT / "pneucli").rglob("*.py")}
    for file, name in places:
        assert any(path.endswith(f"/{file}") and f"def {name}(" in text for path, text in files.items()), (file, name)


def test_the_page_of_benchmarks_lists_each_of_them() -> None:
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == BENCHMARKS
