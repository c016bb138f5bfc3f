"""A vessel that exchanges heat with its wall: what the law cannot hold exactly must not lead the curves astray."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.identify.valve import identify_valve
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import prepare
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate
from pneucli.simulate.valve_area import ValveArea

RIG = Rig(ambient_pressure=1.013e5, supply_pressure=7.5e5, vessel_volume=160e-6)
NOISE = NoiseModel(white=250.0)
WARM = Model(
    RIG,
    (catalogue()["heat-transfer"],),
    {"rig.vessel_volume": 160e-6, "heat-transfer.conductance": 0.7},
    ValveArea((-10.0, -1.0, 1.0, 10.0), (1.7e-6, 1.5e-7, 1.5e-7, 1.7e-6), 0.2, 0.2),
)


def charge_and_discharge(level: float, seed: int) -> Recording:
    time = 1e-3 * np.arange(1600)
    u = np.select([time < 0.1, time < 0.8, time < 0.9], [0.0, level, 0.0], -level)
    still = Recording(f"{level} V", "valve", "train", time, {"u": u, "p1": np.full(1600, 1.013e5)})
    p = simulate(WARM, prepare(still, RIG, None))["p1"]
    read = p + NOISE.draw(time, np.random.default_rng(seed))
    return Recording(still.name, "valve", "train", time, {"u": u, "p1": read}, {"p1": NOISE})


def test_curves_are_followed_though_heat_is_exchanged() -> None:
    """Heat makes the gradient depend on what went before; little more than noise stays, not a drift of kilopascal."""
    found = identify_valve([charge_and_discharge(u, k) for k, u in enumerate((0.6, 1.2, 2.5, 6.0, 8.0, 10.0))], RIG)
    assert NOISE.rms < found.noise_rms < 2 * NOISE.rms
    assert max(found.residual_rms.values()) < 3 * NOISE.rms
    assert found.overlap["charge"].value == pytest.approx(0.2, abs=0.3)
