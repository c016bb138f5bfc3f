"""What the views leave over of a true model: noise, also at break-aways, behind a lag and after each restart."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import fit
from pneucli.identify.estimation.model_fit import fit_model, fit_with_effect, free_parameters
from pneucli.identify.residuals import ChamberPressures, ForceBalance, ResidualModel, residual_models
from pneucli.identify.residuals.base import MAX_RESIDUAL, bounded_difference
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import with_parameters
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import simulate
from tests.compare.fixture_experiments import FixtureExperiments, load_fixture
from tests.simulate.synthetic_experiments import held_commands, model, time_grid
from tests.simulate.synthetic_experiments import make_experiment as ideal

LAG = 0.004  # s


@pytest.fixture(scope="module")
def stribeck(tmp_path_factory: pytest.TempPathFactory) -> FixtureExperiments:
    return load_fixture("friction_null_stribeck", tmp_path_factory)


def test_static_friction_is_met_at_break_aways(stribeck: FixtureExperiments):
    """What the true model leaves over at 25 break-aways is noise: its mean is within 3 standard errors of none."""
    true, experiments = stribeck
    left = np.concatenate([leftover(ForceBalance(e), true) for e in experiments])
    assert left.size > 20
    assert abs(left.mean()) < 3.0 * left.std() / np.sqrt(left.size)
    assert left.std() < 0.05 * true.values["stribeck.static"]


def leftover(view: ResidualModel, true: object) -> np.ndarray:
    return view.residual(true)["force"][view._breakaways_and_uncertain_direction[0] != 0.0]


def test_an_effect_leads_a_law_of_friction_out_of_another_part_of_the_curve(stribeck: FixtureExperiments):
    """The law describes how friction bends at high speed: a minimum that a fit does not leave by itself."""
    true, experiments = stribeck
    views, velocity = [ForceBalance(e) for e in experiments], true.values["stribeck.velocity"]
    curve = {"friction.coulomb": 28.0, "stribeck.static": 6.0, "stribeck.velocity": 0.9}
    start = with_parameters(true, curve)
    bent = fit(start, views, free_parameters(start, views))
    found = fit_with_effect(bent, views, catalogue()["constant-force"])
    assert bent["stribeck.velocity"].value > 10.0 * velocity
    assert found["stribeck.velocity"].value == pytest.approx(velocity, rel=0.1)
    assert found.cost < 0.2 * bent.cost


def test_a_lag_of_the_pressures_is_not_found_too_small(stribeck: FixtureExperiments):
    """Readings put through 4 ms and noise of 800 Pa; comparing pressures with the lag undone gives 1.9 ms.

    5 %: smoothing the readings that stand in for the truth, and the sampling, are worth 3 % here.
    """
    true, experiments = stribeck
    late = [through_lag(e, seed) for seed, e in enumerate(experiments)]
    added = [catalogue()["stribeck"], catalogue()["pressure-lag"]]
    found = fit_model(true, residual_models(late), added)
    assert found["pressure-lag.time_constant"].value == pytest.approx(LAG, rel=0.05)


def through_lag(e: Experiment, seed: int) -> Experiment:
    """The experiment with pressures that a first-order sensor read, exact for straight lines between the samples."""
    decay, rng = np.exp(-e.recording.period / LAG), np.random.default_rng(seed)
    mean = (1.0 - decay) * LAG / e.recording.period
    signals = dict(e.recording.signals)
    for name, column in (("p1", at.IN_P1), ("p2", at.IN_P2)):
        true, read = e.inputs[:, column], e.inputs[:, column].copy()
        for k in range(1, read.size):
            read[k] = decay * read[k - 1] + (mean - decay) * true[k - 1] + (1.0 - mean) * true[k]
        signals[name] = read + rng.normal(scale=800.0, size=read.size)
    return prepare(replace(e.recording, signals=signals), e.rig, None)


@pytest.fixture
def chamber() -> ResidualModel:
    """A chamber that is filled and vented, restarted every 0.1 s, read with noise of 500 Pa and smoothed."""
    time, rng = time_grid(2.0), np.random.default_rng(2)
    given = {"u": held_commands(time, [2.0, -2.0, 1.0, -1.0], 0.5), "x": np.full(time.size, 0.1)}
    exact = ideal("axis", time, {**given, "v": np.zeros(time.size), "p1": 2e5}, chamber_2="open")
    exact.flags[at.MECHANICS] = 0.0
    readings = simulate(model(), exact)["p1"] + rng.normal(scale=500.0, size=time.size)
    recording = replace(exact.recording, signals={**given, "p1": readings})
    ready = prepare(recording, exact.rig, 0.1)
    ready.flags[at.MECHANICS] = 0.0
    return ChamberPressures(ready, whiten_initial_state=True)


def test_initial_state_errors_are_whitened_in_a_chamber(chamber: ResidualModel):
    """White noise of 1 remains, where the errors of the starts, carried on, would add to it."""
    scale = chamber.noise["p1"]
    plain = chamber.residual(model(), {})["p1"] / scale
    settled = chamber.residual(model())["p1"] / scale
    assert np.std(plain) > np.std(settled)
    assert np.std(settled) == pytest.approx(1.0, abs=0.05)


def test_other_errors_are_not_whitened_away(chamber: ResidualModel):
    """A sine that does not look like one loses less than a tenth."""
    sine = {"p1": 1000.0 * np.sin(2 * np.pi * 50.0 * chamber.experiment.time)}
    left = chamber.apply_whitening(sine, chamber.initial_state_sensitivity(model()))
    assert np.std(left["p1"]) > 0.9 * np.std(sine["p1"])


def test_the_start_of_a_late_sensor_errs_as_that_of_any(chamber: ResidualModel):
    """A lag is not undone, so it gains nothing by the noise of a slope: 2 % come from its own dynamics."""
    late = model(["pressure-lag"], {"pressure-lag.time_constant": 0.005})
    plain, lagging = (np.linalg.norm(chamber.initial_state_sensitivity(one)["p1"]) for one in (model(), late))
    assert lagging == pytest.approx(plain, rel=0.02)


def test_what_draws_of_noise_become_is_pooled_in_units_of_noise(
    chamber: ResidualModel, monkeypatch: pytest.MonkeyPatch
):
    """Draws of 3 and 4: the root of 12.5."""
    n, asked = chamber.experiment.time.size, []

    def deviations(model: object, experiment: object, draws: int) -> dict[str, np.ndarray]:
        asked.append((experiment, draws))
        return {"p1": np.repeat([[3.0], [4.0]], n, axis=1), "else": np.zeros((2, n))}

    monkeypatch.setattr("pneucli.identify.residuals.base.sample_deviations", deviations)
    found = chamber.monte_carlo_rms(model(), {}, 2, 11)
    assert found == {"p1": pytest.approx(np.sqrt(12.5) / chamber.noise["p1"])}
    assert asked == [(chamber.experiment, 2)]


def test_a_channel_that_never_changes_has_no_measure_and_is_left_out():
    e = ideal("axis", time_grid(1.0), {"u": 1.0, "p1": 2e5, "p2": 2e5, "x": 0.1})
    noise = dict.fromkeys(("p1", "p2", "x"), NoiseModel(white=1.0))
    dead = replace(e, noise={**noise, "p2": NoiseModel(white=0.0)})
    (chambers,) = [view for view in residual_models([dead]) if isinstance(view, ChamberPressures)]
    assert chambers.channels == ("p1",)
    both = replace(dead, noise={**dead.noise, "p1": NoiseModel(white=0.0)})
    assert [type(view) for view in residual_models([both])] == [ForceBalance]


def test_a_diverging_model_has_large_finite_residuals():
    measured = np.array([1.0, np.nan, 2.0, 3.0])
    left = bounded_difference(measured, np.array([0.5, 1.0, np.nan, -np.inf]), noise=0.1)
    np.testing.assert_array_equal(left, [0.5, 0.0, 0.1 * MAX_RESIDUAL, 0.1 * MAX_RESIDUAL])


def test_an_effect_whose_part_no_recording_has_is_refused():
    e = ideal("valve", time_grid(1.0), {"u": 1.0, "p1": 2e5})
    with pytest.raises(InputError, match=r"stribeck.*no training recording has \(cylinder\)"):
        fit_model(model(), residual_models([e]), [catalogue()["stribeck"]])
