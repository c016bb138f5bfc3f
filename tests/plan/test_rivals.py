"""Rivals of a diagnosis: effects at a size that the recordings do not exclude, parameters off by their intervals."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.physics.effects import catalogue
from pneucli.plan.rivals import MIN_PRIOR_ODDS, at_plausible_size, refused_effects, size_is_known
from pneucli.plan.shifted import shifted_models, with_monotone_valves
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms.area import ValveArea

EFFECT = catalogue()["extra-mass"]
NAME = "extra-mass.mass"
TYPICAL = {NAME: 0.8}


def fit(value: float, error: float, upper: float = 100.0) -> Any:
    model = Model(Rig(), (EFFECT,), {NAME: value, "friction.coulomb": 10.0})
    free = (
        FreeParameter(NAME, "kg", value, 0.0, upper, 1.0),
        FreeParameter("friction.coulomb", "N", 10.0, 0.0, 100.0, 10.0),
    )
    estimates = (SimpleNamespace(name=NAME, value=value, error=error),)
    return SimpleNamespace(model=model, free=free, estimates=estimates, covariance=np.diag([error**2, 0.01]))


def test_a_certain_size_stays_and_keeps_its_error() -> None:
    model, error = at_plausible_size(fit(1.0, 0.2), EFFECT, TYPICAL)
    assert (model.values[NAME], error) == (1.0, pytest.approx(0.2))


def test_a_size_within_its_error_becomes_two_standard_errors() -> None:
    model, error = at_plausible_size(fit(0.1, 0.3), EFFECT, TYPICAL)
    assert model.values[NAME] == pytest.approx(0.6)
    assert error == 0.5


@pytest.mark.parametrize("error", [3.0, 0.0, np.nan, np.inf])
@pytest.mark.parametrize("value", [0.1, 0.0])
def test_a_size_of_which_the_recordings_say_nothing_becomes_the_typical_one(value: float, error: float) -> None:
    model, relative = at_plausible_size(fit(value, error), EFFECT, TYPICAL)
    if value and not error:  # known exactly
        assert (model.values[NAME], relative) == (value, 0.0)
    else:
        assert (model.values[NAME], relative) == (0.8, 0.5)


@pytest.mark.parametrize(("error", "known"), [(0.2, True), (0.3, True), (3.0, False), (np.nan, False)])
def test_a_size_is_known_where_its_error_is_smaller_than_the_typical_size(error: float, known: bool) -> None:
    fitted = fit(0.1, error)
    model, _ = at_plausible_size(fitted, EFFECT, TYPICAL)
    assert size_is_known(fitted, EFFECT, model) == known


def test_an_effect_that_the_fit_returns_as_none_gets_typical_values_of_its_other_parameters() -> None:
    effect = catalogue()["opening-leak"]
    growth, opening = "opening-leak.growth", "opening-leak.opening"
    model = Model(Rig(), (effect,), {growth: 0.0, opening: 6e5})
    free = (FreeParameter(growth, "kg/(s Pa^2)", 0.0, 0.0, 1e-9, 1e-12),)
    fitted: Any = SimpleNamespace(
        model=model, free=free, estimates=(SimpleNamespace(name=growth, value=0.0, error=1e-13),)
    )
    found, _ = at_plausible_size(fitted, effect, {growth: 5e-13, opening: 2e5})
    assert found.values[growth] == pytest.approx(2e-13)  # two standard errors
    assert found.values[opening] == 2e5


def test_an_effect_whose_null_is_another_parameter_is_enlarged_as_well() -> None:
    effect = catalogue()["stribeck"]
    names = ["stribeck.static", "friction.coulomb", "stribeck.velocity"]
    model = Model(Rig(), (effect,), dict(zip(names, [10.1, 10.0, 0.01], strict=True)))
    free = tuple(FreeParameter(n, "N", model.values[n], 0.0, 100.0, 10.0) for n in names)
    estimates = (SimpleNamespace(name=names[0], value=10.1, error=1.0),)
    fitted: Any = SimpleNamespace(model=model, free=free, estimates=estimates)
    assert at_plausible_size(fitted, effect, {names[0]: 18.0})[0].values[names[0]] == pytest.approx(12.0)


def test_an_enlarged_size_stays_within_its_bounds() -> None:
    assert at_plausible_size(fit(0.1, 0.3, upper=0.4), EFFECT, TYPICAL)[0].values[NAME] == 0.4


def test_shifted_parameters_lie_two_standard_errors_away_and_within_their_bounds() -> None:
    fitted = fit(1.0, 0.2)
    models = shifted_models(fitted, fitted.model, 40, seed=1)
    masses = np.array([m.values[NAME] for m in models])
    coulomb = np.array([m.values["friction.coulomb"] for m in models])
    assert np.abs(masses - 1.0).max() == pytest.approx(0.4)
    assert np.abs(coulomb - 10.0).max() == pytest.approx(2.0)  # 2 x 0.1 of a scale of 10 N
    assert np.std(masses) > 0.1


def entry(effect: str, reason: str, confidence: float = 0.003, **properties: Any) -> dict[str, Any]:
    known = {"effect": effect, "reason": reason, "confidence_alone": confidence, "supported": False}
    return known | {"parameters": {"size": {"value": 1.0}}} | properties


def test_refused_effects_that_better_recordings_may_show_are_in_question_the_most_probable_first() -> None:
    found = refused_effects(
        [
            entry("a leak", "vanishes"),
            entry("a lag", "not-significant"),
            entry("a scale", "raises-error", 0.5),
            entry("a mass", "at-bound", 0.4),
            entry("an offset", "contradicted-by-reading", 0.4),
            entry("a cushion", "not-promising", parameters={}),
            entry("a droop", "supported", 0.9, supported=True),
        ]
    )
    assert found == [(pytest.approx(1.0), "a scale"), (MIN_PRIOR_ODDS, "a lag"), (MIN_PRIOR_ODDS, "a leak")]


def test_a_valve_that_is_off_by_its_intervals_still_passes_less_near_its_null() -> None:
    """The area at 0.1 V, within the dead zone, may be off by orders of magnitude."""
    valve = ValveArea((-2.0, -1.0, -0.1, 0.1, 1.0, 2.0), (9e-7, 4e-7, 1e-3, 1e-3, 3e-7, 8e-7), 0.05, 0.05)
    model = with_monotone_valves(Model(Rig(), (), {}, valve))
    assert isinstance(model.valve, ValveArea)
    assert model.valve.areas == (9e-7, 4e-7, 4e-7, 3e-7, 3e-7, 8e-7)
