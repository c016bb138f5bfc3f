"""The noise model: its level, its draws, and the pool of several estimates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from pneucli.noise import NoiseModel, detect_jumps, estimate_noise, jump_free_segments, pool_noise
from pneucli.noise.estimate import detect_mains_lines

TIME = 1e-3 * np.arange(40_000)


def drawn(model: NoiseModel, seed: int = 1) -> np.ndarray:
    return model.draw(TIME, np.random.default_rng(seed))


def test_powers_add_up_and_a_line_of_amplitude_a_has_half_its_square() -> None:
    assert NoiseModel(3.0, 4.0).rms == pytest.approx(5.0)
    assert NoiseModel(3.0, lines=((50.0, 4.0), (60.0, 2.0))).rms == pytest.approx(np.sqrt(9.0 + 8.0 + 2.0))


def test_rounding_alone_is_a_step_over_the_root_of_twelve() -> None:
    assert NoiseModel(0.0, step=12.0).rms == pytest.approx(np.sqrt(12.0))
    assert NoiseModel(100.0, step=12.0).rms == 100.0


def test_an_unspecified_model_is_white_at_1_khz() -> None:
    plain = NoiseModel(2.0)
    assert (plain.coloured, plain.pole, plain.period, plain.lines, plain.step) == (0.0, 0.0, 1e-3, (), 0.0)


def test_white_noise_has_its_level_and_no_memory() -> None:
    noise = drawn(NoiseModel(2.0))
    assert noise.shape == TIME.shape
    assert np.std(noise) == pytest.approx(2.0, rel=0.02)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.02


@pytest.mark.parametrize("pole", [0.5, 0.9])
def test_coloured_noise_has_its_level_and_memory_from_the_first_sample_on(pole: float) -> None:
    model = NoiseModel(0.0, coloured=2.0, pole=pole)
    noise = drawn(model)
    assert np.std(noise) == pytest.approx(2.0, rel=0.05)
    for lag in (1, 3):
        assert np.corrcoef(noise[lag:], noise[:-lag])[0, 1] == pytest.approx(pole**lag, abs=0.03)
    first = [model.draw(TIME[:1], np.random.default_rng(seed))[0] for seed in range(2000)]
    assert np.std(first) == pytest.approx(2.0, rel=0.06)


def test_white_and_coloured_noise_add_up() -> None:
    assert np.std(drawn(NoiseModel(2.0, coloured=1.5, pole=0.5))) == pytest.approx(2.5, rel=0.03)


def test_hum_has_its_frequency_and_amplitude_and_a_phase_of_its_own() -> None:
    model = NoiseModel(0.0, lines=((50.0, 3.0), (100.0, 2.0)))
    one, other = drawn(model, 1), drawn(model, 2)
    spectrum = 2 * np.abs(np.fft.rfft(one)) / TIME.size
    at = np.rint(np.array([50.0, 100.0]) * TIME.size * 1e-3).astype(int)
    assert spectrum[at] == pytest.approx([3.0, 2.0], rel=1e-6)
    assert np.delete(spectrum, at).max() < 1e-6
    assert np.abs(one - other).max() > 1.0


def test_a_sensor_that_only_rounds_draws_as_much_as_rounding_is_worth() -> None:
    assert np.std(drawn(NoiseModel(0.0, step=12.0))) == pytest.approx(np.sqrt(12.0), rel=0.02)
    assert np.std(drawn(NoiseModel(0.0, coloured=1.0, pole=0.5, step=12.0))) == pytest.approx(1.0, rel=0.03)
    assert np.std(drawn(NoiseModel(0.0, lines=((50.0, 1.0),), step=12.0))) == pytest.approx(np.sqrt(0.5), rel=0.01)


# --- several recordings of one sensor


def test_pooled_shares_are_means_of_powers_scaled_to_the_median_power() -> None:
    """Powers 1 + 0, 0 + 1 and 8 + 1: the median is 1; means 3 and 2/3 of 11/3 in all."""
    found = pool_noise(
        [NoiseModel(1.0), NoiseModel(0.0, coloured=1.0, pole=0.4), NoiseModel(8**0.5, coloured=1.0, pole=0.8)]
    )
    assert found.white**2 == pytest.approx(9.0 / 11.0)
    assert found.coloured**2 == pytest.approx(2.0 / 11.0)
    assert found.pole == pytest.approx(0.6)


def test_the_pole_is_weighted_by_the_coloured_power() -> None:
    found = pool_noise([NoiseModel(0.0, coloured=1.0, pole=0.9), NoiseModel(0.0, coloured=3.0, pole=0.5)])
    assert found.pole == pytest.approx((0.9 + 9 * 0.5) / 10)


def test_the_pool_of_noise_free_sensors_is_noise_free() -> None:
    found = pool_noise([NoiseModel(0.0), NoiseModel(0.0)])
    assert (found.white, found.coloured, found.pole, found.rms) == (0.0, 0.0, 0.0, 0.0)


def test_period_and_step_are_the_median_and_the_finest() -> None:
    found = pool_noise([NoiseModel(1.0, period=p, step=s) for p, s in ((1e-3, 0.0), (2e-3, 4.0), (9e-3, 3.0))])
    assert found.period == 2e-3
    assert found.step == 3.0
    assert pool_noise([NoiseModel(1.0)]).step == 0.0


@pytest.mark.parametrize(("heard", "kept"), [(1, False), (2, True), (4, True)])
def test_hum_in_half_of_the_recordings_belongs_to_the_sensor(heard: int, kept: bool) -> None:
    """Its power is the mean over all of them, also those without."""
    models = [NoiseModel(1.0, lines=((50.0 + 0.1 * k, 2.0),)) for k in range(heard)]
    found = pool_noise([*models, *[NoiseModel(1.0)] * (4 - heard)]).lines
    assert bool(found) == kept
    if kept:
        ((frequency, amplitude),) = found
        assert frequency == pytest.approx(50.0 + 0.05 * (heard - 1))
        assert amplitude == pytest.approx(2.0 * np.sqrt(heard / 4))


def test_hum_in_two_of_five_recordings_does_not_belong_to_the_sensor() -> None:
    heard = [NoiseModel(1.0, lines=((50.0, 2.0),))] * 2
    assert pool_noise([*heard, *[NoiseModel(1.0)] * 3]).lines == ()


def test_hum_and_its_harmonics_are_pooled_separately() -> None:
    lines = pool_noise(
        [NoiseModel(1.0, lines=((49.9, 3.0), (100.1, 1.0))), NoiseModel(1.0, lines=((50.1, 3.0), (60.0, 1.0)))]
    )
    assert [f for f, _ in lines.lines] == pytest.approx([50.0, 60.0, 100.1])
    assert [a for _, a in lines.lines] == pytest.approx([3.0, 0.5**0.5, 0.5**0.5])


def test_the_interval_of_several_recordings_is_narrower_than_each_of_theirs() -> None:
    one = NoiseModel(100.0, interval=(50.0, 200.0))
    least, most = pool_noise([one] * 4).interval or (0.0, 0.0)
    assert (least, most) == pytest.approx((100.0 / 2**0.5, 100.0 * 2**0.5))
    assert pool_noise([NoiseModel(100.0)] * 2).interval is None


# --- noise is found beneath the content of signals shaped like recordings of a servo-pneumatic axis


PERIOD = 1e-3


def charge_and_discharge(time: np.ndarray) -> np.ndarray:
    """A vessel's pressure in Pa: rest, linear charge, knee, rest, exponential discharge; kinks but no jumps."""
    rise = 1e5 + 5e5 * np.clip((time - 0.15) / 0.9, 0, 1)
    return np.where(time < 1.45, rise, 6e5 * np.exp(-(time - 1.45) / 0.8))


