"""A residual's correlation with itself and with the inputs, and its bounds under independence."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from pneucli.compare.residual_correlation import Correlation, confidence_bound, residual_correlations
from tests.compare.test_channel_errors import TIME, comparison

N = 4000


def slow(rng: np.random.Generator, pole: float) -> np.ndarray:
    """A series of mean 0 and norm 1 whose samples follow one another."""
    series = lfilter([1.0], [1.0, -pole], rng.standard_normal(N))
    series -= series.mean()
    return series / np.linalg.norm(series)


def full(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.correlate(first, second, "full")


def of(residual: np.ndarray, other: np.ndarray) -> dict[str, Correlation]:
    """Correlations of a made-up comparison of one channel, sampled each ms, with one input."""
    recording = SimpleNamespace(name="r", use="test", period=1e-3, time=np.arange(residual.size) * 1e-3)
    experiment = SimpleNamespace(recording=recording, raw={"u": other, "p1": residual}, channels=("p1",))
    made: Any = SimpleNamespace(experiment=experiment, residual=lambda channel: residual)
    return {c.against: c for c in residual_correlations(made, 0.1)}


def test_a_delayed_response_shows_at_its_lag() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(N)
    late = np.roll(u, 30) + 0.5 * rng.standard_normal(N)
    found = of(late, u)["u"]
    assert found.lag[np.argmax(found.correlation)] == pytest.approx(0.030)
    assert found.correlation.max() == pytest.approx(1 / np.sqrt(1.25), abs=0.05)
    assert 1.0 <= found.bound / (1.96 / np.sqrt(N)) < 2.0


def test_autocorrelation_starts_at_one_and_white_noise_stays_within_the_bound() -> None:
    found = of(np.random.default_rng(1).standard_normal(N), np.ones(N))
    assert list(found) == ["p1"]  # what does not change has no correlation
    own = found["p1"]
    assert (own.lag[0], own.correlation[0]) == (0.0, pytest.approx(1.0))
    assert np.mean(abs(own.correlation[1:]) > own.bound) < 0.12


def test_the_bound_holds_for_series_that_change_slowly() -> None:
    """Of 400 independent pairs about 95 in 100 stay inside; with the bound of white noise it would be 30."""
    rng = np.random.default_rng(2)
    inside = white = 0
    for _ in range(400):
        a, b = slow(rng, 0.98), slow(rng, 0.98)
        inside += abs(a @ b) < confidence_bound(full(a, a), full(b, b))
        white += abs(a @ b) < 1.96 / np.sqrt(N)
    assert 0.90 <= inside / 400 <= 0.99
    assert white / 400 < 0.5


def test_every_channel_is_correlated_with_every_input() -> None:
    rng = np.random.default_rng(3)
    found = comparison(rng.standard_normal(TIME.size))
    raw = {**found.experiment.raw, "u": rng.standard_normal(TIME.size)}
    given = replace(found, experiment=replace(found.experiment, raw=raw))
    assert [(c.channel, c.against) for c in residual_correlations(given, 0.5)] == [
        ("force", "force"),
        ("force", "x"),
        ("force", "u"),
    ]
