"""What residuals cost: as noise their number, and beyond noise the less the slower they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from pneucli.diagnose.likelihood import deviance, octaves

RNG = np.random.default_rng
N = 4096
EACH = 250  # samples of a block of 0.25 s


class Seen:
    """A view of some channels, sampled with a period; ``more`` is what errors of its starts add to each residual."""

    def __init__(self, *channels: str, n: int = N, period: float = 1e-3, more: float = 0.0) -> None:
        self.channels, self.more = channels or ("p1",), more
        self.experiment: Any = type("Experiment", (), {"time": period * np.arange(n)})

    def volume(self, errors: Any) -> np.ndarray:
        return np.full(self.experiment.time.size * len(self.channels), self.more)


class Other(Seen):
    """Another subsystem."""


def cost(residual: Any, *views: Seen) -> Any:
    """The deviance by block of a residual, by default of one channel."""
    seen: Any = views or [Seen(n=len(residual))]
    return deviance(seen, np.asarray(residual, float), [{}] * len(seen))


def noise(seed: int, n: int = N) -> np.ndarray:
    return RNG(seed).standard_normal(n)


def fast(size: float, n: int = N) -> np.ndarray:
    """What changes its sign with every sample: all of it stands in the finest octave."""
    return size * np.where(np.arange(n) % 2, -1.0, 1.0)


# --- octaves


@pytest.mark.parametrize("n", [1, 2, 3, 7, 8, 13, 100])
def test_octaves_are_another_orthonormal_basis(n: int) -> None:
    basis = np.array([np.concatenate(octaves(row)) for row in np.eye(n)])
    assert basis @ basis.T == pytest.approx(np.eye(n), abs=1e-12)


def test_the_finest_octave_comes_first_and_the_mean_last() -> None:
    n = 16
    power = [float(o @ o) for o in octaves(fast(1.0, n))]
    assert power == pytest.approx([16.0, 0.0, 0.0, 0.0, 0.0])
    slower = [float(o @ o) for o in octaves(np.where(np.arange(n) % 8 < 4, 1.0, -1.0))]
    assert slower == pytest.approx([0.0, 0.0, 16.0, 0.0, 0.0])
    assert [float(o @ o) for o in octaves(np.ones(n))] == pytest.approx([0.0, 0.0, 0.0, 0.0, 16.0])
    assert [o.size for o in octaves(np.ones(n))] == [8, 4, 2, 1, 1]


def test_nothing_has_no_octaves() -> None:
    assert octaves(np.zeros(0)) == []


# --- noise


@pytest.mark.parametrize("seed", range(4))
def test_noise_alone_costs_its_number(seed: int) -> None:
    """No less, and what chance has in some octaves above its mean a little more."""
    assert N <= cost(noise(seed)).sum() < 1.03 * N


@pytest.mark.parametrize("size", [1e-3, 0.5])
def test_a_model_that_leaves_less_than_noise_gains_nothing_by_it(size: float) -> None:
    assert cost(size * noise(1)).sum() == pytest.approx(N)


def test_what_was_not_read_costs_as_noise_and_says_nothing() -> None:
    assert cost(np.zeros(N)).sum() == pytest.approx(N)
    read, gaps = 3.0 * noise(1), np.zeros(2 * N)
    gaps[np.sort(RNG(2).permutation(2 * N)[:N])] = read
    assert cost(gaps).sum() == pytest.approx(cost(read).sum() + N)


# --- a discrepancy


def test_an_error_costs_the_logarithm_of_its_variance_in_its_octave() -> None:
    """The finest half of the coefficients has a variance of 2 * 3^2, the other half none beyond noise."""
    assert cost(fast(3.0)).sum() == pytest.approx(N / 2 * (1.0 + np.log(18.0)) + N / 2)


def test_a_slow_error_counts_as_fewer_readings_than_a_fast_one_of_the_same_power() -> None:
    """A wave of 2 s and white noise, both of five times the sensors' rms."""
    slow = 5.0 * np.sqrt(2.0) * np.sin(np.pi * 1e-3 * np.arange(N))
    rough = 5.0 * noise(2)
    assert np.mean(slow**2) == pytest.approx(np.mean(rough**2), rel=0.1)
    costs_slow, costs_rough = cost(slow + noise(1)).sum() - N, cost(rough + noise(1)).sum() - N
    assert 0.0 < costs_slow < 0.1 * costs_rough


