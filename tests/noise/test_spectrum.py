"""The noise floor's spectrum, lines and steps, separately."""

import numpy as np
import pytest

from pneucli.noise import NoiseModel, estimate_noise
from pneucli.noise.estimate import detect_mains_lines, quantisation_step
from pneucli.noise.spectrum import noise_floor, segment_length

RNG = np.random.default_rng


@pytest.mark.parametrize(
    ("samples", "length"), [(79, 0), (80, 16), (159, 16), (160, 32), (1279, 128), (1280, 256), (10**6, 256)]
)
def test_segments_are_powers_of_two_of_at_most_a_fifth_and_of_three_tenths_of_a_second(
    samples: int, length: int
) -> None:
    assert segment_length(samples, 1e-3) == length


@pytest.mark.parametrize(("period", "length"), [(1e-4, 2048), (2e-4, 1024), (1e-2, 256)])
def test_segments_are_never_limited_below_256_samples_by_time(period: float, length: int) -> None:
    assert segment_length(10**6, period) == length


@pytest.mark.parametrize("sigma", [1.0, 30.0])
def test_white_noise_has_its_variance_at_every_frequency(sigma: float) -> None:
    floor = noise_floor(sigma * RNG(1).standard_normal(40_000), 1e-3)
    assert floor is not None
    assert np.mean(floor.power) == pytest.approx(sigma**2, rel=0.03)
    assert floor.power.max() < 1.6 * sigma**2
    assert floor.power.min() > 0.6 * sigma**2


def test_the_lowest_bins_and_the_last_are_left_out() -> None:
    floor = noise_floor(RNG(1).standard_normal(1280), 1e-3)
    assert floor is not None
    assert floor.omega == pytest.approx(2 * np.pi * np.arange(3, 128) / 256)
    # nine half-overlapping segments, of which the lower quartile is worth a quarter
    assert floor.weight == pytest.approx(0.25 * 9)
    short = noise_floor(RNG(1).standard_normal(80), 1e-3)
    assert short is not None
    assert short.weight == pytest.approx(0.25 * 9)


def test_a_parabola_is_removed_and_a_cubic_is_not() -> None:
    t = np.arange(1280) / 256.0
    bent, more = (noise_floor(values, 1e-3) for values in (5.0 + 3.0 * t - 2.0 * t * t, t**3))
    assert bent is not None
    assert more is not None
    assert bent.power.max() < 1e-20
    assert more.power.max() > 1e-12


def test_a_burst_in_half_of_the_segments_has_no_influence() -> None:
    values = RNG(2).standard_normal(20_000)
    values[:10_000] *= 50.0
    floor = noise_floor(values, 1e-3)
    assert floor is not None
    assert np.mean(floor.power) < 3.0


def test_gaps_are_left_out_and_too_many_leave_no_floor() -> None:
    values = RNG(3).standard_normal(1280)
    values[:256] = np.nan
    floor = noise_floor(values, 1e-3)
    assert floor is not None
    assert np.all(np.isfinite(floor.power))
    assert floor.weight == pytest.approx(0.25 * 7)
    values[640:] = np.nan
    assert noise_floor(values, 1e-3) is None


@pytest.mark.parametrize(("whole", "there"), [(3, False), (4, True)])
def test_four_complete_segments_suffice(whole: int, there: bool) -> None:
    """Segments of 16 samples begin every 8."""
    values = np.full(80, np.nan)
    values[: 16 + 8 * (whole - 1)] = RNG(4).standard_normal(16 + 8 * (whole - 1))
    assert (noise_floor(values, 1e-3) is not None) == there


def test_a_short_signal_has_no_floor() -> None:
    assert noise_floor(RNG(1).standard_normal(79), 1e-3) is None


# --- lines


def hum(frequency: float, amplitude: float = 1.0, seconds: float = 4.0, period: float = 1e-3) -> np.ndarray:
    time = np.arange(0.0, seconds, period)
    return amplitude * np.sin(2 * np.pi * frequency * time + 0.3) + 0.5 * RNG(5).standard_normal(time.size)


