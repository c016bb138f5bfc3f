"""The chance of an effect: by its parameters, or by what it gains on recordings that were held out."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import data as data_module
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.evidence import score_gain
from pneucli.diagnose.score import FittedModel
from pneucli.physics.effects import catalogue
from tests.diagnose.candidates import BLOCKS, diagnosis_data, model_fit
from tests.simulate.synthetic_experiments import make_experiment as recorded
from tests.simulate.synthetic_experiments import model as of_rig
from tests.simulate.synthetic_experiments import time_grid

SPREAD = np.where(np.arange(BLOCKS) % 2, 90.0, 10.0)  # of what falls block by block


def chance(monkeypatch: pytest.MonkeyPatch, wald: float, *, held_out: bool) -> float:
    """The p value of an effect that explains 50 of 200 in the mean block, fitted and held out."""
    before = held(model_fit().train_costs)
    after = held(before.train_costs - SPREAD)
    monkeypatch.setattr(data_module, "wald_p_value", lambda fit, effect, *_: wald)
    residual_models: Any = (object(),) if held_out else ()
    where = replace(diagnosis_data(), held_out=residual_models)
    return DiagnosisData.candidate(where, before, after, next(iter(where.effects.values()))).p_value


def held(costs: Any) -> FittedModel:
    """A fitted model that costs the same on fitted and on held-out data."""
    return FittedModel(model_fit().fit, costs, costs, np.tile(costs, 2), np.full(2 * BLOCKS, 100.0))


def test_jointly_identified_parameters_are_tested_by_their_held_out_gain(
    monkeypatch: pytest.MonkeyPatch,
):
    seen = score_gain(SPREAD, np.zeros(BLOCKS)).p_value
    assert seen < 1e-6
    assert chance(monkeypatch, 0.4, held_out=True) == pytest.approx(2.0 * seen)


def test_the_better_of_two_tests_counts_twice(monkeypatch: pytest.MonkeyPatch):
    assert chance(monkeypatch, 1e-30, held_out=True) == pytest.approx(2e-30)


def test_without_held_out_data_the_wald_test_decides(monkeypatch: pytest.MonkeyPatch):
    assert chance(monkeypatch, 0.4, held_out=False) == 0.4


def test_without_a_null_the_fitted_gain_is_tested(monkeypatch: pytest.MonkeyPatch):
    seen = score_gain(SPREAD, np.zeros(BLOCKS)).p_value
    assert chance(monkeypatch, float("nan"), held_out=True) == pytest.approx(seen)


@pytest.mark.parametrize(("coulomb", "starts"), [(14.0, True), (0.0, True)])
def test_an_effect_in_units_of_dry_friction_has_a_size_at_a_fit_without_friction_too(
    coulomb: float, starts: bool
) -> None:
    seen: Any = SimpleNamespace(experiment=recorded("friction", time_grid(0.1), {"p1": 3e5, "p2": 3e5, "x": 0.1}))
    fitted: Any = SimpleNamespace(model=of_rig((), {"friction.coulomb": coulomb}))
    before = replace(model_fit(), fit=fitted)
    assert (
        DiagnosisData.has_initial_guess(replace(diagnosis_data(), train=[seen]), before, catalogue()["stribeck"])
        == starts
    )
    assert DiagnosisData.has_initial_guess(replace(diagnosis_data(), train=[seen]), before, catalogue()["extra-mass"])
