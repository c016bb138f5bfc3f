"""Every key of the pipeline file is said, with an example that the program itself reads."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from pneucli.closed_loop.robustness import read_settings
from pneucli.closed_loop.scenarios import read_scenario as closed_loop
from pneucli.config import load, validate
from pneucli.config.json_schema import json_schema, parse_toml_value
from pneucli.config.key_reference import CLOSED_LOOP, MODELS, MONTE_CARLO, OPEN_LOOP, Key, all_keys, key_texts
from pneucli.config.pipeline_tables import PipelineConfig
from pneucli.design.requirements import read_requirements
from pneucli.errors import InputError
from pneucli.physics.effects import catalogue
from pneucli.simulate.open_loop import parse_scenario as open_loop
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
    assert names - {model.__name__ for model in MODELS.values()} == {"SignalsTable"}  # whose keys are the signals


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
