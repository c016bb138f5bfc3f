"""Evidence: blocks of correlated residuals feign nothing, families of tests are adjusted."""

import numpy as np
import pytest

from pneucli.diagnose.evidence import block_costs, effective_number, gain, holm


def test_the_cost_of_a_block_is_its_sum_of_squares():
    costs = block_costs(np.array([1.0, 2.0, 3.0]), np.array([0, 0, 1]))
    assert costs.tolist() == [5.0, 9.0]


def test_a_fall_in_every_block_is_certain():
    before = np.full(40, 100.0) + np.arange(40) % 5
    found = gain(before, before - 10.0 - np.arange(40) % 3)
    assert found.total == pytest.approx(10.0 * 40 + np.sum(np.arange(40) % 3))
    assert found.certain
    assert found.p_value < 1e-6


def test_a_fall_in_one_block_alone_is_not_certain():
    before = np.full(40, 100.0)
    after = before.copy()
    after[7] = 0.0
    found = gain(before, after)
    assert found.total == 100.0
    assert not found.certain or found.p_value > 0.05


def test_no_change_is_no_gain():
    found = gain(np.ones(30), np.ones(30))
    assert (found.total, found.certain, found.p_value) == (0.0, False, 1.0)


def test_noise_is_called_certain_as_often_as_its_bound_says():
    """One-sided 95 %: 5 % of data sets without any difference pass, here 400 of them: 20 +- 13 (3 sigma)."""
    rng = np.random.default_rng(1)
    passed = sum(gain(rng.normal(size=60), rng.normal(size=60)).certain for _ in range(400))
    assert 7 <= passed <= 38


def test_equal_parts_count_fully_and_one_large_part_counts_as_one():
    assert effective_number(np.random.default_rng(2).normal(size=1000)) == pytest.approx(1000, rel=0.15)
    assert effective_number(np.array([1000.0, 1.0, 1.0, 1.0])) == pytest.approx(1.0, abs=0.01)


def test_a_larger_family_costs_more():
    assert holm([0.01], 20) == [pytest.approx(0.2)]
    assert holm([0.01, 0.04], 2) == pytest.approx([0.02, 0.04])
    assert holm([], 5) == []
