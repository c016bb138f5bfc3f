"""The noise model: its level, its draws, and the pool of several estimates."""

import numpy as np
import pytest

from pneucli.noise import NoiseModel, pool_noise

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
