"""The law of the gradient and its fit, held to their definitions: derivatives by differences, curves by an exact one.

The trend is a toy with a formula of its own; that of the model is tested with the identification as a whole.
"""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pneucli.errors import InputError
from pneucli.identify.valve.area_model import (
    LEAK_COEFFICIENTS,
    MAX_LOG_CORRECTION,
    OWN_COEFFICIENTS,
    SHARED_COEFFICIENTS,
    AreaModel,
    Direction,
    polynomial,
)
from pneucli.identify.valve.fit import (
    Posterior,
    TransientBatch,
    TransientProblem,
    autocovariances,
    averaged_noise_autocovariance,
    initial_pressure_sensitivity,
    parameter_sensitivity,
    simulate_transients,
    whitening_filter,
)
from pneucli.identify.valve.maps import invert_gradient
from pneucli.identify.valve.transients import Transients, average_readings, cut_transients, interpolation_error
from pneucli.noise import NoiseModel
from pneucli.recording import Recording

RNG = np.random.default_rng
AMBIENT, SUPPLY = 1e5, 7e5
NODES = (np.array([1.0, 3.0, 8.0]), np.array([2.0, 9.0]))


class Shut:
    """A valve that is shut below 0.4 V."""

    form = "map"

    def __call__(self, u: np.ndarray) -> np.ndarray:
        return np.maximum(np.abs(u) - 0.4, 0.0)


class Trend:
    """dp/dt = e^a |u|^(1 + b) (other side - p), of coordinates a and b; shut below 0.4 V for the inverse."""

    free = ("a", "b")
    start = np.array([0.3, 0.1])
    valve = Shut()

    def at_coordinates(self, z: np.ndarray) -> Callable[..., np.ndarray]:
        def gradient(u: np.ndarray, p: np.ndarray, supply: np.ndarray) -> np.ndarray:
            other = np.where(u > 0, supply, AMBIENT)
            return np.asarray(np.exp(z[0]) * np.abs(u) ** (1.0 + z[1]) * (other - p))

        return gradient

    def sensitivity(self, z: np.ndarray, u: np.ndarray, p: np.ndarray, supply: np.ndarray) -> np.ndarray:
        return self.at_coordinates(z)(u, p, supply)[..., None] * np.stack([np.ones_like(u), np.log(np.abs(u))], axis=-1)


TREND: Any = Trend()
MOVED = len(Trend.free)
LAW = AreaModel(TREND, (Direction(1, NODES[0]), Direction(-1, NODES[1])), AMBIENT, SUPPLY, 2e6)
THETA = LAW.initial_theta() + 0.02 * RNG(1).standard_normal(LAW.size)  # with corrections and a leak that are not small
U = np.array([0.6, 2.0, 5.0, 8.0, -0.7, -3.0, -9.0, 4.0])
P = np.array([2e5, 3e5, 6.5e5, 1.5e5, 4e5, 1.2e5, 6e5, 6.9e5])
S = np.full(8, SUPPLY)


def test_a_polynomial_is_summed_from_its_lowest_power() -> None:
    coefficients = np.array([1.0, 10.0, 100.0])
    assert [polynomial(2.0, coefficients), polynomial(-1.0, coefficients)] == pytest.approx([421.0, 91.0])


def test_node_weights_are_linear_in_the_logarithm_of_the_command() -> None:
    d = Direction(-1, np.array([1.0, 4.0]))
    assert d.node_weights(np.array([-0.5, -1.0, -2.0, -4.0, -9.0])) == pytest.approx(
        np.array([[1, 0], [1, 0], [0.5, 0.5], [0, 1], [0, 1]])
    )


