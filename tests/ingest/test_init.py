"""``init``: an example that is valid, and guesses that are shown and can be ingested."""

from pathlib import Path

import pytest

from pneucli.config import load
from pneucli.errors import InputError
from pneucli.pipeline.context import Context
from pneucli.stages import ingest, init
from pneucli.stages.guess import guess


def test_the_example_is_a_valid_pipeline(tmp_path: Path) -> None:
    answer = init.create(tmp_path / "my bench")
    assert load(answer["pipeline"]).name == "my bench"
    with pytest.raises(InputError, match="exists already"):
        init.create(tmp_path / "my bench")


@pytest.mark.parametrize(
    ("column", "signal", "unit"),
    [
        ("t [ms]", "time", "ms"),
        ("time_s", "time", "s"),
        ("U_valve [V]", "u", "V"),
        ("P_supply [bar]", "p_supply", "bar"),
        ("P1 (kPa)", "p1", "kPa"),
        ("Pos [mm]", "x", "mm"),
        ("Acc [m/s2]", "a", "m/s2"),
        ("group/Force in N", "force", "N"),
        ("Temperatur [°C]", "temperature", "°C"),
        ("P1 [mm]", "", ""),
        ("gain", "", ""),
    ],
)
def test_columns_are_guessed_by_name_and_unit(column: str, signal: str, unit: str) -> None:
    (one,) = guess([column])
    assert (one.signal, one.unit) == (signal, unit)


def test_a_pipeline_from_raw_files_runs_through_ingest(tmp_path: Path) -> None:
    rows = "\n".join(f"{n},3.0,{1 + n / 50:.3f},{n * n / 100:.3f}" for n in range(60))
    (tmp_path / "a.csv").write_text(f"t [ms],U [V],P1 [bar],Pos [mm]\n{rows}\n")
    (tmp_path / "b.csv").write_text(f"time_s,U [V],P1 [bar],Junk\n{rows}\n")
    answer = init.create(tmp_path / "rig", [tmp_path / "a.csv", tmp_path / "b.csv"])
    assert '"Junk" -> not taken' in init.describe(answer)
    path = tmp_path / "rig" / "pipeline.toml"
    config = load(path)
    assert [one.experiment for one in config.recordings] == ["axis", "valve"]
    recordings = ingest.run(Context(path, config, tmp_path / "out", tmp_path))["recordings"]
    assert [row["to"] for row in recordings] == pytest.approx([0.059, 59.0])


def test_raw_files_without_time_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("q1,q2\n0,1\n")
    with pytest.raises(InputError, match="no column looks like time"):
        init.create(tmp_path / "rig", [tmp_path / "a.csv"])
    assert not (tmp_path / "rig").exists()