@pytest.mark.parametrize("frequency", [50.0, 100.0, 150.0, 60.0, 120.0, 180.0])
def test_mains_and_harmonics_are_detected(frequency: float) -> None:
    (found,) = detect_mains_lines(hum(frequency), 1e-3)
    assert found[0] == pytest.approx(frequency, abs=0.1)
    assert found[1] == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("frequency", [40.0, 51.5, 55.0, 200.0, 240.0])
def test_other_frequencies_are_not_hum(frequency: float) -> None:
    assert detect_mains_lines(hum(frequency, 0.5), 1e-3) == ()


def test_two_lines_are_distinguished() -> None:
    both = detect_mains_lines(hum(50.0) + hum(150.0, 0.6), 1e-3)
    assert [f for f, _ in both] == pytest.approx([50.0, 150.0], abs=0.1)
    assert [a for _, a in both] == pytest.approx([1.0, 0.6], rel=0.15)


@pytest.mark.parametrize(("rate", "shown"), [(115.0, 50.0), (101.0, 50.0), (99.0, 49.0), (60.0, 10.0), (41.0, 9.0)])
def test_a_slow_log_shows_hum_at_another_frequency(rate: float, shown: float) -> None:
    """Taken for white noise it would count more than it has, or, as slow as a signal, not at all."""
    ((found, amplitude),) = detect_mains_lines(hum(50.0, period=1.0 / rate, seconds=40.0), 1.0 / rate)
    assert found == pytest.approx(shown, abs=0.1)
    assert amplitude == pytest.approx(1.0, rel=0.15)


def test_hum_that_looks_like_motion_or_stands_at_half_the_rate_is_no_line_and_half_a_second_is_needed() -> None:
    for rate in (100.0, 54.0, 50.0):  # at half the rate, at 4 Hz, at 0 Hz
        assert detect_mains_lines(hum(50.0, period=1.0 / rate, seconds=40.0), 1.0 / rate) == (), rate
    assert detect_mains_lines(hum(50.0, 9.0, seconds=0.49), 1e-3) == ()
    assert detect_mains_lines(hum(50.0, 9.0, seconds=0.6), 1e-3) != ()


def test_with_missing_samples_no_line_is_reported() -> None:
    values = hum(50.0)
    values[100] = np.nan
    assert detect_mains_lines(values, 1e-3) == ()


def test_slow_content_hides_no_hum() -> None:
    time = np.arange(0.0, 4.0, 1e-3)
    (found,) = detect_mains_lines(hum(50.0) + 1e4 * np.sin(2 * np.pi * 0.5 * time) + 500.0 * time**2, 1e-3)
    assert found[1] == pytest.approx(1.0, rel=0.1)


# --- steps


def test_a_rounded_signal_shows_its_step_at_any_offset() -> None:
    values = 0.123 + 0.25 * np.round(20.0 * RNG(6).standard_normal(2000))
    assert quantisation_step(values) == pytest.approx(0.25)
    values[::7] = np.nan
    assert quantisation_step(values) == pytest.approx(0.25)


def test_an_unrounded_signal_shows_no_step() -> None:
    assert quantisation_step(RNG(7).standard_normal(2000)) == 0.0
    assert quantisation_step(np.array([1.0, 2.0, 3.0])) == 0.0
    assert quantisation_step(np.full(100, 3.0)) == 0.0


def test_gaps_that_are_all_multiples_of_a_smaller_step_show_it() -> None:
    """Levels 2 and 3 steps apart: the step is none of the gaps."""
    levels = np.cumsum(np.tile([2, 3], 20)) * 0.1
    assert quantisation_step(RNG(8).permutation(np.repeat(levels, 5))) == pytest.approx(0.1)


@pytest.mark.parametrize(("levels", "held", "shown"), [(4, 5, True), (3, 5, False), (10, 100, False), (24, 100, True)])
def test_a_command_of_few_held_levels_shows_no_step(levels: int, held: int, shown: bool) -> None:
    """24 levels, or a change in every twentieth sample; fewer than four levels say nothing."""
    values = 0.5 * np.repeat(np.resize(np.arange(levels), 60), held)
    assert (quantisation_step(values) == 0.5) == shown


def test_rounding_errors_of_the_levels_are_no_steps() -> None:
    values = 0.1 * RNG(9).integers(0, 50, 2000)
    assert quantisation_step(values * (1 + 1e-13 * RNG(9).standard_normal(2000))) == pytest.approx(0.1, rel=1e-6)


