"""Intervals where the model misses something that is a function of a signal."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from pneucli.identify.estimation import blocks, intervals
from pneucli.identify.estimation.fit import Fit, parameter_estimates
from pneucli.identify.estimation.intervals import Groups, group_labels, variance_inflation, with_intervals
from pneucli.identify.estimation.parameters import FreeParameter
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid

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


def test_leaving_out_groups_of_equal_size_gives_the_variance_of_their_means() -> None:
    rng = np.random.default_rng(3)
    labels = np.repeat(np.arange(8), N // 8)
    found = mean_of(rng.standard_normal(N) + rng.standard_normal(8)[labels], np.arange(N) // 20)
    means = np.bincount(labels, found.residual) / (N / 8)
    assert intervals._jackknife_variance(Groups(found, labels)) == pytest.approx(np.var(means, ddof=1) / 8, rel=1e-9)


def test_white_readings_keep_their_interval_and_a_function_of_position_widens_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where groups show all: 200 rigs whose level is 10. Of the 95 % intervals 95 % hold it, where something over x is
    missed too (of 200 not fewer than 181 but once in 300 times). Ten groups tell how much, so there are nine degrees of
    freedom and a few for what blocks tell.
    """
    monkeypatch.setattr(intervals, "COMMON_ERROR_FACTOR", 1.0)
    position = np.arange(N) // 10 % 10  # the piston comes by each place 40 times
    blocks, held, usual, wider = np.arange(N) // 20, 0, 0, []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        noise = rng.standard_normal(N)
        missed = mean_of(noise + rng.standard_normal(10)[position], blocks)
        (growth,), (freedom,) = variance_inflation(missed, iter([position]))
        error = abs(missed.estimates[0].value - 10.0)
        usual += error < 1.96 * missed.covariance[0, 0] ** 0.5
        within = student.ppf(0.975, freedom)
        held += error < within * (missed.covariance[0, 0] * growth) ** 0.5
        wider.append(float(variance_inflation(mean_of(noise, blocks), iter([position]))[0][0]))
        assert 9.0 < freedom < 10.0
    assert usual < 100
    assert 181 <= held < 200
    assert np.median(wider) < 1.5


@pytest.mark.parametrize(("noise", "times"), [(0.1, 1.0), (1.0, 1.0), (2.0, 4.75), (10.0, 5.95)])
def test_what_groups_add_counts_six_times_as_far_as_squares_are_beyond_noise(
    monkeypatch: pytest.MonkeyPatch, noise: float, times: float
) -> None:
    """At twice the noise three quarters of the squares are beyond it: 1 + 5 times 3/4."""
    labels = np.arange(N) // 10 % 10
    left = np.random.default_rng(5).standard_normal(N) + 0.5 * np.sin(labels)
    left -= left.mean()
    found = mean_of(noise * left / np.sqrt(np.mean(left**2)), np.arange(N) // 20)
    (told,), (freedom,) = variance_inflation(found, iter([labels]))
    monkeypatch.setattr(intervals, "COMMON_ERROR_FACTOR", 1.0)
    (shown,), _ = variance_inflation(found, iter([labels]))
    assert told - 1.0 == pytest.approx(times * (shown - 1.0))
    assert shown > 1.5
    assert freedom >= 9.0


def test_intervals_are_those_of_students_t(monkeypatch: pytest.MonkeyPatch) -> None:
    """Position is one sample in ten after another, and ten groups of it are all that tells."""
    monkeypatch.setattr(intervals, "COMMON_ERROR_FACTOR", 1.0)
    time = time_grid(4.0)
    view: Any = SimpleNamespace(
        experiment=make_experiment("axis", time, {"x": 0.01 * (np.arange(N + 1) // 10 % 10)}), channels=("p1",)
    )
    rng = np.random.default_rng(2)
    at = np.arange(N + 1) // 10 % 10
    found = with_intervals(
        mean_of(rng.standard_normal(N + 1) + rng.standard_normal(10)[at], np.arange(N + 1) // 20), [view]
    )
    (level,) = found.estimates
    assert (level.ci95[1] - level.ci95[0]) / 2.0 == pytest.approx(student.ppf(0.975, 9.3) * level.error, rel=0.02)


def test_a_direction_that_one_group_determines_keeps_that_group() -> None:
    found = mean_of(np.random.default_rng(1).standard_normal(N), np.arange(N) // 20)
    assert np.isfinite(intervals._jackknife_variance(Groups(found, np.zeros(N, dtype=int)))).all()
    growth, freedom = variance_inflation(found, iter([np.zeros(N, dtype=int)]))
    assert growth == pytest.approx(1.0)
    assert freedom == np.inf


def test_groups_are_recordings_and_bins_of_each_signal_with_as_many_samples() -> None:
    time = time_grid(1.0)
    pair: list[Any] = [
        SimpleNamespace(experiment=make_experiment("axis", time, {"x": 0.1 * time, "u": 1.0}), channels=("p1", "p2"))
        for _ in range(2)
    ]
    n = time.size
    recordings, clocks, x, *_, u = group_labels(pair)
    assert recordings.size == x.size == 4 * n
    assert np.array_equal(x[:n], x[n : 2 * n])  # the channels of one view
    counts = np.bincount(x)[np.unique(x)]
    assert len(counts) == intervals.BINS_PER_SIGNAL
    assert counts == pytest.approx(4 * n / intervals.BINS_PER_SIGNAL, rel=0.02)
    assert np.array_equal(clocks, x)  # here x grows with time
    assert np.unique(u).size == 1


def test_a_fit_without_free_parameters_is_unchanged() -> None:
    found = mean_of(np.zeros(N), np.arange(N) // 20)
    bare = Fit(found.model, (), (), found.residual, np.zeros((N, 0)), found.blocks, np.zeros((0, 0)), 0.0, ())
    assert with_intervals(bare, []) is bare


def test_curvatures_are_summed_up_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 50 samples in three groups, in some order, 7 at a time; a label may have no sample."""
    monkeypatch.setattr(blocks, "ROWS_PER_CHUNK", 7)
    rng = np.random.default_rng(8)
    jacobian, weights, labels = rng.standard_normal((50, 3)), rng.standard_normal(50), rng.choice([0, 1, 3], 50)
    each = [jacobian[labels == i].T @ jacobian[labels == i] for i in range(4)]
    assert blocks.group_curvatures(jacobian, labels) == pytest.approx(np.array(each))
    weighted = jacobian * weights[:, None]
    assert blocks.weighted_curvature(jacobian, weights) == pytest.approx(weighted.T @ weighted)