def test_where_much_is_left_anyway_a_little_less_of_it_is_worth_little() -> None:
    """A tenth of the rms less: the squares fall by 19 % of any size, -2 log L by the same amount at any size."""
    gained = [cost(size * noise(1)).sum() - cost(0.9 * size * noise(1)).sum() for size in (10.0, 1000.0)]
    assert gained[0] == pytest.approx(gained[1], rel=1e-3)
    assert gained[0] == pytest.approx(-2.0 * N * np.log(0.9), rel=0.01)


# --- by block


def test_a_cost_stands_in_the_block_in_which_the_error_does() -> None:
    errs = np.arange(4000) // EACH == 5
    found = cost(np.where(errs, 30.0, 1.0) * noise(1, 4000))
    assert found.size == 16
    assert np.argmax(found) == 5
    assert found[5] > 3.0 * np.delete(found, 5).max()


def test_blocks_of_noise_cost_alike_and_sum_to_the_whole() -> None:
    found = cost(noise(1, 4000))
    assert found == pytest.approx(np.full(16, EACH), rel=0.35)  # 4 sigma of a chi-square with 250 degrees of freedom
    assert found.sum() == pytest.approx(4000, rel=0.04)


def test_gaps_do_not_move_costs_into_other_blocks() -> None:
    """Nothing is read in the first half; what errs in the block 12 stays there."""
    number = np.arange(4000) // EACH
    residual = np.where(number == 12, 30.0, 1.0) * noise(1, 4000) * (number >= 8)
    found = cost(residual)
    assert found[:8] == pytest.approx(np.full(8, EACH))
    assert np.argmax(found) == 12


def test_errors_of_starts_add_their_volume() -> None:
    residual = noise(1, 4000)
    assert cost(residual, Seen(n=4000, more=0.1)) == pytest.approx(cost(residual) + 0.1 * EACH)


# --- whose variance


def test_recordings_share_a_variance_channels_and_subsystems_do_not() -> None:
    """In the finest octave: of both together the mean variance, 2^2 + 4^2, of each alone twice its own square."""
    both = np.concatenate([fast(2.0), fast(4.0)])
    rest, log = N, np.log
    together = N * (1.0 + log(2.0**2 + 4.0**2)) + rest
    apart = N / 2 * (2.0 + log(2 * 2.0**2) + log(2 * 4.0**2)) + rest
    assert cost(both, Seen(), Seen()).sum() == pytest.approx(together)
    assert cost(both, Seen("p1", "p2")).sum() == pytest.approx(apart)
    assert cost(both, Seen(), Seen("p2")).sum() == pytest.approx(apart)
    assert cost(both, Seen(), Other()).sum() == pytest.approx(apart)


def test_recordings_of_other_rates_and_lengths_have_their_own_blocks() -> None:
    """4 s at 1 kHz and 8 s at 250 Hz: 16 blocks of 250 readings and 32 of 62 or 63."""
    found = cost(noise(1, 6000), Seen(n=4000), Seen(n=2000, period=4e-3))
    assert found.size == 16 + 32
    assert found[:16].mean() == pytest.approx(250.0, rel=0.05)
    assert found[16:].mean() == pytest.approx(62.5, rel=0.05)


def test_single_readings_have_a_cost() -> None:
    assert cost([5.0]).sum() == pytest.approx(1.0 + np.log(25.0))
    assert cost([0.5]).sum() == pytest.approx(1.0)


def test_what_one_recording_says_does_not_depend_on_the_rate_of_another() -> None:
    """Half of the same slow error, taken off at 1 kHz or at 100 Hz: worth what it is worth by itself."""

    def drift(period: float, seed: int) -> np.ndarray:
        pole, rough = np.exp(-period / 0.05), noise(seed, round(8.0 / period))
        return np.asarray(20.0 * lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], rough))

    fast, slow = Seen(n=8000), Seen(n=800, period=1e-2)
    errs, other = drift(1e-3, 1), drift(1e-2, 2)
    read, less, beside = (noise(3, 8000) + errs, noise(3, 8000) + 0.5 * errs, noise(4, 800) + other)
    alone = cost(read, fast).sum() - cost(less, fast).sum()
    both = [cost(np.append(one, beside), fast, slow).sum() for one in (read, less)]
    assert both[0] - both[1] == pytest.approx(alone, rel=0.2)
