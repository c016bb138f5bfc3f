"""What repeats is found with its period, over time or over position; what the comparison makes is not."""

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.signal import lfilter

from pneucli.diagnose.discrepancy import PeriodicTerm, find_period
from pneucli.identify.residuals import ChamberPressures
from pneucli.simulate import layout as at

STEP = 1e-3
TIME = np.arange(0.0, 8.0, STEP)


class Seen(ChamberPressures):
    """What a view shows, without a rig behind it: residuals in units of noise; restarts every 0.5 s."""

    channels = ("p1",)
    noise: ClassVar = {"p1": 1.0}

    def __init__(self, left: np.ndarray, x: np.ndarray | None = None, time: np.ndarray = TIME) -> None:
        inputs = np.zeros((time.size, len(at.INPUTS)))
        raw = {}
        if x is not None:
            inputs[:, at.IN_X] = raw["x"] = x
        self.__dict__.update(left=left)
        every, recording = np.arange(0, time.size, 500), SimpleNamespace(period=STEP)
        e = SimpleNamespace(time=time, inputs=inputs, raw=raw, restarts=every, recording=recording)
        self.__dict__["experiment"] = e

    def residual(self, model: Any, errors: Any = None) -> dict[str, np.ndarray]:
        return {"p1": self.__dict__["left"]}


class Balance(Seen):
    """It starts nowhere anew."""

    is_simulated = False


def found(*residual_models: Seen) -> PeriodicTerm | None:
    """The period of p1."""
    return find_period(None, residual_models, "p1")  # type: ignore[arg-type]


def noise(seed: int, n: int = TIME.size) -> np.ndarray:
    """White noise of 1."""
    return np.random.default_rng(seed).standard_normal(n)


def told(*residual_models: Seen) -> PeriodicTerm:
    """The period, where there is one."""
    one = found(*residual_models)
    assert one is not None
    return one


def wandering(seed: int) -> np.ndarray:
    """A position that goes to and fro at a changing pace."""
    return 0.1 + 0.08 * np.sin(2.0 * np.pi * np.cumsum(0.3 + 0.2 * np.sin(0.7 * TIME + seed)) * STEP + seed)


@pytest.mark.parametrize(("frequency", "share"), [(1.3, 0.65), (3.1, 0.78), (7.3, 0.78), (31.0, 0.78)])
def test_a_period_over_time_is_found(frequency: float, share: float) -> None:
    """3 of amplitude beside noise of 1: 4.5 of 5.5, of which few cycles have a part outside of the band."""
    wave = 3.0 * np.sin(2.0 * np.pi * frequency * TIME)
    one = told(Seen(wave + noise(1)), Seen(-wave + noise(2)))
    assert (one.variable, one.length) == ("time", pytest.approx(1.0 / frequency, rel=0.02))
    assert share < one.share < 4.5 / 5.5 + 0.05


def test_a_decaying_oscillation_has_a_period() -> None:
    """A load on a spring, 12 Hz and 5 % of critical damping, struck at random: its power stands in a band."""
    rng, turn = np.random.default_rng(4), 2.0 * np.pi * 12.0 * STEP
    struck = np.where(rng.uniform(size=TIME.size) < 2e-3, 1.0, 0.0) * rng.standard_normal(TIME.size)
    swing = lfilter([1.0], [1.0, -2.0 * np.exp(-0.05 * turn) * np.cos(turn), np.exp(-0.1 * turn)], struck)
    one = told(Seen(3.0 * swing / np.std(swing) + noise(5)))
    assert one.length == pytest.approx(1.0 / 12.0, rel=0.1)


def test_it_need_not_be_in_every_recording() -> None:
    wave = 5.0 * np.sin(2.0 * np.pi * 3.1 * TIME)
    assert told(Seen(wave + noise(1)), Seen(noise(2))).length == pytest.approx(1.0 / 3.1, rel=0.02)


def test_noise_and_drifts_have_no_period() -> None:
    assert found(*(Seen(noise(seed)) for seed in range(3))) is None
    assert found(Seen(5.0 * TIME / TIME[-1] + noise(3))) is None


def test_an_error_with_the_period_of_the_restarts_is_excluded() -> None:
    """An error that grows after each of the restarts and is set back at the next; a balance starts nowhere anew."""
    saw = 50.0 * (TIME % 0.5 - 0.25) + noise(1)
    assert found(Seen(saw)) is None
    assert told(Balance(saw)).length == pytest.approx(0.5, rel=0.02)


def test_a_period_over_position_is_found() -> None:
    """A pitch of 4 mm, of which no spline of a law would know; over time it has no period."""
    residual_models = []
    for seed in range(3):
        x = wandering(seed)
        residual_models.append(Seen(3.0 * np.sin(2.0 * np.pi * x / 0.004) + noise(seed), x))
    one = told(*residual_models)
    assert (one.variable, one.length) == ("x", pytest.approx(0.004, rel=0.01))
    assert one.share == pytest.approx(4.5 / 5.5, abs=0.05)


def test_recordings_that_cover_little_do_not_hide_it() -> None:
    x, still = wandering(0), 0.1 + 1e-4 * np.sin(TIME)
    residual_models = [Seen(3.0 * np.sin(2.0 * np.pi * x / 0.01) + noise(1), x), Seen(noise(2), still)]
    assert told(*residual_models).length == pytest.approx(0.01, rel=0.01)


def test_an_empty_recording_has_no_period() -> None:
    """Such as one in which the piston rests all the time, so that no reading of the force is compared."""
    assert found(Seen(np.zeros(TIME.size))) is None
    assert found(Seen(np.r_[1.0, np.zeros(TIME.size - 1)], np.full(TIME.size, 0.1))) is None


@pytest.mark.parametrize("readings", [1, 20, 99])
def test_few_readings_have_no_period(readings: int) -> None:
    """As of an accelerometer that hardly ever rests."""
    left = np.where(np.arange(TIME.size) < readings, np.sin(TIME * 300.0) + 2.0, 0.0)
    assert found(Seen(left, wandering(0))) is None


def test_power_at_the_restart_frequency_has_no_period() -> None:
    """Nothing is left of its power."""
    saw = np.tile(np.arange(500.0) - 249.5, TIME.size // 500)
    assert found(Seen(saw)) is None
