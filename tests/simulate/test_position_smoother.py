"""Motion from a position sensor alone: its error, its covariance, and what a mass fitted with it is."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from pneucli.noise import NoiseModel
from pneucli.simulate import position_smoother
from pneucli.simulate.position_smoother import PositionSmoother, fit_position_smoother, low_frequency_deviation

Array = np.ndarray
PERIOD = 2e-3
STEP = 2e-5  # m, of an encoder
MASS, COULOMB, VISCOUS = 3.5, 20.0, 40.0


def stick_slip(seed: int, duration: float = 8.0) -> tuple[Array, Array, Array, Array, Array]:
    """Return time, x, v, a and the force that drives a mass with dry friction, sampled from steps of 20 us."""
    rng, h = np.random.default_rng(seed), 2e-5
    count = round(duration / h)
    levels = np.repeat(rng.uniform(-60.0, 60.0, 16), count // 16)
    force = np.convolve(levels, np.full(2500, 1 / 2500), mode="same")
    x, v, a = np.zeros((3, force.size))
    for k in range(force.size - 1):
        direction = np.sign(v[k]) if v[k] else np.sign(force[k])
        beyond = force[k] - direction * COULOMB - VISCOUS * v[k]
        a[k] = 0.0 if v[k] == 0.0 and abs(force[k]) <= COULOMB else beyond / MASS
        v[k + 1] = v[k] + h * a[k]
        if v[k] * v[k + 1] < 0.0:
            v[k + 1] = 0.0
        x[k + 1] = x[k] + 0.5 * h * (v[k] + v[k + 1])
    every = slice(None, -1, round(PERIOD / h))
    return h * np.arange(force.size)[every], x[every], v[every], a[every], force[every]


@pytest.fixture(scope="module")
def moved() -> tuple[Array, ...]:
    """A stick-slip with the encoder's reading and its smoother behind it."""
    time, x, v, a, force = stick_slip(3)
    read = STEP * np.round((x + 0.2 * STEP * np.random.default_rng(0).standard_normal(x.size)) / STEP)
    return time, x, v, a, force, read


def smoother_of(time: Array, read: Array) -> PositionSmoother:
    return fit_position_smoother(time, read, NoiseModel(np.hypot(0.2, 12**-0.5) * STEP, period=PERIOD, step=STEP))


def rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def test_it_errs_little_more_than_the_best_local_polynomial(moved: tuple[Array, ...]) -> None:
    """Of all Savitzky-Golay windows that of least error, which only the truth tells."""
    time, _, v, a, _, read = moved
    _, found_v, found_a = smoother_of(time, read)(read)
    windows = range(5, 101, 4)
    best_v = min(rms(savgol_filter(read, n, 2, deriv=1, delta=PERIOD) - v) for n in windows)
    best_a = min(rms(savgol_filter(read, n, 3, deriv=2, delta=PERIOD) - a) for n in windows)
    assert rms(found_v - v) < 1.1 * best_v
    assert rms(found_a - a) < 1.1 * best_a


def drawn_deviations(smoother: PositionSmoother) -> Array:
    """Standard deviations of position, velocity and acceleration by sample, shape (3, n), of 20 draws."""
    rng = np.random.default_rng(1)
    drawn = [smoother.draw_error(smoother.sigma * rng.standard_normal(smoother.time.size)) for _ in range(20)]
    return np.asarray(np.sqrt(np.mean(np.square(drawn), axis=0)))


def test_drawn_errors_cover_the_truth_and_not_much_more(moved: tuple[Array, ...]) -> None:
    """Those of the process alone hold more than 99 % of the acceleration: twice too wide."""
    time, _, v, a, _, read = moved
    smoother = smoother_of(time, read)
    for true, found, deviation in zip((v, a), smoother(read)[1:], drawn_deviations(smoother)[1:], strict=True):
        assert 0.93 < np.mean(np.abs(found - true) < 1.96 * deviation) < 0.985


