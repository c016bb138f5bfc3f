"""The layout that the repository promises: small typed modules, documented, free of any one machine."""

from __future__ import annotations

import ast
import re
import statistics
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "pneucli"
TEXT = {".py", ".md", ".toml", ".html", ".js", ".css", ".yml", ".yaml", ".c", ".h", ".j2", ".sh", ""}
WHOLE = {"kernel/run.py", "kernel/balance.py"}  # compiled as one function, whose loop must not call out of itself
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if "/".join(path.parts[-2:]) not in WHOLE)


def tracked() -> list[Path]:
    """Text files under version control; all but hidden folders where there is no git (a source archive)."""
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode:
        found = [path for path in ROOT.rglob("*") if not any(part.startswith(".") for part in path.parts)]
    else:
        found = [ROOT / name for name in listing.stdout.split("\0") if name]
    return [path for path in found if path.is_file() and path.suffix in TEXT]


def packages() -> set[str]:
    return {path.parent.name for path in PACKAGE.glob("*/__init__.py")}


def functions(path: Path) -> Iterator[ast.FunctionDef]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def body_lines(function: ast.FunctionDef) -> int:
    """Lines of a function's body, its docstring not counted."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return body[-1].end_lineno - body[0].lineno + 1 if body and body[-1].end_lineno else 0


def test_no_file_names_a_path_of_one_machine() -> None:
    places = "|".join(["work", "tmp", "home", "root", "Users", "mnt"])
    path = re.compile(rf"(?<![\w./~$}}>*-])/(?:{places})/\w")
    found = [
        f"{file.relative_to(ROOT)}:{number}: {line.strip()[:80]}"
        for file in tracked()
        for number, line in enumerate(file.read_text(encoding="utf-8", errors="replace").splitlines(), 1)
        if path.search(line)
    ]
    assert not found, "\n".join(found)


def test_modules_are_short() -> None:
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    long = [f"{path.relative_to(ROOT)}: {lines} lines" for path, lines in lengths.items() if lines > 300]
    assert not long, "\n".join(long)


def test_functions_are_short_and_half_of_them_have_at_most_eight_lines() -> None:
    lengths = {f"{path.relative_to(ROOT)}: {f.name}": body_lines(f) for path in MODULES for f in functions(path)}
    assert statistics.median(lengths.values()) <= 8
    long = [f"{name}: {lines} lines" for name, lines in lengths.items() if lines > 45]
    assert not long, "\n".join(long)


def test_every_package_of_the_program_has_its_layer() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    named = {name.strip() for layer in layers for name in layer.split("|")}
    files = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}
    assert {f"pneucli.{name}" for name in files | packages()} <= named


def test_the_layers_are_described() -> None:
    page = (ROOT / "docs" / "development" / "architecture.md").read_text(encoding="utf-8")
    assert [name for name in packages() if not re.search(rf"\b{name}\b", page)] == []


@pytest.mark.parametrize("path", ["Makefile", ".ci/run", "LICENSE", "docs/development/architecture.md", "docs/cli.md"])
def test_what_a_newcomer_looks_for_is_there(path: str) -> None:
    assert (ROOT / path).is_file()


def test_ci_runs_make_test() -> None:
    assert "exec make test" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
