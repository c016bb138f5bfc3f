"""The interval of a parameter that acts as a product with another one (Fieller, 1954)."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.fit import multiplied_level, parameter_estimates, ratio_interval
from pneucli.identify.estimation.parameters import FreeParameter, effect_parameters
from pneucli.physics.effects import catalogue
from pneucli.quantities import Z95
from pneucli.simulate.rig_quantities import rig_quantities
from tests.simulate.synthetic_experiments import model


def covariance_of_ratio(product: float, factor: float, errors: np.ndarray) -> np.ndarray:
    """Covariance (2, 2) of ratio and factor to first order, from that of product and factor, as a fit gives it."""
    change = np.array([[1.0 / factor, -product / factor**2], [0.0, 1.0]])
    return np.asarray(change @ errors @ change.T)


def interval(product: float, factor: float, errors: np.ndarray) -> tuple[float, float]:
    """The interval of the ratio from estimates of product and factor with such a covariance (2, 2)."""
    return ratio_interval(product / factor, factor, covariance_of_ratio(product, factor, errors))


def coverage(factor_error: float, correlation: float) -> float:
    """The share of 4000 rigs whose interval holds a ratio of 0.6, from a product of 1.2 +- 0.3 and a factor of 2.

    The factor is friction, whose bound is 0: rigs with an estimate below do not exist.
    """
    ratio, factor, product_error = 0.6, 2.0, 0.3
    shared = correlation * product_error * factor_error
    errors = np.array([[product_error**2, shared], [shared, factor_error**2]])
    drawn = np.random.default_rng(4).multivariate_normal([ratio * factor, factor], errors, size=4000)
    ends = [interval(float(product), float(of_rig), errors) for product, of_rig in drawn if of_rig > 0.0]
    return float(np.mean([low <= ratio <= high for low, high in ends]))


@pytest.mark.parametrize("factor_error", [0.1, 0.5])
@pytest.mark.parametrize("correlation", [-0.8, 0.0, 0.8])
def test_the_interval_holds_the_ratio_in_95_of_100_rigs(factor_error: float, correlation: float) -> None:
    """0.95 +- 0.01 are three standard errors of such a share."""
    assert coverage(factor_error, correlation) == pytest.approx(0.95, abs=0.011)


@pytest.mark.parametrize("factor_error", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("correlation", [-0.8, 0.0, 0.8])
def test_the_interval_holds_the_ratio_as_often_where_the_factor_may_be_zero(
    factor_error: float, correlation: float
) -> None:
    """Somewhat more often, since rigs with an estimate below 0 would have missed it; not always."""
    assert 0.94 < coverage(factor_error, correlation) < 0.985


def test_with_a_certain_factor_the_interval_is_symmetric() -> None:
    low, high = ratio_interval(0.4, 2.0, np.diag([0.04, 0.0]))
    assert (low, high) == (pytest.approx(0.4 - Z95 * 0.2), pytest.approx(0.4 + Z95 * 0.2))


def test_with_a_nearly_certain_factor_the_interval_is_nearly_symmetric() -> None:
    low, high = interval(0.8, 2.0, np.diag([0.1**2, 0.02**2]))
    error = math.sqrt(covariance_of_ratio(0.8, 2.0, np.diag([0.1**2, 0.02**2]))[0, 0])
    assert high - 0.4 == pytest.approx(Z95 * error, rel=0.03)
    assert 0.4 - low == pytest.approx(Z95 * error, rel=0.03)
    assert high - 0.4 > 0.4 - low  # a small factor makes a large ratio


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_end_is_infinite_where_the_factor_may_be_zero(sign: float) -> None:
    """A product of 8 standard errors and a factor of 1: the ratio is not 0, and it has no upper end."""
    ends = interval(sign * 0.8, 1.0, np.diag([0.1**2, 1.0]))
    near, far = ends if sign > 0.0 else ends[::-1]
    assert far == sign * math.inf
    assert 0.0 < sign * near < 0.8
    # at the near end the product less the ratio times the factor is just 95 % certain not to be 0
    assert (sign * 0.8 - near) ** 2 == pytest.approx(Z95**2 * (0.1**2 + near**2))


def test_both_ends_are_infinite_where_neither_is_certain() -> None:
    assert interval(0.1, 1.0, np.diag([0.1**2, 1.0])) == (-math.inf, math.inf)


@pytest.mark.parametrize("factor_error", [0.01, 0.3, 0.6, 3.0])
@pytest.mark.parametrize("product", [0.5, -0.5])
@pytest.mark.parametrize("standard_errors", [1.0, 1.95, 1.97, 10.0])
def test_the_interval_contains_zero_exactly_where_that_of_the_product_does(
    factor_error: float, product: float, standard_errors: float
) -> None:
    """Whether the factor is certain or may be 0."""
    error = abs(product) / standard_errors
    shared = 0.5 * error * factor_error
    low, high = interval(product, 1.0, np.array([[error**2, shared], [shared, factor_error**2]]))
    assert (low <= 0.0 <= high) == (standard_errors < Z95)
    assert low <= product <= high


# --- the estimates of a fit

COULOMB = FreeParameter("friction.coulomb", "N", 2.0, 0.0, 1e3, 4.0)
GAIN = FreeParameter("pressure-friction.gain", "1/bar", 0.4, 0.0, 20.0, 0.1, multiplies=("friction.coulomb",))
ENDED = model(["pressure-friction"], {"friction.coulomb": 2.0, "pressure-friction.gain": 0.4})
IN_UNITS = np.array([[0.09, -0.45], [-0.45, 2.25]])  # of gain and Coulomb friction: their product is known to 0.16 N


def in_coordinates(*free: FreeParameter) -> np.ndarray:
    """The covariance of the coordinates of gain and friction, in the order of the free parameters."""
    order = [[GAIN.name, COULOMB.name].index(f.name) for f in free]
    scales = np.array([f.scale for f in free])
    return np.asarray(IN_UNITS[np.ix_(order, order)] / np.outer(scales, scales))


@pytest.mark.parametrize("free", [(COULOMB, GAIN), (GAIN, COULOMB)])
def test_a_ratio_has_the_interval_by_its_product_up_to_its_bound(free: tuple[FreeParameter, ...]) -> None:
    """Without a bound it has no upper end, which the documented example of ratio_interval shows."""
    found = {e.name: e for e in parameter_estimates(free, ENDED, in_coordinates(*free))}
    gain = found["pressure-friction.gain"]
    low, high = ratio_interval(0.4, 2.0, IN_UNITS)
    assert (low, high) == (pytest.approx(0.162, abs=1e-3), math.inf)
    assert gain.ci95 == (pytest.approx(low), 20.0)
    assert gain.error == pytest.approx(0.3)  # that of the value itself
    friction = found["friction.coulomb"]
    assert friction.ci95 == (0.0, pytest.approx(2.0 + Z95 * 1.5))


def test_a_ratio_whose_factor_is_not_fitted_has_a_symmetric_interval() -> None:
    free = (GAIN,)
    (gain,) = parameter_estimates(free, ENDED, np.array([[0.1**2 / GAIN.scale**2]]))
    assert gain.ci95 == (pytest.approx(0.4 - Z95 * 0.1), pytest.approx(0.4 + Z95 * 0.1))


def test_an_interval_without_ends_is_that_of_the_bounds() -> None:
    weak = replace(GAIN, lower=-0.95, upper=0.95)
    shaky = in_coordinates(weak, COULOMB) + np.diag([0.0, 1.0])
    shaky[0, 0] += 10.0**2
    gain, _ = parameter_estimates((weak, COULOMB), ENDED, shaky)
    assert gain.ci95 == (-0.95, 0.95)


def test_a_ratio_multiplies_the_level_of_dry_friction_that_is_determined_best() -> None:
    """No reading is fast enough for Coulomb friction, 24 +- 6 N: all show 26 +- 0.4 N, which grow by 67 +- 3 %."""
    values = {"friction.coulomb": 24.0, "stribeck.static": 26.0, "stribeck.velocity": 1.8}
    known = {"position-friction.from": 0.1, "position-friction.to": 0.2, "position-friction.gain": 0.67}
    ended, friction = model(["stribeck", "position-friction"], values | known), catalogue()["position-friction"]
    *_, gain = effect_parameters(friction, ended, rig_quantities(ended))
    assert gain.name == "position-friction.gain"
    assert gain.multiplies == ("friction.coulomb", "stribeck.static")
    static = replace(COULOMB, name="stribeck.static")
    free = (COULOMB, static, gain)
    errors = np.array([6.0 / COULOMB.scale, 0.4 / COULOMB.scale, 0.03 / gain.scale])
    found = parameter_estimates(free, ended, np.diag(errors**2))[2]
    assert found.ci95 == (pytest.approx(0.67 - Z95 * 0.03, abs=5e-3), pytest.approx(0.67 + Z95 * 0.03, abs=5e-3))
    level = multiplied_level(gain, free, ended, np.diag(errors**2))
    assert level is not None
    assert level.value == pytest.approx(26.0, abs=0.02)
    assert level.weights.sum() == pytest.approx(1.0)
