"""Paths are shown from where the user stands."""

import ast
from pathlib import Path

import pytest

from pneucli.init import writer
from pneucli.paths import from_here


@pytest.mark.parametrize(
    ("path", "shown"),
    [
        ("here/raw/a.csv", "raw/a.csv"),
        ("beside/a.csv", "../beside/a.csv"),
        ("../far/a.csv", "../../far/a.csv"),
        ("hereafter/a.csv", "../hereafter/a.csv"),
    ],
)
def test_a_path_starts_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str, shown: str
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    whole = (tmp_path / path).resolve() if ".." in path else tmp_path / path
    assert from_here(f"{whole}, line 3: no column") == f"{shown}, line 3: no column"
    assert from_here(f'file "{whole}"') == f'file "{shown}"'


def test_a_path_elsewhere_and_one_that_is_relative_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for text in ("/elsewhere/a.csv", f"other{tmp_path}/a.csv", "raw/a.csv"):
        assert from_here(text) == text
    monkeypatch.chdir("/")
    assert from_here("/etc/a.csv") == "/etc/a.csv"


# --- what can be told on Linux of how the program runs on Windows


PACKAGE = Path(__file__).parents[1] / "pneucli"
POSIX_MODULES = {"fcntl", "grp", "posix", "pwd", "resource", "syslog", "termios", "tty"}
POSIX_CALLS = {"fork", "getuid", "geteuid", "getpgid", "killpg", "mkfifo", "nice", "pread", "pwrite",
               "sched_getaffinity", "setsid", "statvfs", "sync", "sysconf", "uname", "wait", "waitpid"}  # fmt: skip


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_what_only_posix_has_is_asked_for_first(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    assert not imported & POSIX_MODULES or "sys.platform ==" in text
    used = {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and getattr(n.value, "id", "") == "os"}
    assert [name for name in used & POSIX_CALLS if f'hasattr(os, "{name}")' not in text] == []


def test_a_file_on_another_drive_is_named_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def relpath(path: str, start: Path) -> str:
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr(writer.os.path, "relpath", relpath)
    assert writer.relative_path("D:/raw/a_*.csv", tmp_path) == "D:/raw/a_*.csv"
