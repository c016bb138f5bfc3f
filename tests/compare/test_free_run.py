"""The free run over a whole recording: a slow error that no restart lets grow."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from pneucli.compare import compare
from pneucli.compare.channel_errors import Comparison, channel_result
from pneucli.compare.error_regions import BeyondFitted, beyond_fitted, excess_beyond_fitted
from pneucli.compare.goodness_of_fit import exceeds_limit, free_runs, judge_with_free_runs, worst_channel
from pneucli.messages.compare import LackOfFit
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig, Use
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from tests.simulate.synthetic_experiments import VALVE, make_experiment, model, time_grid

RIG = Rig(vessel_volume=1e-3, supply_pressure=7e5)
NOISE, SECONDS, START = 300.0, 100.0, 6e5  # Pa, s, Pa
LEAK = 1e-9  # m^2
TIME = np.arange(0.0, SECONDS, 0.02)


def vessel(rate: float = 0.0) -> Experiment:
    """A shut vessel whose pressure falls by the share ``rate`` in a second, restarted every half second."""
    p1 = START * np.exp(-rate * TIME) + NOISE * np.random.default_rng(2).standard_normal(TIME.size)
    recording = Recording("shut", "valve", "train", TIME, {"p1": p1}, {"p1": NoiseModel(NOISE)}, valve_shut=True)
    return prepare(recording, RIG, 0.5)


def leaking(area: float) -> Model:
    return model(["chamber-leak"], {"chamber-leak.area": area, "rig.vessel_volume": 1e-3}, RIG)


def tight() -> Model:
    return Model(RIG, (), {"rig.vessel_volume": 1e-3}, VALVE)


def none() -> Sequence[Model]:
    pytest.fail("noise explains the errors")


def test_a_slow_leak_shows_over_the_whole_recording_alone() -> None:
    """0.03 % in a second: 90 Pa in a segment, 3 % of 6 bar in the end."""
    e = vessel(3e-4)
    (restarted,) = compare(tight(), e).results
    assert restarted.ratio_to_noise < 1.1
    (found,) = free_runs(tight(), [e], lambda: [])
    assert found.rmsd == pytest.approx(3e-4 * SECONDS * START / math.sqrt(3.0), rel=0.05)
    assert found.percent == pytest.approx(100.0 / math.sqrt(3.0), rel=0.15)
    assert exceeds_limit(found)


def test_the_free_run_of_a_correct_model_is_within_its_limit() -> None:
    (found,) = free_runs(tight(), [vessel()], none)
    assert found.ratio_to_noise < 1.2
    assert not exceeds_limit(found)


def test_uncertain_parameters_may_explain_a_free_run() -> None:
    e = vessel(3e-4)
    drawn = [leaking(area) for area in (0.0, 0.5 * LEAK, LEAK, 2.0 * LEAK, 3.0 * LEAK, 3.0 * LEAK)]
    (certain,), (uncertain,) = free_runs(leaking(0.0), [e], lambda: []), free_runs(leaking(0.0), [e], lambda: drawn)
    assert certain.ratio_to_noise == uncertain.ratio_to_noise
    assert exceeds_limit(certain)
    assert not exceeds_limit(uncertain)


def test_an_imposed_motion_has_no_free_run() -> None:
    v = np.full(TIME.size, 1e-3)
    signals = {"x": 1e-3 * TIME, "v": v, "force": 20.0 + 0.1 * np.random.default_rng(1).standard_normal(TIME.size)}
    noise = {"x": NoiseModel(1e-7), "v": NoiseModel(1e-6), "force": NoiseModel(0.1)}
    imposed = Recording("given", "friction", "train", TIME, signals, noise, "open", "motion")
    assert free_runs(model(), [prepare(imposed, RIG, 0.5)], none) == []


def test_a_free_run_beyond_its_limit_is_a_lack_of_fit() -> None:
    (found,) = free_runs(tight(), [vessel(3e-4)], lambda: [])
    good = LackOfFit(present=False, p=0.4, undetermined=False, use="train", error=1.0, limit=1.2, excused=0)
    judged = judge_with_free_runs(good, [found])
    assert judged == replace(good, p=0.01, present=True, worst=worst_channel(found))
    assert judge_with_free_runs(good, [replace(found, ratio_limit=1e3)]) is good
    bad = replace(good, error=5.0, p=1e-9, present=True)
    assert judge_with_free_runs(bad, [found]) is bad


# --- held-out samples beyond the fitted range, counted apart


BEYOND_FITTED_TIME = time_grid(0.999)  # 1000 samples


def compared(use: Use, u: np.ndarray, error: np.ndarray) -> Comparison:
    """A comparison of p1, restarted every 100 samples, with this error over a noise of 1 Pa."""
    e = make_experiment("valve", BEYOND_FITTED_TIME, {"u": u, "p1": 3e5}, restarts=range(0, 1000, 100))
    e = replace(e, recording=replace(e.recording, name=f"{use}_run", use=use))
    result = channel_result(e.recording, "p1", error, np.zeros(BEYOND_FITTED_TIME.size), 1.0)
    return Comparison(e, (result,), {"p1": error}, {"p1": np.zeros(BEYOND_FITTED_TIME.size)})


def ramp(high: float) -> np.ndarray:
    return np.linspace(-1.0, high, BEYOND_FITTED_TIME.size)


FITTED = compared("train", ramp(3.0), np.ones(BEYOND_FITTED_TIME.size))


def test_samples_beyond_hold_the_error_up_to_the_next_restart() -> None:
    u = np.where((BEYOND_FITTED_TIME >= 0.25) & (BEYOND_FITTED_TIME < 0.26), 5.0, 0.5)
    error = np.where((BEYOND_FITTED_TIME >= 0.25) & (BEYOND_FITTED_TIME < 0.3), 10.0, 2.0)
    found, within = beyond_fitted([FITTED, compared("test", u, error)])
    share = 50.0 * 100.0 / (50.0 * 100.0 + 950.0 * 4.0)
    assert found == [BeyondFitted("test_run", "u", 0.05, 3.0, 5.0, "V", pytest.approx(share))]  # type: ignore[arg-type]
    assert within == pytest.approx(2.0)
    excess = excess_beyond_fitted([FITTED, compared("test", u, error)])
    assert excess == [{}, {"p1": pytest.approx(0.05 * 100.0 + 0.95 * 4.0 - 4.0)}]


@pytest.mark.parametrize(("high", "beyond"), [(3.15, False), (3.3, True)])
def test_a_twentieth_of_the_fitted_range_is_no_extrapolation(high: float, beyond: bool) -> None:
    found, within = beyond_fitted([FITTED, compared("test", ramp(high), np.ones(BEYOND_FITTED_TIME.size))])
    assert bool(found) == beyond
    assert (within is not None) == beyond


def test_the_end_that_a_recording_passes_further_is_told() -> None:
    u = np.where(BEYOND_FITTED_TIME < 0.1, -4.0, np.where(BEYOND_FITTED_TIME > 0.9, 3.5, 0.0))
    (found,), _ = beyond_fitted([FITTED, compared("test", u, np.ones(BEYOND_FITTED_TIME.size))])
    assert (found.from_, found.to) == (-1.0, -4.0)
    assert found.share == pytest.approx(0.2, abs=0.002)


def test_unmeasured_samples_are_no_error() -> None:
    u = np.where(BEYOND_FITTED_TIME < 0.1, 5.0, 0.0)
    error = np.where(BEYOND_FITTED_TIME < 0.55, 3.0, np.nan)
    (found,), within = beyond_fitted([FITTED, compared("test", u, error)])
    assert found.share_of_error == pytest.approx(100.0 / 550.0, rel=0.01)
    assert within == pytest.approx(3.0)


def test_fitted_recordings_alone_go_beyond_nothing() -> None:
    assert beyond_fitted([FITTED]) == ([], None)
    assert beyond_fitted([]) == ([], None)
    assert excess_beyond_fitted([FITTED]) == [{}]