def stick_slip(time: np.ndarray) -> np.ndarray:
    """A pressure in Pa that climbs while the piston sticks and falls within 20 ms when it slips, once a second."""
    phase = time % 1.0
    return 1.2e5 + 2e4 * np.where(phase < 0.98, phase / 0.98, (1 - phase) / 0.02)


def motion(time: np.ndarray) -> np.ndarray:
    """A chamber's pressure in Pa under closed-loop motion: sums of sines below 6 Hz."""
    return 3e5 + 1.5e5 * np.sin(2 * np.pi * 0.4 * time) + 2e4 * np.sin(2 * np.pi * 3 * time) + 3e3 * np.cos(36 * time)


SHAPES = [charge_and_discharge, stick_slip, motion]


def noisy(shape, model: NoiseModel, seed: int, duration: float = 4.0):
    time = np.arange(0.0, duration, model.period)
    values = shape(time) + model.draw(time, np.random.default_rng(seed))
    return time, values if not model.step else model.step * np.round(values / model.step)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.sampled_from(SHAPES), st.integers(0, 999), st.floats(100, 1500))
def test_white_noise_is_found_within_15_percent(shape, seed, rms):
    time, values = noisy(shape, NoiseModel(white=rms, period=PERIOD), seed)
    assert estimate_noise(time, values).rms == pytest.approx(rms, rel=0.15)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("pole", "tolerance"), [(0.5, 0.25), (0.8, 0.25), (0.9, 0.35)])
