"""Smoothing of signals into states: linear, true to lines and kinks, and quieter than the sensor."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate.local_polynomials import autocovariance, choose_windows, polynomial_window, window_deviations
from pneucli.simulate.motion_smoother import MotionSmoother, estimate_acceleration_delay, least_squares_motion
from pneucli.simulate.preparation import prepare

N, PERIOD = 600, 1e-3
TIME = PERIOD * np.arange(N)
NOISE = NoiseModel(white=1.0)
RNG = np.random.default_rng(3)
DRAWN = NOISE.draw(TIME, RNG)


@pytest.mark.parametrize(("a", "b"), [(0.0, 0.0), (5.0, 30.0), (-2.0, -1e3)])
def test_lines_pass_within_the_noise_and_have_their_slope(a: float, b: float) -> None:
    smoother = choose_windows(a + b * TIME + DRAWN, NOISE, PERIOD)
    assert smoother(a + b * TIME) == pytest.approx(a + b * TIME, abs=0.5)  # constants serve where noise hides the slope
    assert smoother.slope(a + b * TIME) == pytest.approx(np.full(N, b), abs=1e-6)


def test_it_is_linear() -> None:
    smoother = choose_windows(100 * np.sin(20 * TIME) + DRAWN, NOISE, PERIOD)
    one, other = RNG.standard_normal((2, N))
    assert smoother(2.0 * one - 3.0 * other) == pytest.approx(2.0 * smoother(one) - 3.0 * smoother(other), abs=1e-12)


def test_a_bend_in_the_signal_is_not_smoothed_away() -> None:
    """A ramp of 100 noises that begins within a sample: away from it noise is averaged, at it nothing is rounded."""
    ramp = 100.0 * np.maximum(TIME - 0.3, 0.0) / 0.1
    smoother = choose_windows(ramp + DRAWN, NOISE, PERIOD)
    # what smoothing does to the signal itself may nowhere exceed a few noises, though windows reach 256 samples
    assert np.abs(smoother(ramp) - ramp).max() < 3.0


def test_a_standstill_is_averaged_over_a_long_window() -> None:
    smoother = choose_windows(DRAWN, NOISE, PERIOD)
    assert np.std(smoother(DRAWN)) < 0.25


def test_the_deviation_of_a_window_matches_its_estimates() -> None:
    drawn = np.array([NOISE.draw(TIME[:17], RNG) for _ in range(400)])
    estimates = drawn @ polynomial_window(8, 1).value[8]
    assert window_deviations(NOISE, 8, 1)[8] == pytest.approx(1 / np.sqrt(17), rel=1e-9)
    assert np.std(estimates) == pytest.approx(1 / np.sqrt(17), rel=0.15)  # the mean of 17 samples


@pytest.mark.parametrize(
    "noise",
    [NoiseModel(1.0), NoiseModel(0.5, coloured=1.0, pole=0.9), NoiseModel(0.3, lines=((50.0, 1.0),))],
    ids=["white", "coloured", "hum"],
)
def test_the_autocovariance_matches_the_draws(noise: NoiseModel) -> None:
    drawn = np.array([noise.draw(TIME, RNG) for _ in range(2000)])
    measured = np.mean(drawn[:, :1] * drawn[:, :30], axis=0)
    assert measured == pytest.approx(autocovariance(noise, 30), abs=4 * noise.rms**2 / np.sqrt(2000))


def test_position_and_acceleration_give_a_velocity_without_drift() -> None:
    x_noise, a_noise, bias = 1e-5, 0.05, 0.4
    time = PERIOD * np.arange(5000)
    x, v, a = 0.05 * np.sin(6 * time), 0.3 * np.cos(6 * time), -1.8 * np.sin(6 * time)
    noisy_x, noisy_a = x + x_noise * RNG.standard_normal(5000), a + bias + a_noise * RNG.standard_normal(5000)
    found_x, found_v, found_bias = MotionSmoother(time, x_noise, a_noise)(noisy_x, noisy_a)
    assert found_bias == pytest.approx(bias, abs=0.01)
    # integrated alone, the bias would be 2 m/s off after 5 s
    assert np.abs(found_v - v).max() < 0.01
    assert abs(np.mean((found_v - v)[-500:])) < 1e-3
    assert np.std(found_x - x) < x_noise


def test_every_sample_uses_its_own_window() -> None:
    smoother = choose_windows(100 * np.sin(20 * TIME) + DRAWN, NOISE, PERIOD)
    y = RNG.standard_normal(N)
    for k in (0, 3, 300, N - 2):
        half, degree = (int(a[smoother.for_value[k]]) for a in (smoother.bank.half, smoother.bank.degree))
        begin = min(max(k - half, 0), N - 2 * half - 1)
        around = slice(begin, begin + 2 * half + 1)
        line = np.polynomial.Polynomial.fit(TIME[around], y[around], degree)
        assert smoother(y)[k] == pytest.approx(line(TIME[k]), abs=1e-12)


def test_the_motion_minimises_the_squares_of_readings_and_steps() -> None:
    """The bands against numpy's own solution of the equations as they are written down."""
    n, wx = 12, 3.0
    dt, wv, wp = RNG.uniform(0.5, 2.0, (3, n - 1))
    x, a = RNG.standard_normal((2, n))
    rows, right = [], []
    for k in range(n):
        rows.append(np.eye(2 * n + 1)[k] * wx)
        right.append(wx * x[k])
    for k, h in enumerate(dt):
        speed, place = np.zeros((2, 2 * n + 1))
        speed[[n + k, n + k + 1, 2 * n]] = -1.0, 1.0, h
        place[[k, k + 1, n + k, 2 * n]] = -1.0, 1.0, -h, 0.5 * h**2
        rows += [wv[k] * speed, wp[k] * place]
        right += [wv[k] * h * (a[k] + a[k + 1]) / 2, wp[k] * h**2 * (2 * a[k] + a[k + 1]) / 6]
    expected = np.linalg.lstsq(np.array(rows), np.array(right))[0]
    found_x, found_v, bias = least_squares_motion(dt, wx, wv, wp, x, a)
    assert np.concatenate([found_x, found_v, [bias]]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("late", "found"), [(0, 0), (1, 0), (9, 4)])
