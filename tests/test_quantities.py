"""What is told of a rotary axis carries its units and names."""

from pathlib import Path

import pytest

from pneucli.io.artifacts import Provenance, read_metadata, read_table, write_table
from pneucli.messages.diagnose import discrepancy_kind_text
from pneucli.messages.formatting import format_quantity
from pneucli.quantities import axis_motion, axis_unit, display_unit, in_axis_units

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
        assert (display_unit("x"), display_unit("p1")) == ("deg", "bar")
    assert display_unit("x") == "mm"
    assert display_unit("x", "rad") == "deg"


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
