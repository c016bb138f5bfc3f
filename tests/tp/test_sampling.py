"""Samples from functions and from scattered measurements."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.errors import InputError
from pneucli.tp import check, sample, transform
from pneucli.tp.scattered import fit_samples

from .cases import CASES, damping

LINE = np.linspace(-1.0, 1.0, 21)


def test_a_missing_limit_is_named():
    with np.errstate(invalid="ignore"), pytest.raises(InputError, match=r"sample at \(0\)"):
        sample(lambda v: np.sin(v) / v, [np.array([-1.0, 0.0, 1.0])])


def test_a_function_of_the_wrong_shape_is_refused():
    with pytest.raises(InputError, match="sampled function"):
        sample(lambda v: 1.0, [LINE])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), parameters=st.integers(1, 3))
def test_multilinear_functions_are_recovered_exactly(seed, parameters):
    rng = np.random.default_rng(seed)
    grids = [np.sort(rng.uniform(-1, 1, 5)) for _ in range(parameters)]
    grids = [np.concatenate(([-1.1], g, [1.1])) for g in grids]
    points = rng.uniform(-1.1, 1.1, (3000, parameters))
    slope = rng.standard_normal((parameters, 2))
    found = fit_samples(points, 3.0 + points @ slope, grids)
    truth = 3.0 + np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1) @ slope
    assert np.abs(found.samples - truth).max() < 1e-8
    assert found.support.sum() == pytest.approx(3000)


def test_a_gap_in_the_measurements_is_bridged_and_shown():
    points = np.concatenate((np.linspace(-1, -0.4, 200), np.linspace(0.4, 1, 200)))
    found = fit_samples(points, 2 * points, [LINE])
    assert found.samples == pytest.approx(2 * LINE, abs=1e-9)
    assert np.all(found.support[np.abs(LINE) < 0.35] < 1e-12)


def test_repeated_measurements_average_out():
    # the error of a mean falls with the square root of the number
    rng = np.random.default_rng(0)

    def error(count):
        at = rng.uniform(-1, 1, count)
        return np.std(fit_samples(at, np.cos(at) + 0.1 * rng.standard_normal(count), [LINE]).samples - np.cos(LINE))

    few, many = (np.mean([error(count) for _ in range(20)]) for count in (1_000, 16_000))
    assert few / many == pytest.approx(4, rel=0.25)


def test_measurements_count_by_their_sigma():
    rng = np.random.default_rng(1)
    at = rng.uniform(-1, 1, 4000)
    sigma = np.where(np.arange(4000) % 2, 1.0, 1e-3)
    values = at**2 + sigma * rng.standard_normal(4000)
    weighted, plain = fit_samples(at, values, [LINE], sigma=sigma), fit_samples(at, values, [LINE])
    assert np.std(weighted.samples - LINE**2) < 0.05 * np.std(plain.samples - LINE**2)


def test_direct_and_analytical_model_of_friction_agree():
    # 2 % noise, about 146 measurements a node, three times over; and linear interpolation at 137 nodes errs by 2e-3
    rng = np.random.default_rng(2)
    grid, v = np.linspace(-0.05, 0.05, 137), rng.uniform(-0.05, 0.05, 20_000)
    measured = damping(v) * (1 + 0.02 * rng.standard_normal(v.size))
    direct = transform(fit_samples(v, measured, [grid], sigma=damping(v)).samples, [grid])
    analytical = transform(sample(damping, [grid]), [grid])
    assert check(direct) == []
    assert direct.vertices.shape == (2,)
    tolerance = 3 * 0.02 / np.sqrt(20_000 / 137) + 2e-3
    assert np.sort(direct.vertices) == pytest.approx(np.sort(analytical.vertices), rel=tolerance)


def test_scattered_measurements_of_two_parameters_give_the_reference_case():
    case = CASES["c"]
    v, p = np.meshgrid(*case.grids, indexing="ij")
    points = np.column_stack((v.ravel(), p.ravel()))
    found = fit_samples(points, case.samples.ravel(), case.grids, smoothing=1e-9)
    assert found.samples == pytest.approx(case.samples, rel=1e-6)


@pytest.mark.parametrize(
    ("points", "values", "options", "message"),
    [
        ([0.0, 1.5], [1.0, 1.0], {}, "within"),
        ([0.0, np.nan], [1.0, 1.0], {}, "not finite"),
        ([0.0], [1.0, 1.0], {}, "unequal length"),
        ([0.0, 0.5], [1.0, 1.0], {"sigma": [1.0, 0.0]}, "sigma"),
        ([0.0, 0.5], [1.0, 1.0], {"smoothing": 0.0}, "smoothing"),
    ],
)
def test_measurements_that_do_not_fit_are_refused(points, values, options, message):
    with pytest.raises(InputError, match=message):
        fit_samples(points, values, [LINE], **options)
