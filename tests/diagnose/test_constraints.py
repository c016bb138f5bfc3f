"""What no probability outweighs: absence within the interval, a higher error, a time that changes with the horizon."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import constraints
from pneucli.diagnose.constraints import (
    has_unmeasured_force,
    interval_contains_null,
    raises_error_beyond_noise,
    raises_held_out_error,
    violated_constraint,
)
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.score import ErrorsByUse
from pneucli.identify.estimation.fit import Fit, fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.identify.residuals import ChamberPressures, ForceBalance, ResidualModel
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import simulate
from tests.diagnose.candidates import StatedErrors, candidate, costing, diagnosis_data, model_fit
from tests.simulate.synthetic_experiments import held_commands, make_experiment, model, time_grid

DELAY = 0.015  # s


def estimated(name: str, intervals: dict[str, tuple[float, float]], correlation: float = 0.0) -> Any:
    """A fit of an effect's parameters with their intervals, beside a Coulomb friction of 14 +- 2 N."""
    values = {f"{name}.{key}": 0.5 * (low + high) for key, (low, high) in intervals.items()}
    free = [f"{name}.{key}" for key in intervals] + ["friction.coulomb"]
    errors = np.array([(high - low) / 3.92 for low, high in intervals.values()] + [2.0])
    covariance = np.diag(errors**2)
    covariance[0, -1] = covariance[-1, 0] = correlation * errors[0] * errors[-1]
    estimates = {f"{name}.{key}": (values[f"{name}.{key}"], ci) for key, ci in intervals.items()}
    estimates["friction.coulomb"] = (14.0, (10.0, 18.0))

    class Fitted(SimpleNamespace):
        def __getitem__(self, key: str) -> Any:
            return next(e for e in self.estimates if e.name == key)

    return Fitted(
        model=model([name], values),
        free=[SimpleNamespace(name=n, upper=1e3, derivative=lambda value: 1.0) for n in free],
        covariance=covariance,
        estimates=[SimpleNamespace(name=n, value=v, ci95=ci, at_bound=False) for n, (v, ci) in estimates.items()],
    )


@pytest.mark.parametrize(
    ("name", "intervals", "contains"),
    [
        ("chamber-leak", {"area": (-1e-9, 5e-8)}, True),
        ("chamber-leak", {"area": (1e-9, 5e-8)}, False),
        ("pressure-scale", {"scale": (0.97, 1.02)}, True),
        ("pressure-scale", {"scale": (1.01, 1.03)}, False),
        ("friction-asymmetry", {"asymmetry": (-0.1, 0.3), "viscous_asymmetry": (-0.2, 0.4)}, True),
        ("friction-asymmetry", {"asymmetry": (-0.1, 0.3), "viscous_asymmetry": (0.1, 0.4)}, False),
        ("presliding", {"stiffness": (800.0, 1200.0), "damping": (1.0, 2.0)}, True),  # infinite, or as stiff as may be
        ("presliding", {"stiffness": (500.0, 900.0), "damping": (1.0, 2.0)}, False),
    ],
)
def test_an_effect_may_be_absent_if_all_its_intervals_contain_their_nulls(
    name: str, intervals: dict[str, tuple[float, float]], contains: bool
) -> None:
    assert interval_contains_null(estimated(name, intervals), catalogue()[name]) == contains


@pytest.mark.parametrize(("correlation", "contains"), [(0.0, True), (0.9, False)])
def test_a_null_that_is_fitted_too_has_an_error_of_its_own(correlation: float, contains: bool) -> None:
    """Static friction of 18 +- 4 N over 14 +- 2 N: alone it contains 14, and their difference may exclude 0."""
    fitted = estimated("stribeck", {"static": (14.2, 21.8), "velocity": (0.01, 0.02)}, correlation)
    assert interval_contains_null(fitted, catalogue()["stribeck"]) == contains


@pytest.mark.parametrize(("after", "rises"), [((5.0, 9.9), False), ((5.0, 10.04), False), ((5.0, 10.1), True)])
def test_the_held_out_error_may_not_rise_whatever_the_fitted_one_does(after: tuple[float, float], rises: bool) -> None:
    tried = candidate("extra-mass")
    data = diagnosis_data([(tried.reduced, 10.0, 10.0), (tried.full, *after)])
    assert raises_held_out_error(data, tried.reduced, tried.full) == rises


@pytest.mark.parametrize(
    ("before", "limit", "rises", "beyond_noise"),
    [(1.0, 1.2, False, False), (1.0, 1.05, True, True), (1.0, None, True, True), (9.0, 1.2, False, True)],
)
def test_the_error_may_rise_by_chance_alone(
    before: float, limit: float | None, rises: bool, beyond_noise: bool
) -> None:
    """Noise moves the noise in an error, not the eight ninths of it that the model misses.

    With a damper a correct model errs by less: half the error in mm may be twice as much of its own units.
    """
    tried = candidate("end-cushion")
    without, damped = tried.reduced.model, tried.full.model

    def data_where(in_same_units: float, in_own_units: float) -> DiagnosisData:
        def errors(model: Model, reference: Model | None) -> ErrorsByUse:
            ratio = {id(without): 1.0, id(damped): in_same_units if reference is without else in_own_units}[id(model)]
            return {"train": None, "test": before * ratio}

        return replace(diagnosis_data(), free_run_errors=StatedErrors(errors, limit))

    more = data_where(10.0 / 9.0, 10.0 / 9.0)
    assert raises_held_out_error(more, tried.reduced, tried.full) == rises
    assert raises_error_beyond_noise(more, tried.reduced, tried.full) == beyond_noise
    for in_same_units, is_more in ((0.5, False), (0.8, True)):
        other = data_where(in_same_units, 1.9)
        assert raises_held_out_error(other, tried.reduced, tried.full) == is_more
        assert raises_error_beyond_noise(other, tried.reduced, tried.full) == is_more


