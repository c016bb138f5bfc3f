"""The pipeline file: every key, every fault with line and mend, and edits that keep comments."""

from pathlib import Path

import pytest

from pneucli.config import load, sources
from pneucli.config.edit import set_effects
from pneucli.errors import InputError

BASE = """\
[pipeline]
name = "rig"
[rig]
ambient_pressure = "1.0 bar"
supply_pressure = "6 barg"
[rig.vessel]
volume = "160 cm^3"
[rig.cylinder]
piston_area_1 = "9.50 cm^2"
[signals]
time = { column = "t", unit = "ms" }
p1 = { column = "P1", unit = "bar", reference = "gauge", noise = "0.4 kPa" }
u = { column = "U" }
[[recordings]]
name = "step"
file = "raw/*.csv"
experiment = "valve"
use = "train"
take = ["time", "p1"]
u = "3 V"
valve = "shut"
from = "0.1 s"
to = "500 ms"
[recordings.signals]
p1 = { column = 2, unit = "psi(g)" }
[model] # keep me
effects = [] # and me
[checks]
"compare.error.test" = { max = 1.5 }
"""


def write(folder: Path, text: str = BASE, raw: tuple[str, ...] = ("a_2.csv", "a_10.csv")) -> Path:
    (folder / "raw").mkdir()
    for name in raw:
        (folder / "raw" / name).write_text("t,P1\n0,1\n")
    path = folder / "pipeline.toml"
    path.write_text(text)
    return path


def test_quantities_are_si_and_gauge_stands_on_the_files_own_ambient(tmp_path: Path) -> None:
    config = load(write(tmp_path))
    rig = config.to_rig()
    assert rig.supply_pressure == pytest.approx(7e5)
    assert rig.vessel_volume == pytest.approx(160e-6)
    assert rig.piston_area_1 == pytest.approx(9.5e-4)
    assert rig.stroke is None
    recording = config.recordings[0]
    assert (recording.from_, recording.to, recording.constants) == (0.1, 0.5, {"u": 3.0})
    assert config.compare.horizon == 0.5
    assert config.checks["compare.error.test"].max == 1.5


def test_a_glob_makes_numbered_recordings_in_natural_order(tmp_path: Path) -> None:
    found = sources(load(write(tmp_path)))
    assert [(one.name, one.path.name) for one in found] == [("step_1", "a_2.csv"), ("step_2", "a_10.csv")]
    assert found[0].signals["p1"].column == 2  # the recording's own entry replaces that of [signals]
    assert set(found[0].signals) == {"time", "p1"}  # u is a constant here, and was not taken


def test_without_a_name_the_files_name_the_recordings(tmp_path: Path) -> None:
    found = sources(load(write(tmp_path, BASE.replace('name = "step"\n', ""))))
    assert [one.name for one in found] == ["a_2", "a_10"]


def test_environment_variables_lead_to_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, BASE.replace("raw/*.csv", "${PNEUCLI_TEST_RAW}/a_2.csv"))
    with pytest.raises(InputError, match="PNEUCLI_TEST_RAW is not set"):
        sources(load(path))
    monkeypatch.setenv("PNEUCLI_TEST_RAW", str(tmp_path / "raw"))
    assert [one.name for one in sources(load(path))] == ["step"]


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("supply_pressure =", "suply_pressure =", 5, 'did you mean "supply_pressure"'),
        ('"160 cm^3"', '"160 cm^2"', 7, "dimension of m^3"),
        ('"9.50 cm^2"', '"-9.50 cm^2"', 9, "greater than 0"),
        ('p1 = { column = "P1"', 'pp1 = { column = "P1"', 12, 'did you mean "p1"'),
        ('unit = "bar"', 'unit = "V"', 12, "does not measure pressure of chamber 1"),
        ('u = { column = "U" }', 'u = { column = "U", reference = "gauge" }', 13, "not a pressure"),
        ('experiment = "valve"', 'experiment = "valv"', 17, 'did you mean "valve"'),
        ('use = "train"\n', "", 14, "missing"),
        ('u = "3 V"', 'u = "3 bar"', 20, "dimension of V"),
        ("{ max = 1.5 }", "{}", 29, "limits nothing"),
    ],
)
def test_a_fault_names_line_key_and_mend(tmp_path: Path, old: str, new: str, line: int, says: str) -> None:
    assert old in BASE
    with pytest.raises(InputError) as error:
        load(write(tmp_path, BASE.replace(old, new, 1)))
    assert f"line {line}," in str(error.value)
    assert says in str(error.value)


def test_all_faults_come_at_once(tmp_path: Path) -> None:
    text = BASE.replace("supply_pressure", "suply").replace("160 cm^3", "x").replace('"valve"', '"v"')
    with pytest.raises(InputError, match="3 faults"):
        load(write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "says"), [("[pipeline\n", "line 1"), ("", "key pipeline"), ("a = \xff", "not valid|unknown key")]
)
def test_what_is_no_pipeline_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        load(write(tmp_path, text))
    with pytest.raises(InputError, match="no such file"):
        load(tmp_path / "absent.toml")


def test_two_recordings_of_one_name_and_missing_files_are_refused(tmp_path: Path) -> None:
    twice = BASE.replace(
        "[model]", '[[recordings]]\nname="step_1"\nfile="raw/a_2.csv"\nexperiment="valve"\nuse="test"\n[model]'
    )
    with pytest.raises(InputError, match='two recordings are called "step_1"'):
        sources(load(write(tmp_path, twice)))
    (tmp_path / "pipeline.toml").write_text(BASE.replace("raw/*.csv", "raw/a_3.csv"))
    with pytest.raises(InputError, match=r'did you mean "a_2\.csv"'):
        sources(load(tmp_path / "pipeline.toml"))


def test_setting_effects_changes_nothing_else(tmp_path: Path) -> None:
    path = write(tmp_path)
    set_effects(path, ["stribeck", "piston-leak"])
    assert path.read_text() == BASE.replace("effects = []", 'effects = ["stribeck", "piston-leak"]')
    assert list(tmp_path.glob(".pipeline*")) == []


def test_many_recordings_cost_one_look_at_the_file(tmp_path: Path) -> None:
    from pneucli.config.load import _lines

    recordings = "".join(
        f'[[recordings]]\nname = "r{k}"\nfile = "raw/a_2.csv"\nexperiment = "valve"\nuse = "train"\n'
        for k in range(300)
    )
    config = load(write(tmp_path, BASE.replace("[model]", recordings + "[model]")))
    _lines.cache_clear()
    found = sources(config)
    assert _lines.cache_info().misses == 1
    text = config.path.read_text().splitlines()
    for k, source in enumerate(found[-300:]):
        line = int(source.where.split("line ")[1].split(",")[0])
        assert text[line - 2 : line] == [f'name = "r{k}"', 'file = "raw/a_2.csv"']