def test_coloured_noise_is_found_within_25_percent(shape, pole, tolerance):
    """Three recordings pooled, as one sensor is heard in several; 4 draws each, all must hold.

    At a pole of 0.9 the corner (17 Hz) lies within the content of a slip, so single draws err more.
    """
    truth = NoiseModel(white=0.0, coloured=400.0, pole=pole, period=PERIOD)
    for seed in range(4):
        found = pool_noise([estimate_noise(*noisy(shape, truth, 10 * seed + k)) for k in range(3)])
        assert found.rms == pytest.approx(400.0, rel=tolerance)
        assert found.pole == pytest.approx(pole, abs=0.12)


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_hum_is_found_with_its_frequency_and_amplitude(mains):
    truth = NoiseModel(white=250.0, lines=((mains, 150.0),), period=PERIOD)
    for seed in range(3):
        (frequency, amplitude), *others = estimate_noise(*noisy(charge_and_discharge, truth, seed)).lines
        assert frequency == pytest.approx(mains, abs=0.3)
        assert amplitude == pytest.approx(150.0, rel=0.2)
        assert not others


def test_no_hum_is_found_where_there_is_none():
    """Six searches (two mains, three harmonics) at 1e-4 each: 60 signals give 0.04 false lines on average."""
    truth = NoiseModel(white=0.0, coloured=250.0, pole=0.8, period=PERIOD)
    found = [detect_mains_lines(noisy(shape, truth, seed)[1], PERIOD) for shape in SHAPES for seed in range(20)]
    assert sum(map(bool, found)) <= 1


def test_motion_and_slips_without_noise_are_not_taken_for_noise():
    """A position known to 1 um: what is found stays near step / sqrt(12), whatever the slips of 4 mm."""
    time = np.arange(0.0, 4.0, PERIOD)
    x = 1e-6 * np.round(
        1e6 * (0.03 + 4e-3 * (np.floor(time) + np.sin(np.pi / 2 * np.clip((time % 1 - 0.9) / 0.1, 0, 1))))
    )
    found = estimate_noise(time, x)
    assert found.step == pytest.approx(1e-6, rel=1e-6)
    assert found.rms == pytest.approx(1e-6 / np.sqrt(12), rel=0.05)


@pytest.mark.parametrize("step", [10.0, 1000.0])
def test_noise_is_never_below_the_quantisation_step(step):
    time, values = noisy(motion, NoiseModel(white=20.0, step=step, period=PERIOD), 3)
    found = estimate_noise(time, values)
    assert found.step == pytest.approx(step, rel=1e-6)
    assert found.rms >= step / np.sqrt(12)


