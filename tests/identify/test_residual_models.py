"""Residual models: what they leave over of a true model, the balance of forces, and the pressures' derivatives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import fit
from pneucli.identify.estimation.model_fit import fit_model, fit_with_effect, free_parameters
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import base_parameters, effect_parameters
from pneucli.identify.residuals import ChamberPressures, ForceBalance, ResidualModel, base, residual_models
from pneucli.identify.residuals.base import MAX_RESIDUAL, bounded_difference
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import with_parameters
from pneucli.simulate.outputs import accelerometer_offset
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.run import simulate
from tests.compare.fixture_experiments import FixtureExperiments, load_fixture
from tests.simulate.synthetic_experiments import RIG, VALVE, held_commands, make_experiment, model, time_grid
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


# --- the balance of forces: what motion and pressures leave over, at rest and in motion, and how sure that is


TIME = time_grid(1.0)
AREA_1, AREA_2 = RIG.piston_areas


def pushed(force: float, v: float = 0.0, **more: Any) -> ForceBalance:
    """A piston under a constant net force of the pressures, at rest or sliding steadily."""
    p2 = 2e5
    p1 = RIG.ambient_pressure + (force + AREA_2 * (p2 - RIG.ambient_pressure)) / AREA_1
    signals = {"p1": p1, "p2": p2, "x": 0.1 + v * TIME, "v": v, **more}
    return ForceBalance(with_noise(make_experiment("friction", TIME, signals)))


def with_noise(e: Any) -> Any:
    """The experiment with a sensor of position that is nearly perfect."""
    e.noise["x"] = NoiseModel(1e-9)
    return e


INSIDE = slice(20, -20)


@pytest.mark.parametrize(
    ("v", "force", "left"), [(0.1, 30.0, 30.0 - 14.0 - 4.5), (-0.1, -30.0, -30.0 + 14.0 + 4.5), (0.2, 14.0, -9.0)]
)
def test_in_motion_the_residual_is_the_force_beyond_friction(v: float, force: float, left: float) -> None:
    """Coulomb friction of 14 N and 45 N s/m."""
    found = pushed(force, v).residual(model())["force"]
    assert found[INSIDE] == pytest.approx(np.full(961, left), abs=0.05)


@pytest.mark.parametrize(("force", "left"), [(10.0, 0.0), (-13.0, 0.0), (20.0, 6.0), (-20.0, -6.0)])
def test_at_rest_the_residual_is_the_force_beyond_static_friction(force: float, left: float) -> None:
    found = pushed(force).residual(model())["force"]
    assert found[INSIDE] == pytest.approx(np.full(961, left), abs=0.2)


@pytest.mark.parametrize(("force", "left"), [(10.0, 0.0), (-13.0, 0.0), (20.0, 6.0)])
def test_bristles_at_rest_take_the_deflection_that_the_force_tells(force: float, left: float) -> None:
    """Not the position: a micrometre of its noise is as much as 1 N here. A rigid contact says the same at rest."""
    read = 0.1 + 1e-6 * np.random.default_rng(0).standard_normal(TIME.size)
    elastic = model(["presliding"], {"presliding.stiffness": 1e6, "presliding.damping": 0.0})
    found = pushed(force, x=read).residual(elastic)["force"]
    assert found[INSIDE] == pytest.approx(np.full(961, left), abs=0.2)


def test_bristles_slide_off_from_the_deflection_at_rest() -> None:
    """From 10 N at rest to 14 N while sliding 1 mm/s: of the missing 4 N exp(-s / 14 um) remain."""
    slides = TIME > 0.5
    distance = 1e-3 * np.maximum(TIME - 0.5, 0.0)
    force = np.where(slides, 14.0 + 45.0 * 1e-3, 10.0)
    p1 = RIG.ambient_pressure + force / AREA_1
    signals = {"p1": p1, "p2": RIG.ambient_pressure, "x": 0.1 + distance, "v": np.where(slides, 1e-3, 0.0)}
    view = ForceBalance(with_noise(make_experiment("friction", TIME, signals)))
    elastic = model(["presliding"], {"presliding.stiffness": 1e6, "presliding.damping": 0.0})
    found, expected = view.residual(elastic)["force"], 4.0 * np.exp(-distance / 14e-6)
    sure = slides & (found != 0.0)
    assert np.count_nonzero(sure & (expected > 0.4)) > 10
    assert found[sure] == pytest.approx(expected[sure], abs=0.1)


def test_acceleration_is_a_force_of_the_mass() -> None:
    """3 m/s^2 of 2.2 kg while sliding, read by an accelerometer, or differentiated from the velocity."""
    v = 0.1 + 3.0 * TIME
    force = 14.0 + 45.0 * v + 2.2 * 3.0
    p1 = RIG.ambient_pressure + force / AREA_1
    signals = {"p1": p1, "p2": RIG.ambient_pressure, "x": 0.05 + 0.1 * TIME + 1.5 * TIME**2, "v": v}
    for more in ({}, {"a": 3.0}):
        e = with_noise(make_experiment("friction", TIME, {**signals, **more}))
        e.noise.update({"a": NoiseModel(0.0)})
        assert ForceBalance(e).residual(model())["force"][INSIDE] == pytest.approx(np.zeros(961), abs=0.05)


def test_without_an_accelerometer_position_gives_the_acceleration_and_its_error() -> None:
    time = 1e-3 * np.arange(2000)
    read = 0.01 * np.sin(10.0 * time) + 2e-6 * np.random.default_rng(0).standard_normal(time.size)
    noise = {"x": NoiseModel(2e-6), "p1": NoiseModel(100.0)}
    signals = {"x": read, "p1": 2e5 + 0.0 * time, "p2": 2e5 + 0.0 * time}
    view = ForceBalance(prepare(Recording("moved", "friction", "train", time, signals, noise, "closed"), RIG, None))
    a, true = view._acceleration_and_removed_force[0], -np.sin(10.0 * time)
    assert a[50:-50] == pytest.approx(true[50:-50], abs=0.2)
    drawn = [inputs_and_loads[1][0] - a for inputs_and_loads in view._noise_realisations(4, 0)]
    assert 1.0 < np.std(np.array(drawn)[:, 50:-50]) / np.std((a - true)[50:-50]) < 2.0


def resting(noise: float = 0.05, **values: float) -> ForceBalance:
    e = with_noise(make_experiment("friction", TIME, {"p1": 2e5, "p2": 2e5, "x": 0.1, "v": 0.0, "a": 0.3}))
    e.noise["a"] = NoiseModel(noise)
    return ForceBalance(e)


def test_an_accelerometer_at_rest_is_held_against_its_own_reading() -> None:
    biased = model(["acceleration-bias"], {"acceleration-bias.bias": 0.1})
    view = resting()
    assert view.channels == ("force", "a")
    assert view.residual(model())["a"][INSIDE] == pytest.approx(np.full(961, 0.3))
    assert view.residual(biased)["a"][INSIDE] == pytest.approx(np.full(961, 0.2))
    assert not view.residual(model())["a"][:1].any()  # at the edges the piston may be moving
    assert (accelerometer_offset(model(), view.experiment), accelerometer_offset(biased, view.experiment)) == (0.0, 0.1)
    assert resting(0.0).channels == ("force",)


def test_an_accelerometer_in_motion_is_not() -> None:
    view = pushed(20.0, 0.1, a=0.3)
    view.experiment.noise["a"] = NoiseModel(0.05)
    assert not view.residual(model())["a"].any()


def test_drawn_noise_propagates_like_the_sensors_noise() -> None:
    """A balance of unsmoothed pressures in motion: the noise of both, once; the accelerometer always its own."""
    view = pushed(30.0, 0.1)
    view.experiment.noise.update({"p1": NoiseModel(300.0), "p2": NoiseModel(400.0)})
    view = ForceBalance(replace(view.experiment))
    found = view.monte_carlo_rms(model(), {}, 2, 11)
    assert found["force"] == pytest.approx(1.0, abs=0.1)
    still = resting()
    still.experiment.noise.update({"p1": NoiseModel(300.0)})
    at_rest = still.monte_carlo_rms(model(), {}, 1, 11)
    assert at_rest["a"] == 1.0
    assert at_rest["force"] < 0.01  # friction holds the piston, and takes the noise too


@pytest.mark.parametrize(("effect", "channels"), [("acceleration-bias", ("a",)), ("constant-force", ())])
def test_the_accelerometer_at_rest_reads_nothing_but_its_own_fault(effect: str, channels: tuple[str, ...]) -> None:
    """Only where it was recorded; whatever pushes the piston, at rest it reads zero."""
    e = with_noise(make_experiment("friction", TIME, {"p1": 3e5, "p2": 3e5, "x": 0.1, "a": 0.0}))
    e.noise["a"] = NoiseModel(0.1)
    assert ForceBalance(e).exclusive_channels(catalogue()[effect]) == channels
    silent = with_noise(make_experiment("friction", TIME, {"p1": 3e5, "p2": 3e5, "x": 0.1}))
    assert ForceBalance(silent).exclusive_channels(catalogue()[effect]) == ()


# --- the pressure residuals: which channels a single effect explains alone, and their derivatives


@pytest.mark.parametrize(("effect", "channels"), [("heat-transfer", ("temperature",)), ("chamber-leak", ())])
def test_only_heat_transfer_changes_the_modelled_gas_temperature(effect: str, channels: tuple[str, ...]) -> None:
    measured = {"u": 1.0, "p_supply": 7e5, "p1": 3e5}
    e = make_experiment("valve", TIME, measured | {"temperature": 293.15})
    e.noise.update({"p1": NoiseModel(400.0), "temperature": NoiseModel(1.0)})
    assert ChamberPressures(e).exclusive_channels(catalogue()[effect]) == channels
    assert ChamberPressures(make_experiment("valve", TIME, measured)).exclusive_channels(catalogue()[effect]) == ()


def test_one_simulation_gives_the_derivatives_of_weighted_and_whitened_residuals_that_differences_give(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    time = time_grid(0.4)
    u = held_commands(time, (0.0, 6.0, -3.0, 7.0), 0.1)
    made = make_experiment(
        "axis", time, {"u": u, "u2": -u, "p1": 3e5, "p2": 4e5, "x": 0.1, "v": 0.0}, "valve", (0, 200)
    )
    lost = made.recording["p2"].copy()
    lost[50:90] = np.nan
    recording = replace(made.recording, signals={**made.recording.signals, "p2": lost})
    noise = {"p1": NoiseModel(200.0), "p2": NoiseModel(300.0)}
    pressures = ChamberPressures(
        replace(made, recording=recording, noise=noise).without_mechanics(), weights={"p1": 0.4}
    )
    scaled = model(["pressure-scale"], {"pressure-scale.scale": 1.01})
    free = [f for f in base_parameters(model(), [made]) if f.name in VALVE.parameters()]
    free += effect_parameters(catalogue()["pressure-scale"], scaled, rig_quantities(scaled, [made]))
    problem = LeastSquaresProblem(scaled, [pressures], free, [{"p1": np.full((1, time.size), 0.3)}])
    at_once = problem.jacobian(problem.start)
    monkeypatch.setattr(ChamberPressures, "differentiable", ResidualModel.differentiable)
    by_differences = problem.jacobian(problem.start)
    for one, other in zip(at_once.T, by_differences.T, strict=True):
        assert np.linalg.norm(one - other) <= 1e-3 * np.linalg.norm(other)
    assert not at_once[time.size + 50 : time.size + 90].any()
    assert all(np.linalg.norm(column) > 0.0 for column in at_once.T)


def test_a_diverging_model_tells_nothing_of_initial_states_and_warns_of_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Warnings are errors in tests; without the derivative its cost is infinite, and a fit steps back."""
    reading = 3e5 + np.random.default_rng(1).normal(scale=400.0, size=TIME.size)
    e = prepare(make_experiment("valve", TIME, {"u": 1.0, "p_supply": 7e5, "p1": reading}).recording, RIG, 0.5)
    gone = {name: np.full(TIME.size, np.inf) for name in ("p1", "p2")}
    monkeypatch.setattr(base, "simulate", lambda *_: gone)
    assert not np.isfinite(base.initial_state_sensitivity(model(), e, {"p1": 1.0, "p2": 1.0})["p1"]).any()
