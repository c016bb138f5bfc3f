"""The pipeline file: every key, every fault with line and mend, and edits that keep comments."""

import math
import tomllib
from pathlib import Path

import pytest

from pneucli.config import load, load_description, recording_sources
from pneucli.config.effect_edit import append_recordings, set_effects
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
    assert (recording.from_, recording.to, recording.held_constant) == (0.1, 0.5, {"u": 3.0})
    assert config.compare.horizon is None
    assert config.checks["compare.error.test"].max == 1.5


def test_the_grid_of_the_friction_models_may_be_stated(tmp_path: Path) -> None:
    table = '[identify.friction]\nvelocity_range = "50 mm/s"\nnodes = 500\neta = "2 s/mm"\n'
    found = load(write(tmp_path, BASE + table)).identify.friction
    assert (found.velocity_range, found.nodes, found.eta) == (0.05, 500, 2000.0)
    (tmp_path / "pipeline.toml").write_text(BASE + table.replace("500", "3"))
    with pytest.raises(InputError, match=r"(?s)identify\.friction\.nodes"):
        load(tmp_path / "pipeline.toml")


def test_a_glob_makes_numbered_recordings_in_natural_order(tmp_path: Path) -> None:
    found = recording_sources(load(write(tmp_path)))
    assert [(one.name, one.path.name) for one in found] == [("step_1", "a_2.csv"), ("step_2", "a_10.csv")]
    assert found[0].signals["p1"].column == 2  # the recording's own entry replaces that of [signals]
    assert set(found[0].signals) == {"time", "p1"}  # u is a constant here, and was not taken


def test_without_a_name_the_files_name_the_recordings(tmp_path: Path) -> None:
    found = recording_sources(load(write(tmp_path, BASE.replace('name = "step"\n', ""))))
    assert [one.name for one in found] == ["a_2", "a_10"]


def test_environment_variables_lead_to_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, BASE.replace("raw/*.csv", "${PNEUCLI_TEST_RAW}/a_2.csv"))
    with pytest.raises(InputError, match="PNEUCLI_TEST_RAW is not set"):
        recording_sources(load(path))
    monkeypatch.setenv("PNEUCLI_TEST_RAW", str(tmp_path / "raw"))
    assert [one.name for one in recording_sources(load(path))] == ["step"]


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
        ("{ max = 1.5 }", "{ max = nan }", 29, "wanted: a number up to 1e+18"),
        ("{ max = 1.5 }", "{ max = 99999999999999999999 }", 29, "wanted: a number up to 1e+18"),
        ('"6 barg"', '"1e999 bar"', 5, "not finite"),
        ('"6 barg"', '"1e15 bar"', 5, "beyond what a rig may have"),
        ('"160 cm^3"', "5e-324", 7, "next to nothing"),
        ('"160 cm^3"', '"1 m^999999999"', 7, "dimension"),
        ('"160 cm^3"', '"1 km^999999999"', 7, "beyond all numbers"),
        ('"160 cm^3"', f'"1 {"(" * 3000}"', 7, "is not a quantity"),
        ('unit = "ms"', f'unit = "{"(" * 3000}"', 11, "is no unit"),
        ('unit = "ms"', 'unit = "ms", offset = -inf', 11, "wanted: a number up to 1e+18"),
        ('unit = "ms"', 'unit = "ms", scale = 0', 11, "a factor other than 0"),
        ('unit = "ms"', 'unit = "ms", scale = 1e300', 11, "wanted: a number up to 1e+18"),
        ('unit = "ms"', 'unit = "ms", decimal = "٫"', 11, "'.' or ','"),
        ('unit = "ms"', 'unit = "ms", thousands = "1"', 11, "cannot stand between thousands"),
        ('unit = "ms"', 'unit = "ms", decimal = ".", thousands = "."', 11, "decimal mark"),
        ('column = "U"', "column = 0", 13, "greater than or equal to 1"),
        ('column = "U"', "column = true", 13, "valid"),
        ('column = "U"', 'column = "U\\n[P]"', 13, "holds control characters"),
        ('"raw/*.csv"', '""', 16, "wanted: a text that is not blank"),
        ('"raw/*.csv"', "7", 16, "valid string"),
        ('"raw/*.csv"', '["raw/a.csv"]', 16, "valid string"),
        ('name = "step"', 'name = "a\\u001b[2J"', 15, "holds control characters"),
        ('name = "step"', 'name = "a\\u202eb"', 15, "holds control characters"),
        ('name = "step"', 'encoding = "hex"', 15, "no encoding of text"),
        ('name = "step"', 'encoding = "idna"', 15, "no encoding of text"),
        ('name = "step"', 'delimiter = "ab"', 15, "cannot stand between columns"),
        ('name = "step"', 'delimiter = "é"', 15, "cannot stand between columns"),
        ('name = "step"', 'decimal = ","\ndelimiter = ","', 15, "decimal mark"),
        ('[rig.vessel]\nvolume = "160 cm^3"', "[[rig.vessel]]", 6, "wanted: a table"),
        ("[pipeline]", 'compare = ["0.5 s"]\n[pipeline]', 1, "wanted: a table"),
        (
            "[checks]",
            '[model.parameters]\n"friction.viscous" = "45 N s/m"\n[checks]',
            29,
            'mend: write { fixed = "45 N s/m" }, or another of its keys: start, min, max, sigma',
        ),
        ("[checks]", f"[design]\nx = {'[' * 20}{']' * 20}\n[checks]", 29, "tables in tables"),
    ],
)
def test_a_fault_names_line_key_and_mend(tmp_path: Path, old: str, new: str, line: int, says: str) -> None:
    assert old in BASE
    with pytest.raises(InputError) as error:
        load(write(tmp_path, BASE.replace(old, new, 1)))
    assert f"line {line}," in str(error.value)
    assert says in str(error.value)


