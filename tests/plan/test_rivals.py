"""Rivals of a diagnosis: effects at a size that the recordings do not exclude, parameters off by their intervals."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.physics.effects import catalogue
from pneucli.plan.rivals import at_plausible_size, shifted_models
from pneucli.recording import Rig
from pneucli.simulate.model import Model

EFFECT = catalogue()["extra-mass"]
NAME = "extra-mass.mass"


def fit(value: float, error: float, upper: float = 100.0) -> Any:
    model = Model(Rig(), (EFFECT,), {NAME: value, "friction.coulomb": 10.0})
    free = (
        FreeParameter(NAME, "kg", value, 0.0, upper, 1.0),
        FreeParameter("friction.coulomb", "N", 10.0, 0.0, 100.0, 10.0),
    )
    estimates = (SimpleNamespace(name=NAME, value=value, error=error),)
    return SimpleNamespace(model=model, free=free, estimates=estimates, covariance=np.diag([error**2, 0.01]))


def test_a_certain_size_stays_and_keeps_its_error() -> None:
    model, error = at_plausible_size(fit(1.0, 0.2), EFFECT)
    assert (model.values[NAME], error) == (1.0, pytest.approx(0.2))


def test_a_size_within_its_error_becomes_two_standard_errors() -> None:
    model, error = at_plausible_size(fit(0.1, 0.3), EFFECT)
    assert model.values[NAME] == pytest.approx(0.6)
    assert error == 0.5


def test_an_enlarged_size_stays_within_its_bounds() -> None:
    assert at_plausible_size(fit(0.1, 0.3, upper=0.4), EFFECT)[0].values[NAME] == 0.4


def test_shifted_parameters_lie_two_standard_errors_away_and_within_their_bounds() -> None:
    fitted = fit(1.0, 0.2)
    models = shifted_models(fitted, fitted.model, 40, seed=1)
    masses = np.array([m.values[NAME] for m in models])
    coulomb = np.array([m.values["friction.coulomb"] for m in models])
    assert np.abs(masses - 1.0).max() == pytest.approx(0.4)
    assert np.abs(coulomb - 10.0).max() == pytest.approx(2.0)  # 2 x 0.1 of a scale of 10 N
    assert np.std(masses) > 0.1
