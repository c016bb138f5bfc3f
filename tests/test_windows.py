"""What can be told on Linux of how the program runs on Windows."""

from __future__ import annotations

import ast
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

import pytest

from pneucli.init import writer
from pneucli.pipeline import lock

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


class Held(ModuleType):
    """Stands in for msvcrt: a byte of a file that one descriptor may hold; waiting gives up, as LK_LOCK does."""

    LK_LOCK, LK_NBLCK = 1, 2

    def __init__(self) -> None:
        super().__init__("msvcrt")
        self.holder: int | None = None
        self.calls: list[tuple[int, int]] = []

    def locking(self, descriptor: int, mode: int, size: int) -> None:
        assert size == 1
        assert os.lseek(descriptor, 0, os.SEEK_CUR) >= 1 << 30  # beyond what others read
        self.calls.append((descriptor, mode))
        if self.holder is not None:
            if len(self.calls) > 3:
                self.holder = None  # the other run ends
            raise OSError(36, "resource deadlock avoided")
        self.holder = descriptor


def test_the_lock_of_windows_waits_until_the_other_run_has_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = Held()
    monkeypatch.setitem(sys.modules, "msvcrt", fake)
    spec = importlib.util.spec_from_file_location("lock_of_windows", str(lock.__file__))
    assert spec is not None
    twin = importlib.util.module_from_spec(spec)
    with monkeypatch.context() as context:
        context.setattr(sys, "platform", "win32")
        spec.loader.exec_module(twin)  # type: ignore[union-attr]
    said: list[str] = []
    with twin.folder_lock(tmp_path, said.append):
        assert (tmp_path / lock.LOCK_FILE).read_text() == str(os.getpid())
        assert [mode for _, mode in fake.calls] == [fake.LK_NBLCK]
        fake.calls.clear()
    fake.holder = 0  # another run
    with twin.folder_lock(tmp_path, said.append):
        assert [mode for _, mode in fake.calls] == [fake.LK_NBLCK, *[fake.LK_LOCK] * 4]
    assert len(said) == 1
    assert said[0].startswith("waiting for another run")


def test_a_file_on_another_drive_is_named_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def relpath(path: str, start: Path) -> str:
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr(writer.os.path, "relpath", relpath)
    assert writer.relative_path("D:/raw/a_*.csv", tmp_path) == "D:/raw/a_*.csv"
