"""Commands as segments: values at their ends, the rise of a sine, sampling across segments."""

import numpy as np
import pytest

from pneucli.plan.manoeuvre import duration_of, hold, ramp, sample, sine


def test_a_sine_begins_and_ends_at_its_centre_without_a_jump():
    wave = sine(0.1, 0.02, 2.0, 5.0)
    values = sample((wave,), 1e-3)
    assert values[0] == 0.1
    assert abs(values[-1] - 0.1) < 1e-4
    assert np.abs(np.diff(values)).max() <= 0.02 * 2.0 * np.pi * 2.0 * 1e-3 * 1.05


def test_a_sine_reaches_its_amplitude_after_one_period():
    wave = sine(0.0, 1.0, 2.0, 5.0)
    assert wave.rise == 0.5
    assert np.abs(sample((wave,), 1e-3)[500:4500]).max() == pytest.approx(1.0, abs=1e-3)


def test_segments_follow_each_other_at_their_times():
    profile = (hold(1.0, 0.5), ramp(1.0, 3.0, 1.0), hold(3.0, 0.25))
    values = sample(profile, 0.25)
    assert duration_of(profile) == 1.75
    assert values.tolist() == [1.0, 1.0, 1.0, 1.5, 2.0, 2.5, 3.0]
