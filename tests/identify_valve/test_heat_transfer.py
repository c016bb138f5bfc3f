"""A vessel that exchanges heat with its wall: what is measured then depends on what went before."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.identify.valve.model_gradient import QuasiStaticGradient
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import simulate
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages.identify_tables import valve_findings
from tests.identify_valve.synthetic_tests import identify

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


@cache
def vessel_tests() -> list[Recording]:
    return [charge_and_discharge(u, k) for k, u in enumerate((0.6, 1.2, 2.5, 6.0, 8.0, 10.0))]


def test_a_model_that_knows_nothing_of_heat_says_that_it_does_not_follow_the_curves() -> None:
    found = identify(vessel_tests(), RIG)
    assert found.lack_of_fit.is_significant
    assert {"valve-curves-not-followed", "valve-lack-of-fit"} <= {code for code, _ in valve_findings(found)}
    half = 0.5 * (found.map.ci_high - found.map.ci_low)[found.map.covered]
    assert np.median(half) > 0.05 * np.median(np.abs(found.map.gradient[found.map.covered]))


def test_heat_transfer_in_the_model_does_not_change_the_map_of_the_valve() -> None:
    """What the model's heat adds in these very tests is taken off: the map is the valve's, the gas as the wall."""
    found = identify(vessel_tests(), RIG, ["heat-transfer"])
    assert found.residual_to_noise("train") == pytest.approx(1.0, abs=0.1)
    assert found.lack_of_fit.p95 < 0.05
    u, p = np.meshgrid(found.map.u, found.map.p, indexing="ij")
    cold = QuasiStaticGradient(replace(WARM, effects=()), prepare(vessel_tests()[0], RIG, None))(
        u, p, np.full(u.shape, 7.5e5)
    )
    off = (found.map.gradient - cold)[found.map.covered]
    assert np.sqrt(np.mean(off**2)) < 0.005 * np.abs(cold).max()
    for one in found.iso:  # the gas's state is known: no isothermal vessel is left to doubt
        assert one.C.high < 1.3 * one.C.value
