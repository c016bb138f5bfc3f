"""The layout that the repository promises: small typed modules, documented, free of any one machine."""

import ast
import re
import shutil
import statistics
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from pneucli.physics.effects import catalogue

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "pneucli"
TEXT = {".py", ".md", ".toml", ".html", ".js", ".css", ".yml", ".yaml", ".c", ".h", ".j2", ".sh", ""}
HOOK = ROOT / ".githooks" / "commit-msg"
WHOLE = {"kernel/run.py", "kernel/balance.py"}  # compiled as one function, whose loop must not call out of itself
Program = dict[Path, tuple[str, ast.Module]]
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


@pytest.fixture(scope="module")
def program() -> Program:
    """Text and syntax tree of every module."""
    texts = {path: path.read_text(encoding="utf-8") for path in MODULES}
    return {path: (text, ast.parse(text)) for path, text in texts.items()}


def functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
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


def code_lines(text: str, tree: ast.Module) -> int:
    """Lines of a module without its docstrings, which specify and may be as long as that takes."""
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    nodes = (node for node in ast.walk(tree) if isinstance(node, kinds) and ast.get_docstring(node))
    docstrings = sum((node.body[0].end_lineno or 0) - node.body[0].lineno + 1 for node in nodes)
    return len(text.splitlines()) - docstrings


MAX_LINES = 600  # what a command answers, its types and its words, is one module


def test_modules_are_short(program: Program) -> None:
    lengths = {path: code_lines(*of) for path, of in program.items()}
    long = [f"{path.relative_to(ROOT)}: {lines} lines" for path, lines in lengths.items() if lines > MAX_LINES]
    assert not long, "\n".join(long)


def test_functions_are_short_and_half_of_them_have_at_most_eight_lines(program: Program) -> None:
    found = {f"{path.relative_to(ROOT)}: {f.name}": f for path, (_, tree) in program.items() for f in functions(tree)}
    lengths = {name: body_lines(function) for name, function in found.items()}
    assert statistics.median(lengths.values()) <= 8
    long = [f"{name}: {lines} lines" for name, lines in lengths.items() if lines > 45]
    assert not long, "\n".join(long)


def string_literals(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and value of each string in the code of a module; docstrings are no code."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docs = {
        id(node.body[0].value) for node in ast.walk(tree) if isinstance(node, documented) and ast.get_docstring(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            yield node.lineno, node.value


def test_no_effect_of_the_catalogue_is_named_outside_it_and_the_exam(program: Program) -> None:
    """What is true of one effect alone stands in its declaration, so that a user's own effect is treated alike.

    Help texts show the use of real names.
    """
    apart = ("physics/effects", "exam", "cli/commands")
    names = "|".join(re.escape(name) for name in sorted(catalogue(), key=len, reverse=True))
    named = re.compile(rf"(?<![\w-])(?:{names})(?![\w-])")
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text[:60]}"
        for path, (_, tree) in program.items()
        if not path.relative_to(PACKAGE).as_posix().startswith(apart)
        for line, text in string_literals(tree)
        if named.search(text)
    ]
    assert not found, "\n".join(found)


def test_the_normal_quantile_of_95_percent_intervals_is_written_once(program: Program) -> None:
    quantile = re.compile(r"1\.9599|1\.96\b|ppf\(0\.975\)")
    found = [path.relative_to(PACKAGE).as_posix() for path, (text, _) in program.items() if quantile.search(text)]
    assert found == ["quantities.py"]


def test_every_package_of_the_program_has_its_layer() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    named = {name.strip() for layer in layers for name in layer.split("|")}
    files = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}
    assert {f"pneucli.{name}" for name in files | packages()} <= named


def test_the_layers_are_described() -> None:
    page = (ROOT / "docs" / "development" / "architecture.md").read_text(encoding="utf-8")
    assert [name for name in packages() if not re.search(rf"\b{name}\b", page)] == []


def git(*arguments: str) -> str:
    """What git prints; nothing where this is no checkout or git is not installed."""
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        return ""
    command = ["git", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, encoding="utf-8", check=False).stdout


def subjects_since_the_hook() -> list[str]:
    """Subjects of the last fifty commits after the last change of the hook's rules, as far as the clone has them."""
    changed = git("log", "-1", "--format=%H", "--", HOOK.relative_to(ROOT).as_posix()).strip()
    return git("log", "-50", "--no-merges", "--format=%s", f"{changed}..HEAD").splitlines() if changed else []


def refusal(subject: str, folder: Path) -> str:
    """What the hook prints about a commit with this subject; nothing where it accepts it."""
    if shutil.which("sh") is None:
        pytest.skip("no POSIX shell")
    message = folder / "message"
    message.write_text(f"# a comment\n{subject}\n\nWhy it was done. It ended.\n", encoding="utf-8")
    run = subprocess.run(["sh", HOOK, message], capture_output=True, text=True, encoding="utf-8", check=False)
    assert (run.returncode == 0) == (run.stderr == "")
    return run.stderr


@pytest.mark.parametrize(
    ("subject", "reason"),
    [
        ("Add a test", ""),
        ("Fleet: store results", ""),
        ("Feed the observer", ""),
        ("Bring the page up to date", ""),
        ("Read 95 °C as a temperature " + "ü" * 44, ""),
        ("Read 95 °C as a temperature " + "ü" * 45, "73 characters"),
        ("add a test", "capital"),
        ("Add a test.", "period"),
        ("Added a test", "imperative"),
        ("Storing results", "imperative"),
        ("Fleet: stored results", "imperative"),
    ],
)
def test_a_subject_is_short_imperative_and_no_sentence(subject: str, reason: str, tmp_path: Path) -> None:
    found = refusal(subject, tmp_path)
    assert (reason in found) if reason else found == ""


def test_a_blank_line_separates_subject_and_body(tmp_path: Path) -> None:
    assert "not blank" in refusal("Add a test\nbecause it was missing", tmp_path)


def test_the_last_commits_keep_the_rules_of_the_hook(tmp_path: Path) -> None:
    assert [text for subject in subjects_since_the_hook() if (text := refusal(subject, tmp_path))] == []


def test_make_installs_the_hook_only_in_a_checkout(tmp_path: Path) -> None:
    """The recipe runs in a copy of the Makefile: with git the hook is set, in a source archive nothing happens."""
    if shutil.which("make") is None or shutil.which("git") is None:
        pytest.skip("no make or no git")
    shutil.copy(ROOT / "Makefile", tmp_path)
    make = ["make", "--no-print-directory", "hooks"]
    configured = ["git", "config", "--local", "core.hooksPath"]
    subprocess.run(make, cwd=tmp_path, check=True)
    assert subprocess.run(configured, cwd=tmp_path, capture_output=True, check=False).returncode != 0
    subprocess.run(["git", "init", "--quiet"], cwd=tmp_path, check=True)
    subprocess.run(make, cwd=tmp_path, check=True)
    assert subprocess.run(configured, cwd=tmp_path, capture_output=True, text=True, check=True).stdout == ".githooks\n"
    assert HOOK.stat().st_mode & 0o111
