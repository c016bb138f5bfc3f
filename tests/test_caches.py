"""Compiled functions are kept where there is a place for them, and made anew where what is kept is damaged."""

import importlib.util
import logging
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from pneucli import caches, paths
from pneucli.paths import cache_folder
from pneucli.simulate import build

TEXT = """
from pneucli.caches import compiled

@compiled()
def twice(x):
    return 2.0 * x
"""


def loaded(path: Path) -> ModuleType:
    """Import a module from its file, as a new process does."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def hits(module: ModuleType) -> int:
    return sum(module.twice.stats.cache_hits.values())


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """A module whose function has been compiled and kept."""
    path = tmp_path / "kept.py"
    path.write_text(TEXT)
    assert loaded(path).twice(1.0) == 2.0
    again = loaded(path)
    assert (again.twice(1.0), hits(again)) == (2.0, 1)
    return path


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize("harm", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b"foreign"])
def test_a_truncated_or_foreign_cache_is_compiled_again_and_stored(
    kept: Path, kind: str, harm: Callable[[bytes], bytes]
) -> None:
    (file,) = (kept.parent / "__pycache__").glob(f"*.{kind}")
    file.write_bytes(harm(file.read_bytes()))
    mended, again = loaded(kept), loaded(kept)
    assert (mended.twice(1.0), hits(mended)) == (2.0, 0)
    assert (again.twice(1.0), hits(again)) == (2.0, 1)


def test_a_disk_that_is_full_does_not_stop_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "full.py"
    path.write_text(TEXT)

    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", full)
    assert loaded(path).twice(1.0) == 2.0
    assert [r.getMessage() for r in caplog.records if "No space left" in r.getMessage()]


def test_a_kernels_text_that_is_foreign_is_written_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(caches, "cache_folder", lambda: tmp_path)
    text = "".join(f"def {name}():\n    return 1\n" for name in build.ENTRY_POINTS)
    path = Path(str(build._load(text).__file__))
    path.write_text("raise SystemExit('foreign')")
    monkeypatch.delitem(sys.modules, path.stem)
    assert build._load(text).run() == 1
    assert path.read_text() == text


def test_a_read_only_home_gives_a_temporary_cache_and_one_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "home").write_text("a file, where a folder should be made")
    monkeypatch.setenv("PNEUCLI_CACHE", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with caplog.at_level(logging.WARNING):
        first, second = cache_folder(), cache_folder()
    assert first == second
    assert first.parent == tmp_path
    assert first.stat().st_mode & 0o077 == 0
    assert len(caplog.records) == 1


def test_a_temporary_folder_that_others_can_write_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    open_to_all = paths._temporary()
    open_to_all.chmod(0o777)
    assert paths._temporary() != open_to_all


def test_a_kept_function_is_loaded_without_the_types_of_all_of_numpy(tmp_path: Path) -> None:
    """They are registered once something is compiled, which may call the loaded function."""
    (tmp_path / "kept.py").write_text(TEXT)
    use = (
        f"import sys, numba; sys.path.insert(0, {str(tmp_path)!r}); from kept import twice; assert twice(1.5) == 3.0\n"
    )
    check = """
assert sum(twice.stats.cache_hits.values()) == 1
assert "numba.cpython.setobj" not in sys.modules
assert numba.njit(lambda x: twice(x) + 1.0)(2.0) == 5.0
assert "numba.cpython.setobj" in sys.modules
"""
    for code in (use, use + check):
        subprocess.run([sys.executable, "-c", code], check=True)
