"""At reversals of an imposed motion the direction is uncertain, and dry friction may have either sign."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from pneucli.compare.channel_errors import compare
from pneucli.compare.expected_error import expected_rms
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.residuals import ImposedMotion
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import Experiment, detect_reversals
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import required_force
from pneucli.simulate.position_smoother import PositionSmoother
from pneucli.simulate.preparation import prepare

RIG = Rig(piston_area_1=1e-3, piston_area_2=1e-3, moving_mass=2.0, stroke=0.2)
COULOMB, NOISE = 20.0, 0.5  # N
TRUE = Model(RIG, (), {"friction.coulomb": COULOMB, "friction.viscous": 0.0})
PERIOD = 0.01  # s
TIME = PERIOD * np.arange(800)


def speed_at(time: np.ndarray, cycle: float) -> np.ndarray:
    knots = cycle * np.array([0.0, 0.125, 0.375, 0.5, 0.625, 0.875, 1.0])
    return np.interp((time + 0.004) % cycle, knots, [0.0, 0.05, 0.05, 0.0, -0.1, -0.1, 0.0])


SPEED = speed_at(TIME, 4.0)


def driven(low_pass: float | None = None, late: float = 0.0, cycle: float = 4.0) -> Experiment:
    """A piston that a machine moves to and fro, faster one way; it slows to its turn and leaves it at another rate.

    The force is recorded late (s); a cycle (s) that is no number of samples turns anywhere between two.
    """
    rng, speed = np.random.default_rng(3), speed_at(TIME - late, cycle)
    x = cumulative_trapezoid(speed_at(TIME, cycle), TIME, initial=0.0)
    force = COULOMB * np.sign(speed) + 2.0 * np.gradient(speed, PERIOD) + rng.normal(scale=NOISE, size=TIME.size)
    noise = {"x": NoiseModel(2e-6), "force": NoiseModel(NOISE)}
    signals = {"x": x + rng.normal(scale=2e-6, size=TIME.size), "force": force}
    recording = Recording("given", "friction", "train", TIME, signals, noise, "open", "motion")
    return prepare(recording, RIG, None, low_pass)


def test_the_measured_motion_is_smoothed_once_for_all_models(monkeypatch: pytest.MonkeyPatch) -> None:
    """Smoothing takes several times as long as a model's force."""
    e, calls, smooth = driven(), list[int](), PositionSmoother.__call__

    def counted(self: PositionSmoother, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        calls.append(x.size)
        return smooth(self, x)

    monkeypatch.setattr(PositionSmoother, "__call__", counted)
    first = required_force(TRUE, e)
    other = required_force(replace(TRUE, values={**TRUE.values, "friction.coulomb": 2.0 * COULOMB}), e)
    assert calls == [TIME.size]
    assert np.max(np.abs(other - first)) == pytest.approx(COULOMB)
    shaken = required_force(TRUE, e, {"x": np.full(TIME.size, 1e-3)})
    assert len(calls) == 2
    assert np.max(np.abs(shaken - first)) < 1e-3  # a shift changes no velocity
    assert np.array_equal(required_force(TRUE, e), first)


def test_a_reversal_is_where_the_velocity_changes_its_sign() -> None:
    e = driven()
    crossings = np.flatnonzero(np.diff(np.sign(SPEED)))
    found = np.flatnonzero(detect_reversals(e))
    assert {round(f) for f in crossings} <= {*found, *(found - 1), *(found + 1)}
    assert found.size == pytest.approx(2 * crossings.size, abs=2)


def test_a_low_pass_widens_a_reversal_by_its_rise_time() -> None:
    """0.35 / 5 Hz is 7 samples, before and after."""
    turns = detect_reversals(driven(5.0))
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], turns.astype(int), [0]]))))[::2]
    assert set(runs.tolist()) <= {16, 17}  # one more where a sample stands at the turn


def test_a_correct_model_has_residuals_of_noise_around_reversals() -> None:
    """The jump of 40 N that comes a sample early or late would be 80 times the noise."""
    e = driven()
    (found,) = compare(TRUE, e).results
    assert found.ratio_to_noise < 1.2
    left = ImposedMotion(e).residual(TRUE)["force"]
    assert np.array_equal(left == 0.0, detect_reversals(e))
    assert np.sqrt(np.mean(left**2)) < 1.2 * NOISE


