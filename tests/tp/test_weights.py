"""Every type of weights has its properties and is as good as the reference."""

import itertools
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pneucli.errors import InputError
from pneucli.tp import WeightType, check, hosvd, sample, transform, weights

from .cases import CASES

TYPES = [t for t in get_args(WeightType) if t != "no"]


def rebuilt(model):
    return model.evaluate(*np.meshgrid(*model.grids, indexing="ij"))


def numbers(text):
    """The list of numbers of one cell of a summary, "[0.9 0.8][1.0 1.0]" -> one list a parameter."""
    return [[float(x) for x in part.split()] for part in text.strip("[]").split("][")]


@pytest.mark.parametrize("weight_type", TYPES)
@pytest.mark.parametrize("name", CASES)
def test_invariants_span_and_reconstruction(name, weight_type):
    case = CASES[name]
    model = transform(case.samples, case.grids, weight_type)
    assert check(model) == []
    assert np.abs(rebuilt(model) - case.samples).max() < 1e-13 * np.abs(case.samples).max()
    assert np.all(model.errors <= 1e-12 * model.scale)
    for columns, basis in zip(model.weights, hosvd(case.samples / model.scale, len(case.grids)).bases, strict=True):
        outside = basis - columns @ np.linalg.lstsq(columns, basis, rcond=None)[0]
        assert np.abs(outside).max() < 1e-10


@pytest.mark.parametrize("weight_type", get_args(WeightType))
def test_one_scalar_parameter_has_two_vertices_of_every_type(weight_type):
    case = CASES["a"]
    model = transform(case.samples, case.grids, weight_type)
    low, high = case.samples.min(), case.samples.max()
    order = np.argsort(model.vertices)
    assert model.vertices[order] == pytest.approx([low, high], rel=1e-13)
    assert model.vertices[order] == pytest.approx(case.table("own_vertices_mvs")[:, 1], rel=1e-12)
    assert model.weights[0][:, order[1]] == pytest.approx((case.samples - low) / (high - low), abs=1e-12)


@pytest.mark.parametrize("weight_type", ["mvs", "irno"])
@pytest.mark.parametrize("name", ["c", "d"])
def test_vertices_are_those_of_the_independent_computation(name, weight_type):
    case = CASES[name]
    model = transform(case.samples, case.grids, weight_type, scaling="none")
    reference = case.table(f"own_vertices_{weight_type}")[:, len(case.grids) :]
    found, scale = model.systems.reshape(len(reference), -1), np.abs(reference).max(axis=0) + 1e-300
    for row in reference:  # up to the order of vertices
        assert np.abs((found - row) / scale).max(axis=1).min() < 1e-8


@pytest.mark.parametrize("weight_type", ["mvs", "irno"])
def test_weights_of_the_two_parameter_case_are_those_of_the_reference(weight_type):
    case = CASES["c"]
    model = transform(case.samples, case.grids, weight_type)
    for mode, parameter in enumerate(case.names):
        reference = case.table(f"own_W_{weight_type}_mode_{parameter}")[:, 1:]
        orders = itertools.permutations(range(reference.shape[1]))
        assert min(np.abs(model.weights[mode][:, list(o)] - reference).max() for o in orders) < 1e-7


@pytest.mark.parametrize("name", CASES)
def test_objectives_are_at_least_as_good_as_the_references(name):
    case = CASES[name]
    own, toolbox = case.summary("own_summary"), case.summary("summary")
    cno = transform(case.samples, case.grids, "cno").weights
    irno = transform(case.samples, case.grids, "irno").weights
    assert sum(weights.distance_to_vertices(w) for w in cno) <= float(own["cno_hh0"]["sum_minus_log_colmax"]) + 1e-6
    for w, maxima in zip(cno, numbers(toolbox["cno"]["colmax_per_mode"]), strict=True):
        assert weights.distance_to_vertices(w) <= -np.sum(np.log(maxima)) + 1e-6
    for w, maxima in zip(irno, numbers(own["irno"]["colmax_per_mode"]), strict=True):
        assert w.max() >= max(maxima) - 1e-6


clouds = st.builds(
    lambda d, n, seed: np.random.default_rng(seed).standard_normal((n, d)),
    st.integers(2, 3),
    st.integers(8, 40),
    st.integers(0, 2**32 - 1),
)


