"""``diff`` on the command line, with toy stages."""

import json
import shutil
from pathlib import Path

from tests.cli.conftest import Command
from tests.cli.test_commands import with_effects


def other_bench(bench: Path, *effects: str) -> Path:
    """A second pipeline on the same raw file."""
    folder = bench.parent / "other"
    folder.mkdir()
    for name in ("raw.csv", "bench.toml"):
        shutil.copy(bench.parent / name, folder)
    return with_effects(folder / "bench.toml", *effects)


def test_pipelines_are_compared_first_and_folders_read_as_they_are(pneucli: Command, bench: Path) -> None:
    other = other_bench(bench, "valve-lag", "valve-leak")
    first = pneucli("diff", bench, other, "--json")
    assert first.code == 0
    assert "running compare" in first.err
    answer = json.loads(first.out)
    assert answer["schema"] == "pneucli/diff/1"
    assert answer["effects"] == {"only_a": [], "only_b": ["valve-leak"]}
    assert (answer["a"]["error"]["test"], answer["b"]["error"]["test"]) == (2.0, 1.0)
    folders = [file.parent / "artifacts" / "bench" for file in (bench, other)]
    bench.unlink()
    again = pneucli("diff", *folders)
    assert again.err == ""
    assert "only B: valve-leak" in again.out
    assert "2.00 → 1.00 × noise" in again.out


def test_a_verdict_is_told_only_of_the_model_as_it_is(pneucli: Command, bench: Path) -> None:
    pneucli("diagnose", bench)
    pneucli("compare", bench)
    folder = bench.parent / "artifacts" / "bench"
    sides = json.loads(pneucli("diff", folder, folder, "--json").out)
    assert sides["a"]["verdict"] == "missing-effect"
    with_effects(bench, "valve-leak")
    (bench.parent / "raw.csv").write_text("t,p\n0,1\n1,3\n")
    sides = json.loads(pneucli("diff", bench, folder, "--json").out)
    assert sides["a"]["verdict"] is None


def test_a_folder_without_a_compared_model_is_an_input_error(pneucli: Command, bench: Path) -> None:
    pneucli("ingest", bench)
    result = pneucli("diff", bench.parent / "artifacts" / "bench", bench)
    assert result.code == 2
    assert "no model was compared there" in result.err
