"""The free run over a whole recording: a slow error that no restart lets grow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from pneucli.compare import compare
from pneucli.compare.free_run import exceeds_limit, free_runs, judge_with_free_runs
from pneucli.compare.goodness_of_fit import GoodnessOfFit
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from tests.simulate.synthetic_experiments import VALVE, model

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
    good = GoodnessOfFit("train", 1.0, 1.2, 0.4, lacks=False, undetermined=False, worst=None)
    judged = judge_with_free_runs(good, [found])
    assert judged == replace(good, p=0.01, lacks=True, worst=found)
    assert judge_with_free_runs(good, [replace(found, ratio_limit=1e3)]) is good
    bad = replace(good, error=5.0, p=1e-9, lacks=True)
    assert judge_with_free_runs(bad, [found]) is bad