@pytest.mark.parametrize(("period", "duration"), [(1e-2, 40.0), (0.1, 145.0)])
def test_slow_sampling_keeps_the_level(period, duration):
    """100 Hz and 10 Hz: content below a fortieth of the sampling rate, white noise."""
    truth = NoiseModel(white=50.0, period=period)
    time, values = noisy(lambda t: 1e5 + 4e3 * np.sin(2 * np.pi * t / (80 * period)), truth, 1, duration)
    assert estimate_noise(time, values).rms == pytest.approx(50.0, rel=0.2)


def test_pooling_ignores_the_one_recording_that_is_off():
    models = [NoiseModel(white=w) for w in (100.0, 102.0, 98.0, 101.0, 900.0)]
    assert pool_noise(models).rms == pytest.approx(101.0, rel=0.01)


def test_draws_of_an_estimate_have_the_original_noise():
    truth = NoiseModel(white=0.0, coloured=400.0, pole=0.8, period=PERIOD)
    time, values = noisy(charge_and_discharge, truth, 11)
    drawn = estimate_noise(time, values).draw(np.arange(0, 20, PERIOD), np.random.default_rng(0))
    once = np.std(lfilter([1, -0.8], [1], drawn)[1:])
    assert once == pytest.approx(400 * np.sqrt(1 - 0.8**2), rel=0.2)


def switched(time: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Command and pressure (Pa) of a chamber behind a valve that opens for 30 ms, 7 times a second or less."""
    rng = np.random.default_rng(seed)
    u, p = np.zeros(time.size), np.full(time.size, 3e5)
    for start in np.cumsum(rng.integers(140, 700, 40)):
        u[start : start + 30] = 24.0 * rng.choice([-1.0, 1.0])
    for k in range(1, time.size):
        p[k] = p[k - 1] + PERIOD * (u[k - 1] * 1e5 - 2.0 * (p[k - 1] - 3e5))
    return u, p


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bends_by_a_switching_valve_are_not_taken_for_coloured_noise(seed):
    time = np.arange(0.0, 8.0, PERIOD)
    u, p = switched(time, seed)
    values = p + NoiseModel(white=0.0, coloured=400.0, pole=0.8, period=PERIOD).draw(time, np.random.default_rng(seed))
    assert estimate_noise(time, values, detect_jumps([u], u.size)).rms == pytest.approx(400.0, rel=0.25)


def tank(samples: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Command and pressure (Pa) of a tank at 100 Hz; the valve is set anew after 0.25 to 0.7 s."""
    rng = np.random.default_rng(seed)
    levels = np.repeat(rng.choice([-9.0, -5.0, 4.0, 8.0], samples), rng.integers(25, 70, samples))[:samples]
    p = np.full(samples, 1.2e5)
    for k in range(1, samples):
        goal = 7e5 if levels[k - 1] > 0 else 1.013e5
        p[k] = goal + (p[k - 1] - goal) * np.exp(-0.004 * abs(levels[k - 1]))
    return levels, p


@pytest.mark.parametrize("samples", [400, 600, 1000])
def test_noise_of_a_short_test_with_steps_is_found_and_its_interval_holds_it(samples):
    time, found = 0.01 * np.arange(samples), []
    for seed in range(20):
        u, p = tank(samples, seed)
        values = p + 400.0 * np.random.default_rng(99 + seed).standard_normal(samples)
        found.append(estimate_noise(time, values, detect_jumps([u], samples)))
    assert all(400.0 / 1.5 < one.rms < 1.5 * 400.0 for one in found)
    assert sum(one.interval[0] < 400.0 < one.interval[1] for one in found) >= 18  # 95 % of 20


@pytest.mark.parametrize("seed", range(4))
def test_stamps_of_an_uneven_clock_count_where_they_are_those_of_the_samples(seed):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.choice([0.005, 0.01, 0.015], 800))
    time[500:] += 0.8  # a hole
    values = 6e5 * np.exp(-np.sin(2.0 * time)) + 400.0 * rng.standard_normal(800)
    found = estimate_noise(time, values)
    assert found.rms == pytest.approx(400.0, rel=0.25)
    assert found.interval[0] < found.rms < found.interval[1]
    even = 0.01 * np.arange(800)
    host = np.sort(even + rng.uniform(-0.004, 0.004, 800))  # stamps of a busy host: the samples are even
    values = 6e5 * np.exp(-np.sin(2.0 * even)) + 400.0 * rng.standard_normal(800)
    assert estimate_noise(host, values).rms == pytest.approx(400.0, rel=0.25)