@pytest.mark.parametrize(("unseen", "blind"), [(True, False), (False, True), (False, False)])
def test_an_unmeasured_force_names_no_effect(unseen: bool, blind: bool) -> None:
    """Without p2 what a shut chamber 2 does to the piston looks like a spring; without a pressure anything does."""
    residual_model = object.__new__(ForceBalance)
    experiment = SimpleNamespace(p2_is_unmeasured=unseen, lacks_pressures=blind, can_show=lambda effect: True)
    object.__setattr__(residual_model, "experiment", experiment)
    assert has_unmeasured_force([residual_model], catalogue()["spring-force"]) == (unseen or blind)
    assert not has_unmeasured_force([], catalogue()["spring-force"])


@pytest.fixture
def passing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every constraint holds but the one under test."""
    monkeypatch.setattr(constraints, "has_unmeasured_force", lambda residual_models, effect: False)
    monkeypatch.setattr(constraints, "refuted_by_reading", lambda one, effect, residual_models: False)
    monkeypatch.setattr(DiagnosisData, "with_intervals", lambda self, fitted: fitted.fit)
    monkeypatch.setattr(constraints, "interval_contains_null", lambda fitted, effect: False)


def test_each_constraint_has_its_reason(monkeypatch: pytest.MonkeyPatch, passing: None) -> None:
    tried = candidate("valve-lag", ends={"time_constant": (0.01, False)})
    worse = diagnosis_data([(tried.reduced, 10.0, 10.0), (tried.full, 5.0, 20.0)])
    assert violated_constraint(diagnosis_data(), tried) is None
    assert violated_constraint(worse, tried) == "raises-error"
    assert violated_constraint(worse, tried, error_may_rise=True) is None
    assert (
        violated_constraint(diagnosis_data(), candidate("valve-lag", ends={"time_constant": (0.01, True)}))
        == "at-bound"
    )
    monkeypatch.setattr(constraints, "interval_contains_null", lambda fitted, effect: True)
    assert violated_constraint(diagnosis_data(), tried) == "interval-contains-null"
    monkeypatch.setattr(constraints, "has_unmeasured_force", lambda residual_models, effect: True)
    assert violated_constraint(diagnosis_data(), tried) == "cannot-show"


@pytest.mark.parametrize(("scatter", "reason"), [(1.0, None), (2000.0, "not-significant")])
def test_an_effect_without_null_is_judged_on_against_off(passing: None, scatter: float, reason: str | None) -> None:
    """Heat transfer has no value at which it is absent: its interval says nothing, its gain does."""
    tried = candidate("heat-transfer")
    turns = np.where(np.arange(tried.full.costs.size) % 2, scatter, -scatter)
    after = costing(tried.full.fit, tried.reduced.costs - 10.0 - turns)
    assert violated_constraint(diagnosis_data(), replace(tried, full=after)) == reason
    assert model_fit().costs.size == after.costs.size


def late(name: str, value: float, horizon: float, hidden: dict[str, float] | None = None) -> ChamberPressures:
    """A chamber that is filled and vented, read by a late sensor with noise of 300 Pa; ``hidden`` effects act too."""
    time, rng = time_grid(4.0), np.random.default_rng(5)
    u = held_commands(time, [0.0, 2.0, -1.5, 1.0, -2.0, 1.5, -1.0, 0.5, -0.5], 0.43)
    given = {"u": u, "x": np.full(time.size, 0.1)}
    exact = make_experiment("axis", time, {**given, "v": np.zeros(time.size), "p1": 2e5}, chamber_2="open")
    exact.flags[at.MECHANICS] = 0.0
    parameter = "delay" if name == "time-skew" else "time_constant"
    values = {f"{name}.{parameter}": value, **(hidden or {})}
    readings = simulate(model(sorted({key.partition(".")[0] for key in values}), values), exact)["p1"]
    readings = readings + rng.normal(scale=300.0, size=time.size)
    recording = replace(exact.recording, signals={**given, "p1": readings}, noise={"p1": NoiseModel(300.0)})
    return ChamberPressures(prepare(recording, exact.rig, horizon).without_mechanics())


def fitted_time(residual_model: ResidualModel, name: str, start: float) -> Fit:
    """The fit of a time from a start value, with its interval."""
    parameter = "delay" if name == "time-skew" else "time_constant"
    begun = model([name], {f"{name}.{parameter}": start})
    return with_intervals(fit(begun, [residual_model], free_parameters(begun, [residual_model])), [residual_model])


@pytest.mark.parametrize("name", ["time-skew", "pressure-lag"])
@pytest.mark.parametrize("hidden", [{"valve-hysteresis.half_width": 0.4}, {"chamber-leak.area": 5e-8}])
def test_another_missing_effect_gives_no_delay(name: str, hidden: dict[str, float]) -> None:
    """With a play in the valve and restarts every 0.1 s, a delay of 0.28 s once left less than noise."""
    residual_model = late(name, 0.0, 0.1, hidden)
    found = fitted_time(residual_model, name, 0.01)
    assert interval_contains_null(found, catalogue()[name])