@settings(max_examples=15, deadline=None)
@given(cloud=clouds, seed=st.integers(0, 2**32 - 1))
def test_smallest_volume_does_not_change_when_the_points_are_rotated(cloud, seed):
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((cloud.shape[1],) * 2))[0]
    plain, turned = (weights.homogeneous(y) for y in (cloud, cloud @ turn))
    smallest = [weights.log_reciprocal_volume(weights.smallest_simplices(h)[0]) for h in (plain, turned)]
    assert smallest[0] == pytest.approx(smallest[1], abs=0.02)  # several local optima of a random cloud nearly tie


@settings(max_examples=15, deadline=None)
@given(cloud=clouds)
def test_each_weight_type_is_best_by_its_own_criterion(cloud):
    h = weights.homogeneous(cloud)
    smallest, closest, equal = (
        weights.smallest_simplices(h)[0],
        weights.closest_simplex(h),
        weights.equal_maxima_simplex(h),
    )
    assume(equal is not None)
    others = [weights.regular_simplex(h), weights.tighten(h, weights.spanned_simplex(h)), closest, equal]
    assert all(weights.log_reciprocal_volume(smallest) >= weights.log_reciprocal_volume(m) - 1e-3 for m in others)
    others[2] = smallest
    assert all(weights.distance_to_vertices(h @ closest) <= weights.distance_to_vertices(h @ m) + 1e-3 for m in others)


def test_type_no_exists_only_where_samples_span_a_simplex():
    share = np.linspace(0, 1, 31)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    path = np.concatenate([a + share[:, None] * (b - a) for a, b in itertools.pairwise(corners)])
    grid = np.arange(len(path), dtype=float)
    model = transform(path, (grid,), "no")
    assert check(model) == []
    assert sorted(map(tuple, model.vertices.round(12))) == sorted(map(tuple, corners))
    with pytest.raises(InputError, match="take cno"):
        transform(CASES["c"].samples, CASES["c"].grids, "no")


def circle():
    grid = (np.linspace(0, 2 * np.pi, 60, endpoint=False),)
    return grid, sample(lambda t: np.stack([np.cos(t), np.sin(t)], axis=-1), grid)


@pytest.mark.parametrize(
    ("weight_type", "claimed", "broken"),
    [("snnn", "ino", None), ("ino", "no", "NO"), ("cno", "irno", "RNO"), ("snnn", "mvs", "MVS"), ("irno", "no", "NO")],
)
def test_the_check_catches_weights_of_another_type(weight_type, claimed, broken):
    case = CASES["c"]
    model = transform(case.samples, case.grids, weight_type)
    found = {v.invariant.split(":")[0] for v in check(replace(model, weight_type=claimed))}
    assert found == ({broken} if broken else set())


def test_the_check_catches_lost_sums_signs_minima_and_vertices():
    grid, samples = circle()
    model = transform(samples, grid, "ino")
    (w,) = model.weights
    assert {v.invariant[:2] for v in check(replace(model, weights=(w * 1.001,)))} == {"SN"}
    assert {v.invariant[:2] for v in check(replace(model, weights=(w + np.array([-1e-6, 1e-6, 0]),)))} == {"NN", "IN"}
    looser = 0.9 * w + 0.1 / 3
    assert {v.invariant[:3] for v in check(replace(model, weights=(looser,)))} == {"INO"}
    wrong = replace(model, errors=model.errors + 1e-3)
    assert [v.invariant for v in check(wrong)] == ["reconstruction within the discarded singular values"]


def test_smallest_triangle_around_a_circle_is_the_equilateral_one():
    # regular 60-gon: the smallest triangle lies on three of its sides, 120 degrees apart, and its area is
    # 3 sqrt(3) cos(pi / 60)^2; touching three corners instead is a saddle, larger by 0.3 %
    grid, samples = circle()
    model = transform(samples, grid, "mvs")
    a, b, c = model.vertices
    area = abs(np.linalg.det(np.array([b - a, c - a]))) / 2
    assert area == pytest.approx(3 * np.sqrt(3) * np.cos(np.pi / 60) ** 2, rel=1e-6)


def test_an_unknown_type_is_answered_with_the_available_ones():
    with pytest.raises(InputError, match='did you mean "irno"'):
        transform(CASES["a"].samples, CASES["a"].grids, "irnoo")