def test_each_parameter_has_its_place() -> None:
    assert LAW.offsets() == [MOVED, MOVED + SHARED_COEFFICIENTS + 3 * OWN_COEFFICIENTS]
    assert LAW.size == MOVED + 2 * SHARED_COEFFICIENTS + 5 * OWN_COEFFICIENTS + LEAK_COEFFICIENTS
    groups = LAW.prior_groups()
    assert sorted(np.concatenate([range(MOVED), *groups.values()])) == list(range(LAW.size))
    assert groups["leak"].tolist() == list(range(LAW.size - LEAK_COEFFICIENTS, LAW.size))
    assert (groups["shared"].size, groups["own"].size) == (2 * SHARED_COEFFICIENTS, 5 * OWN_COEFFICIENTS)
    assert groups["shared"][0] == MOVED
    assert groups["own"][0] == MOVED + SHARED_COEFFICIENTS
    assert LAW.initial_theta().tolist() == [0.3, 0.1, *[0.0] * (LAW.size - MOVED)]
    assert LAW.coordinate_shift(LAW.initial_theta() + 0.5).tolist() == [0.5, 0.5]


@pytest.mark.parametrize(
    ("u", "p", "other", "ratio"),
    [(5.0, 3.5e5, 7e5, 0.5), (-5.0, 4e5, 1e5, 0.25), (5.0, 8e5, 7e5, 7 / 8), (-5.0, 0.5e5, 1e5, 0.5)],
)
def test_the_ratio_is_that_of_the_lower_to_the_higher_pressure(u: float, p: float, other: float, ratio: float) -> None:
    at = np.array([u]), np.array([p]), np.array([SUPPLY])
    assert LAW.opposite_pressure(at[0], at[2])[0] == other
    assert LAW.pressure_ratio(*at)[0] == pytest.approx(ratio)


def test_without_corrections_the_gradient_is_the_models() -> None:
    assert LAW.gradient(LAW.initial_theta(), U, P, S) == pytest.approx(TREND.at_coordinates(TREND.start)(U, P, S))


def test_a_correction_multiplies_the_commands_of_its_sign_and_none_more_than_a_hundredfold() -> None:
    theta = LAW.initial_theta()
    theta[LAW.offsets()[1]] = 0.5
    trend = TREND.at_coordinates(TREND.start)(U, P, S)
    assert LAW.gradient(theta, U, P, S) == pytest.approx(trend * np.where(U < 0, np.exp(0.5), 1.0))
    theta[LAW.offsets()[1]] = 99.0
    assert LAW.gradient(theta, U, P, S) == pytest.approx(trend * np.where(U < 0, np.exp(MAX_LOG_CORRECTION), 1.0))


def test_a_commands_own_correction_is_shared_with_its_neighbours() -> None:
    theta = LAW.initial_theta()
    theta[LAW.offsets()[0] + SHARED_COEFFICIENTS + OWN_COEFFICIENTS] = 0.5  # the second command's, constant in r
    u = np.array([1.0, 3.0, 8.0, 24.0**0.5, -3.0])
    found = LAW.gradient(theta, u, P[:5], S[:5]) / TREND.at_coordinates(TREND.start)(u, P[:5], S[:5])
    assert np.log(found) == pytest.approx([0.0, 0.5, 0.0, 0.25, 0.0], abs=1e-12)


def test_a_leak_is_a_cubic_of_pressure_between_ambient_and_supply() -> None:
    theta = THETA.copy()
    theta[-LEAK_COEFFICIENTS:] = 1.0, 2.0, 3.0, 4.0
    p = np.array([0.0, AMBIENT, 4e5, SUPPLY, 9e5])
    found = LAW.correction_of_gradient(theta)(np.zeros(p.size), np.zeros((p.size, 1)), p, p)
    assert found == pytest.approx(2e6 * np.array([1.0, 1.0, 1 + 1 + 0.75 + 0.5, 10.0, 10.0]))


def test_the_sensitivity_is_the_derivative_of_the_gradient() -> None:
    found = LAW.sensitivity(THETA, U, P, S)
    assert found.shape == (8, LAW.size)
    for k, row in enumerate(1e-6 * np.eye(LAW.size)):
        slope = (LAW.gradient(THETA + row, U, P, S) - LAW.gradient(THETA - row, U, P, S)) / 2e-6
        assert found[:, k] == pytest.approx(slope, rel=2e-4, abs=1e-5 * np.abs(found).max())