@pytest.mark.parametrize("intensity", [1e-4, 1e-2])
def test_a_motion_as_rough_as_the_process_is_found_as_rough(intensity: float) -> None:
    """There the deviation of the acceleration by the process is the right one."""
    rng, n = np.random.default_rng(1), 5000
    smoother = PositionSmoother(PERIOD * np.arange(n), 1e-5, np.full(n - 1, intensity))
    path = smoother._draw_path(rng)[:, 0] + rng.standard_normal(n)
    rough = smoother.with_roughness(1e-5 * path)
    assert np.mean(rough.roughness) == pytest.approx(1.0, abs=0.25)
    error = rough(1e-5 * path)[2] - 1e-5 / PERIOD**2 * smoother._draw_path(np.random.default_rng(1))[:, 2]
    assert rms(error[50:-50]) == pytest.approx(rms(drawn_deviations(rough)[2, 50:-50]), rel=0.15)


def test_one_noise_has_one_error(moved: tuple[Array, ...]) -> None:
    time, *_, read = moved
    smoother = smoother_of(time, read)
    noise = smoother.sigma * np.random.default_rng(2).standard_normal(time.size)
    assert np.array_equal(smoother.draw_error(noise), smoother.draw_error(noise))


@pytest.mark.parametrize("coarse", [1.0, 5.0])
def test_a_mass_fitted_with_it_is_not_biased_toward_zero(moved: tuple[Array, ...], coarse: float) -> None:
    """With a coarser encoder as well: the mean given the readings errs independently of itself."""
    time, x, _, _, force, _ = moved
    step = coarse * STEP
    read = step * np.round((x + 0.2 * step * np.random.default_rng(4).standard_normal(x.size)) / step)
    found = fit_position_smoother(time, read, NoiseModel(np.hypot(0.2, 12**-0.5) * step, period=PERIOD))(read)
    moving = np.abs(found[1]) > 0.02
    design = np.column_stack([found[2], np.sign(found[1]), found[1]])[moving]
    assert np.linalg.lstsq(design, force[moving])[0][0] == pytest.approx(MASS, rel=0.03)


def test_a_coarse_encoder_passing_whole_steps_a_sample_shows_no_swings() -> None:
    """From 0 to 3 steps a sample: near 1 and 2 the error of rounding varies as slowly as a motion."""
    time, step = 5e-4 * np.arange(4000), 1e-4
    v, a = 0.3 * (1.0 - np.cos(np.pi * time)), 0.3 * np.pi * np.sin(np.pi * time)
    read = step * np.round(0.3 * (time - np.sin(np.pi * time) / np.pi) / step)
    noise = NoiseModel(3e-6, period=5e-4, step=step)
    smoother = fit_position_smoother(time, read, noise)
    _, found_v, found_a = smoother(read + smoother.correction)
    assert rms(found_v - v) < 5e-4
    assert rms(found_a - a) < 0.05
    assert np.abs(smoother.correction).max() <= 0.5 * step
    assert np.all(fit_position_smoother(time, read, NoiseModel(step, period=5e-4, step=step)).correction == 0.0)


def test_the_intensity_rises_where_the_piston_breaks_away_and_falls_where_it_rests(moved: tuple[Array, ...]) -> None:
    time, _, v, _, _, read = moved
    smoother = smoother_of(time, read)
    leaves = np.flatnonzero((v[:-1] == 0.0) & (v[1:] != 0.0))
    rests = np.convolve(v == 0.0, np.ones(41), mode="same") == 41
    assert np.median(smoother.memories[leaves]) < 0.5 * np.median(smoother.memories[rests[:-1]])


def test_what_only_moves_evenly_is_smoothed_as_long_as_it_may_be() -> None:
    time = PERIOD * np.arange(2000)
    read = 0.1 * time + 1e-6 * np.random.default_rng(0).standard_normal(time.size)
    smoother = fit_position_smoother(time, read, NoiseModel(1e-6, period=PERIOD))
    assert np.median(smoother.memories) > 10 * PERIOD
    assert smoother(read)[1][200:-200] == pytest.approx(0.1, abs=1e-4)


