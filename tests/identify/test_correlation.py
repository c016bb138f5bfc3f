"""What data say of parameters together, how a fit goes, and how much each channel counts."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pneucli.identify.estimation.fit import Fit, Iteration, fit, report_iterations_to
from pneucli.identify.estimation.intervals import parameter_correlation, sensitivities
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.residuals import ChamberPressures, with_channel_weights
from pneucli.noise import NoiseModel
from tests.identify.test_fit import TIME, Line
from tests.simulate.synthetic_experiments import make_experiment, model

FREE = [
    FreeParameter("friction.coulomb", "N", 10.0, 0.0, 1e3, 10.0),
    FreeParameter("friction.viscous", "N s/m", 30.0, 0.0, 1e3, 10.0),
]


def fitted(*views: Line) -> Fit:
    return fit(model(), list(views), FREE)  # type: ignore[arg-type]


def test_parameters_of_one_channel_each_are_hardly_correlated() -> None:
    together = parameter_correlation(fitted(Line()))
    np.testing.assert_array_equal(np.diag(together), 1.0)
    assert together[0, 1] == 0.0


def test_parameters_of_which_only_the_sum_is_observable_are_correlated() -> None:
    """Of J'J = [[1, c], [c, 1]] the inverse has the correlation -c; a column of zeros tells nothing."""
    c = 0.96
    rows = np.array([[1.0, c], [0.0, np.sqrt(1 - c**2)]])
    assert parameter_correlation(replace(fitted(Line()), jacobian=rows))[0, 1] == pytest.approx(-c)
    silent = replace(fitted(Line()), jacobian=np.array([[0.0, 1.0], [0.0, 1.0]]))
    np.testing.assert_array_equal(parameter_correlation(silent), np.eye(2))


def test_a_percent_of_a_parameter_does_to_its_channel_what_the_model_says() -> None:
    """Channel x is Coulomb friction (15 N) times a wave of rms w, noise 2: 1 % of it is 0.15 w / 2."""
    found = fitted(Line())
    felt = {(s.name, s.channel): s.times_noise for s in sensitivities(found, [Line()])}  # type: ignore[list-item]
    assert felt.keys() == {("friction.coulomb", "x"), ("friction.viscous", "a")}
    wave = np.sqrt(np.mean(np.sin(3.0 * TIME) ** 2))
    wanted = 0.01 * found["friction.coulomb"].value * wave / 2.0
    assert felt["friction.coulomb", "x"] == pytest.approx(wanted, rel=1e-4)


def test_each_iteration_is_reported_and_the_residual_falls_to_the_noise() -> None:
    rounds: list[Iteration] = []
    with report_iterations_to(rounds.append):
        fitted(Line())
        fitted(Line())
    fitted(Line())
    assert {r.search for r in rounds} == {1, 2}
    first = [r for r in rounds if r.search == 1]
    assert [r.round for r in first] == list(range(len(first)))
    assert all(a.residual > b.residual for a, b in pairwise(first))
    assert first[-1].residual == pytest.approx(1.0, abs=0.03)


def test_a_channel_of_weight_zero_informs_no_parameter() -> None:
    whole, ignoring = Line(), Line()
    ignoring.weights = {"a": 0.0}
    found, less = fitted(whole), fitted(ignoring)
    assert less["friction.coulomb"].value == pytest.approx(found["friction.coulomb"].value, rel=1e-3)
    assert less["friction.viscous"].value == pytest.approx(30.0)  # where it started


def test_weights_decide_between_channels_that_disagree() -> None:
    """Two lines say 15 N and 25 N of the same parameter: the estimate is the mean by squared weight."""
    low, high = Line(("x",), noise=1e-3), Line(("x",), noise=1e-3)
    high.measured = {"x": high.measured["x"] * 25.0 / 15.0}
    low.weights = {"x": 2.0}
    found = fit(model(), [low, high], FREE[:1])  # type: ignore[list-item]
    assert found["friction.coulomb"].value == pytest.approx((4 * 15 + 25) / 5, rel=1e-3)


def test_residual_models_take_the_weights_of_the_pipeline_file() -> None:
    one = ChamberPressures(replace(make_experiment("axis", TIME, {"u": 1.0}), noise={"p1": NoiseModel(1.0)}))
    assert with_channel_weights([one], {})[0].weights == {}
    assert with_channel_weights([one], {"p1": 0.5})[0].weights == {"p1": 0.5}
