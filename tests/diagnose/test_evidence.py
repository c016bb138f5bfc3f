"""Evidence: blocks of correlated residuals feign nothing, families of tests are adjusted."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.diagnose.evidence import (
    effective_degrees_of_freedom,
    null_contrast,
    score_gain,
    significance,
    wald_p_value,
)
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import FreeParameter, effect_parameters
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue
from pneucli.simulate.model import with_parameters
from pneucli.simulate.rig_quantities import rig_quantities
from tests.simulate.synthetic_experiments import model

N, BLOCK = 6000, 50


def fitted(effect: Effect, values: dict[str, float], columns: np.ndarray, seed: int = 1) -> Fit:
    """A fit that ended at values, with white noise left over; columns (N, k) are its derivatives."""
    ended = model([effect.name], {f"{effect.name}.{n}": v for n, v in values.items()})
    free = tuple(effect_parameters(effect, ended, rig_quantities(ended)))
    noise = np.random.default_rng(seed).normal(size=N)
    left = noise - columns @ np.linalg.lstsq(columns, noise, rcond=None)[0]
    unused = np.zeros((len(free), len(free)))
    return Fit(ended, free, (), left, columns, np.arange(N) // BLOCK, unused, float(left @ left), ())


def test_blocks_without_a_reading_do_not_count():
    """A sample every 2 s leaves blocks of 1.5 s empty: they are no evidence against a gain."""
    before, after = np.array([9.0, 12.0, 10.0, 11.0]), np.array([3.0, 5.0, 2.0, 4.0])
    spaced = [np.zeros(12), np.zeros(12)]
    for costs, sparse in zip((before, after), spaced, strict=True):
        sparse[::3] = costs
    assert score_gain(*spaced) == score_gain(before, after)


def test_a_fall_in_every_block_is_certain():
    before = np.full(40, 100.0) + np.arange(40) % 5
    found = score_gain(before, before - 10.0 - np.arange(40) % 3)
    assert found.total == pytest.approx(10.0 * 40 + np.sum(np.arange(40) % 3))
    assert found.significant
    assert found.p_value < 1e-6


def test_noise_is_called_certain_as_often_as_its_bound_says():
    """One-sided 95 %: 5 % of data sets without any difference pass, here 400 of them: 20 +- 13 (3 sigma)."""
    rng = np.random.default_rng(1)
    passed = sum(score_gain(rng.normal(size=60), rng.normal(size=60)).significant for _ in range(400))
    assert 7 <= passed <= 38


def test_equal_parts_count_fully_and_one_large_part_counts_as_one():
    assert effective_degrees_of_freedom(np.random.default_rng(2).normal(size=1000)) == pytest.approx(1000, rel=0.15)
    assert effective_degrees_of_freedom(np.array([1000.0, 1.0, 1.0, 1.0])) == pytest.approx(1.0, abs=0.01)
    for size in (1e-200, 1.0, 1e200):  # of an effect that the readings hardly show, the parts have any size
        assert effective_degrees_of_freedom(size * np.array([1.0, -1.0] * 20)) == pytest.approx(118.0)


def test_parameters_without_a_null_are_held():
    """Gain and time constant of a dwell trade off exactly; that they are something together is certain all the same."""
    dwell = catalogue()["dwell-breakaway"]
    wave = np.sin(np.arange(N) / 40.0)
    traded = fitted(dwell, {"gain": 0.5, "time_constant": 0.3}, np.column_stack([wave, -wave]))
    assert wald_p_value(traded, dwell) < 1e-12
    assert significance(traded, dwell) > 20.0


def test_an_effect_that_the_residuals_do_not_determine_is_not_significant():
    """The derivatives of a diverging model say that a delay is certain to 1e-28 s; its interval is its whole range."""
    dwell = catalogue()["dwell-breakaway"]
    diverging = fitted(dwell, {"gain": 0.5, "time_constant": 0.3}, 1e24 * np.ones((N, 2)))
    assert significance(diverging, dwell) > 1e6
    names = frozenset(f.name for f in diverging.free)
    assert significance(replace(diverging, undetermined=names), dwell) == 0.0


@pytest.mark.parametrize(("sensitivity", "seen"), [(1.0, True), (0.03, False)])
def test_an_effect_that_vanishes_as_a_parameter_grows_is_tested_by_the_reciprocal(sensitivity: float, seen: bool):
    """150 residuals move by 1 (0.03) for a small relative change: the stiffness is known to 8 % (270 %)."""
    presliding = catalogue()["presliding"]
    column = (np.arange(N) % 40 == 0) * sensitivity
    found = fitted(presliding, {"stiffness": 2e4, "damping": 50.0}, np.column_stack([column, np.zeros(N)]))
    assert (wald_p_value(found, presliding) < 1e-3) == seen


# --- what of an effect is 0 where it is absent

COULOMB = FreeParameter("friction.coulomb", "N", 14.0, 0.0, 1e5, 7.0)


def beside_friction(fit: Fit) -> Fit:
    """The fit with Coulomb friction of 14 N fitted, too; its coordinate is that over 7 N."""
    return replace(fit, free=(COULOMB, *fit.free), jacobian=np.column_stack([np.ones(N), fit.jacobian]))


def slopes_by_differences(fit: Fit, effect: Effect, step: float = 1e-6) -> np.ndarray:
    """The derivatives of the distance by the coordinates, shape (m, k), by central differences."""
    columns = []
    for f in fit.free:
        value = fit.model.values[f.name]
        ends = [
            replace(fit, model=with_parameters(fit.model, {f.name: f.from_coordinate(f.to_coordinate(value) + s)}))
            for s in (-step, step)
        ]
        low, high = (null_contrast(end, effect) for end in ends)
        assert low is not None
        assert high is not None
        columns.append((high.distance - low.distance) / (2.0 * step))
    return np.array(columns).T


@pytest.mark.parametrize(
    ("name", "values", "distance", "at_bounds"),
    [
        ("constant-force", {"force": 10.0}, [10.0], False),
        ("chamber-leak", {"area": 1e-8}, [1e-8], True),
        ("pressure-scale", {"scale": 1.1}, [0.1], False),
        ("stribeck", {"static": 20.0, "velocity": 0.01}, [20.0 - 14.0], False),  # static less Coulomb friction
        ("presliding", {"stiffness": 2e4, "damping": 50.0}, [1.0 / 2e4], True),  # rigid bristles are none
        ("pressure-friction", {"gain": 0.2}, [0.2 * 14.0], False),  # N per bar; friction may fall with pressure
        ("friction-asymmetry", {"asymmetry": 0.2, "viscous_asymmetry": -0.1}, [0.2 * 14.0, -0.1], False),
        ("dwell-breakaway", {"gain": 0.5, "time_constant": 0.3}, [0.5 * 14.0], True),  # the time constant has no null
    ],
)
def test_the_distance_from_absence_has_the_derivatives_of_differences(
    name: str, values: dict[str, float], distance: list[float], at_bounds: bool
) -> None:
    """A ratio counts as its product with the base parameter where that is fitted, too; viscous friction is not."""
    effect = catalogue()[name]
    found = beside_friction(fitted(effect, values, np.ones((N, len(values)))))
    null = null_contrast(found, effect)
    assert null is not None
    assert null.distance.tolist() == pytest.approx(distance)
    assert null.at_bounds == at_bounds
    assert null.contrast == pytest.approx(slopes_by_differences(found, effect), rel=1e-4, abs=1e-12)


def test_a_ratio_whose_base_parameter_is_not_fitted_counts_by_itself() -> None:
    friction = catalogue()["pressure-friction"]
    found = fitted(friction, {"gain": 0.2}, np.ones((N, 1)))
    null = null_contrast(found, friction)
    assert null is not None
    assert null.distance.tolist() == [0.2]
    assert null.contrast.tolist() == [[found.free[0].scale]]


def test_a_ratio_is_tested_with_the_friction_that_the_data_determine() -> None:
    """Where a Stribeck curve leaves Coulomb friction open, what a growth multiplies is the friction that was seen."""
    friction = catalogue()["pressure-friction"]
    static = FreeParameter("stribeck.static", "N", 20.0, 0.0, 1e5, 7.0)
    found = beside_friction(fitted(friction, {"gain": 0.2}, np.ones((N, 1))))
    coulomb, gain = found.free
    gain = replace(gain, multiplies=(coulomb.name, static.name))
    for errors, level in (((3.0, 0.0), 20.0), ((0.0, 3.0), 14.0), ((3.0, 3.0), 17.0)):
        fit = replace(
            found,
            model=with_parameters(found.model, {static.name: 20.0}),
            free=(coulomb, static, gain),
            covariance=np.diag([*np.square(errors), 1e-4]),
        )
        null = null_contrast(fit, friction)
        assert null is not None
        assert null.distance.tolist() == pytest.approx([0.2 * level])
        weights = (level - 14.0) / 6.0
        assert null.contrast.tolist()[0] == pytest.approx(
            [0.2 * (1.0 - weights) * 7.0, 0.2 * weights * 7.0, level * gain.scale]
        )


def test_an_effect_without_a_null_has_no_distance() -> None:
    """No conductance makes heat transfer absent: the walls are isothermal or adiabatic."""
    heat = catalogue()["heat-transfer"]
    values = {p.name: 1.0 for p in heat.parameters}
    assert null_contrast(fitted(heat, values, np.ones((N, len(values)))), heat) is None


def test_a_ratio_is_tested_by_its_product_however_uncertain_the_base_parameter_is() -> None:
    """Dry friction of 2 + 5 p N, p in bar about 3: what grows with p is certain, what is left at 0 bar is not.

    The ratio 2.5 +- 20 per bar says nothing; the product is known to 0.2 %, as where Coulomb friction is 14 N.
    """
    friction = catalogue()["pressure-friction"]
    pressure = 3.0 + 0.05 * np.sin(np.arange(N) / 40.0)
    for coulomb, gain in ((2.0, 2.5), (14.0, 5.0 / 14.0)):
        found = fitted(friction, {"gain": gain}, np.zeros((N, 1)))
        found = replace(found, model=with_parameters(found.model, {"friction.coulomb": coulomb}))
        # d/d coordinate of coulomb (1 + gain p), for coulomb = 7 z_1 and gain = scale z_2
        columns = np.column_stack([7.0 * (1.0 + gain * pressure), coulomb * pressure * found.free[0].scale])
        noise = np.random.default_rng(1).normal(size=N)
        left = noise - columns @ np.linalg.lstsq(columns, noise, rcond=None)[0]
        found = replace(found, free=(COULOMB, *found.free), jacobian=columns, residual=left)
        # the slope of friction over pressure, by blocks of time
        plain = np.column_stack([np.ones(N), pressure])
        influence = plain @ np.linalg.inv(plain.T @ plain)[:, 1]
        error = float(np.sqrt(np.sum(np.bincount(found.blocks, influence * left) ** 2)))
        assert significance(found, friction) == pytest.approx(5.0 / error, rel=1e-6)
