"""Held out by turns: each recording is judged by what the others say, and what only one shows is not held out."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import data
from pneucli.identify.estimation.blocks import group_sums
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.physics.effects import catalogue
from tests.simulate.synthetic_experiments import model

N = 300
RNG = np.random.default_rng(5)
TURN = np.arange(N) // 100


def residual_model(name: str) -> Any:
    return SimpleNamespace(experiment=SimpleNamespace(recording=SimpleNamespace(name=name)))


def linear(columns: np.ndarray, wanted: np.ndarray, values: dict[str, float]) -> tuple[Fit, Any]:
    """A fit of ``columns`` (N, k) z to ``wanted`` (N,) and its problem; a Newton step is exact there."""
    effect = catalogue()["constant-force"]
    z = np.linalg.lstsq(columns, wanted, rcond=None)[0]
    ended = model([effect.name], dict(zip(values, z, strict=True)))
    free = tuple(FreeParameter(name, "N", 0.0, -1e9, 1e9, 1.0) for name in values)
    left = columns @ z - wanted
    fit = Fit(ended, free, (), left, columns, TURN, np.zeros((len(z), len(z))), 0.0, ())
    bounds = np.full(len(z), -1e9), np.full(len(z), 1e9)
    none: Any = SimpleNamespace(prior_residuals=lambda z: np.zeros(0), prior_jacobian=lambda z: np.zeros((0, len(z))))
    none.bounds = lambda: bounds
    return fit, none


def without(fit: Fit, problem: Any, fold: int) -> np.ndarray:
    (sums,) = group_sums(fit.jacobian, fit.residual, [TURN])
    return data.parameters_without(fit, problem, sums, fold)


def test_the_held_out_parameters_are_those_of_a_fit_to_the_others():
    """Against least squares of the others; an effect of 1000 times its noise is not drawn to its absence."""
    columns = RNG.normal(size=(N, 2))
    wanted = columns @ [3.0, 1000.0] + RNG.normal(size=N)
    fit, problem = linear(columns, wanted, {"friction.viscous": 0.0, "constant-force.force": 0.0})
    out = TURN == 1
    exact = np.linalg.lstsq(columns[~out], wanted[~out], rcond=None)[0]
    assert without(fit, problem, 1) == pytest.approx(exact, abs=1e-3)
    of_all = np.linalg.lstsq(columns, wanted, rcond=None)[0]
    assert not np.allclose(exact, of_all, atol=1e-3)


def test_an_effect_of_a_single_recording_is_absent_without_it():
    columns = np.column_stack([RNG.normal(size=N), np.where(TURN == 2, 1.0, 0.0)])
    wanted = columns @ [3.0, 20.0] + RNG.normal(size=N)
    fit, problem = linear(columns, wanted, {"friction.viscous": 0.0, "constant-force.force": 0.0})
    assert without(fit, problem, 2)[1] == pytest.approx(0.0, abs=1e-9)
    assert without(fit, problem, 0)[1] == pytest.approx(20.0, abs=0.5)


def test_unidentified_base_parameters_keep_their_value():
    columns = np.column_stack([np.where(TURN == 2, 1.0, 0.0), np.ones(N)])
    wanted = columns @ [7.0, 20.0] + RNG.normal(size=N)
    fit, problem = linear(columns, wanted, {"friction.viscous": 0.0, "constant-force.force": 0.0})
    kept = fit.model.values["friction.viscous"]
    assert without(fit, problem, 2)[0] == pytest.approx(kept)


def test_holding_out_a_recording_without_information_changes_nothing():
    """As one in which nothing moves: whichever way it is held out, the model is that of all."""
    columns = np.where(TURN == 1, 0.0, 1.0)[:, None] * np.column_stack([RNG.normal(size=N), np.ones(N)])
    wanted = columns @ [3.0, 20.0] + np.where(TURN == 1, 0.0, RNG.normal(size=N))
    fit, problem = linear(columns, wanted, {"friction.viscous": 0.0, "constant-force.force": 0.0})
    z = [fit.model.values[f.name] for f in fit.free]
    assert without(fit, problem, 1) == pytest.approx(z, rel=1e-3)


def test_each_recording_has_its_turn_and_its_views_share_it():
    assert data.folds_of([residual_model("a"), residual_model("a"), residual_model("b"), residual_model("c")]) == (
        0,
        0,
        1,
        2,
    )


def test_a_single_recording_has_no_folds():
    assert data.folds_of([residual_model("a"), residual_model("a")]) == ()
