"""The pressure residuals: which channels a single effect explains alone."""

import pytest

from pneucli.identify.residuals import ChamberPressures
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from tests.simulate.synthetic_experiments import make_experiment, time_grid

TIME = time_grid(1.0)


@pytest.mark.parametrize(("effect", "channels"), [("heat-transfer", ("temperature",)), ("chamber-leak", ())])
def test_only_heat_transfer_changes_the_modelled_gas_temperature(effect: str, channels: tuple[str, ...]) -> None:
    measured = {"u": 1.0, "p_supply": 7e5, "p1": 3e5}
    e = make_experiment("valve", TIME, measured | {"temperature": 293.15})
    e.noise.update({"p1": NoiseModel(400.0), "temperature": NoiseModel(1.0)})
    assert ChamberPressures(e).exclusive_channels(catalogue()[effect]) == channels
    assert ChamberPressures(make_experiment("valve", TIME, measured)).exclusive_channels(catalogue()[effect]) == ()
