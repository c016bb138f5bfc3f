"""Coordinates of a fit, starts of an effect, what its signature promises, and how it is added."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.identify.estimation import model_fit as added
from pneucli.identify.estimation import score_test
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import require_finite
from pneucli.identify.estimation.parameters import FreeParameter, base_parameters, effect_parameters, null_value
from pneucli.identify.estimation.score_test import ScoreTest, initial_guesses, scaled_initial_guess, score_tests
from pneucli.identify.residuals import ChamberPressures, ForceBalance, FreeRun, ImposedMotion, residual_models
from pneucli.noise import NoiseModel
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.effects import catalogue
from pneucli.physics.scales import RigQuantities
from pneucli.simulate.experiment import SignalRanges
from pneucli.simulate.model import parameter_value, with_effect, with_parameters
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms import ValveArea
from tests.simulate.synthetic_experiments import RIG, make_experiment, model, time_grid

RNG = np.random.default_rng
FACTS = rig_quantities(model())
N = 2000


# --- coordinates


def test_a_coordinate_is_the_value_over_its_scale_or_its_logarithm() -> None:
    linear = FreeParameter("a", "N", 10.0, 0.0, 1e3, 5.0)
    assert (linear.to_coordinate(15.0), linear.from_coordinate(3.0), linear.derivative(15.0)) == (3.0, 15.0, 5.0)
    curved = replace(linear, logarithmic=True)
    assert (curved.to_coordinate(np.e), curved.from_coordinate(1.0), curved.derivative(7.0)) == (
        1.0,
        pytest.approx(np.e),
        7.0,
    )
    assert np.isfinite(curved.from_coordinate(1e6))
    assert (linear.prior_sigma, linear.step, linear.logarithmic) == (np.inf, 1e-4, False)


def test_values_of_all_kinds_are_read_and_replaced_by_name() -> None:
    known = model(["stribeck"], {"stribeck.static": 20.0, "stribeck.velocity": 0.01})
    areas = [name for name in known.valve.parameters() if "area" in name]
    assert parameter_value(known, "stribeck.static") == 20.0
    assert parameter_value(known, "friction.coulomb") == 14.0
    assert parameter_value(known, "rig.dead_volume_1") == RIG.dead_volume_1
    assert parameter_value(known, areas[0]) == known.valve.areas[0]
    changed = with_parameters(known, {"stribeck.static": 25.0, areas[0]: 3e-6, "friction.viscous": 1.0})
    assert parameter_value(changed, "stribeck.static") == 25.0
    assert parameter_value(changed, areas[0]) == 3e-6
    assert parameter_value(changed, areas[1]) == known.valve.areas[1]
    assert (changed.values["friction.viscous"], changed.values["friction.coulomb"]) == (1.0, 14.0)


def free_names(*experiments: Any, **rig: Any) -> list[str]:
    return [f.name.partition("(")[0] for f in base_parameters(model(rig=replace(RIG, **rig)), experiments)]


DRIVEN = make_experiment("axis", time_grid(0.1), {"u": 4.0, "p1": 3e5, "p2": 3e5, "x": 0.1})
PUSHED = make_experiment("friction", time_grid(0.1), {"p1": 3e5, "p2": 3e5, "x": 0.1})
FILLED = make_experiment("valve", time_grid(0.1), {"u": 4.0, "p1": 3e5})
SHUT = make_experiment("valve", time_grid(0.1), {"u": 4.0, "p1": 3e5}, valve_shut=True)


def test_base_parameters_are_those_that_the_experiments_can_tell() -> None:
    friction = ["friction.coulomb", "friction.viscous"]
    valve = ["valve.effective_area"] * 4 + ["valve.overlap_fill", "valve.overlap_vent"]
    assert free_names(PUSHED) == friction
    assert free_names(FILLED) == valve
    assert free_names(DRIVEN) == free_names(PUSHED, FILLED) == friction + valve
    assert free_names(SHUT) == []
    assert free_names(PUSHED, moving_mass=None)[:3] == [*friction, "rig.moving_mass"] or RIG.moving_mass is None


def test_an_overlap_ends_below_the_smallest_knot_of_its_own_direction() -> None:
    """A duty that opens nothing has no knot: of pulses shorter than the dead time, say, that fill but vent."""
    valve = ValveArea((-10.0, -1.5, 3.0, 10.0), (1e-6, 1e-7, 3e-7, 1e-6))
    found = {f.name: f.upper for f in base_parameters(replace(model(), valve=valve), [FILLED])}
    assert found["valve.overlap_fill"] == pytest.approx(0.95 * 3.0)
    assert found["valve.overlap_vent"] == pytest.approx(0.95 * 1.5)


def test_areas_are_fitted_as_logarithms_and_friction_from_its_guess() -> None:
    found = {f.name.partition("(")[0]: f for f in base_parameters(model(), [DRIVEN])}
    coulomb, area = found["friction.coulomb"], found["valve.effective_area"]
    assert (coulomb.start, coulomb.scale, coulomb.unit, coulomb.lower, coulomb.logarithmic) == (
        14.0,
        14.0,
        "N",
        0.0,
        False,
    )
    assert found["friction.viscous"].start == 45.0
    assert (area.logarithmic, area.unit) == (True, "m^2")
    none = {f.name: f for f in base_parameters(model(values={"friction.coulomb": 0.0}), [PUSHED])}
    assert none["friction.coulomb"].scale > 0.0


def test_an_effects_parameters_start_at_given_present_or_typical_values() -> None:
    force = catalogue()["constant-force"]
    declared = force.parameters[0].range_on(FACTS)
    (typical,) = effect_parameters(force, model(), FACTS)
    (known,) = effect_parameters(force, model(["constant-force"], {"constant-force.force": 30.0}), FACTS)
    (given,) = effect_parameters(force, model(), FACTS, {"constant-force.force": -7.0})
    assert (typical.start, known.start, given.start) == (declared.typical[0], 30.0, -7.0)
    assert (given.scale, known.scale) == (7.0, 30.0)
    assert (given.name, given.unit, given.lower, given.upper) == (
        "constant-force.force",
        "N",
        declared.lower,
        declared.upper,
    )
    (most,) = effect_parameters(force, model(), FACTS, {"constant-force.force": 1e99})
    assert most.start == declared.upper
    (near,) = effect_parameters(force, model(), FACTS, {"constant-force.force": 1e-9})
    assert near.scale == pytest.approx(0.1 * abs(declared.typical[0]))


def test_a_scale_is_the_distance_from_null() -> None:
    (scale,) = effect_parameters(catalogue()["pressure-scale"], model(), FACTS, {"pressure-scale.scale": 1.3})
    assert scale.scale == pytest.approx(0.3)


def test_a_parameter_without_null_and_above_zero_is_a_logarithm() -> None:
    stiffness = effect_parameters(catalogue()["presliding"], model(), FACTS)[0]
    assert stiffness.logarithmic
    assert not effect_parameters(catalogue()["constant-force"], model(), FACTS)[0].logarithmic


def test_a_null_may_be_a_number_another_parameter_or_none() -> None:
    def null(effect: str, parameter: str) -> float | None:
        declared = next(p for p in catalogue()[effect].parameters if p.name == parameter)
        return null_value(declared, model())

    assert null("constant-force", "force") == 0.0
    assert null("pressure-scale", "scale") == 1.0
    assert null("stribeck", "static") == 14.0
    assert null("stribeck", "velocity") is None
    assert null("presliding", "stiffness") is None


# --- starts


def parameter(name: str, *typical: float | str) -> Parameter:
    return Parameter(name, "N", 0.0, -9e9, 9e9, typical)


def made_of(*parameters: Parameter) -> Effect:
    one: Any = SimpleNamespace(name="e", parameters=parameters)
    one.in_model_with = lambda effects: one
    return one  # type: ignore[no-any-return]


def test_starts_are_typical_values_on_this_rig() -> None:
    shares = made_of(parameter("a", "0.5 Coulomb forces", "2 Coulomb forces"))
    assert initial_guesses(shares, RigQuantities(coulomb=14.0)) == [{"e.a": 7.0}, {"e.a": 28.0}]


def test_a_share_of_an_unknown_quantity_gives_no_start() -> None:
    assert initial_guesses(made_of(parameter("a", "0.5 Coulomb forces")), RigQuantities()) == []


def test_starts_are_all_combinations_with_from_below_to() -> None:
    one = made_of(parameter("from", 1.0, 2.0), parameter("to", 2.0, 3.0), parameter("gain", 5.0))
    assert initial_guesses(one, RigQuantities()) == [
        {"e.from": 1.0, "e.to": 2.0, "e.gain": 5.0}, {"e.from": 1.0, "e.to": 3.0, "e.gain": 5.0},
        {"e.from": 2.0, "e.to": 3.0, "e.gain": 5.0},
    ]  # fmt: skip


def test_an_effect_is_switched_on_once() -> None:
    force = catalogue()["constant-force"]
    one = with_effect(
        model(["stribeck"], {"stribeck.static": 20.0, "stribeck.velocity": 0.01}), force, {"constant-force.force": 3.0}
    )
    assert [e.name for e in one.effects] == ["stribeck", "constant-force"]
    assert one.values["constant-force.force"] == 3.0
    assert [e.name for e in with_effect(one, force, {}).effects] == ["stribeck", "constant-force"]


# --- signatures


def fitted(columns: np.ndarray, residual: np.ndarray, blocks: int = 20) -> Fit:
    free = tuple(FreeParameter(f"f{k}", "N", 1.0, 0.0, 9.0, 1.0) for k in range(columns.shape[1]))
    none = np.zeros((len(free), len(free)))
    numbers = np.arange(residual.size) // (residual.size // blocks)
    return Fit(model(), free, (), residual, columns, numbers, none, float(residual @ residual), ())


def test_the_score_test_predicts_the_gain_of_the_best_step_with_base_parameters_adjusting() -> None:
    rng = RNG(1)
    base, change = rng.standard_normal((N, 1)), rng.standard_normal(N)
    residual = rng.standard_normal(N) - 0.3 * change + 2.0 * base[:, 0]
    found = fitted(base, residual)
    mine = score_test._score_test({"e.a": 1.0}, change, found, nested=True)
    both = np.column_stack([base, change])
    least = residual - both @ np.linalg.lstsq(both, residual, rcond=None)[0]
    alone = found.projected_residual
    assert mine.step == pytest.approx(-np.linalg.lstsq(both, residual, rcond=None)[0][1])
    assert mine.step == pytest.approx(0.3, abs=0.05)
    assert mine.gain == pytest.approx(alone @ alone - least @ least)
    null = score_test._score_test({}, change, fitted(base, rng.standard_normal(N)), nested=True)
    assert null.step_error == pytest.approx(1 / np.sqrt(N), rel=0.4)  # from twenty blocks
    assert mine.values == {"e.a": 1.0}


def test_an_effect_that_is_not_nested_is_tested_at_full_size() -> None:
    rng = RNG(2)
    base, change = rng.standard_normal((N, 1)), rng.standard_normal(N)
    found = fitted(base, rng.standard_normal(N) - 0.7 * change)
    mine = score_test._score_test({}, change, found, nested=False)
    target, new = found.projected_residual, found.project_out_nuisance(change)
    assert mine.step == 1.0
    assert mine.gain == pytest.approx(target @ target - (target + new) @ (target + new))


@pytest.mark.parametrize("change", ["base", "nan", "none"])
def test_a_change_within_the_base_model_or_a_diverging_one_has_no_gain(change: str) -> None:
    base = RNG(3).standard_normal((N, 1))
    columns = {"base": 2.0 * base[:, 0], "nan": np.full(N, np.nan), "none": np.zeros(N)}
    with np.errstate(invalid="ignore"):
        mine = score_test._score_test({}, columns[change], fitted(base, RNG(4).standard_normal(N)), nested=True)
    assert (mine.gain, mine.step, mine.step_error) == (0.0, 0.0, np.inf)


EXTENT = SignalRanges(command=10.0, pressure=6e5, force=400.0, speed=0.5, low=0.0, high=0.2, period=1e-3)


class View:
    """A view of one channel whose residual falls by a wave times the force."""

    channels, is_simulated = ("x",), True

    def __init__(self, wave: np.ndarray, felt: bool = True) -> None:
        self.wave, self.felt = wave, felt
        recording = SimpleNamespace(name="run 7", kind=SimpleNamespace(valve=False), signals={})
        self.experiment = SimpleNamespace(
            time=np.arange(wave.size),
            horizon=1.0,
            restarts=np.arange(2),
            raw={},
            signal_ranges=EXTENT,
            recording=recording,
        )
        self.noise = {"x": 2.0}
        self.weights: dict[str, float] = {}

    def is_sensitive_to(self, effect: Any) -> bool:
        return self.felt

    def initial_state_sensitivity(self, model: Any) -> dict[str, Any]:
        return {}

    def residual(self, model: Any, errors: Any = None) -> dict[str, np.ndarray]:
        return {"x": 10.0 - model.values.get("constant-force.force", 0.0) * self.wave}


def test_score_tests_are_sorted_by_gain_and_evaluate_sensitive_residual_models() -> None:
    force = catalogue()["constant-force"]
    views: Any = [View(np.ones(400)), View(np.ones(600), felt=False)]
    found = replace(fitted(np.zeros((1000, 0)), np.full(1000, 5.0)), initial_state_sensitivities=({}, {}))
    ranked = score_tests(force, found, views)
    assert {s.values["constant-force.force"] for s in ranked} == set(force.parameters[0].range_on(FACTS).typical)
    assert [s.gain for s in ranked] == sorted((s.gain for s in ranked), reverse=True)
    blind: Any = [View(np.ones(400), felt=False), View(np.ones(600), felt=False)]
    assert score_tests(force, found, blind) == []
    (change,) = score_test.residual_changes(force, found, views, [{"constant-force.force": 8.0}])
    assert change.tolist() == [-4.0] * 400 + [0.0] * 600


@pytest.mark.parametrize(
    ("step", "share", "value"), [(0.5, 1.0, 5.0), (0.5, 0.1, 0.5), (0.01, 1.0, 0.5), (9.0, 1.0, 50.0), (-2.0, 1.0, 0.5)]
)
def test_a_start_is_the_predicted_step_from_null_limited_to_a_twentieth_and_five(
    step: float, share: float, value: float
) -> None:
    signature = ScoreTest({"constant-force.force": 10.0}, 1.0, step, 1.0)
    found = scaled_initial_guess(catalogue()["constant-force"], signature, model(), FACTS, share)
    assert found == {"constant-force.force": pytest.approx(value)}


def test_only_parameters_with_a_null_are_scaled_and_within_bounds() -> None:
    signature = ScoreTest({"stribeck.static": 24.0, "stribeck.velocity": 0.01}, 1.0, 2.0, 1.0)
    found = scaled_initial_guess(catalogue()["stribeck"], signature, model(), FACTS)
    assert found == {"stribeck.static": pytest.approx(34.0), "stribeck.velocity": 0.01}
    declared = catalogue()["chamber-leak"].parameters[0].range_on(FACTS)
    far = ScoreTest({"chamber-leak.area": declared.upper}, 1.0, 5.0, 1.0)
    assert scaled_initial_guess(catalogue()["chamber-leak"], far, model(), FACTS)["chamber-leak.area"] == declared.upper


# --- adding


def test_a_model_without_finite_numbers_is_refused_by_recording_and_channel() -> None:
    view = View(np.full(9, np.nan))
    with pytest.raises(InputError, match=r"(?s)no finite x for run 7.*belong to one rig.*ingest"):
        require_finite(model(values={"constant-force.force": 1.0}), [view])  # type: ignore[list-item]


def test_a_fit_that_ends_without_finite_numbers_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first guess is finite, and an effect of the pipeline leaves that region: nothing could judge such a fit."""
    force = catalogue()["constant-force"]
    lost = with_effect(model(), force, {"constant-force.force": np.nan})
    monkeypatch.setattr(added, "fit", lambda started, *_, **__: SimpleNamespace(model=started))
    monkeypatch.setattr(added, "_with_overlap_reestimated", lambda fitted, *_, **__: fitted)
    monkeypatch.setattr(added, "_with_friction_reestimated", lambda fitted, *_, **__: fitted)
    monkeypatch.setattr(added, "base_parameters", lambda *_: [])
    monkeypatch.setattr(added, "fit_with_effect", lambda *_, **__: SimpleNamespace(model=lost))
    with pytest.raises(InputError, match="no finite x for run 7"):
        added.fit_model(model(), [View(np.ones(9))], [force])  # type: ignore[list-item]


