"""With the true parameters, errors are as large as the expected error of a correct model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneucli.compare import ChannelResult, compare, overall_error
from pneucli.compare.expected_error import expected_rms
from pneucli.simulate.noise_propagation import sample_deviations
from tests.compare.fixture_experiments import FixtureExperiments, load_fixture


@pytest.fixture(scope="module")
def vessel(tmp_path_factory: pytest.TempPathFactory) -> FixtureExperiments:
    return load_fixture("valve_null", tmp_path_factory)


@pytest.fixture(scope="module")
def piston(tmp_path_factory: pytest.TempPathFactory) -> FixtureExperiments:
    return load_fixture("friction_null_coulomb", tmp_path_factory)


def results(found: FixtureExperiments) -> list[ChannelResult]:
    model, experiments = found
    return [r for e in experiments for r in compare(model, e).results]


def test_pressures_of_a_vessel_are_at_their_noise(vessel: FixtureExperiments) -> None:
    for r in results(vessel):
        assert r.ratio_to_noise == pytest.approx(1.0, abs=0.15), r.recording
    assert overall_error(results(vessel), "test") == pytest.approx(1.0, abs=0.1)


def test_motion_is_at_its_noise(piston: FixtureExperiments) -> None:
    """x of a stick-slip is one slip or two, whose ends scatter: three standard deviations of so few are a factor."""
    for r in results(piston):
        low = 0.3 if r.channel == "x" and r.recording.startswith("stickslip") else 0.7
        assert low < r.ratio_to_noise < 1.6, (r.recording, r.channel)
    for use in ("train", "test"):
        assert overall_error(results(piston), use) == pytest.approx(1.0, abs=0.25)


def test_a_wrong_parameter_exceeds_the_expected_error(vessel: FixtureExperiments, piston: FixtureExperiments) -> None:
    model, experiments = piston
    rough = model.with_values({"friction.coulomb": 1.2 * model.values["friction.coulomb"]})
    assert overall_error(results((rough, experiments)), "test") > 4.0
    model, experiments = vessel
    wide = replace(model, valve=replace(model.valve, areas=tuple(1.05 * a for a in model.valve.areas)))
    assert overall_error(results((wide, experiments)), "test") > 3.0


def test_the_noise_of_the_restart_state_is_propagated(vessel: FixtureExperiments) -> None:
    """Just after a restart a correct model is off by the sensor's noise and the restart's, which are not the same."""
    model, experiments = vessel
    e = experiments[0]
    drawn = sample_deviations(model, e, draws=40)["p1"]
    sensor = e.noise["p1"].rms
    rms = np.sqrt(np.mean(drawn**2))
    assert sensor < rms < 1.3 * sensor
    assert expected_rms(model, e)["p1"] == pytest.approx(rms, rel=0.1)


def test_draws_repeat_and_follow_the_seed(vessel: FixtureExperiments) -> None:
    model, experiments = vessel
    one, again, other = (sample_deviations(model, experiments[0], draws=2, seed=s)["p1"] for s in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


def test_noise_is_never_below_quantisation(piston: FixtureExperiments) -> None:
    """The encoder counts micrometres; interface, section 3: never below a step / sqrt(12)."""
    for r in results(piston):
        if r.channel == "x":
            assert r.noise >= 1e-6 / np.sqrt(12)