# --- curves


def stretches(period: float = 1e-4, samples: int = 300, steps: int = 1) -> Transients:
    """A charge at 5 V and a discharge at -6 V, the second 60 samples shorter, beside something that drifts."""
    time = period * np.arange(samples)
    grid = np.repeat(time[:, None], 2, axis=1)
    valid = np.arange(samples)[:, None] < np.array([samples, samples - 60])
    u, p = np.broadcast_to([5.0, -6.0], grid.shape), np.broadcast_to([2e5, 6e5], grid.shape).copy()
    beside = np.broadcast_to([2e5, 3e5, 0.0], (samples, 2, 1 + MOVED))
    single, ones = np.full(2, period), np.ones(2, dtype=np.int64)
    supply = np.full(grid.shape, SUPPLY)
    return Transients(grid, u, supply, p, beside, valid, single, np.arange(2), ones, steps, 1e7)


START = np.array([1.5e5, 6e5])


@pytest.mark.parametrize(("period", "steps"), [(1e-4, 1), (2e-3, 20)])
def test_a_simulated_curve_is_the_exact_one(period: float, steps: int) -> None:
    """The gradient, and what is beside it at the trend's coordinates."""
    s = stretches(period, steps=steps)
    found = simulate_transients(LAW, THETA, START, s)
    beside = 2e5 + 3e5 * LAW.coordinate_shift(THETA)[0]
    for k, u in enumerate((5.0, -6.0)):

        def slope(_: float, p: np.ndarray, u: float = u) -> np.ndarray:
            return LAW.gradient(THETA, np.array([u]), p, np.array([SUPPLY])) + beside

        times = s.time[:, k]
        exact = solve_ivp(slope, (0.0, times[-1]), START[k : k + 1], t_eval=times, rtol=1e-9, max_step=1e-3)
        assert found[:, k] == pytest.approx(exact.y[0], rel=2e-4)


def test_no_step_leads_beyond_the_other_side() -> None:
    """However long it is against the curve's own time: here ten times and more."""
    s = stretches(1.0, samples=3)
    found = simulate_transients(
        LAW, LAW.initial_theta(), START, replace(s, memory_gradient=np.zeros((3, 2, 1 + MOVED)))
    )
    assert found.min() >= AMBIENT
    assert found.max() <= SUPPLY


def test_sensitivities_of_a_curve_are_its_differences() -> None:
    s = stretches()
    p = simulate_transients(LAW, THETA, START, s)
    decay, by_start = initial_pressure_sensitivity(LAW, THETA, p, s)
    by_theta = parameter_sensitivity(LAW, THETA, p, decay, s)
    ahead, behind = (simulate_transients(LAW, THETA, START + d, s) for d in (10.0, -10.0))
    assert by_start == pytest.approx((ahead - behind) / 20.0, abs=5e-3)
    for k in (0, 1, 2, 5, LAW.offsets()[1], LAW.size - 1):
        row = 1e-5 * np.eye(LAW.size)[k]
        slope = (
            simulate_transients(LAW, THETA + row, START, s) - simulate_transients(LAW, THETA - row, START, s)
        ) / 2e-5
        assert by_theta[..., k] == pytest.approx(slope, rel=5e-3, abs=5e-3 * np.abs(slope).max())


def part(noise: float = 300.0) -> TransientBatch:
    s = stretches()
    p = simulate_transients(LAW, THETA, START, s)
    s.p[:] = p + noise * RNG(2).standard_normal(p.shape)
    return TransientBatch(LAW, s, np.array([1.0, -0.5]), noise, START)


def test_a_signal_is_whitened_by_the_filter_where_all_of_it_is_seen() -> None:
    one, ones = part(), np.ones((300, 2))
    found = one.whiten(ones)
    assert found.shape == (299, 2)
    assert found[:, 0] == pytest.approx(np.full(299, 0.5 / 300.0))
    assert np.flatnonzero(found[:, 1] == 0.0).tolist() == list(range(239, 299))
    assert one.whiten(np.ones((300, 2, 3)))[..., 1] == pytest.approx(found)