def test_a_key_of_two_types_is_told_once_and_by_its_own_name(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        load(write(tmp_path, BASE.replace('column = "U"', "column = []")))
    assert "line 13, key signals.u.column: []" in str(error.value)
    assert "faults" not in str(error.value)


@pytest.mark.parametrize("delimiter", ['"\\t"', "','", "' '", "'|'", r"'\s+'"])
def test_delimiters_that_laboratories_use_are_taken(tmp_path: Path, delimiter: str) -> None:
    assert load(write(tmp_path, BASE.replace('use = "train"', f'use = "train"\ndelimiter = {delimiter}')))


def test_lists_in_lists_without_end_are_the_users_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="lists in lists"):
        load(write(tmp_path, f"{BASE}deep = {'[' * 5000}{']' * 5000}\n"))


def test_what_is_found_is_shown_in_part_where_it_is_long_and_never_acts_on_the_terminal(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        load(write(tmp_path, BASE.replace('"valve"', f'"{"v" * 5000}"').replace('"train"', '"\\u001b[31m"')))
    assert len(str(error.value)) < 600
    assert "\x1b" not in str(error.value)


@pytest.mark.parametrize(
    ("file", "says"),
    [("raw", "a folder, a pipe or a device"), ("/dev/zero", "a folder, a pipe"), ("x" * 300, "no file")],
)
def test_what_is_no_file_is_not_opened(tmp_path: Path, file: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        recording_sources(load(write(tmp_path, BASE.replace("raw/*.csv", file))))


@pytest.mark.parametrize("name", ["a\nb.csv", "a\udcff.csv"])
def test_a_file_whose_name_cannot_be_printed_is_refused_and_shown_with_escapes(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="rename the file") as error:
        recording_sources(load(write(tmp_path, raw=(name,))))
    assert str(error.value).isprintable() == ("\n" not in str(error.value))
    assert repr(name)[1:-1] in str(error.value)


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
        recording_sources(load(write(tmp_path, twice)))
    (tmp_path / "pipeline.toml").write_text(BASE.replace("raw/*.csv", "raw/a_3.csv"))
    with pytest.raises(InputError, match=r'did you mean "a_2\.csv"'):
        recording_sources(load(tmp_path / "pipeline.toml"))


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("text", [BASE, BASE.replace("[model] # keep me\neffects = [] # and me\n", "")])
def test_setting_effects_keeps_line_ends_and_the_mark_at_the_start(
    tmp_path: Path, mark: str, end: str, text: str
) -> None:
    path = write(tmp_path)
    path.write_bytes((mark + text.replace("\n", end)).encode())
    set_effects(path, ["stribeck"])
    written = path.read_bytes().decode()
    assert written.startswith(f"{mark}[pipeline]{end}")
    assert written.count("\n") == written.count(end)
    assert load(path).model.effects == ["stribeck"]


@pytest.mark.parametrize("model", ["model = 3\n", "model = { effects = [] }\n"])
def test_where_effects_cannot_be_set_the_file_stays(tmp_path: Path, model: str) -> None:
    path = write(tmp_path, model + BASE.replace("[model] # keep me\neffects = [] # and me\n", ""))
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"\[model\] on a line of its own"):
        set_effects(path, ["stribeck"])
    assert path.read_bytes() == before


def test_setting_effects_changes_nothing_else(tmp_path: Path) -> None:
    path = write(tmp_path)
    set_effects(path, ["stribeck", "piston-leak"])
    assert path.read_text() == BASE.replace("effects = []", 'effects = ["stribeck", "piston-leak"]')
    assert list(tmp_path.glob(".pipeline*")) == []


def test_many_recordings_cost_one_look_at_the_file(tmp_path: Path) -> None:
    from pneucli.config.load import _line_numbers

    recordings = "".join(
        f'[[recordings]]\nname = "r{k}"\nfile = "raw/a_2.csv"\nexperiment = "valve"\nuse = "train"\n'
        for k in range(300)
    )
    config = load(write(tmp_path, BASE.replace("[model]", recordings + "[model]")))
    _line_numbers.cache_clear()
    found = recording_sources(config)
    assert _line_numbers.cache_info().misses == 1
    text = config.path.read_text().splitlines()
    for k, source in enumerate(found[-300:]):
        line = int(source.where.split("line ")[1].split(",")[0])
        assert text[line - 2 : line] == [f'name = "r{k}"', 'file = "raw/a_2.csv"']


ROTARY = """\
[pipeline]
name = "joint"
[rig.cylinder]
moment_of_inertia = "20 kg cm^2"
piston_area_1 = "3 cm^3/rad"
stroke = "270 deg"
[signals]
time = { column = "t" }
x = { column = "q", unit = "deg", noise = "0.1 deg" }
force = { column = "M", unit = "Nm" }
[[recordings]]
name = "swing"
file = "raw/a_2.csv"
experiment = "friction"
use = "train"
v = "60 rpm"
"""


def test_a_rotary_axis_takes_angles_and_torques_in_the_same_places(tmp_path: Path) -> None:
    config = load(write(tmp_path, ROTARY))
    rig = config.to_rig()
    assert config.rotary
    assert (rig.moving_mass, rig.piston_area_1, rig.stroke) == pytest.approx((2e-3, 3e-6, 1.5 * math.pi))
    assert config.unit("force") == "N m"
    assert config.recordings[0].v == pytest.approx(2 * math.pi)
    assert config.signals.x is not None
    assert config.signals.x.noise == pytest.approx(math.radians(0.1))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"270 deg"', '"200 mm"', "has not the dimension of rad"),
        ('"Nm"', '"N"', 'wanted: one such as "N m"'),
        ("[signals]", 'moving_mass = "1 kg m^2"\n[signals]', "leave one of them out"),
    ],
)
def test_linear_and_rotary_do_not_mix(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        load(write(tmp_path, ROTARY.replace(old, new)))


def test_a_linear_axis_has_no_angles(tmp_path: Path) -> None:
    assert not load(write(tmp_path)).rotary


@pytest.mark.parametrize(
    ("gas", "ratio", "constant"), [("air", 1.4, 287.0), ("helium", 5 / 3, 2077.1), ("argon", 5 / 3, 208.13)]
)
def test_a_gas_by_name_sets_what_is_not_given(tmp_path: Path, gas: str, ratio: float, constant: float) -> None:
    rig = load(write(tmp_path, BASE.replace("[rig]", f'[rig]\ngas = "{gas}"'))).to_rig()
    assert (rig.heat_capacity_ratio, rig.gas_constant) == pytest.approx((ratio, constant))
    other = tmp_path / "other"
    other.mkdir()
    given = load(write(other, BASE.replace("[rig]", f'[rig]\ngas = "{gas}"\ngas_constant = "300 J/(kg K)"'))).to_rig()
    assert (given.heat_capacity_ratio, given.gas_constant) == pytest.approx((ratio, 300.0))


@pytest.mark.parametrize(
    ("thermal", "exponent", "free"),
    [('"adiabatic"', None, False), ('"isothermal"', 1.0, False), ("1.2", 1.2, False), ('"identify"', None, True)],
)
def test_how_the_gas_changes_is_stated(tmp_path: Path, thermal: str, exponent: float | None, free: bool) -> None:
    rig = load(write(tmp_path, BASE.replace("[rig]", f"[rig]\nthermal = {thermal}"))).to_rig()
    assert (rig.polytropic_exponent, rig.exponent_free) == (exponent, free)


AXIS = 'experiment = "closed-loop"\nchamber_2 = "closed"\n'


@pytest.mark.parametrize(
    ("table", "wanted"),
    [
        (AXIS, 'controller = "FILE"'),
        (
            'experiment = "axis"\nchamber_2 = "closed"\ncontroller = "unknown"\n',
            'belongs to experiment = "closed-loop"',
        ),
        ('experiment = "closed-loop"\ncontroller = "unknown"\n', "chamber_2"),
    ],
)
def test_a_log_names_its_controller_and_nothing_else_does(table: str, wanted: str, tmp_path: Path) -> None:
    path = write(tmp_path, BASE.replace('experiment = "valve"\n', table).replace('valve = "shut"\n', ""))
    with pytest.raises(InputError) as error:
        load(path)
    assert wanted in str(error.value)


def test_a_mass_that_moved_in_one_recording_is_read(tmp_path: Path) -> None:
    axis = AXIS.replace("closed-loop", "axis") + 'added_mass = "2 kg"\n'
    taken = load(write(tmp_path, BASE.replace('experiment = "valve"\n', axis).replace('valve = "shut"\n', "")))
    assert {source.table.added_mass for source in recording_sources(taken)} == {2.0}


def test_a_vessel_moves_no_mass(tmp_path: Path) -> None:
    valve = BASE.replace('experiment = "valve"\n', 'experiment = "valve"\nadded_mass = "2 kg"\n')
    with pytest.raises(InputError, match="added_mass moves with a piston"):
        load(write(tmp_path, valve))


def test_the_controller_of_a_log_stands_in_its_table(tmp_path: Path) -> None:
    path = write(tmp_path, BASE.replace('experiment = "valve"\n', AXIS + 'controller = "a.json"\n'))
    assert [source.table.controller for source in recording_sources(load(path))] == ["a.json", "a.json"]


@pytest.mark.parametrize(
    ("experiments", "cylinder", "is_chamber"),
    [
        (["valve"], True, True),
        (["valve", "friction"], True, True),
        (["valve", "axis"], True, False),
        (["valve"], False, True),
        ([], True, False),
    ],
)
def test_a_vessel_is_the_chamber_where_no_recording_has_another(
    tmp_path: Path, experiments: list[str], cylinder: bool, is_chamber: bool
) -> None:
    text = BASE[: BASE.index("[[recordings]]")]
    text = text if cylinder else text.replace('[rig.cylinder]\npiston_area_1 = "9.50 cm^2"\n', "")
    for n, experiment in enumerate(experiments):
        chamber_2 = 'chamber_2 = "open"\n' if experiment == "axis" else ""
        text += f'[[recordings]]\nname = "{n}"\nfile = "a.csv"\nexperiment = "{experiment}"\nuse = "train"\n{chamber_2}'
    path = tmp_path / "pipeline.toml"
    path.write_text(text)
    assert load_description(path).to_rig().vessel_is_chamber is is_chamber


# --- new recordings go into the pipeline file; everything else in it stays as it was


TEXT = """# my rig
[pipeline]
name = "a"   # short

[[recordings]]
name = "one"
file = "one.csv"   # the first
experiment = "axis"

[model]
effects = []  # none
"""


def test_comments_and_layout_stay(tmp_path: Path):
    file = tmp_path / "pipeline.toml"
    file.write_text(TEXT, encoding="utf-8")
    append_recordings(file, [{"name": "two", "file": "two.csv", "use": "test"}])
    text = file.read_text(encoding="utf-8")
    for line in TEXT.splitlines():
        assert line in text
    recordings = tomllib.loads(text)["recordings"]
    assert recordings[1] == {"name": "two", "file": "two.csv", "use": "test"}
    assert recordings[0]["name"] == "one"


def test_a_file_without_recordings_gets_its_first(tmp_path: Path):
    file = tmp_path / "pipeline.toml"
    file.write_text('[pipeline]\nname = "a"\n', encoding="utf-8")
    append_recordings(file, [{"name": "two"}, {"name": "three"}])
    assert [r["name"] for r in tomllib.loads(file.read_text(encoding="utf-8"))["recordings"]] == ["two", "three"]


def test_recordings_that_are_no_tables_are_refused_and_the_file_stays(tmp_path: Path):
    file = tmp_path / "pipeline.toml"
    file.write_text("recordings = 3\n", encoding="utf-8")
    with pytest.raises(InputError):
        append_recordings(file, [{"name": "two"}])
    assert file.read_text(encoding="utf-8") == "recordings = 3\n"


def test_the_first_recordings_of_a_file_are_separated_by_one_blank_line(tmp_path: Path) -> None:
    file = tmp_path / "pipeline.toml"
    file.write_text('[compare]\nhorizon = "1 s"\n', encoding="utf-8")
    append_recordings(file, [{"name": "one"}, {"name": "two"}])
    expected = '[compare]\nhorizon = "1 s"\n\n[[recordings]]\nname = "one"\n\n[[recordings]]\nname = "two"\n'
    assert file.read_text(encoding="utf-8") == expected
