"""Parameters drawn from the uncertainty of a fit."""

from typing import Any

import numpy as np
import pytest

from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import draw_parameters
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.simulate.model import Model
from tests.simulate.synthetic_experiments import FRICTION, RIG, VALVE

COULOMB = FreeParameter("friction.coulomb", "N", 14.0, 0.0, 100.0, 10.0)
VISCOUS = FreeParameter("friction.viscous", "N s/m", 30.0, 1.0, 1e3, 1.0, logarithmic=True)


def fitted(jacobian: np.ndarray, *free: FreeParameter) -> Fit:
    """A fit with derivatives in units of the noise; the covariance of its residuals is ten times as wide."""
    model = Model(RIG, (), FRICTION, VALVE)
    wide: Any = np.eye(len(free)) * 1e4
    return Fit(
        model, free, (), np.zeros(len(jacobian)), jacobian, np.zeros(len(jacobian), dtype=np.int64), wide, 0.0, ()
    )


def test_they_scatter_as_the_curvature_of_the_data_says_and_not_as_the_residuals_do() -> None:
    jacobian = np.array([[20.0, 0.0], [10.0, 10.0]])
    drawn = draw_parameters(fitted(jacobian, COULOMB, VISCOUS), draws=4000)
    coordinates = np.array([[d[f.name] for f in (COULOMB, VISCOUS)] for d in drawn])
    coordinates = np.column_stack([coordinates[:, 0] / 10.0, np.log(coordinates[:, 1])])
    expected = np.linalg.inv(jacobian.T @ jacobian)
    assert np.cov(coordinates.T) == pytest.approx(expected, rel=0.1, abs=2e-4)
    assert coordinates.mean(axis=0) == pytest.approx(
        [FRICTION["friction.coulomb"] / 10.0, np.log(FRICTION["friction.viscous"])], abs=0.01
    )


def test_a_parameter_that_no_residual_depends_on_is_anything_between_its_bounds() -> None:
    drawn = draw_parameters(fitted(np.array([[1e-3, 0.0]]), COULOMB, VISCOUS), draws=50)
    among = np.sort([np.log(d["friction.viscous"] / VISCOUS.lower) for d in drawn])
    assert among / np.log(VISCOUS.upper / VISCOUS.lower) == pytest.approx(np.linspace(0.0, 1.0, 50), abs=0.15)
    values = [d["friction.coulomb"] for d in drawn]
    assert min(values) == 0.0
    assert max(values) == 100.0


def test_draws_are_the_same_each_time() -> None:
    one = fitted(np.eye(2), COULOMB, VISCOUS)
    assert draw_parameters(one) == draw_parameters(one)