def test_it_is_linear_and_follows_uneven_stamps() -> None:
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(0.5, 1.5, 400)) * PERIOD
    course = 0.05 * np.sin(8.0 * time)
    smoother = fit_position_smoother(time, course + 1e-6 * rng.standard_normal(400), NoiseModel(1e-6, period=PERIOD))
    one, other = rng.standard_normal((2, 400))
    for a, b, both in zip(smoother(one), smoother(other), smoother(2.0 * one - other), strict=True):
        assert both == pytest.approx(2.0 * a - b, rel=1e-5, abs=1e-5 * np.abs(a).max())
    _, v, a = smoother(course)
    assert v[20:-20] == pytest.approx(0.4 * np.cos(8.0 * time)[20:-20], abs=2e-3)
    assert a[20:-20] == pytest.approx(-3.2 * np.sin(8.0 * time)[20:-20], abs=0.1)


def test_coloured_noise_counts_as_what_it_is_at_low_frequencies() -> None:
    assert low_frequency_deviation(NoiseModel(3.0)) == 3.0
    assert low_frequency_deviation(NoiseModel(0.0, coloured=1.0, pole=0.6)) == pytest.approx(2.0)
    assert low_frequency_deviation(NoiseModel(0.0, step=12**0.5)) == pytest.approx(1.0)


@pytest.mark.parametrize("digits", [4, 5])
def test_a_text_with_few_digits_is_no_motion(digits: int) -> None:
    """Rounding to significant digits is small while x is small: noise that is estimated there misses most of it."""
    time = 2e-3 * np.arange(4000)
    read = np.array([float(f"{x:.{digits}g}") for x in np.pi * time])
    fine = NoiseModel(2e-5, period=2e-3)
    smoother = fit_position_smoother(time, read, fine)
    assert rms(smoother(read)[1][200:-200] - np.pi) < 0.01 * np.pi
    assert smoother.noise_ratio(fine) > 2.0


@pytest.mark.parametrize("factor", [1, 5])
def test_a_motion_that_changes_within_two_samples_is_no_noise(factor: int) -> None:
    """The path follows every reading of a stick-slip that is sampled this slowly, and the noise stays as stated."""
    time, x, *_ = stick_slip(3)
    time, x = time[::factor], x[::factor]
    read = x + 6e-6 * np.random.default_rng(0).standard_normal(x.size)
    noise = NoiseModel(6e-6, period=factor * PERIOD)
    assert fit_position_smoother(time, read, noise).noise_ratio(noise) == pytest.approx(1.0)


def test_a_few_glitches_are_not_the_noise_of_all_readings() -> None:
    """Three readings in a hundred exceed what is expected by far, the others are below it."""
    rng, time = np.random.default_rng(5), PERIOD * np.arange(6000)
    noise = NoiseModel(3e-5, period=PERIOD)
    read = 0.02 * np.sin(time) + rng.normal(scale=1.6e-5, size=time.size)
    read[rng.choice(time.size, 180, replace=False)] += rng.normal(scale=3e-4, size=180)
    assert fit_position_smoother(time, read, noise).noise_ratio(noise) == 1.0


def test_no_update_is_kept_that_makes_the_readings_less_likely(monkeypatch: pytest.MonkeyPatch) -> None:
    time, read = PERIOD * np.arange(300), np.random.default_rng(1).standard_normal(300)
    start = PositionSmoother(time, 1.0, np.full(299, 1e-6))
    monkeypatch.setattr(position_smoother, "UPDATE_EXPONENT", -40.0)  # an update in the wrong direction
    assert np.array_equal(position_smoother._climbed(start, read, position_smoother._whole).intensity, start.intensity)
