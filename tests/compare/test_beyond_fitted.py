"""Held-out samples beyond the fitted range, counted apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneucli.compare.beyond_fitted import BeyondFitted, beyond_fitted, excess_beyond_fitted
from pneucli.compare.channel_errors import Comparison, channel_result
from pneucli.recording import Use
from tests.simulate.synthetic_experiments import make_experiment, time_grid

TIME = time_grid(0.999)  # 1000 samples


def compared(use: Use, u: np.ndarray, error: np.ndarray) -> Comparison:
    """A comparison of p1, restarted every 100 samples, with this error over a noise of 1 Pa."""
    e = make_experiment("valve", TIME, {"u": u, "p1": 3e5}, restarts=range(0, 1000, 100))
    e = replace(e, recording=replace(e.recording, name=f"{use}_run", use=use))
    result = channel_result(e.recording, "p1", error, np.zeros(TIME.size), 1.0)
    return Comparison(e, (result,), {"p1": error}, {"p1": np.zeros(TIME.size)})


def ramp(high: float) -> np.ndarray:
    return np.linspace(-1.0, high, TIME.size)


FITTED = compared("train", ramp(3.0), np.ones(TIME.size))


def test_samples_beyond_hold_the_error_up_to_the_next_restart() -> None:
    u = np.where((TIME >= 0.25) & (TIME < 0.26), 5.0, 0.5)
    error = np.where((TIME >= 0.25) & (TIME < 0.3), 10.0, 2.0)
    found, within = beyond_fitted([FITTED, compared("test", u, error)])
    share = 50.0 * 100.0 / (50.0 * 100.0 + 950.0 * 4.0)
    assert found == [BeyondFitted("test_run", "u", 0.05, 3.0, 5.0, "V", pytest.approx(share))]  # type: ignore[arg-type]
    assert within == pytest.approx(2.0)
    excess = excess_beyond_fitted([FITTED, compared("test", u, error)])
    assert excess == [{}, {"p1": pytest.approx(0.05 * 100.0 + 0.95 * 4.0 - 4.0)}]


@pytest.mark.parametrize(("high", "beyond"), [(3.15, False), (3.3, True)])
def test_a_twentieth_of_the_fitted_range_is_no_extrapolation(high: float, beyond: bool) -> None:
    found, within = beyond_fitted([FITTED, compared("test", ramp(high), np.ones(TIME.size))])
    assert bool(found) == beyond
    assert (within is not None) == beyond


def test_the_end_that_a_recording_passes_further_is_told() -> None:
    u = np.where(TIME < 0.1, -4.0, np.where(TIME > 0.9, 3.5, 0.0))
    (found,), _ = beyond_fitted([FITTED, compared("test", u, np.ones(TIME.size))])
    assert (found.from_, found.to) == (-1.0, -4.0)
    assert found.share == pytest.approx(0.2, abs=0.002)


def test_unmeasured_samples_are_no_error() -> None:
    u = np.where(TIME < 0.1, 5.0, 0.0)
    error = np.where(TIME < 0.55, 3.0, np.nan)
    (found,), within = beyond_fitted([FITTED, compared("test", u, error)])
    assert found.share_of_error == pytest.approx(100.0 / 550.0, rel=0.01)
    assert within == pytest.approx(3.0)


def test_fitted_recordings_alone_go_beyond_nothing() -> None:
    assert beyond_fitted([FITTED]) == ([], None)
    assert beyond_fitted([]) == ([], None)
    assert excess_beyond_fitted([FITTED]) == [{}]
