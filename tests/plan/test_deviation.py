"""The expected deviation grows with what a recording accumulates: a model errs by a share of a flow or a force."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.plan.deviation import ExpectedDeviation, LagDifference, accumulated_change, expected_deviations, travelled

TIME = 1e-3 * np.arange(4000)


def experiment(values: np.ndarray, noise: float = 1.0) -> Any:
    sensor = {"p1": SimpleNamespace(rms=noise)}
    recording = SimpleNamespace(period=1e-3)
    return SimpleNamespace(raw={"p1": values}, noise=sensor, recording=recording, restarts=np.array([0]), time=TIME)


def test_a_fast_sine_accumulates_in_proportion_to_its_frequency() -> None:
    slow, fast = (accumulated_change(experiment(1000.0 * np.sin(2 * np.pi * f * TIME)), "p1") for f in (0.5, 5.0))
    assert fast / slow == pytest.approx(10.0, rel=0.05)


def test_noise_alone_accumulates_next_to_nothing() -> None:
    noise = np.random.default_rng(1).standard_normal(TIME.size)
    assert accumulated_change(experiment(noise), "p1") < 5.0


def test_a_rest_keeps_what_was_accumulated_and_a_restart_forgets_it() -> None:
    step = np.where(TIME < 1.0, 0.0, 100.0) + np.random.default_rng(2).standard_normal(TIME.size)
    assert travelled(step, [0], 20) == pytest.approx(np.sqrt(0.75) * 100.0, rel=0.05)
    assert travelled(step, [0, 2000], 20) == pytest.approx(np.sqrt(0.25) * 100.0, rel=0.05)


def test_a_channel_that_is_not_recorded_accumulates_nothing() -> None:
    assert accumulated_change(experiment(TIME), "p2") == 0.0


def test_a_calm_recording_is_not_trusted_to_leave_less() -> None:
    left = ExpectedDeviation(3.0, 0.0, path=100.0)
    assert left.divisor(1e-3, 10.0) == left.divisor(1e-3, 100.0) == pytest.approx(3.0)
    assert left.divisor(1e-3, 200.0) == pytest.approx(np.sqrt(1.0 + 8.0 * 4.0))


def test_the_deviation_of_a_fit_remembers_what_its_recordings_accumulated() -> None:
    sine = 1000.0 * np.sin(2 * np.pi * TIME)
    model: Any = SimpleNamespace(title="gas", channels=("p1",), experiment=experiment(sine))
    found = expected_deviations([model], np.full(TIME.size, 2.0))["gas", "p1"]
    assert found.ratio == pytest.approx(2.0)
    assert found.path == pytest.approx(accumulated_change(experiment(sine), "p1"))


def test_a_lag_is_as_large_as_the_deviation_so_far_allows_and_at_most_of_typical_size() -> None:
    hidden = ExpectedDeviation(2.0, lags=(LagDifference(1.0),))  # so far it would leave less than the deviation
    shown = ExpectedDeviation(2.0, lags=(LagDifference(300.0),))  # so far it would leave a hundred times the deviation
    fast = [LagDifference(400.0)]
    assert hidden.rms(lags=fast) == pytest.approx(np.sqrt(401.0))
    assert shown.rms(lags=fast) == pytest.approx(np.sqrt(1.0 + 400.0 * 3.0 / 300.0))
    assert ExpectedDeviation(1.0, lags=(LagDifference(300.0),)).rms(lags=fast) == 1.0  # the model leaves nothing


def test_a_recording_that_shows_less_of_a_lag_is_not_trusted_to_leave_less() -> None:
    assert ExpectedDeviation(2.0, lags=(LagDifference(3.0),)).rms(lags=[LagDifference(0.1)]) == pytest.approx(2.0)


def test_a_deviation_lasts_as_long_as_the_change_that_a_lag_makes() -> None:
    left = ExpectedDeviation(2.0, 0.05, lags=(LagDifference(3.0),))
    assert left.divisor(1e-3, lags=[LagDifference(3.0, 0.5)]) == pytest.approx(np.sqrt(1.0 + 3.0 * 1000.0))


def test_the_deviation_of_a_fit_remembers_what_each_lag_would_have_changed() -> None:
    model: Any = SimpleNamespace(title="gas", channels=("p1",), experiment=experiment(TIME))
    lasting = 3.0 * np.sign(np.sin(2 * np.pi * 0.5 * TIME))
    found = expected_deviations([model], np.full(TIME.size, 2.0), [np.zeros(TIME.size), lasting])["gas", "p1"]
    assert [lag.mean_square for lag in found.lags] == pytest.approx([0.0, 9.0], rel=0.01)
    assert found.lags[1].time_constant > 0.1
