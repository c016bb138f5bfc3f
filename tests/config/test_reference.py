"""Every key of the pipeline file is said, with an example that the program itself reads."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.closed_loop.robustness import read_settings
from pneucli.closed_loop.scenarios import read_scenario as closed_loop
from pneucli.config import load, validate
from pneucli.config.key_reference import (
    CLOSED_LOOP,
    MONTE_CARLO,
    OPEN_LOOP,
    Key,
    all_keys,
    json_schema,
    key_texts,
    parse_toml_value,
    table_models,
)
from pneucli.config.pipeline_tables import PipelineConfig
from pneucli.design.requirements import read_requirements
from pneucli.errors import InputError
from pneucli.identify.estimation.score_test import initial_guesses
from pneucli.physics.effects import catalogue, catalogue_with_sides
from pneucli.physics.scales import RigQuantities
from pneucli.simulate.open_loop import parse_scenario as open_loop
from pneucli.stages.look import read_pipeline
from pneucli.stages.pipeline_file import parameter_priors, priors_in_model
from pneucli.units import same_dimension

KEYS = all_keys()
ROOT = Path(__file__).parents[2]
MINIMAL: dict[str, Any] = {
    "pipeline": {"name": "p"},
    "recordings": [{"file": "a.csv", "experiment": "valve", "use": "train"}],
}


def placed(key: Key) -> dict[str, Any]:
    """Return a pipeline file with the key at its example, and what it cannot be without."""
    document = json.loads(json.dumps(MINIMAL))
    value = parse_toml_value(key.example)
    first = document["recordings"][0]
    axis = {"experiment": "friction", "chamber_2": "open"} if key.name in ("imposed", "added_mass") else {}
    axis |= {"experiment": "closed-loop", "chamber_2": "closed"} if key.name == "controller" else {}
    if key.table == "recordings":
        first |= {"chamber_2": "closed"} if (key.name, value) == ("experiment", "axis") else axis
        first[key.name] = value
    elif key.table == "recordings.more":
        further = {"file": "b.csv", key.name: value}
        first["more"] = [further | ({"offset": "find"} if key.name == "match" else {})]
    elif key.table.startswith("signals.NAME"):
        column = {} if key.name == "expression" else {"column": "c"}
        inner = {
            "signals.NAME.where": {"where": {"column": "c", "equals": 1, key.name: value}},
            "signals.NAME.time": {"time": {"column": "c", key.name: value}},
        }
        signal = inner.get(key.table, {key.name: value})
        document["signals"] = {"p1": column | signal}
    elif key.table == "model.parameters.NAME":
        document["model"] = {"parameters": {"friction.viscous": {key.name: value}}}
    elif key.table == "checks.PATH":
        document["checks"] = {"compare.error.test": {key.name: value}}
    else:
        table = document
        for part in key.table.split("."):
            table = table.setdefault(part, {})
        table[key.name] = value
    return document


STAGES = {
    "design": lambda table: read_requirements(table, "design"),
    OPEN_LOOP: lambda table: open_loop({"recording": "r", **table}, "scenarios"),
    CLOSED_LOOP: lambda table: closed_loop({k: v for k, v in table.items() if k != "kind"}, "scenarios"),
    MONTE_CARLO: lambda table: read_settings(table, "scenarios"),
}


def read(key: Key) -> None:
    if key.table in STAGES:
        STAGES[key.table]({key.name: parse_toml_value(key.example)})
    else:
        validate(Path("pipeline.toml"), placed(key))


@pytest.mark.parametrize("key", KEYS, ids=lambda key: f"{key.table}.{key.name}")
def test_the_example_of_a_key_is_read(key: Key) -> None:
    read(key)


def test_an_example_that_is_wrong_would_be_found() -> None:
    for table, name in (("rig", "supply_pressure"), ("design", "period"), (OPEN_LOOP, "dwell"), (CLOSED_LOOP, "load")):
        key = next(key for key in KEYS if (key.table, key.name) == (table, name))
        with pytest.raises(InputError):
            read(key._replace(example='"7 apples"'))


def test_every_key_is_said() -> None:
    silent = [f"{key.table}: {key.name}" for key in KEYS if not key.says]
    assert silent == [], "add them to pneucli/config/keys.toml, each with an example"


def test_every_table_of_the_file_is_listed() -> None:
    names = set(PipelineConfig.model_json_schema()["$defs"])
    listed = {model.__name__ for model in table_models().values()}
    assert names - listed == {"SignalsTable"}  # whose keys are the signals


def test_nothing_is_said_of_keys_that_are_gone() -> None:
    known = {(key.table, key.name) for key in KEYS}
    assert {(table, name) for table, own in key_texts().items() for name in own} == known


def test_units_are_those_that_the_example_is_read_in() -> None:
    by_name = {(key.table, key.name): key for key in KEYS}
    assert by_name["rig", "supply_pressure"].unit == "Pa"
    assert by_name["rig.cylinder", "piston_area_1"].unit == "m^2"
    assert by_name["recordings", "x"].unit == "m"
    for key in KEYS:
        found = re.match(r'"[-+.\d e]+ ?([^"\d]\S*( \S+)*)"$', key.example)
        if key.unit and key.unit != "1" and found:
            assert same_dimension(found[1], key.unit), key


def test_defaults_are_those_of_the_file_that_says_nothing() -> None:
    empty = validate(Path("pipeline.toml"), MINIMAL)
    by_name = {(key.table, key.name): key.default for key in KEYS}
    assert float(by_name["rig", "gas_temperature"]) == empty.rig.gas_temperature
    assert (by_name["compare", "horizon"], empty.compare.horizon) == ("", None)
    assert by_name["rig", "gas"] == f'"{empty.rig.gas}"'


def test_the_schema_accepts_what_the_program_accepts_and_marks_what_it_does_not() -> None:
    jsonschema = pytest.importorskip("jsonschema", reason="no jsonschema (extra dev)")
    check = jsonschema.Draft202012Validator(json_schema(catalogue()))
    for path in (*ROOT.glob("pipelines/*.toml"), *ROOT.glob("fixtures/*/*.toml")):
        load(path)
        assert list(check.iter_errors(json.loads(json.dumps(load(path).document, default=str)))) == [], path
    misspelt = MINIMAL | {"rig": {"suply_pressure": "7 bar"}}
    assert "suply_pressure" in next(check.iter_errors(misspelt)).message
    assert list(check.iter_errors(MINIMAL | {"recordings": [{**MINIMAL["recordings"][0], "use": "exam"}]}))


def test_the_schema_offers_effects_and_says_what_keys_are() -> None:
    made = json_schema(["stribeck"])
    assert made["$defs"]["ModelTable"]["properties"]["effects"]["items"]["anyOf"][0] == {"enum": ["stribeck"]}
    pressure = made["$defs"]["RigTable"]["properties"]["supply_pressure"]
    assert pressure["description"].startswith("absolute supply pressure")
    assert pressure["description"].endswith("(SI unit: Pa)")
    assert {"number", "string"} <= set(re.findall(r'"type": "(\w+)"', json.dumps(pressure["anyOf"])))


# --- what an engineer states where it stands: tolerances, a spring, the weight, a sensor's lag and resolution


FILE = """
[pipeline]
name = "axis"
[rig.cylinder]
piston_area_1 = "9.5 cm^2"
dead_volume_1 = "38 cm^3"
moving_mass = "2 kg"
# cylinder
[signals]
time = { column = "t", unit = "s" }
p1 = { column = "p", unit = "bar" }
[[recordings]]
file = "run.csv"
experiment = "axis"
chamber_2 = "open"
use = "train"
# end
"""


def stated(tmp_path: Path, *changes: tuple[str, str]) -> PipelineConfig:
    text = FILE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "axis.toml"
    path.write_text(text, encoding="utf-8")
    return load(path)


@pytest.mark.parametrize("tolerance", ["+- 5 %", "± 1.9 cm^3", "+/-1.9 cm^3"])
def test_a_tolerance_is_a_prior_about_the_value(tmp_path: Path, tolerance: str) -> None:
    config = stated(tmp_path, ('"38 cm^3"', f'"38 cm^3 {tolerance}"'))
    prior = parameter_priors(config, catalogue_with_sides())["rig.dead_volume_1"]
    assert prior.start == config.rig.cylinder.dead_volume_1 == pytest.approx(38e-6)
    assert prior.sigma == pytest.approx(1.9e-6 / math.sqrt(3.0))


def test_what_parameters_say_counts_in_place_of_a_tolerance(tmp_path: Path) -> None:
    entry = '[model.parameters]\n"rig.dead_volume_1" = { sigma = "3 cm^3" }\n'
    config = stated(tmp_path, ('"38 cm^3"', '"38 cm^3 +- 5 %"'), ("# end", entry))
    assert parameter_priors(config, catalogue_with_sides())["rig.dead_volume_1"].sigma == pytest.approx(3e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("# cylinder", 'stroke = "200 mm +- 1 mm"'), "a tolerance says nothing here"),
        (('"2 kg"', '"2 kg +- 1 mm"'), "has not the dimension of kg"),
        (('"2 kg"', '"2 kg +- 0 %"'), "is not above 0"),
        (("# cylinder", 'preload = "45 N"'), "preload belongs to a spring"),
        (("# cylinder", 'bench_range = ["0.4 bar", "1.6 bar"]'), "needs piston_area_1 and stroke"),
        (('moving_mass = "2 kg"', 'angle = "90 deg"'), "no moving_mass is stated"),
        (('column = "t", unit = "s"', 'column = "t", unit = "s", lag = "1 ms"'), "time takes no lag"),
        (('unit = "bar"', 'unit = "bar", resolution = "-1 mbar"'), "is negative"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        stated(tmp_path, change)


def test_a_spring_and_the_weight_are_effects_with_known_values(tmp_path: Path) -> None:
    lines = 'spring = "1200 N/m"\npreload = "45 N"\nangle = "30 deg"'
    config = stated(tmp_path, ("# cylinder", lines), ("# end", '[model]\neffects = ["stribeck"]'))
    assert config.model.effects == ["stribeck", "spring-force", "constant-force"]
    priors = parameter_priors(config, catalogue_with_sides())
    effect = catalogue_with_sides()["spring-force"]
    spring = [priors[f"spring-force.{one.name}"].fixed for one in effect.parameters]
    at_start = effect.ports["force"](0.0, 0.0, 0.2, *spring)
    assert at_start == pytest.approx(-45.0)
    assert priors["constant-force.force"].fixed == pytest.approx(2.0 * 9.80665 * 0.5)


def test_a_payload_on_a_slope_has_its_weight(tmp_path: Path) -> None:
    config = stated(tmp_path, ("# cylinder", 'angle = "30 deg"'))
    assert config.model.effects == ["constant-force"]
    effects = catalogue_with_sides()
    known, payload = priors_in_model(config, [effects["constant-force"]], effects), effects["extra-mass"]
    guess = initial_guesses(payload, RigQuantities(mass=4.0), known)[0]
    assert guess["extra-mass.gravity"] == pytest.approx(9.80665 * 0.5)
    weight = payload.ports["force"](0.1, 0.0, 0.2, *guess.values())
    assert weight == pytest.approx(-guess["extra-mass.mass"] * 9.80665 * 0.5)
    assert "extra-mass.gravity" not in initial_guesses(payload, RigQuantities(mass=4.0))[0]


def test_a_bench_range_is_a_spring(tmp_path: Path) -> None:
    lines = 'stroke = "20 mm"\nbench_range = ["0.4 bar", "1.6 barg"]'
    priors = parameter_priors(stated(tmp_path, ("# cylinder", lines)), catalogue_with_sides())
    rate = 1.2e5 * 9.5e-4 / 0.02
    assert priors["spring-force.stiffness"].fixed == pytest.approx(rate)
    assert priors["spring-force.rest_position"].fixed == pytest.approx(-0.4e5 * 9.5e-4 / rate)


def test_a_spring_with_a_tolerance_is_identified(tmp_path: Path) -> None:
    config = stated(tmp_path, ("# cylinder", 'spring = "1.2 N/mm +- 10 %"'))
    prior = parameter_priors(config, catalogue_with_sides())["spring-force.stiffness"]
    assert prior.fixed is None
    assert prior.start == pytest.approx(1200.0)
    assert prior.sigma == pytest.approx(120.0 / math.sqrt(3.0))


def test_a_plant_says_ambient_percent_and_three_ports(tmp_path: Path) -> None:
    travel = 'p1 = { column = "p", unit = "bar" }\nx = { column = "ZT", unit = "%", scale = 2.0, offset = 10.0 }'
    config = stated(
        tmp_path,
        ("# cylinder", 'stroke = "30 mm"\nchamber_2 = "ambient"\n[rig.valve]\narrangement = "3/3"'),
        ('\nchamber_2 = "open"', ""),
        ('p1 = { column = "p", unit = "bar" }', travel),
    )
    assert config.recordings[0].chamber_2 == "open"
    assert config.arrangement == "one-chamber"
    assert config.signals.x is not None
    assert config.signals.x.unit == "m"
    assert config.signals.x.scale == pytest.approx(2.0 * 0.03 / 100.0)
    assert config.signals.x.offset == pytest.approx(10.0 * 0.03 / 100.0)


def test_a_lag_and_a_resolution_are_those_of_the_sensor(tmp_path: Path) -> None:
    config = stated(tmp_path, ('unit = "bar"', 'unit = "bar", lag = "2.5 ms", resolution = "5 mbar"'))
    assert config.model.effects == ["pressure-lag"]
    assert parameter_priors(config, catalogue_with_sides())["pressure-lag.time_constant"].fixed == 2.5e-3
    assert config.signals.p1 is not None
    assert config.signals.p1.resolution == 500.0


def test_no_reading_is_finer_than_the_stated_resolution(tmp_path: Path) -> None:
    time = np.arange(0.0, 4.0, 0.01)
    p = 3.0 + np.sin(time) + 1e-4 * np.random.default_rng(1).standard_normal(time.size)
    rows = "".join(f"{t:.2f},{one:.6f}\n" for t, one in zip(time, p, strict=True))
    (tmp_path / "run.csv").write_text(f"t,p\n{rows}", encoding="utf-8")
    change = ('experiment = "axis"\nchamber_2 = "open"', 'experiment = "valve"\nvalve = "shut"')
    for entry, floor in (("", 0.0), (', resolution = "5 mbar"', 500.0 / math.sqrt(12.0))):
        config = stated(tmp_path, change, ('unit = "bar"', f'unit = "bar"{entry}'))
        folder = tmp_path / f"read{bool(entry)}"
        folder.mkdir()
        (one,) = read_pipeline(config.path, folder)[1]
        assert floor <= one.noise["p1"].rms < floor + 30.0


def test_a_valve_test_knows_nothing_of_the_spring(tmp_path: Path) -> None:
    config = stated(tmp_path, ("# cylinder", 'spring = "1200 N/m"'), ('"axis"\nchamber_2 = "open"', '"valve"'))
    assert config.model.effects == []


@pytest.mark.parametrize(
    ("test", "signals", "meant"),
    [
        ("positioner", 'u = { column = "OUT", unit = "V" }\n', "axis"),
        ("positioner", "", "friction"),  # its output is a pressure
        ("signature", 'u = { column = "OUT", unit = "V" }\n', "friction"),
    ],
)
def test_tests_of_a_process_valve_are_experiments(tmp_path: Path, test: str, signals: str, meant: str) -> None:
    config = stated(
        tmp_path, ('"axis"\nchamber_2 = "open"', f'"{test}"'), ("[[recordings]]", f"{signals}[[recordings]]")
    )
    (recording,) = config.recordings
    assert (recording.experiment, recording.chamber_2) == (meant, "open")


def test_rows_without_a_clock_are_no_test_of_friction(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"key recordings\.1\.experiment: friction is not identified from rows"
    ) as said:
        stated(tmp_path, ('"axis"', '"friction-map"'))
    assert 'experiment = "friction"' in str(said.value)


def test_a_valve_that_sets_a_pressure_has_its_loop_in_the_model(tmp_path: Path) -> None:
    regulating = stated(tmp_path, ("# cylinder", '[rig.valve]\nkind = "pressure"'))
    assert "pressure-control" in regulating.model.effects
    assert "pressure-control" not in stated(tmp_path).model.effects


def test_a_pump_needs_no_recorded_supply_since_the_command_may_drive_it(tmp_path: Path) -> None:
    pump = stated(tmp_path, ("# cylinder", '[rig.source]\nkind = "pump"'))
    assert (pump.rig.source.kind, pump.to_rig().source) == ("pump", "pump")


def test_a_diaphragms_area_counts_as_its_mean(tmp_path: Path) -> None:
    areas = '[["0 %", "250 cm^2"], ["50 %", "248 cm^2"], ["100 %", "242 cm^2"]]'
    config = stated(tmp_path, ('piston_area_1 = "9.5 cm^2"', f"effective_area = {areas}"))
    assert config.to_rig().piston_area_1 == pytest.approx((249e-4 + 245e-4) / 2.0)


@pytest.mark.parametrize(
    ("areas", "said"),
    [
        ('[["0 mm", "250 cm^2"], ["100 %", "242 cm^2"]]', "percent of the stroke"),
        ('[["0 %", "250 cm^2"], ["120 %", "242 cm^2"]]', "percent of the stroke"),
        ('[["50 %", "250 cm^2"], ["50 %", "242 cm^2"]]', "one travel alone"),
    ],
)
def test_areas_that_state_no_course_are_refused(tmp_path: Path, areas: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        stated(tmp_path, ('piston_area_1 = "9.5 cm^2"', f"effective_area = {areas}"))


def test_an_area_is_stated_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="effective_area is that of piston_area_1"):
        stated(tmp_path, ("# cylinder", 'effective_area = [["0 %", "9 cm^2"], ["100 %", "10 cm^2"]]'))
