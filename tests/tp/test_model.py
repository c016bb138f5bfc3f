"""The model anywhere on its domain."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.errors import InputError
from pneucli.tp import check, sample, transform

from .cases import CASES, damping

MODEL_D = transform(CASES["d"].samples, CASES["d"].grids)
inside = st.tuples(*(st.floats(g[0], g[-1]) for g in CASES["d"].grids))


@given(at=inside)
@settings(deadline=None)
def test_between_nodes_linear_weights_stay_convex(at):
    for weights in MODEL_D.weights_at(*at):
        assert weights.min() >= -1e-12
        assert weights.sum() == pytest.approx(1, abs=1e-12)


def test_errors_between_nodes_are_those_measured():
    # 137 nodes: 2e-3 of the range (measured, recorded with the reference cases)
    grid = (CASES["c"].grids[0],)
    model = transform(sample(damping, grid), grid)
    v = np.linspace(-0.05, 0.05, 5001)
    error = np.abs(model.evaluate(v) - damping(v)).max()
    assert error / np.ptp(damping(v)) == pytest.approx(2e-3, rel=0.5)


def test_parameters_broadcast_and_the_matrix_comes_last():
    v, p, x = (0.5 * (g[0] + g[-1]) for g in MODEL_D.grids)
    assert MODEL_D.evaluate(v, p, x).shape == (3, 3)
    many = MODEL_D.evaluate(np.full((4, 1), v), p, np.full(5, x))
    assert many.shape == (4, 5, 3, 3)
    assert np.allclose(many, MODEL_D.evaluate(v, p, x), rtol=1e-14)


def test_vertices_weighted_by_their_products_are_the_model():
    at = (0.011, 3.3e5, 0.07)
    products = MODEL_D.weights_at(*at)
    shares = np.einsum("i,j,k->ijk", *products).ravel()
    assert MODEL_D.systems.shape == (8, 3, 3)
    assert np.allclose(np.tensordot(shares, MODEL_D.systems, axes=1), MODEL_D.evaluate(*at), rtol=1e-12)


@pytest.mark.parametrize("v", [-0.06, 0.0500001, np.nan])
def test_outside_the_domain_is_refused(v):
    model = transform(CASES["a"].samples, CASES["a"].grids)
    with pytest.raises(InputError, match="within"):
        model.evaluate(v)


def test_a_parameter_without_influence_has_one_vertex():
    grids = (np.linspace(-1, 1, 9), np.linspace(0, 1, 5))
    model = transform(sample(lambda v, p: v + 0 * p, grids), grids)
    assert model.vertices.shape == (2, 1)
    assert check(model) == []


def test_samples_of_zero_stay_zero():
    grid = (np.linspace(0, 1, 5),)
    model = transform(np.zeros((5, 2, 2)), grid)
    assert np.all(model.evaluate(0.3) == 0)
    assert check(model) == []


def test_reduced_model_reports_the_error_of_each_entry():
    case = CASES["c"]
    noisy = case.samples * (1 + 0.01 * np.random.default_rng(1).standard_normal(case.samples.shape))
    model = transform(np.stack([noisy, case.samples], axis=-1), case.grids, "mvs", rank=(3, 2))
    assert check(model) == []
    true = np.abs(model.evaluate(*np.meshgrid(*case.grids, indexing="ij")) - np.stack([noisy, case.samples], -1))
    assert model.errors == pytest.approx(true.max(axis=(0, 1)), rel=1e-9)
    assert model.errors[0] > 0.01 * case.samples.min()


@pytest.mark.parametrize(
    ("samples", "grids", "message"),
    [
        (np.ones(4), [np.arange(3.0)], "shape"),
        (np.ones(3), [np.array([0.0, 2.0, 1.0])], "strictly rising"),
        (np.array([1.0, np.nan, 1.0]), [np.arange(3.0)], "sample at"),
    ],
)
def test_samples_that_do_not_fit_are_refused(samples, grids, message):
    with pytest.raises(InputError, match=message):
        transform(samples, grids)


def test_scaling_must_be_valid_and_positive():
    for scaling in ("peaks", 0.0):
        with pytest.raises(InputError, match="scaling"):
            transform(CASES["a"].samples, CASES["a"].grids, scaling=scaling)


def test_exact_decomposition_keeps_all_singular_values_but_no_vertex_of_rounding():
    case = CASES["d"]
    model = transform(case.samples, case.grids, "mvs", tolerance=0)
    assert [s.rank for s in model.spectra] == [41, 31, 21]
    assert model.vertices.shape == (2, 2, 2, 3, 3)
    assert check(model) == []


def test_noise_of_full_rank_is_refused_rather_than_searched():
    noise = np.random.default_rng(0).standard_normal((30, 30))
    with pytest.raises(InputError, match="bound the rank"):
        transform(noise, [np.arange(30.0)] * 2, "mvs")


def test_a_scalar_model_is_evaluated_at_a_scalar_parameter() -> None:
    grid = np.linspace(0.0, 1.0, 5)
    assert transform(grid**2, [grid]).evaluate(0.5) == pytest.approx(0.25)
