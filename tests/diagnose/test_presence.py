"""An effect whose null is not its absence: the thesis's hysteresis, without a drop, beside Stribeck friction.

The rig is the exam's, which shares no code with the program.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.diagnose.constraints import end_locations
from pneucli.diagnose.evidence import relative_effect_size, significance, wald_p_value
from pneucli.identify.estimation.fit import Fit, parameter_estimates
from pneucli.identify.estimation.model_fit import fit_model, fit_with_effect, score_tests
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import ResidualModel, residual_models
from pneucli.physics.effects import catalogue
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from tests.identify_friction.synthetic_recordings import BENCH, RIG, pressed, pulses, recorded

STRIBECK, HYSTERESIS = catalogue()["stribeck"], catalogue()["friction-hysteresis"]
STICKY = BENCH._replace(static=20.0, stribeck_velocity=0.02)


@cache
def fitted(drop: float) -> tuple[Fit, Fit, tuple[ResidualModel, ...]]:
    """Fits with Stribeck friction and with hysteresis beside it, of a rig with such a drop; below 0 it has none."""
    rig = STICKY._replace(drop=drop)
    runs = [recorded(rig, pressed(rig, pulses(6, peak)), seed) for seed, peak in ((1, 26.0), (2, 32.0))]
    experiments = [prepare(run, RIG, 0.5) for run in runs]
    views = tuple(residual_models(experiments))
    before = fit_model(guess_base_model(experiments, RIG), views, [STRIBECK])
    return before, fit_with_effect(before, views, HYSTERESIS), views


@pytest.mark.parametrize("drop", [0.0, 0.3])
def test_a_hysteresis_without_a_drop_is_as_sure_as_one_with(drop: float) -> None:
    before, after, views = fitted(drop)
    assert after.cost - after.residual.size < 0.2 * (before.cost - before.residual.size)
    assert after["friction-hysteresis.drop"].value == pytest.approx(drop, abs=0.02)
    assert after["stribeck.static"].value == pytest.approx(20.0, rel=0.02)
    assert after["stribeck.velocity"].value == pytest.approx(0.02, rel=0.1)
    assert score_tests(HYSTERESIS, before, views)[0].gain > 0.8 * (before.cost - after.cost)
    assert wald_p_value(after, HYSTERESIS, views) < 1e-4
    assert significance(after, HYSTERESIS, views) > 10.0


def test_an_interval_ends_where_a_drop_does() -> None:
    low, high = fitted(0.0)[1]["friction-hysteresis.drop"].ci95
    assert low >= 0.0
    assert low < high < 0.05
    after = fitted(0.0)[1]
    wide = parameter_estimates(after.free, after.model, 1e4 * after.covariance)
    assert next(e for e in wide if e.name == "friction-hysteresis.drop").ci95[0] == 0.0


def test_a_drop_of_zero_does_not_say_that_the_effect_vanishes() -> None:
    _, after, _ = fitted(0.0)
    trial: Any = SimpleNamespace(effect=HYSTERESIS, full=SimpleNamespace(model=after.model, fit=after))
    assert "null" not in end_locations(trial)


def test_its_size_is_what_it_changes_over_what_usual_values_would() -> None:
    _, after, views = fitted(0.0)
    facts = rig_quantities(after.model, [view.experiment for view in views])
    assert 0.1 < relative_effect_size(after, HYSTERESIS, facts, views) < 1.0
    _, after, views = fitted(0.3)
    assert relative_effect_size(after, HYSTERESIS, facts, views) == pytest.approx(1.0, abs=0.6)


def test_where_both_branches_are_one_hysteresis_is_not_significant() -> None:
    before, after, views = fitted(-1.0)
    assert before["stribeck.static"].value == pytest.approx(20.0, rel=0.02)
    assert wald_p_value(after, HYSTERESIS, views) > 0.01
