"""What is told of a rotary axis carries its units and names."""

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import get_args

import pytest

from pneucli.experiments import EXPERIMENT_KINDS, ExperimentName
from pneucli.figure import Figure, flat, laid_out, optional, read, to_json
from pneucli.identify.residuals import ChamberPressures, ForceBalance, FreeRun, ImposedMotion
from pneucli.io.artifacts import Provenance, read_metadata, read_table, write_table
from pneucli.messages.diagnose import discrepancy_kind_text
from pneucli.messages.formatting import format_quantity, unit_symbol
from pneucli.physics.effects import catalogue
from pneucli.physics.ports import PORTS
from pneucli.quantities import axis_motion, axis_unit, in_axis_units

ANSWER = {
    "parameters": {
        "rig.moving_mass": {"value": 2.0, "unit": "kg"},
        "rig.piston_area_1": {"value": 3e-6, "unit": "m^2"},
        "piston-leak.area": {"value": 1e-8, "unit": "m^2"},
    },
    "channels": [{"channel": "x", "unit": "m"}],
}


def test_an_answer_of_a_rotary_axis() -> None:
    with axis_motion(rotary=True):
        found = in_axis_units(ANSWER)
    assert found == {
        "parameters": {
            "rig.moment_of_inertia": {"value": 2.0, "unit": "kg m^2"},
            "rig.piston_area_1": {"value": 3e-6, "unit": "m^3/rad"},
            "piston-leak.area": {"value": 1e-8, "unit": "m^2"},
        },
        "channels": [{"channel": "x", "unit": "rad"}],
    }


def test_an_answer_of_a_linear_axis_is_unchanged() -> None:
    assert in_axis_units(ANSWER) is ANSWER
    with axis_motion(rotary=False):
        assert in_axis_units(ANSWER) is ANSWER
        assert axis_unit("N") == "N"


def test_angles_are_displayed_in_degrees(tmp_path: Path) -> None:
    with axis_motion(rotary=True):
        assert format_quantity(0.5, "m", 3) == "28.6 deg"
        assert format_quantity(1.0, "N") == "1.000 N·m"
        assert (unit_symbol("m"), unit_symbol("Pa")) == ("deg", "bar")
    assert (unit_symbol("m"), unit_symbol("rad")) == ("mm", "deg")


@pytest.mark.parametrize(("variable", "text"), [("x", "1.5 deg"), ("v", "1.5 deg/s"), ("time", "0.0261 s")])
def test_a_period_over_an_angle_is_an_angle(variable: str, text: str) -> None:
    with axis_motion(rotary=True):
        assert discrepancy_kind_text("periodic", ["force"], variable, period=0.0261).endswith(f"period {text}")


def test_artifacts_state_rotary_units_in_metadata_and_columns(tmp_path: Path) -> None:
    path = tmp_path / "one.parquet"
    with axis_motion(rotary=True):
        columns = {"x": [1.0], "value": [2.0], "unit": ["N s/m"]}
        write_table(path, columns, units={"value": "see column unit"}, schema="s/1", provenance=Provenance(None, {}))
    assert read_metadata(path)["units"]["x"] == "rad"
    assert list(read_table(path)["unit"]) == ["N m s/rad"]
    assert in_axis_units({"unit": "m"}) == {"unit": "m"}


def test_the_axis_ends_with_its_stage() -> None:
    with pytest.raises(ZeroDivisionError), axis_motion(rotary=True):
        _ = 1 / 0
    assert axis_unit("m") == "m"


# --- what a kind of experiment means is asked of its one entry


def test_every_name_of_the_pipeline_file_has_its_entry():
    assert set(EXPERIMENT_KINDS) == set(get_args(ExperimentName))


@pytest.mark.parametrize(
    ("kind", "cylinder", "recorded", "stands", "lacks"),
    [
        ("valve", True, False, {"gas", "valve", "line", "supply", "sensor"}, {"chamber", "cylinder"}),
        ("valve", False, True, {"gas", "valve", "chamber"}, {"supply", "cylinder"}),
        ("friction", True, False, {"cylinder", "sensor"}, {"gas", "valve", "chamber", "supply"}),
        ("axis", True, False, {"gas", "valve", "chamber", "cylinder", "supply"}, set()),
    ],
)
def test_parts_follow_the_interface(kind, cylinder, recorded, stands, lacks):
    parts = EXPERIMENT_KINDS[kind].parts(vessel_is_chamber=not cylinder, supply_recorded=recorded)
    assert stands <= parts
    assert not lacks & parts


