"""The expected entropy follows from the Gram matrix of the rivals alone."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.plan.entropy import (
    detection_power,
    expected_entropy,
    minimum_detectable_size,
    posterior_draws,
    powers_to_decide,
)


def test_without_any_difference_the_entropy_stays_that_of_the_prior():
    assert expected_entropy(np.zeros((3, 3)), [1.0] * 4, [0.3] * 3) == pytest.approx(2.0)


def test_twins_stay_undecided_however_far_both_are_from_the_best_model():
    """Two effects with the same signature: one bit remains of log2(3)."""
    gram = np.full((2, 2), 1e4)
    assert expected_entropy(gram, [1.0, 1.0, 1.0], [0.1, 0.1]) == pytest.approx(2.0 / 3.0, abs=0.02)


def test_an_effect_whose_size_is_unknown_is_told_by_its_shape_alone():
    """Signatures that are multiples of each other are one effect of another size, unless the sizes are known."""
    shape = np.array([1.0, 2.0])
    gram = 1e3 * np.outer(shape, shape)
    known = expected_entropy(gram, [1e-9, 1.0, 1.0], [0.01, 0.01])
    unknown = expected_entropy(gram, [1e-9, 1.0, 1.0], [1.0, 1.0])
    assert known < 0.01
    assert unknown > 0.5


def test_posteriors_agree_with_bayes_theorem_on_simulated_readings():
    """One rival at a distance of 2: the mean posterior of the truth, by integration over the likelihood ratio."""
    distance = 2.0
    draws = posterior_draws(np.array([[distance**2]]), np.array([0.5, 0.5]), [1e-3])
    z = np.random.default_rng(0).normal(distance, 1.0, 200_000)
    expected = np.mean(1.0 / (1.0 + np.exp(-(distance * z - 0.5 * distance**2))))
    assert np.mean(draws[1, :, 1]) == pytest.approx(expected, abs=0.03)


def test_power_grows_with_the_distance_and_is_80_percent_at_the_detectable_size():
    assert detection_power(0.0) < 0.01 < detection_power(2.0) < detection_power(6.0)
    assert detection_power(minimum_detectable_size(1.0, 1.0)) == pytest.approx(0.8, abs=0.005)
    assert minimum_detectable_size(3.0, 0.0) == np.inf


def test_a_rival_is_found_with_those_that_the_recordings_do_not_tell_from_it():
    """Two alike effects and a third one: each alike one has at most half of the posterior, and counts as found."""
    shapes = np.array([[12.0, 0.0], [12.0, 0.1], [0.0, 12.0]])
    found = powers_to_decide(shapes @ shapes.T, [1.0, 0.1, 0.1, 0.1], [0.1, 0.1, 0.1])
    assert found == pytest.approx([1.0, 1.0, 1.0], abs=0.02)
    faint = 0.03 * shapes
    assert max(powers_to_decide(faint @ faint.T, [1.0, 0.1, 0.1, 0.1], [0.1, 0.1, 0.1])) < 0.05
