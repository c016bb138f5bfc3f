"""Models A to F: the smoothed sign, the TP models and their grid, and what direct models make of noise."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.arrays import Array
from pneucli.identify.friction.identification import missing_model_warnings
from pneucli.identify.friction.models_a_to_f import (
    FrictionModel,
    VelocityDomain,
    identify_models,
    tp_from_model,
    tp_from_samples,
)
from pneucli.identify.friction.regression import fit_coulomb
from pneucli.identify.friction.samples import MovingSamples
from pneucli.physics.vectorised import stribeck_friction
from pneucli.tp import check
from tests.identify_friction.synthetic_recordings import FIXTURES, identified

HYSTERETIC = FIXTURES / "friction_hysteresis"
RISING, FALLING = (12.0, 40.0, 18.0, 0.02), (8.0, 45.0, 8.0)
DOMAIN = VelocityDomain(max_velocity=0.3, resolved_velocity=1e-3)
MASS = 2.0


def nouri(v: Array, a: Array) -> Array:
    """Hysteretic friction (3.7): Stribeck while speeding up, Coulomb and viscous with constants of its own slowing."""
    return np.where(np.sign(v) == np.sign(a), stribeck_friction(v, *RISING), stribeck_friction(v, *FALLING))


def samples(repeats: int, seed: int) -> MovingSamples:
    """Triangular velocities to both sides, friction of two branches (3.7), 1 N of white noise; 4 s a repeat."""
    rng = np.random.default_rng(seed)
    time = 5e-4 * np.arange(8000 * repeats)
    v = 0.3 * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * time)) + 1e-6
    a = np.gradient(v, time)
    force = nouri(v, a) + rng.standard_normal(v.size)
    branch = np.sign(v * a).astype(np.int8)
    keep = np.abs(v) > 2e-3
    columns = (v, a, force, force, np.ones_like(v), branch, (time / 0.2).astype(np.int64))
    return MovingSamples(*(column[keep] for column in columns))


def models(repeats: int = 1, seed: int = 0, domain: VelocityDomain = DOMAIN) -> dict[str, FrictionModel]:
    s = samples(repeats, seed)
    found = identify_models(s, fit_coulomb(s, offset=True), domain, MASS)
    return {m.name: m for m in found}


def test_the_smoothed_sign_reaches_95_percent_where_sensors_and_grid_begin_to_resolve() -> None:
    by_sensor = VelocityDomain(max_velocity=0.05, resolved_velocity=1e-3)
    by_grid = VelocityDomain(max_velocity=0.05, resolved_velocity=1e-3, nodes=10)
    assert by_sensor.sign(np.array([1e-3, -1e-3])) == pytest.approx([0.95, -0.95])
    assert by_grid.sign(np.array([2 * by_grid.step])) == pytest.approx([0.95])
    v = np.linspace(-0.05, 0.05, 11)
    assert by_sensor.sign(v) == pytest.approx(2 / (1 + np.exp(-by_sensor.eta * v)) - 1)  # (6.22)


def test_a_stated_steepness_sets_the_vertex_at_standstill() -> None:
    """a22(0) = (Fs eta / 2 + Fv) / m, by eta alone (6.22, 6.9)."""
    for eta in (200.0, 2000.0):
        found = models(domain=VelocityDomain(max_velocity=0.3, resolved_velocity=1e-3, steepness=eta))
        tp = found["B"].branches[0].tp
        a = found["A"].branches[0].parameters
        expected = (0.5 * eta * a["coulomb"].value + a["viscous"].value) / MASS
        assert tp.vertices.max() == pytest.approx(expected, rel=0.05)


def test_nodes_are_so_dense_near_standstill_that_straight_lines_follow_a22() -> None:
    domain = VelocityDomain(max_velocity=0.5, resolved_velocity=5e-4)
    v = np.linspace(5e-4, 0.01, 5000)
    line = np.interp(v, domain.grid, 1.0 / domain.grid)
    assert line * v == pytest.approx(np.ones(v.size), abs=2e-4)
    assert domain.grid[[0, -1]] == pytest.approx([-0.5, 0.5])


def test_two_branches_have_a_constant_force_of_their_own() -> None:
    """More motion to one side while slowing: one law for both branches would take their difference for a force."""
    s = samples(4, 2)
    lopsided = s.select((s.branch > 0) | (s.v > 0) | (np.arange(len(s)) % 4 == 0))
    both = fit_coulomb(lopsided, offset=True)
    found = {m.name: m for m in identify_models(lopsided, both, DOMAIN, MASS)}
    assert abs(found["A"].offset) > 0.5
    for name in "DEF":
        assert found[name].offset == pytest.approx(0.0, abs=0.1)


def test_model_d_is_nouris_model_except_for_the_smoothed_sign() -> None:
    d = models()["D"]
    v = np.concatenate([np.linspace(-0.3, -0.01, 50), np.linspace(0.01, 0.3, 50)])
    truth = nouri(v, v)
    assert d.force(v, True) == pytest.approx(truth, abs=0.03 * 12.0)
    assert d.force(v, False) == pytest.approx(8.0 * np.sign(v) + 45.0 * v, abs=0.03 * 8.0)
    assert d.force(np.zeros(1), True) == pytest.approx([0.0])


def test_level_is_friction_with_a_true_sign() -> None:
    d = models()["D"]
    rising = d.branch(accelerating=True).parameters
    assert d.level(np.array([1e-9]), accelerating=True) == pytest.approx([rising["static"].value], rel=0.005)
    assert d.level(np.array([-1e-9]), accelerating=True) == pytest.approx([rising["static"].value], rel=0.005)


@pytest.mark.parametrize(("name", "source"), [("B", "A"), ("E", "D")])
def test_tp_models_are_convex_and_exact_at_the_nodes(name: str, source: str) -> None:
    found = models()
    for one, original in zip(found[name].branches, found[source].branches, strict=True):
        assert one.tp is not None
        assert check(one.tp) == []
        assert one.tp.grids[0].size == 1000  # the thesis's
        assert one.force(DOMAIN.grid) == pytest.approx(original.force(DOMAIN.grid), rel=1e-9)


def test_the_large_vertex_is_that_of_standstill() -> None:
    """a22(0) = (Fs eta / 2 + Fv) / m (notes on chapter 6); the innermost nodes are half a step from it."""
    domain = VelocityDomain(max_velocity=0.3, resolved_velocity=5e-3)  # so smooth that half a step makes no difference
    found = models(domain=domain)
    one = found["E"].branches[0]
    p = found["D"].branches[0].parameters
    assert one.tp is not None
    at_rest = (p["static"].value * domain.eta / 2 + p["viscous"].value) / MASS
    assert one.tp.vertices.max() == pytest.approx(at_rest, rel=0.01)
    fastest = stribeck_friction(np.array([0.3]), *(p[k].value for k in ("coulomb", "viscous", "static", "velocity")))[0]
    assert one.tp.vertices.min() == pytest.approx(fastest / (MASS * 0.3), rel=0.01)


def test_e_closes_in_on_d_with_the_square_of_the_grid() -> None:
    """Between the nodes a22 is interpolated linearly: the error falls with the square of their distance."""
    sizes, source, errors = (1000, 2000, 4000, 8000), identified(HYSTERETIC).model("D"), []
    fine = np.linspace(-source.domain.max_velocity, source.domain.max_velocity, 40_001)
    for nodes in sizes:
        copy = tp_from_model("E", replace(source, domain=replace(source.domain, nodes=nodes)), MASS)
        off = [a.force(fine) - b.force(fine) for a, b in zip(copy.branches, source.branches, strict=True)]
        errors.append(np.sqrt(np.mean(np.square(off))))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2.0, abs=0.15)


@cache
def direct_errors(repeats: int) -> dict[str, float]:
    """The rms error of either direct model, in N, over four draws."""
    v = DOMAIN.uniform_speeds[DOMAIN.uniform_speeds > 0.01]
    drawn = [models(repeats, seed) for seed in range(4)]
    return {
        name: float(np.sqrt(np.mean([np.mean((one[name].force(v, True) - truth(v)) ** 2) for one in drawn])))
        for name, truth in TRUTHS.items()
    }


@pytest.mark.parametrize("name", ["C", "F"])
def test_averaging_n_repeats_brings_direct_models_down_by_the_root_of_n(name: str) -> None:
    once, four, sixteen = (direct_errors(repeats)[name] for repeats in (1, 4, 16))
    assert once / four == pytest.approx(2.0, rel=0.15)
    assert once / sixteen == pytest.approx(4.0, rel=0.2)


def rising(v: Array) -> Array:
    return nouri(v, v)


def mean_of_branches(v: Array) -> Array:
    """Both branches are met equally often at every velocity."""
    return 0.5 * (rising(v) + 8.0 * np.sign(v) + 45.0 * v)


TRUTHS = {"F": rising, "C": mean_of_branches}


def test_one_direction_mirrors_the_other_where_it_was_not_measured() -> None:
    s = samples(4, 1)
    forward = s.select(s.v > 0)
    model = tp_from_samples("C", DOMAIN, {"both": forward}, 40.0, 0.0, MASS)
    assert model is not None
    v = np.linspace(0.01, 0.3, 30)
    assert model.force(-v) == pytest.approx(-model.force(v))


def test_beyond_the_measured_velocities_direct_models_go_on_with_viscous_friction() -> None:
    s = samples(4, 1)
    both = fit_coulomb(s, offset=True)
    wide = VelocityDomain(max_velocity=0.6, resolved_velocity=1e-3)
    model = tp_from_samples("C", wide, {"both": s}, both["viscous"], both["offset"], MASS)
    assert model is not None
    force = model.force(np.array([0.35, 0.55]))
    assert np.diff(force) == pytest.approx([both["viscous"] * 0.2], rel=1e-3)


def test_no_model_is_made_of_no_samples() -> None:
    s = samples(1, 0)
    none = s.select(np.zeros(len(s), dtype=bool))
    assert tp_from_samples("F", DOMAIN, {"accelerating": s, "slowing": none}, 40.0, 0.0, MASS) is None
    found = identify_models(s.select(s.branch > 0), fit_coulomb(s, offset=True), DOMAIN, MASS)
    assert [m.name for m in found] == ["A", "B", "C"]
    (warning,) = missing_model_warnings(found, s.select(s.branch > 0))
    assert warning.values["models"] == "D, E, F"
    assert warning.values["slowing"] == 0
    assert not list(missing_model_warnings(tuple(models().values()), s))