def test_a_valve_test_needs_a_command_unless_the_valve_is_shut():
    assert "u" in EXPERIMENT_KINDS["valve"].required_signals(set(), valve_shut=False)
    assert "u" not in EXPERIMENT_KINDS["valve"].required_signals(set(), valve_shut=True)


def test_a_piston_is_pushed_by_a_recorded_force_or_by_pressures():
    assert "p1" in EXPERIMENT_KINDS["friction"].required_signals({"x"}, valve_shut=False)
    assert "p1" not in EXPERIMENT_KINDS["friction"].required_signals({"x", "force"}, valve_shut=False)


def test_every_effect_shows_in_a_subsystem_by_its_ports_alone():
    for effect in catalogue().values():
        assert any(view.balances & effect.balances for view in (ChamberPressures, ForceBalance)), effect.name
        assert FreeRun.balances >= effect.balances


def test_measured_pressures_hide_effects_on_flow():
    assert not ForceBalance.balances & catalogue()["piston-leak"].balances
    assert not ImposedMotion.balances & catalogue()["piston-leak"].balances
    assert not ChamberPressures.balances & catalogue()["stribeck"].balances
    assert all(view.balances & catalogue()["pressure-offset"].balances for view in (ChamberPressures, ForceBalance))


def test_only_two_branches_of_friction_are_set_valued():
    assert [name for name, port in PORTS.items() if port.is_set_valued] == ["slowing", "slowing_viscous"]
    assert [e.name for e in catalogue().values() if e.is_set_valued] == ["friction-hysteresis"]


# --- answers are written to JSON and read from it by one routine, whatever their fields are


@dataclass(frozen=True)
class Part:
    """A part with a key that is a word of Python."""

    from_: float
    note: str | None = optional()


@dataclass(frozen=True)
class Whole:
    """An answer of every kind of field."""

    name: str
    error: float
    limit: float | None
    parts: Sequence[Part]
    sizes: Mapping[str, Figure]
    first: Part | None
    rows: Sequence[Sequence[float]]
    held: Figure = field(metadata=laid_out("value ci95 determined"))
    force: Figure = field(metadata=flat("force:value ci95 unit"))


WHOLE = Whole(
    "a",
    math.nan,
    None,
    [Part(1.0), Part(2.0, "b")],
    {"m": Figure(2.0, 1.0, math.inf, "kg")},
    None,
    [[1.0]],
    Figure(0.5, 0.4, 0.6, "", determined=False),
    Figure(5.0, -math.inf, 6.0, "N"),
)
JSON = {
    "name": "a", "error": None, "limit": None, "parts": [{"from": 1.0}, {"from": 2.0, "note": "b"}],
    "sizes": {"m": {"value": 2.0, "unit": "kg", "ci95": [1.0, None]}}, "first": None, "rows": [[1.0]],
    "held": {"value": 0.5, "ci95": [0.4, 0.6], "determined": False},
    "force": 5.0, "ci95": [None, 6.0], "unit": "N",
}  # fmt: skip


def test_fields_are_keys_open_ends_are_null_and_what_is_optional_is_left_out() -> None:
    assert to_json(WHOLE) == JSON
    assert list(to_json(WHOLE)) == list(JSON)


def test_what_was_written_is_read() -> None:
    found = read(Whole, JSON)
    assert math.isnan(found.error)  # a null of a number that is always there
    assert found.limit is None
    assert (found.parts, found.sizes, found.first, found.rows) == (WHOLE.parts, WHOLE.sizes, None, [[1.0]])
    assert (found.held, found.force) == (WHOLE.held, WHOLE.force)


def test_a_key_that_an_older_program_did_not_write_is_empty() -> None:
    found = read(Whole, {"name": "a", "later": 1, "held": JSON["held"]})
    assert (found.name, found.limit, found.parts, found.sizes, found.first) == ("a", None, [], {}, None)


@pytest.mark.parametrize("stage", ["identify", "compare", "diagnose", "plan", "leak", "fleet", "export"])
def test_the_answer_of_each_command_survives_its_json(stage: str) -> None:
    answer = importlib.import_module(f"pneucli.messages.{stage}").Answer
    written = to_json(read(answer, {}))
    assert written["schema"] == ""
    assert to_json(read(answer, written)) == written
