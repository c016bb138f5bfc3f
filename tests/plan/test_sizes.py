"""The sizes of effects in question: of the fit or of a rival, and how far recordings narrow them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.physics.effects import catalogue
from pneucli.plan.information import Information
from pneucli.plan.rivals import Rival
from pneucli.plan.selection import size_objective
from pneucli.plan.sizes import EffectSize, effect_sizes
from pneucli.recording import Rig
from pneucli.simulate.model import Model

MASS, STRIBECK = catalogue()["extra-mass"], catalogue()["stribeck"]
UNKNOWN_BASE = np.zeros((0, 0))


def told(gram: np.ndarray, rivals: int) -> Information:
    return Information(gram, rivals, np.zeros(rivals))


def size(**changes: Any) -> EffectSize:
    return replace(EffectSize("extra-mass.mass", MASS.parameters[0], 2.0, 0.1, 0), **changes)


def test_what_is_known_and_what_the_plan_shows_add() -> None:
    assert size().error_after(told(np.diag([50.0, 0.0]), 2), UNKNOWN_BASE) == pytest.approx(150.0**-0.5)
    assert size(rival=1).error_after(told(np.diag([50.0, 0.0]), 2), UNKNOWN_BASE) == pytest.approx(0.1)


def test_an_effect_that_neither_recording_shows_stays_unknown() -> None:
    assert size(error=np.inf).error_after(told(np.diag([0.0]), 1), UNKNOWN_BASE) == np.inf


def test_the_size_of_an_effect_of_the_best_model_narrows_with_its_parameter() -> None:
    covariance, curvature = np.diag([4.0, 1.0]), np.diag([0.0, 0.0, 3.0])  # one rival, two parameters
    assert size(position=1).error_after(told(curvature, 1), covariance) == pytest.approx(0.1 / np.sqrt(1.0 + 3.0))


def test_the_sizes_of_rivals_are_those_of_their_models_and_of_a_named_effect_that_of_the_best_model() -> None:
    values = {"friction.coulomb": 10.0, "stribeck.static": 14.0}
    best: Any = SimpleNamespace(
        model=Model(Rig(), (STRIBECK,), values),
        free=[SimpleNamespace(name=n) for n in values],
        covariance=np.eye(2),
    )
    fit = type("Fit", (), {"__getitem__": lambda _, name: SimpleNamespace(error=1.0)})()
    fit.model, fit.free = best.model, best.free
    with_mass = Model(Rig(), (STRIBECK, MASS), values | {"extra-mass.mass": 0.8})
    rivals = [Rival(STRIBECK, False, best.model), Rival(MASS, True, with_mass, size_error=0.3)]
    absent, present = effect_sizes(fit, rivals)
    assert (absent.name, absent.distance, absent.error, absent.position) == ("stribeck.static", 4.0, 0.25, 1)
    assert (present.name, present.distance, present.error, present.position) == ("extra-mass.mass", 0.8, 0.3, None)
    assert (absent.rival, present.rival) == (0, 1)


def test_the_objective_falls_where_an_effect_is_shown() -> None:
    objective = size_objective([size(), size(rival=1)], UNKNOWN_BASE)
    nothing, shows = objective(told(np.diag([0.0, 0.0]), 2)), objective(told(np.diag([9900.0, 0.0]), 2))
    assert nothing == pytest.approx(-1.0)
    assert shows == pytest.approx(-1.5)  # one of two errors falls from 0.1 to 0.01
