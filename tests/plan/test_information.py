"""Information of manoeuvres: parameters projected out, manoeuvres that add, deviations that count as blocks."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.plan.deviation import ExpectedDeviation
from pneucli.plan.information import Information

RNG = np.random.default_rng(3)


def information(differences: np.ndarray, jacobian: np.ndarray) -> Information:
    columns = np.column_stack([differences, jacobian])
    return Information(columns.T @ columns, differences.shape[1], np.ones(differences.shape[1]))


def test_a_difference_that_a_free_parameter_can_make_tells_nothing():
    slope = RNG.standard_normal((200, 1))
    told = information(3.0 * slope, slope)
    known, unknown = (told.between_rivals(np.array([[variance]])) for variance in (1e-12, 1e12))
    assert known[0, 0] == pytest.approx(9.0 * float(slope[:, 0] @ slope[:, 0]))
    assert unknown[0, 0] == pytest.approx(0.0, abs=1e-6 * known[0, 0])


def test_the_gram_matrix_is_that_of_the_marginal_covariance():
    """D' (I + J C J')^-1 D, computed directly."""
    d, j, root = RNG.standard_normal((50, 2)), RNG.standard_normal((50, 3)), RNG.standard_normal((3, 3))
    covariance = root @ root.T
    direct = d.T @ np.linalg.solve(np.eye(50) + j @ covariance @ j.T, d)
    assert information(d, j).between_rivals(covariance) == pytest.approx(direct)


def test_two_manoeuvres_tell_as_much_as_one_recording_of_both():
    d, j, covariance = RNG.standard_normal((60, 2)), RNG.standard_normal((60, 2)), np.diag([0.3, 4.0])
    both = information(d[:20], j[:20]) + information(d[20:], j[20:])
    assert both.between_rivals(covariance) == pytest.approx(information(d, j).between_rivals(covariance))
    after = np.linalg.inv(np.linalg.inv(covariance) + j.T @ j)
    assert both.parameter_covariance(covariance) == pytest.approx(after)


@pytest.mark.parametrize(("ratio", "time_constant", "variance"), [(1.0, 0.5, 1.0), (3.0, 0.0, 9.0), (3.0, 0.1, 1601.0)])
def test_a_discrepancy_counts_as_blocks_of_its_correlation_time(ratio: float, time_constant: float, variance: float):
    """At 1 kHz, 0.1 s are 2 * 0.1 / 0.001 = 200 samples a reading."""
    assert ExpectedDeviation(ratio, time_constant).divisor(1e-3) ** 2 == pytest.approx(variance)