def test_transients_shorter_than_the_filter_have_no_residuals() -> None:
    whole = part()
    short = stretches(samples=61).select(np.array([1]))
    one = replace(whole, data=short, whitening=np.eye(9)[0], start=START[1:])
    assert short.p.shape == (1, 1)
    assert one.residuals(THETA).size == 0
    assert one.jacobian(THETA).shape == (0, LAW.size)
    assert one.improved_initial_pressures(THETA).tolist() == [6e5]


def test_residuals_are_whitened_errors_with_initial_pressures_eliminated() -> None:
    one = part()
    found = one.residuals(THETA)
    p = simulate_transients(LAW, THETA, START, one.data)
    error, ahead = one.whiten(p - one.data.p), one.whiten(initial_pressure_sensitivity(LAW, THETA, p, one.data)[1])
    for k in (0, 1):
        share = ahead[:, k] @ error[:, k] / (ahead[:, k] @ ahead[:, k])
        mine = found.reshape(299, 2)[:, k]
        assert mine == pytest.approx(error[:, k] - share * ahead[:, k], abs=1e-6)


def test_the_jacobian_leads_the_residuals() -> None:
    """Where the curves are met, so that what a start can take up of the error does not move."""
    one = part(noise=1.0)
    one.data.p[:] = simulate_transients(LAW, THETA, START, one.data)
    found = one.jacobian(THETA)
    for k in (0, 4, LAW.offsets()[1], LAW.size - 1):
        row = 1e-5 * np.eye(LAW.size)[k]
        slope = (one.residuals(THETA + row) - one.residuals(THETA - row)) / 2e-5
        assert found[:, k] == pytest.approx(slope, abs=1e-2 * np.abs(slope).max())


def test_a_wrong_initial_pressure_is_corrected() -> None:
    one = part(noise=1.0)
    one.start = START + np.array([30.0, -20.0])
    assert one.improved_initial_pressures(THETA) == pytest.approx(START, abs=2.0)


def problem(memory: int, repeated: int = 3) -> TransientProblem:
    """Charges and discharges of two lengths side by side, some that are missed by far."""
    one = part()
    which = np.tile([0, 1], repeated)
    data = one.data.select(which)
    data.p[:, 0] += 500.0
    prior = 2.0 * np.eye(LAW.size)
    return TransientProblem(LAW, data, one.whitening, one.noise, prior, START[which], memory)


def test_batches_have_similar_lengths_and_contain_each_transient_once() -> None:
    data = stretches().select(np.tile([0, 1], 3))
    assert data.lengths.tolist() == 3 * [300, 240]
    assert [some.tolist() for some in data.batches(600)] == [[0, 2], [1, 4], [3, 5]]
    assert [some.tolist() for some in data.batches(1)] == [[0], [2], [4], [1], [3], [5]]
    short = data.select(np.array([5, 1]))
    assert short.p.shape == (240, 2)
    assert short.memory_gradient.shape == (240, 2, 1 + MOVED)
    assert short.recording.tolist() == [1, 1]
    unseen = replace(data, valid=np.zeros_like(data.valid))
    assert unseen.select(np.array([0])).p.shape == (1, 1)
    assert np.concatenate(list(unseen.batches(2))).tolist() == list(range(6))


def test_a_problem_in_parts_is_the_same_problem() -> None:
    whole, parts = problem(1 << 30), problem(8 * LAW.size * 500)
    assert np.sum(parts.residuals(THETA) ** 2) == pytest.approx(np.sum(whole.residuals(THETA) ** 2), rel=1e-9)
    for mine, other in zip(parts.normal_equations(THETA), whole.normal_equations(THETA), strict=True):
        assert mine == pytest.approx(other, rel=1e-9, abs=1e-9 * np.abs(other).max())
    assert parts.improved_initial_pressures(THETA) == pytest.approx(whole.improved_initial_pressures(THETA), rel=1e-9)