def test_the_delay_of_a_filtered_accelerometer_is_found_in_samples(late: int, found: int) -> None:
    """The mean of ``late`` + 1 readings comes late by half as many; what is less than a sample stays."""
    rng, time = np.random.default_rng(3), 2e-4 * np.arange(5000)
    a = np.interp(time, time[::100], rng.choice([-4.0, 0.0, 4.0], 50))
    x = cumulative_trapezoid(cumulative_trapezoid(a, time, initial=0.0), time, initial=0.0)
    x += 3e-7 * rng.standard_normal(time.size)
    reading = np.convolve(a, np.full(late + 1, 1.0 / (late + 1)))[: a.size] + 0.05 * rng.standard_normal(time.size)
    assert estimate_acceleration_delay(x, reading, 2e-4, 1.4e-3) == found


def test_a_short_record_gives_no_delay() -> None:
    assert estimate_acceleration_delay(np.zeros(40), np.zeros(40), 1e-3, 1.4e-3) == 0


@pytest.mark.parametrize(("rate", "delay", "open_at"), [(200.0, 0.5e-3, [0]), (200.0, 0.053, []), (5e3, 0.5e-3, [])])
def test_a_jump_of_the_acceleration_beside_a_restart_leaves_its_velocity_open(
    rate: float, delay: float, open_at: list[int]
) -> None:
    """A piston that breaks away half a sample after the recording begins, or later; fast sampling shows when."""
    fine = np.arange(-delay, 2.0, 1e-5)
    a = np.where(fine >= 0.0, 10.0 * np.cos(30.0 * np.maximum(fine, 0.0)), 0.0)
    v = np.cumsum(a) * 1e-5
    x = 0.05 + np.cumsum(v) * 1e-5
    kept = slice(None, None, round(1e5 / rate))
    time, rng = fine[kept] + delay, np.random.default_rng(1)
    noise = {"x": NoiseModel(1e-6), "a": NoiseModel(0.05), "p1": NoiseModel(300.0)}
    signals = {"x": x[kept], "a": a[kept], "p1": np.full(time.size, 3e5)}
    read = {name: values + noise[name].rms * rng.standard_normal(time.size) for name, values in signals.items()}
    rig = Rig(piston_area_1=1e-3, piston_area_2=1e-3, moving_mass=2.0, stroke=0.2)
    one = prepare(Recording("away", "friction", "test", time, read, noise, "open"), rig, 0.5)
    assert np.flatnonzero(one.undetermined_restarts).tolist() == open_at
