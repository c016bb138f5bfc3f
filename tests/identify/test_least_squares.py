"""Least squares: the minimum is found, also where derivatives are poor, and bounds hold."""

import numpy as np
import pytest

from pneucli.identify.estimation.least_squares import Approximation, Solution, minimise, pseudo_inverse

WIDE = (np.array([-100.0]), np.array([100.0]))
ONES = np.ones(1000)
ROUGH = 5.0 * np.where(np.arange(1000) % 2, 1.0, -1.0)


def line(z: np.ndarray) -> np.ndarray:
    return (z[0] - 3.0) * ONES


def test_a_line_takes_one_step():
    found = minimise(line, lambda z: ONES[:, None], np.zeros(1), WIDE, max_iterations=3, tolerance=1e-9)
    assert found.z[0] == pytest.approx(3.0, rel=1e-5)


def test_derivatives_full_of_noise_make_short_steps_which_are_doubled():
    """Noise of five times the derivative makes each step 26 times too short: two would come to 3 (1 - (25/26)^2)."""
    found = minimise(line, lambda z: (ONES + ROUGH)[:, None], np.zeros(1), WIDE, max_iterations=2, tolerance=0.0)
    assert found.z[0] == pytest.approx(3.0, rel=0.15)


def test_a_bound_holds_though_the_sum_falls_beyond_it():
    bounds = (np.array([0.0]), np.array([2.0]))
    found = minimise(line, lambda z: (ONES + ROUGH)[:, None], np.zeros(1), bounds, max_iterations=12, tolerance=1e-9)
    assert found.z[0] == 2.0


def kinked(z: np.ndarray) -> np.ndarray:
    """Flat in the first coordinate above 1, steep below, where the others pull it."""
    return np.array([100.0 * max(1.0 - z[0], 0.0), z[0] + z[1], 0.5 * (z[1] - 9.0)])


def slopes(side: float) -> np.ndarray:
    steep = -100.0 if side < 0.0 else 0.0
    return np.array([[steep, 0.0], [1.0, 1.0], [0.0, 0.5]])


def test_a_search_that_stalls_at_a_kink_says_so_and_derivatives_of_the_other_side_lead_on() -> None:
    """Derivatives from above promise a gain by leaving the kink downward, where the sum rises."""
    at_kink, bounds = np.array([1.0, 0.0]), (np.full(2, -100.0), np.full(2, 100.0))

    def searched(side: float) -> Solution:
        return minimise(kinked, lambda z: slopes(side), at_kink, bounds, max_iterations=30, tolerance=1e-6)

    stuck, led = searched(1.0), searched(-1.0)
    assert stuck.stalled
    assert not led.stalled
    assert float(led.residual @ led.residual) < 0.99 * float(stuck.residual @ stuck.residual)
    assert led.z[0] == pytest.approx(1.0, abs=1e-2)


def test_where_a_parameter_stops_at_its_bound_the_others_are_solved_for_anew():
    """Without the bound the second would be at -9.7: a step that only cuts off the first leads far past -0.94."""
    slope, evaluated = np.linalg.cholesky(np.array([[2.0, 1.9], [1.9, 2.0]])).T, []

    def residuals(z: np.ndarray) -> np.ndarray:
        evaluated.append(z)
        return slope @ (z - [10.26, -9.74])

    bounds = np.full(2, -20.0), np.array([1.0, 20.0])
    found = minimise(residuals, lambda z: slope.copy(), np.zeros(2), bounds, max_iterations=12, tolerance=5e-3)
    assert found.z == pytest.approx([1.0, -0.943], abs=1e-3)
    assert len(evaluated) <= 3


def test_a_model_that_runs_away_is_no_step_and_a_parameter_that_makes_it_so_is_held() -> None:
    def residuals(z: np.ndarray) -> np.ndarray:
        far = 1e300 if abs(z[0]) > 2.0 else 1.0
        return np.array([z[0] - 1.0, far * (z[0] + 1.0), z[1] - 3.0])

    def jacobian(z: np.ndarray) -> np.ndarray:
        return np.array([[1.0, 0.0, np.nan], [1.0, 0.0, np.inf], [0.0, 1.0, 1e300]])

    found = minimise(
        residuals, jacobian, np.zeros(3), (np.full(3, -9.0), np.full(3, 9.0)), max_iterations=9, tolerance=1e-9
    )
    np.testing.assert_allclose(found.z, [0.0, 3.0, 0.0], atol=1e-3)


class Decay:
    """z0 exp(-z1 t) held against 3 exp(-0.7 t); counts how often its derivatives are asked for."""

    t = np.linspace(0.1, 2.0, 20)

    def __init__(self) -> None:
        self.asked = 0

    def __call__(self, z: np.ndarray) -> np.ndarray:
        return z[0] * np.exp(-z[1] * self.t) - 3.0 * np.exp(-0.7 * self.t)

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        self.asked += 1
        decay = np.exp(-z[1] * self.t)
        return np.column_stack([decay, -z[0] * self.t * decay])

    def fitted(
        self,
        start: tuple[float, float],
        at_start: np.ndarray | None = None,
        approximation: Approximation | None = None,
    ) -> Solution:
        return minimise(
            self,
            self.jacobian,
            np.array(start),
            (np.full(2, -9.0), np.full(2, 9.0)),
            max_iterations=40,
            tolerance=1e-5,
            initial_jacobian=at_start,
            approximation=approximation,
        )


def broyden(jacobian: np.ndarray, before: np.ndarray, after: np.ndarray, change: np.ndarray) -> None:
    move = after - before
    jacobian += np.outer(change - jacobian @ move, move) / (move @ move)


def test_corrected_derivatives_take_the_place_of_new_ones():
    plain, corrected = Decay(), Decay()
    plain.fitted((1.0, 2.0))
    found = corrected.fitted((1.0, 2.0), approximation=Approximation(broyden))
    assert found.z == pytest.approx([3.0, 0.7], abs=1e-3)
    assert corrected.asked < plain.asked
    assert found.jacobian == pytest.approx(Decay().jacobian(found.z), abs=0.05)  # new ones, at the last step's start


def test_a_search_that_may_end_with_corrected_derivatives_evaluates_none():
    one = Decay()
    found = minimise(
        lambda z: np.append(one(z), 10.0),  # a floor, as of noise
        lambda z: pytest.fail("new derivatives"),
        np.array([2.0, 1.0]),
        (np.full(2, -9.0), np.full(2, 9.0)),
        max_iterations=9,
        tolerance=1e-6,
        initial_jacobian=np.vstack([one.jacobian(np.array([2.8, 0.8])), np.zeros(2)]),
        approximation=Approximation(broyden, start_is_exact=False, suffices=True),
    )
    assert found.z == pytest.approx([3.0, 0.7], abs=0.02)


def test_an_inverse_is_right_whatever_the_sizes_of_the_coordinates():
    jacobian = np.random.default_rng(0).standard_normal((50, 3))
    size = np.array([1e-90, 1.0, 1e90])
    expected = np.linalg.inv(jacobian.T @ jacobian)
    found = pseudo_inverse((jacobian * size).T @ (jacobian * size))
    assert found * size[:, None] * size == pytest.approx(expected, rel=1e-9)


def test_the_inverse_is_zero_for_an_undetermined_coordinate():
    assert pseudo_inverse(np.diag([4.0, 0.0])) == pytest.approx(np.diag([0.25, 0.0]))