def test_the_prior_counts_once() -> None:
    one, known = problem(8 * LAW.size * 500), 2.0 * (THETA - LAW.initial_theta())
    assert one.residuals(THETA)[-LAW.size :] == pytest.approx(known)
    without = TransientProblem(LAW, stretches(), np.array([1.0]), 1e12, 2.0 * np.eye(LAW.size), START, 1)
    gradient, curvature = without.normal_equations(THETA)
    assert gradient == pytest.approx(2.0 * known, rel=1e-3)
    assert curvature == pytest.approx(4.0 * np.eye(LAW.size), abs=1e-3)


def test_derivatives_of_all_transients_are_never_held_at_once() -> None:
    many = problem(100_000, repeated=100)
    many.residuals(THETA)
    tracemalloc.start()
    many.normal_equations(THETA)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e6 < 8 * 100 * (300 + 240) * LAW.size


def test_an_ar_process_is_whitened_by_its_own_coefficients() -> None:
    """AR(1) with pole 0.8 and deviation 5."""
    filter_, innovations = whitening_filter(25.0 * 0.8 ** np.arange(5))
    assert filter_ == pytest.approx([1.0, -0.8, 0.0, 0.0, 0.0], abs=1e-4)
    assert innovations == pytest.approx(5.0 * 0.6, rel=1e-4)
    alone, level = whitening_filter(np.array([9.0]))
    assert (alone.tolist(), level) == ([1.0], pytest.approx(3.0, rel=1e-5))


def test_autocovariances_are_means_over_the_pairs_that_were_seen() -> None:
    residual = np.array([[1.0, 2.0], [2.0, 2.0], [3.0, 9.0]] * 30)
    valid = np.array([[True, True], [True, True], [True, False]] * 30)
    found = autocovariances(residual, valid)
    assert found.size == 5  # a twentieth of 90 samples
    assert found[0] == pytest.approx((30 * (1 + 4 + 9) + 60 * 4) / 150)
    assert found[1] == pytest.approx((30 * (2 + 6) + 29 * 3 + 30 * 4) / (89 + 30))
    assert autocovariances(residual[:19], valid[:19]).size == 1
    assert autocovariances(np.tile(residual, (9, 1)), np.tile(valid, (9, 1))).size == 9


def test_averaged_white_noise_has_less_power_and_stays_white() -> None:
    assert averaged_noise_autocovariance(NoiseModel(6.0), 4, 3) == pytest.approx([9.0, 0.0, 0.0])


# --- maps