# --- the estimate as a whole


def test_few_samples_are_estimated_from_differences() -> None:
    """60 samples at 0.1 s: white noise beneath a parabola; period and level are kept."""
    time = 0.1 * np.arange(60)
    levels = []
    for seed in range(20):
        found = estimate_noise(time, 50.0 + 3.0 * time - time**2 + 2.0 * RNG(seed).standard_normal(60))
        assert (found.coloured, found.lines, found.step) == (0.0, (), 0.0)
        assert found.period == pytest.approx(0.1)
        levels.append(found.white)
    assert np.mean(levels) == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize(("values", "white"), [([1.0, 3.0], 2.0 / 2**0.5), ([np.nan, 1.0, np.nan, 3.0], 2.0 / 2**0.5)])
def test_two_samples_give_their_difference_over_the_root_of_two(values: list[float], white: float) -> None:
    found = estimate_noise(1e-3 * np.arange(len(values)), np.array(values))
    assert found.white == pytest.approx(white)
    assert found.period == 1e-3


def test_one_outlier_among_few_samples_has_no_influence() -> None:
    time = 0.1 * np.arange(60)
    values = RNG(1).standard_normal(60)
    values[30] = 1e4
    assert estimate_noise(time, values).white < 3.0


def test_a_held_command_has_no_noise_and_its_period() -> None:
    found = estimate_noise(2e-3 * np.arange(400), np.repeat([0.0, 1.0, 0.5, 2.0], 100))
    assert (found.rms, found.step, found.lines) == (0.0, 0.0, ())
    assert found.period == pytest.approx(2e-3)


@pytest.mark.parametrize("pole", [0.5, 0.9])
def test_coloured_noise_is_distinguished_from_white(pole: float) -> None:
    time = 1e-3 * np.arange(20_000)
    coloured = estimate_noise(time, NoiseModel(0.0, coloured=3.0, pole=pole).draw(time, RNG(1)))
    white = estimate_noise(time, NoiseModel(3.0).draw(time, RNG(1)))
    assert coloured.white == 0.0
    assert coloured.coloured == pytest.approx(3.0, rel=0.1)
    assert coloured.pole == pytest.approx(pole, abs=0.04)
    assert (white.coloured, white.pole) == (0.0, 0.0)
    assert white.white == pytest.approx(3.0, rel=0.05)


def test_white_and_coloured_noise_are_separated() -> None:
    time = 1e-3 * np.arange(40_000)
    found = estimate_noise(time, NoiseModel(2.0, coloured=4.0, pole=0.95).draw(time, RNG(1)))
    assert found.white == pytest.approx(2.0, rel=0.15)
    assert found.coloured == pytest.approx(4.0, rel=0.15)
    assert found.pole == pytest.approx(0.95, abs=0.03)


def test_hum_is_not_counted_as_noise_twice() -> None:
    time = 1e-3 * np.arange(8_000)
    found = estimate_noise(time, NoiseModel(1.0, lines=((50.0, 5.0), (100.0, 5.0))).draw(time, RNG(1)))
    assert found.white == pytest.approx(1.0, rel=0.1)
    assert found.coloured == 0.0
    assert [a for _, a in found.lines] == pytest.approx([5.0, 5.0], rel=0.05)


def test_exact_multiples_of_a_step_have_no_noise_below_rounding() -> None:
    time = 1e-3 * np.arange(4_000)
    found = estimate_noise(time, np.round(300.0 * np.sin(2 * np.pi * 0.5 * time)))
    assert found.step == pytest.approx(1.0)
    assert found.white < 0.6


@pytest.mark.parametrize("step", [0.12875, 0.1893, 0.3217])
def test_a_converter_whose_readings_are_written_with_two_digits_has_its_step(step: float) -> None:
    ramp = np.linspace(0.0, 5.0, 1200) + 0.4 * step * np.random.default_rng(3).standard_normal(1200)
    written = np.round(np.round(ramp / step) * step, 2)
    assert quantisation_step(written) == pytest.approx(step, rel=0.01)


def test_noise_without_steps_has_none() -> None:
    rng = np.random.default_rng(4)
    assert [quantisation_step(np.cumsum(rng.standard_normal(400))) for _ in range(20)] == [0.0] * 20
