"""A flow that was recorded tells area and volume apart, of which pressure alone tells the ratio."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.fit import fit
from pneucli.identify.estimation.parameters import base_parameters
from pneucli.identify.residuals import residual_models
from pneucli.noise import NoiseModel
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.run import run
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid

RIG = Rig(ambient_pressure=101_300.0, supply_pressure=7e5)
VOLUME = 5e-4
TIME = time_grid(0.4)


def test_area_and_volume_are_identified_together() -> None:
    truth = model(values={"rig.vessel_volume": VOLUME}, rig=RIG)
    e = make_experiment("valve", TIME, {"u": 5.0, "p1": 101_300.0}, rig=RIG)
    out = run(truth, e)
    seen = {"p1": out[:, at.R1], "flow": out[:, at.FLOW]}
    recording = replace(e.recording, signals={**e.recording.signals, **seen})
    noise = {**e.noise, "p1": NoiseModel(100.0), "flow": NoiseModel(1e-6)}
    metered = replace(e, recording=recording, raw={**e.raw, **seen}, noise=noise)
    assert metered.channels == ("p1", "flow")
    start = replace(truth.with_values({"rig.vessel_volume": 1e-3}), valve=truth.valve.scaled(1.5))
    found = fit(start, residual_models([metered]), base_parameters(start, [metered]))
    assert found["rig.vessel_volume"].value == pytest.approx(VOLUME, rel=1e-3)
    assert found["valve.effective_area(+5 V)"].value == pytest.approx(0.9e-6, rel=1e-3)
    assert np.abs(found.residual[: 2 * TIME.size]).max() < 1.0
