"""Every benchmark runs to its end in its small mode; what it then prints is no measurement."""

import ast
import importlib
import re
import shutil
import sys
from pathlib import Path

import pytest

from benchmarks import loop, robust
from benchmarks.cost import IMPORTS, KERNELS, PHASES, REST, Sampler

ROOT = Path(__file__).parents[1]
SHARED = {"cases", "door_pages", "rigs"}
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


def calls_equations(node: ast.AST) -> bool:
    """Whether this is a call of a kernel, or of one of its functions."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
        return False
    where = ast.unparse(node.func.value)
    return where.endswith(".functions") or (where == "kernel" and node.func.attr in ("run", "run_duals"))


def test_whatever_calls_compiled_equations_in_fits_and_comparisons_is_counted() -> None:
    package = ROOT / "pneucli"
    found = {
        (f"{path.parent.name}/{path.name}", function.name)
        for folder in ("simulate", "identify/residuals", "diagnose", "compare")
        for path in (package / folder).rglob("*.py")
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(function, ast.FunctionDef) and any(calls_equations(node) for node in ast.walk(function))
    }
    assert found == KERNELS


def test_a_process_is_sampled_in_the_phase_of_its_innermost_function() -> None:
    sampler, named = Sampler(), {}
    source = "def signatures_of(then): then()\ndef fit_with_effect(then): then()\ndef other(then): then()"
    for file in ("diagnose/data.py", "estimation/model_fit.py"):
        exec(compile(source, f"/somewhere/{file}", "exec"), named.setdefault(file, {}))
    screen, refit = named["diagnose/data.py"]["signatures_of"], named["estimation/model_fit.py"]["fit_with_effect"]
    take = lambda: sampler._sample(0, sys._getframe())  # noqa: E731
    for outer in (take, lambda: screen(take), lambda: screen(lambda: refit(take))):
        outer()
    assert set(sampler.seconds) == {REST, "screen", "refits"}


def test_the_page_of_benchmarks_lists_each_of_them() -> None:
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == BENCHMARKS