def test_commands_lead_back_to_their_gradients() -> None:
    sure: Any = Posterior(LAW.initial_theta(), np.zeros((LAW.size, LAW.size)), np.zeros((0, 0)))

    def everywhere(u: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.ones(u.shape, dtype=bool)

    def asked(gradient: np.ndarray, p: np.ndarray, covers: Any = everywhere) -> tuple[np.ndarray, np.ndarray]:
        return invert_gradient(LAW, sure, gradient, p, covers)

    u, p = np.array([-8.0, -2.0, 1.0, 3.0, 7.0]), np.full(5, 3e5)
    gradient = LAW.gradient(LAW.initial_theta(), u, p, S[:5])
    found, reachable = asked(gradient, p)
    assert found == pytest.approx(u, abs=0.02)
    assert reachable.all()
    ends = LAW.gradient(LAW.initial_theta(), np.array([-9.0, 8.0]), p[:2], S[:2])
    at_end, reached = asked(ends, p[:2])
    assert reached.all()
    assert at_end == pytest.approx([-9.0, 8.0])
    beyond, far = asked(1.01 * ends, p[:2])
    assert beyond.tolist() == [-9.0, 8.0]
    assert not far.any()
    assert not asked(gradient, p, lambda u, p: np.zeros(u.shape, dtype=bool))[1].any()


# --- stretches


STEEP = np.where(np.arange(400) < 350, 1e5, 2e5)  # so steep that no readings are averaged


def beside(samples: int) -> list[np.ndarray]:
    return [np.zeros((1, samples))]


def test_straight_curves_are_averaged_to_at_least_eight_samples() -> None:
    """A straight line of 0.4 s: 8 samples of 50 ms, the middle of each at its mean."""
    time = 1e-3 * np.arange(400)
    signals = {"u": np.full(400, 5.0), "p1": 1e5 + time}
    found = cut_transients([Recording("r", "valve", "train", time, signals)], SUPPLY, beside(400))
    (joined,) = found.averaged_readings
    assert found.p.shape[0] >= 8
    assert 1 < joined <= 50
    assert found.period == pytest.approx([1e-3 * joined])
    assert found.p[:, 0] == pytest.approx(1e5 + found.time[:, 0])
    assert found.time[0, 0] == pytest.approx(0.5e-3 * (joined - 1))


@pytest.mark.parametrize(("period", "steps"), [(10e-3, 3), (3e-3, 1), (4.1e-3, 2), (0.5, 13)])
def test_a_sample_has_enough_substeps_for_the_steepest_curve(period: float, steps: int) -> None:
    """3 MPa/s: a fiftieth of the range takes 4 ms where that is 0.2 s, and 40 ms where it is 2 s."""
    time = period * np.arange(max(round(0.2 / period), 4) + 1)
    signals = {"u": np.full(time.size, 5.0), "p1": 1e5 + 3e6 * time}
    found = cut_transients([Recording("r", "valve", "train", time, signals)], SUPPLY, beside(time.size))
    assert (found.substeps, found.averaged_readings.tolist()) == (steps, [1])


def test_an_average_needs_half_of_its_readings_and_holds_the_command() -> None:
    nan = np.nan
    rows = np.array([np.arange(9.0), [0, 0, 0, 0, 1, 1, 1, 1, 1], [1, nan, 3, nan, nan, 5, 7, 7, 7]])
    found = average_readings(rows, 4)
    assert found[0].tolist() == [1.5, 5.5]
    assert found[1].tolist() == [0.0, 1.0]
    assert found[2] == pytest.approx([2.0, 19 / 3])
    assert np.isnan(average_readings(np.array([[0.0, 1, 2], [0, 0, 0], [1, nan, nan]]), 3)[2, 0])


def test_an_average_has_the_command_that_stands_midway_to_the_next() -> None:
    """Means of 4 readings of a ramp are at 1.5 and 5.5 samples: from one to the other 3.5 is the mean command."""
    ramp = np.arange(12.0)  # held over each sample: 3 from sample 3 to 4
    assert average_readings(np.stack([ramp, ramp, ramp]), 4)[1].tolist() == [3.0, 7.0, 11.0]
    assert average_readings(np.stack([ramp, ramp, ramp]), 1)[1].tolist() == ramp.tolist()


def test_a_recording_is_cut_at_jumps_of_the_command() -> None:
    """Jumps cut a recording; 30 ms after each are left out, and so is what does not last 30 ms beyond."""
    time = 1e-3 * np.arange(400)
    u = np.repeat([0.0, 5.0, -5.0, 3.0], [100, 100, 50, 150])
    recorded = Recording("r", "valve", "train", time, {"u": u, "p1": STEEP})
    found = cut_transients([recorded], SUPPLY, [np.arange(800.0).reshape(2, 400)])
    assert found.valid.sum(axis=0).tolist() == [100, 70, 120]
    assert found.u[0].tolist() == [0.0, 5.0, 3.0]
    assert found.time[0] == pytest.approx([0.0, 0.130, 0.280])
    assert np.all(found.supply == SUPPLY)
    assert found.period == pytest.approx(np.full(3, 1e-3))
    assert found.recording.tolist() == [0, 0, 0]
    assert found.averaged_readings.tolist() == [1, 1, 1]
    assert found.memory_gradient[0].tolist() == [[0.0, 400.0], [130.0, 530.0], [280.0, 680.0]]


def test_a_ramp_is_no_jump_and_unmeasured_pressures_are_not_valid() -> None:
    time = 1e-3 * np.arange(400)
    p = np.where(np.arange(400) == 7, np.nan, STEEP)
    found = cut_transients(
        [Recording("r", "valve", "train", time, {"u": np.linspace(0.0, 1.0, 400), "p1": p})], SUPPLY, beside(400)
    )
    assert found.valid.shape == (400, 1)
    assert np.flatnonzero(~found.valid[:, 0]).tolist() == [7]


def test_a_recorded_supply_is_averaged_over_a_tenth_of_a_second() -> None:
    time = 1e-3 * np.arange(1000)
    supply = SUPPLY + 1e4 * np.where(np.arange(1000) % 2, 1.0, -1.0)
    signals = {"u": np.full(1000, 5.0), "p1": np.full(1000, 2e5), "p_supply": supply}
    found = cut_transients([Recording("r", "valve", "train", time, signals)], None, beside(1000))
    assert found.supply[60:-60] == pytest.approx(np.full((880, 1), SUPPLY), abs=200.0)
    ramp = dict(signals, p_supply=SUPPLY + 1e5 * time)
    found = cut_transients([Recording("r", "valve", "train", time, ramp)], None, beside(1000))
    assert found.supply[500, 0] == pytest.approx(SUPPLY + 5e4, rel=1e-4)


@pytest.mark.parametrize(
    ("signals", "says"),
    [
        ({"p1": np.ones(100)}, "no signal u"),
        ({"u": np.ones(100)}, "no signal p1"),
        ({"u": np.ones(100), "p1": np.ones(100)}, "no signal p_supply.*set rig.supply_pressure"),
        (
            {"u": np.arange(100.0) % 2, "p1": np.ones(100), "p_supply": np.ones(100)},
            "no command is held longer than 60 ms",
        ),
    ],
)
def test_what_is_missing_of_a_valve_test_is_named(signals: dict[str, np.ndarray], says: str) -> None:
    with pytest.raises(InputError, match=f"(?s){says}"):
        cut_transients([Recording("r", "valve", "train", 1e-3 * np.arange(100), signals)], None, beside(100))


def uneven(time: np.ndarray, noise: float) -> Recording:
    """A vessel that fills with a time constant of 50 ms."""
    p = 6e5 - 5e5 * np.exp(-time / 0.05) + noise * RNG(2).standard_normal(time.size)
    models = {"p1": NoiseModel(white=noise, period=1e-3)}
    return Recording("r", "valve", "train", time, {"u": np.ones(time.size), "p1": p}, models)


def test_uneven_stamps_are_put_on_an_even_clock_with_the_error_of_that() -> None:
    time = np.cumsum(1e-3 * (1.0 + 0.3 * RNG(1).uniform(-1.0, 1.0, 400)))
    recording = uneven(time, 200.0)
    data = cut_transients([recording], SUPPLY, beside(400))
    even = 6e5 - 5e5 * np.exp(-data.time[:, 0] / 0.05)
    valid = data.valid[:, 0]
    assert np.std(data.p[valid, 0] - even[valid]) < 250.0
    np.testing.assert_allclose(np.diff(data.time[valid, 0]), data.period[0], rtol=1e-9)
    clean = uneven(time, 1e-9)
    clock = np.arange(time[0], time[-1], clean.period)
    true = np.interp(clock, clean.time, clean["p1"]) - (6e5 - 5e5 * np.exp(-clock / 0.05))
    assert interpolation_error(clean, "p1") == pytest.approx(np.sqrt(np.mean(true**2)), rel=0.3)


def test_uneven_sampling_is_refused_where_resampling_errs_by_more_than_the_noise() -> None:
    time = np.cumsum(1e-2 * (1.0 + 0.3 * RNG(1).uniform(-1.0, 1.0, 40)))
    with pytest.raises(InputError, match="sampled unevenly, and too slowly"):
        cut_transients([uneven(time, 200.0)], SUPPLY, beside(40))
