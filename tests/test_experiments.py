"""What a kind of experiment means is asked of its one entry."""

from typing import get_args

import pytest

from pneucli.experiments import EXPERIMENT_KINDS, ExperimentName
from pneucli.identify.residuals import ChamberPressures, ForceBalance, FreeRun, ImposedMotion
from pneucli.physics.effects import catalogue
from pneucli.physics.ports import PORTS


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
