"""What can be told on Linux of how the program runs on Windows."""

import ast
from pathlib import Path

import pytest

from pneucli.init import writer

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