# --- views


NOISE = {c: NoiseModel(1.0) for c in ("p1", "p2", "x", "a")}


def seen(kind: str, *signals: str, **given: Any) -> list[str]:
    e = make_experiment(kind, time_grid(0.1), dict.fromkeys(signals, 0.1), **given)
    e.raw.clear()
    e.raw.update({n: np.full(101, 0.1) for n in signals})
    return [view.name for view in residual_models([replace(e, noise=NOISE)])]


def test_each_kind_of_recording_has_the_residual_models_of_its_subsystems() -> None:
    assert seen("valve", "u", "p1") == ["bench: chamberpressures"]
    assert seen("friction", "p1", "p2", "x") == ["bench: forcebalance"]
    assert seen("axis", "u", "p1", "p2", "x") == ["bench: forcebalance", "bench: chamberpressures"]


def test_chambers_are_simulated_with_the_measured_motion() -> None:
    from pneucli.simulate import layout as at

    (view,) = [
        v
        for v in residual_models([replace(DRIVEN, noise=NOISE)], whiten_initial_state=True)
        if isinstance(v, ChamberPressures)
    ]
    assert view.experiment.flags[at.MECHANICS] == 0.0
    assert DRIVEN.flags[at.MECHANICS] == 1.0
    assert view.whiten_initial_state
    assert view.channels == ("p1", "p2")


