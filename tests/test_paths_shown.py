"""Paths are shown from where the user stands."""

from pathlib import Path

import pytest

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
