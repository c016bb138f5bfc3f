"""The default horizon on readings whose time scale is known."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.arrays import Array
from pneucli.compare.free_run import default_horizon
from pneucli.noise import NoiseModel
from pneucli.recording import Recording

NOISE = 300.0  # Pa


def recording(period: float, seconds: float, noise: float = 0.0, **signals: Array | float) -> Recording:
    time = np.arange(0.0, seconds, period)
    read = {name: np.broadcast_to(np.asarray(s, float), time.shape).copy() for name, s in signals.items()}
    models = {name: NoiseModel(noise, noise, period, ()) for name in read} if noise else {}
    return Recording("run", "valve", "train", time, read, models)


def charge(time_constant: float, period: float = 0.1, seconds: float = 150.0) -> Recording:
    time = np.arange(0.0, seconds, period)
    return recording(period, seconds, p1=1e5 + 6e5 * (1.0 - np.exp(-time / time_constant)))


@pytest.mark.parametrize(("time_constant", "horizon"), [(0.05, 0.5), (0.9, 0.5), (3.0, 2.0), (21.0, 20.0)])
def test_the_horizon_is_the_even_time_before_a_reading_has_responded(time_constant: float, horizon: float) -> None:
    assert default_horizon([charge(time_constant)]) == horizon


@pytest.mark.parametrize("frequency", [0.5, 1.9, 2.0, 3.7, 8.0])
def test_a_fast_sine_is_fast_at_any_frequency(frequency: float) -> None:
    """Over a whole number of its periods a sine does not change at all."""
    time = np.arange(0.0, 60.0, 0.01)
    assert default_horizon([recording(0.01, 60.0, p1=np.sin(2.0 * np.pi * frequency * time))]) == 0.5


def test_the_fastest_recording_decides() -> None:
    assert default_horizon([charge(21.0), charge(0.3)]) == 0.5
    assert default_horizon([charge(21.0), charge(4.0)]) == 2.0


def test_what_does_not_respond_tells_no_time_scale() -> None:
    """A vented chamber reads noise alone, which changes by its whole range at once."""
    slow = charge(21.0)
    vented = 1e5 + NOISE * np.random.default_rng(3).standard_normal(slow.time.size)
    both = recording(0.1, 150.0, NOISE, p1=slow["p1"], p2=vented, temperature=293.15)
    assert default_horizon([both]) == 20.0


def test_slow_logs_have_samples_within_the_horizon() -> None:
    assert default_horizon([charge(2.0, period=1.0)]) == 5.0


def test_where_nothing_responds_the_usual_horizon_holds() -> None:
    assert default_horizon([]) == 0.5
    assert default_horizon([recording(0.1, 150.0, p1=1e5)]) == 0.5