def test_a_signal_that_is_all_motion_leaves_its_noise_open():
    time = 0.05 * np.arange(160)
    values = (
        3e5 + 4e4 * np.sin(2 * np.pi * 3.1 * time + 5 * np.sin(time)) + np.random.default_rng(1).normal(0, 400, 160)
    )
    least, most = estimate_noise(time, values).interval
    assert least < 400.0 < most
    assert most > 4.0 * least


def test_a_command_jumps_where_a_tenth_of_its_range_passes_within_a_sample():
    ramp, step = np.linspace(0.0, 10.0, 101), np.repeat([0.0, 0.9, 10.0], [40, 30, 31])
    assert not detect_jumps([ramp], 101).any()
    assert np.flatnonzero(detect_jumps([ramp, step], 101)).tolist() == [70]
    assert not detect_jumps([], 101).any()


def test_segments_count_as_free_where_they_contain_no_jump():
    jumps = np.zeros(8000, dtype=bool)
    jumps[1000] = True
    free = jump_free_segments(jumps, PERIOD)  # 256 samples a segment, one every 128
    assert np.flatnonzero(~free).tolist() == [6, 7]
    jumps[::200] = True
    assert jump_free_segments(jumps, PERIOD) is None


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rms", [0.1, 1.0])
def test_noise_of_a_force_is_found_between_the_turns_of_dry_friction(seed: int, rms: float):
    """A jump of 40 N every 1.3 to 2.6 s at 100 Hz: no segment of the usual length is free of one."""
    rng, time = np.random.default_rng(seed), 0.01 * np.arange(3000)
    turns = np.cumsum(np.tile([1.3, 2.6], 9))
    force = 20.0 * (-1.0) ** np.searchsorted(turns, time) + 3.0 * np.sin(time) + rng.normal(scale=rms, size=time.size)
    found = estimate_noise(time, force, signal_jumps=detect_jumps([force], time.size))
    assert found.rms == pytest.approx(rms, rel=0.15)
    assert estimate_noise(time, force).rms > 2.0 * rms  # as slow noise, all the turns would be noise


def test_a_signal_that_always_jumps_uses_all_segments():
    time, values = 0.01 * np.arange(2000), np.random.default_rng(0).normal(size=2000)
    everywhere = np.ones(2000, dtype=bool)
    assert estimate_noise(time, values, signal_jumps=everywhere) == estimate_noise(time, values)


@pytest.mark.parametrize("seed", range(3))
def test_the_motion_of_a_position_without_accelerometer_is_not_taken_for_noise(seed: int) -> None:
    """A random walk of the velocity has a spectrum that coloured noise would have too."""
    rng = np.random.default_rng(seed)
    time = PERIOD * np.arange(6000)
    motion = np.cumsum(np.cumsum(5e-7 * rng.standard_normal(6000)))
    found = estimate_noise(time, motion + 4e-6 * rng.standard_normal(6000), is_motion=True)
    assert found.coloured == 0.0
    assert found.white == pytest.approx(4e-6, rel=0.15)


def test_colour_that_a_position_shows_at_rest_counts() -> None:
    rng = np.random.default_rng(0)
    time = PERIOD * np.arange(12000)
    motion = np.where(time < time[6000], 0.0, 0.1 * (time - time[6000]) ** 2)
    truth = NoiseModel(1e-6, coloured=6e-6, pole=0.8, period=PERIOD)
    found = estimate_noise(time, motion + truth.draw(time, rng), is_motion=True)
    assert found.coloured == pytest.approx(6e-6, rel=0.2)