def test_the_openings_reach_from_rest_to_the_largest_commands() -> None:
    for least, most in ((-5.0, 10.0), (2.0, 5.0), (-10.0, -2.0)):
        e = make_experiment(
            "axis", time_grid(0.1), {"u": np.linspace(least, most, 101), "p1": 3e5, "p2": 3e5, "x": 0.1}
        )
        assert ChamberPressures(e).opening_ranges == [(min(least, 0.0), max(most, 0.0))]


@pytest.mark.parametrize(
    ("kind", "effect", "felt"),
    [
        (ChamberPressures, "chamber-leak", True),
        (ForceBalance, "chamber-leak", False),
        (ForceBalance, "stribeck", True),
        (ChamberPressures, "stribeck", False),
        (ChamberPressures, "pressure-lag", True),
        (ForceBalance, "pressure-lag", True),
        (FreeRun, "stribeck", True),
        (FreeRun, "chamber-leak", True),
        (ImposedMotion, "extra-mass", True),
        (ImposedMotion, "valve-lag", False),
    ],
)
def test_an_effect_changes_the_residuals_of_its_own_balances(kind: Any, effect: str, felt: bool) -> None:
    assert kind(DRIVEN).is_sensitive_to(catalogue()[effect]) == felt


def test_the_noise_of_a_force_is_that_of_all_that_is_measured() -> None:
    e = replace(DRIVEN, noise={"p1": NoiseModel(300.0), "p2": NoiseModel(400.0), "a": NoiseModel(0.5)})
    area_1, area_2 = RIG.piston_areas
    wanted = np.sqrt((area_1 * 300.0) ** 2 + (area_2 * 400.0) ** 2 + (RIG.moving_mass * 0.5) ** 2)
    assert ForceBalance(e).noise == {"force": pytest.approx(wanted), "a": 0.5}
    assert ForceBalance(replace(DRIVEN, noise={})).noise == {"force": 1e-6}
