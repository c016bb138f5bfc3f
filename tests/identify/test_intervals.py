"""Intervals where the model misses something that is a function of a signal."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pneucli.identify.estimation import blocks, intervals
from pneucli.identify.estimation.fit import Fit, fit, parameter_estimates
from pneucli.identify.estimation.intervals import (
    group_labels,
    variance_inflation,
    with_intervals,
    with_intervals_over_models,
)
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.experiment import Experiment
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid


class Sum:
    """A view that reads 30 as the sum of both frictions, with noise of 1."""

    name, channels, is_simulated = "a sum", ("x",), False
    weights: dict[str, float] = {}  # noqa: RUF012 - never changed in place
    noise = {"x": 1.0}  # noqa: RUF012
    experiment = make_experiment("axis", time_grid(1.0), {"x": np.linspace(0.0, 0.2, 1001)})

    def is_sensitive_to(self, effect: Any) -> bool:
        return False

    def differs(self, one: Any, other: Any) -> bool:
        return True

    def differentiable(self, directions: Any) -> np.ndarray:
        return np.zeros(len(directions.steps), dtype=bool)

    def initial_state_sensitivity(self, model: Any) -> dict[str, np.ndarray]:
        return {}

    def residual(self, model: Any, errors: Any = None) -> dict[str, np.ndarray]:
        noise = np.random.default_rng(3).standard_normal(1001)
        return {"x": 30.0 + noise - model.values["friction.coulomb"] - model.values["friction.viscous"]}


LEVEL = FreeParameter("friction.coulomb", "N", 10.0, 0.0, 1e3, 1.0)
N = 4000


def mean_of(residual: np.ndarray, blocks: np.ndarray) -> Fit:
    """The fit of one level to readings: what is left is their distance from it."""
    n, left = residual.size, residual - residual.mean()
    sums = np.bincount(blocks, left)
    covariance = np.array([[float(sums @ sums) / n**2]])
    fitted = model(values={"friction.coulomb": 10.0 + float(residual.mean())})
    estimates = parameter_estimates([LEVEL], fitted, covariance)
    return Fit(fitted, (LEVEL,), estimates, left, np.ones((n, 1)), blocks, covariance, float(left @ left), ())


def grouped_variance(found: Fit, labels: np.ndarray) -> np.ndarray:
    (sums,) = blocks.group_sums(found.jacobian, found.residual, [labels])
    return intervals._bias_reduced_variance(*sums, intervals._matrix_square_root(found.inverse_hessian))


def test_an_interval_over_models_contains_that_of_each_of_them() -> None:
    """One that another model does not have keeps its interval; value and covariance stay those of the fit."""
    rng = np.random.default_rng(1)
    fitted, low, high = (mean_of(rng.standard_normal(N) + level, np.arange(N) // 20) for level in (0.0, -2.0, 0.5))
    found = with_intervals_over_models(fitted, [high, low])
    assert found["friction.coulomb"].ci95 == (low["friction.coulomb"].ci95[0], high["friction.coulomb"].ci95[1])
    assert found["friction.coulomb"].value == fitted["friction.coulomb"].value
    assert found.covariance is fitted.covariance
    assert with_intervals_over_models(fitted, []).estimates == fitted.estimates
    other = replace(high, estimates=(replace(high.estimates[0], name="friction.viscous"),))
    assert with_intervals_over_models(fitted, [other]).estimates == fitted.estimates


def test_a_parameter_that_no_residual_depends_on_has_its_range_as_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interval of no width would state as certain what the recordings do not show."""
    monkeypatch.setattr(intervals, "group_labels", lambda _: iter(()))
    still = FreeParameter("friction.viscous", "N s/m", 40.0, 1.0, 500.0, 1.0)
    one = mean_of(np.random.default_rng(1).standard_normal(N), np.arange(N) // 20)
    fitted = model(values={"friction.coulomb": 10.0, "friction.viscous": 40.0})
    covariance = np.diag([one.covariance[0, 0], 0.0])
    free, jacobian = (LEVEL, still), np.column_stack([np.ones(N), np.zeros(N)])
    estimates = parameter_estimates(free, fitted, covariance)
    both = replace(one, model=fitted, free=free, estimates=estimates, jacobian=jacobian, covariance=covariance)
    found = with_intervals(both, [])
    assert found["friction.viscous"].ci95 == (1.0, 500.0)
    assert found["friction.coulomb"].ci95[1] - found["friction.coulomb"].ci95[0] < 1.0


def test_white_readings_keep_their_interval_and_a_function_of_position_widens_it() -> None:
    """200 rigs whose level is 10: of the 95 % intervals at least 95 % hold it where something over x is missed, too
    (of 200 not fewer than 181 but once in 300 times).
    """
    position = np.arange(N) // 10 % 10  # the piston comes by each place 40 times
    blocks, held, usual, wider = np.arange(N) // 20, 0, 0, []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        noise = rng.standard_normal(N)
        missed = mean_of(noise + rng.standard_normal(10)[position], blocks)
        (inflation,) = variance_inflation(missed, iter([position]))
        error, by_blocks = abs(missed.estimates[0].value - 10.0), missed.covariance[0, 0] ** 0.5
        usual += error < 1.96 * by_blocks
        held += error < 1.96 * by_blocks * inflation**0.5
        wider.append(float(variance_inflation(mean_of(noise, blocks), iter([position]))[0]))
    assert usual < 100
    assert held >= 181
    assert np.median(wider) < 1.5


@pytest.mark.parametrize(("noise", "times"), [(0.1, 1.0), (1.0, 1.0), (2.0, 1.75), (10.0, 1.99)])
def test_what_groups_have_in_common_counts_as_far_as_squares_exceed_noise(
    monkeypatch: pytest.MonkeyPatch, noise: float, times: float
) -> None:
    """At twice the noise three quarters of the squares exceed it: 1 + 3/4."""
    labels = np.arange(N) // 10 % 10
    left = np.random.default_rng(5).standard_normal(N) + 0.5 * np.sin(labels)
    left -= left.mean()
    found = mean_of(noise * left / np.sqrt(np.mean(left**2)), np.arange(N) // 20)
    (told,) = variance_inflation(found, iter([labels]))
    monkeypatch.setattr(intervals, "_excess_variance_share", lambda *_: np.zeros(1))
    (shown,) = variance_inflation(found, iter([labels]))
    assert told - 1.0 == pytest.approx(times * (shown - 1.0), rel=2e-3)
    assert shown > 1.5


def test_each_grouping_adds_what_it_shows() -> None:
    rng = np.random.default_rng(2)
    first, second = np.arange(N) // 10 % 10, np.arange(N) % 10
    found = mean_of(
        rng.standard_normal(N) + rng.standard_normal(10)[first] + rng.standard_normal(10)[second], np.arange(N) // 20
    )
    alone = [float(variance_inflation(found, iter([labels]))[0]) - 1.0 for labels in (first, second)]
    assert float(variance_inflation(found, iter([first, second]))[0]) - 1.0 == pytest.approx(sum(alone))
    assert min(alone) > 1.0


def test_a_direction_that_one_group_determines_keeps_that_group() -> None:
    found = mean_of(np.random.default_rng(1).standard_normal(N), np.arange(N) // 20)
    assert np.isfinite(grouped_variance(found, np.zeros(N, dtype=int))).all()
    assert variance_inflation(found, iter([np.zeros(N, dtype=int)])) == pytest.approx(1.0)


def named(name: str, experiment: Experiment) -> Experiment:
    return replace(experiment, recording=replace(experiment.recording, name=name))


def test_groups_are_recordings_and_bins_of_each_signal_with_as_many_samples() -> None:
    time = time_grid(1.0)
    pair: list[Any] = [
        SimpleNamespace(experiment=named(name, make_experiment("axis", time, {"x": 0.1 * time})), channels=("p1", "p2"))
        for name in ("first", "second")
    ]
    n = time.size
    recordings, clocks, x = group_labels(pair)
    assert recordings.size == x.size == 4 * n
    assert np.array_equal(x[:n], x[n : 2 * n])  # the channels of one view
    counts = np.bincount(x)[np.unique(x)]
    assert len(counts) == intervals.BINS_PER_SIGNAL
    assert counts == pytest.approx(4 * n / intervals.BINS_PER_SIGNAL, rel=0.02)
    assert np.array_equal(clocks, x)  # here x grows with time


def test_a_constant_signal_and_a_single_recording_group_nothing() -> None:
    time = time_grid(1.0)
    one: Any = SimpleNamespace(experiment=make_experiment("axis", time, {"u": 1.0}), channels=("p1",))
    (clocks,) = group_labels([one])
    assert np.unique(clocks).size == intervals.BINS_PER_SIGNAL


def test_a_parameter_at_a_bound_widens_no_other() -> None:
    """Viscous friction at its bound of 0 leaves a score of its own; that of the level is as if it were not free."""
    position, rng = np.arange(N) // 10 % 10, np.random.default_rng(4)
    alone = mean_of(rng.standard_normal(N) + rng.standard_normal(10)[position], np.arange(N) // 20)
    slope = FreeParameter("friction.viscous", "N s/m", 0.0, 0.0, 1e3, 1.0)
    free, column = (LEVEL, slope), (1.0 + position)[:, None]
    fitted = model(values={"friction.coulomb": alone.estimates[0].value, "friction.viscous": 0.0})
    covariance = np.diag([alone.covariance[0, 0], 1e-4])
    both = Fit(
        fitted,
        free,
        parameter_estimates(free, fitted, covariance),
        alone.residual,
        np.hstack([alone.jacobian, column]),
        alone.blocks,
        covariance,
        alone.cost,
        (),
    )
    assert variance_inflation(both, iter([position])) == pytest.approx(
        [float(variance_inflation(alone, iter([position]))[0]), 1.0]
    )


def test_an_interval_ends_at_the_bounds() -> None:
    """An unknown viscous friction of 0 to 1000 N s/m, and a stiffness of which only the order is known."""
    slope = FreeParameter("friction.viscous", "N s/m", 0.0, 0.0, 1e3, 1.0)
    stiffness = FreeParameter("presliding.stiffness", "N/m", 1e4, 1e3, 1e8, 1.0, logarithmic=True)
    fitted = model(["presliding"], values={"friction.viscous": 0.0, "presliding.stiffness": 1e4})
    unknown, order = parameter_estimates([slope, stiffness], fitted, np.diag([1e6**2, 1e3**2]))
    assert unknown.ci95 == (0.0, 1e3)
    assert unknown.at_bound
    assert order.ci95 == (1e3, 1e8)
    known, _ = parameter_estimates([slope, stiffness], fitted, np.diag([1.0, 1.0]))
    assert known.ci95 == (0.0, pytest.approx(1.96, abs=1e-2))


def test_parameters_that_only_their_sum_determines_have_their_whole_range_as_interval() -> None:
    """As a constant force and the rest position of a spring; a prior on one of them determines both."""
    for sigma, is_open in ((np.inf, True), (2.0, False)):
        found = fit(
            model(values={"friction.coulomb": 10.0, "friction.viscous": 10.0}),
            [cast("ResidualModel", Sum())],
            [LEVEL, replace(LEVEL, name="friction.viscous", unit="N s/m", prior_sigma=sigma)],
        )
        widened = with_intervals(found, [cast("ResidualModel", Sum())])
        assert [e.ci95 == (0.0, 1e3) for e in widened.estimates] == [is_open, is_open]


def test_a_fit_without_free_parameters_is_unchanged() -> None:
    found = mean_of(np.zeros(N), np.arange(N) // 20)
    bare = Fit(found.model, (), (), found.residual, np.zeros((N, 0)), found.blocks, np.zeros((0, 0)), 0.0, ())
    assert with_intervals(bare, []) is bare


def test_scores_and_curvatures_are_summed_up_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 50 samples in three groups, in some order, 7 at a time; a label may have no sample. Two groupings at once."""
    monkeypatch.setattr(blocks, "ROWS_PER_CHUNK", 7)
    rng = np.random.default_rng(8)
    jacobian, weights, labels = rng.standard_normal((50, 3)), rng.standard_normal(50), rng.choice([0, 1, 3], 50)
    jacobian[:7, 0], jacobian[7:14, 1], jacobian[14:20, 2] = 0.0, 0.0, 0.0  # in a piece, in all or all but its last row
    each = [jacobian[labels == i].T @ jacobian[labels == i] for i in range(4)]
    residual = rng.standard_normal(50)
    scores = [jacobian[labels == i].T @ residual[labels == i] for i in range(4)]
    one, other = blocks.group_sums(jacobian, residual, [np.zeros(50, dtype=np.int64), labels])
    assert one.curvatures == pytest.approx((jacobian.T @ jacobian)[None])
    assert other.curvatures == pytest.approx(np.array(each))
    assert other.scores == pytest.approx(np.array(scores))
    weighted = jacobian * weights[:, None]
    assert blocks.weighted_curvature(jacobian, weights) == pytest.approx(weighted.T @ weighted)
