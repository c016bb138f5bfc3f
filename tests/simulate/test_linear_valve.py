"""A valve of one gain: its area is proportional to the command, and it covers no overlap."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import TABLE_POINTS, LinearValve, ValveArea
from tests.simulate.synthetic_experiments import RIG

VALVE = LinearValve(2e-7, 8.0)


def test_the_area_is_proportional_to_the_command_both_ways():
    assert VALVE(np.array([-3.0, 0.0, 5.0])) == pytest.approx([6e-7, 0.0, 1e-6])


def test_the_table_ends_at_the_requested_command():
    table = VALVE.table(10.0)
    assert table.shape == (TABLE_POINTS,)
    assert table[0] == table[-1] == pytest.approx(2e-6)


def test_one_parameter_is_read_and_set_by_name():
    assert VALVE.parameters() == {"valve.gain": (2e-7, "m^2/V")}
    assert VALVE.with_parameters({"valve.gain": 3e-7, "rig.moving_mass": 1.0}).gain == 3e-7
    assert VALVE.scaled(2.0).gain == 4e-7


def test_a_map_covers_the_overlap_but_a_gain_does_not():
    assert "linear valve" in ValveArea((-1.0, 1.0), (1e-7, 1e-7)).covers
    assert "linear valve" not in VALVE.covers


def test_only_a_rig_that_has_a_part_can_lack_its_law():
    plain = Model(RIG, valve=VALVE)
    assert plain.excluded_parts == VALVE.covers | {"pump", "pressure valve", "switching valve"}
    pumped = replace(plain, rig=replace(RIG, source="pump"))
    assert plain.excluded_parts - pumped.excluded_parts == {"pump"}
    regulating = replace(plain, rig=replace(RIG, valve_kind="pressure"))
    assert plain.excluded_parts - regulating.excluded_parts == {"pressure valve"}