def test_drawn_noise_is_masked_at_reversals_too() -> None:
    e = driven()
    assert expected_rms(TRUE, e)["force"] < 1.5 * NOISE
    assert ImposedMotion(e).monte_carlo_rms(TRUE, {}, 6, 0)["force"] < 1.5


def test_an_error_of_friction_is_not_masked() -> None:
    wrong = replace(TRUE, values={**TRUE.values, "friction.coulomb": COULOMB - 5.0})
    (found,) = compare(wrong, driven()).results
    assert found.rmsd == pytest.approx(np.hypot(5.0, NOISE), rel=0.05)


def test_a_piston_at_rest_has_no_reversal_and_a_shaking_one_is_still_compared() -> None:
    e = driven()
    still = prepare(replace(e.recording, signals={**e.recording.signals, "x": np.full(TIME.size, 0.1)}), RIG, None)
    assert not detect_reversals(still).any()
    shaken = {
        **e.recording.signals,
        "x": 0.1 + 1e-3 * (-1.0) ** np.arange(TIME.size),
        "v": (-1.0) ** np.arange(TIME.size),
    }
    assert not detect_reversals(prepare(replace(e.recording, signals=shaken), RIG, None)).any()


def test_a_standstill_between_two_directions_is_part_of_the_reversal() -> None:
    v = np.concatenate([np.full(300, 0.02), np.zeros(100), np.full(400, -0.02)])
    e = driven()
    rested = {**e.recording.signals, "x": 0.05 + np.cumsum(v) * PERIOD, "v": v}
    found = np.flatnonzero(detect_reversals(prepare(replace(e.recording, signals=rested), RIG, None)))
    assert (found[0], found[-1], found.size) == (299, 400, 102)


def test_a_rest_tells_nothing_of_dry_friction() -> None:
    """A piston that sticks on its way carries any force up to break-away."""
    v = np.concatenate([np.full(300, 0.02), np.zeros(100), np.full(400, 0.02)])
    e = driven()
    force = np.where(v == 0.0, 0.4 * COULOMB, COULOMB)
    rested = {"x": 0.02 + np.cumsum(v) * PERIOD, "v": v, "force": force}
    stuck = prepare(replace(e.recording, signals=rested), RIG, None)
    assert np.flatnonzero(detect_reversals(stuck)).tolist() == list(range(300, 400))
    assert np.max(np.abs(ImposedMotion(stuck).residual(TRUE)["force"][300:400])) == 0.0


LATE = catalogue()["force-skew"]


@pytest.mark.parametrize("late", [0.037, -0.022])
def test_a_force_that_is_recorded_late_or_early_is_found_to_a_part_of_a_sample(late: float) -> None:
    e = driven(late=late, cycle=0.973)
    (without,) = compare(TRUE, e).results
    assert without.ratio_to_noise > 5.0
    found = fit_model(TRUE, [ImposedMotion(e)], [LATE])["force-skew.delay"]
    assert found.value == pytest.approx(late, abs=0.1 * PERIOD)
    assert found.ci95[0] <= late <= found.ci95[1]
    (with_it,) = compare(replace(TRUE, effects=(LATE,), values={**TRUE.values, "force-skew.delay": late}), e).results
    assert with_it.ratio_to_noise < 1.2


def test_what_is_compared_beside_a_late_turn_is_continuous_in_the_delay() -> None:
    """A jump of 40 N from one sample to the next would stop a fit at each half of a period."""
    e = driven()
    forces = [
        required_force(replace(TRUE, effects=(LATE,), values={**TRUE.values, "force-skew.delay": delay}), e)
        for delay in np.arange(0.02, 0.04, 1e-4)
    ]
    assert np.max(np.abs(np.diff(forces, axis=0))) < 0.1 * COULOMB


def test_an_imposed_motion_needs_the_same_force_where_that_is_recorded_in_time() -> None:
    in_time = replace(TRUE, effects=(LATE,), values={**TRUE.values, "force-skew.delay": 0.0})
    assert np.array_equal(required_force(in_time, driven()), required_force(TRUE, driven()))
