"""What stays beside what is named: how large, how slow, over which signal, and which part of all."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.signal import lfilter

from pneucli.diagnose import discrepancy
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.discrepancy import Discrepancy, describe_discrepancies
from pneucli.identify.residuals import ChamberPressures, ForceBalance, FreeRun

N = 20_000


def drifting(time_constant: float, period: float = 1e-3, size: float = 10.0, seed: int = 1) -> np.ndarray:
    """AR(1) noise (N,) of an rms, beside white noise of 1."""
    pole, rng = np.exp(-period / time_constant), np.random.default_rng(seed)
    slow = lfilter([np.sqrt(1 - pole**2)], [1.0, -pole], rng.standard_normal(N))
    return np.asarray(size * slow + rng.standard_normal(N))


class Gas(ChamberPressures):
    """A view whose residuals are stated in units of their noise, which is 50 SI units."""

    channels = ()
    noise: ClassVar = {"p1": 50.0, "p2": 50.0, "force": 50.0}

    def __init__(self, period: float = 1e-3, **left: np.ndarray) -> None:
        time = np.arange(next(iter(left.values())).size) * period
        alone = SimpleNamespace(recording=SimpleNamespace(period=period), time=time, raw={}, restarts=np.zeros(1, int))
        self.__dict__.update(left=left, channels=tuple(left), experiment=alone)

    def residual(self, model: Any, errors: Any = None) -> dict[str, np.ndarray]:
        return {c: 50.0 * r for c, r in self.__dict__["left"].items()}


class Mechanics(Gas, ForceBalance):  # type: ignore[misc]
    title = ForceBalance.title


class Axis(Gas, FreeRun):  # type: ignore[misc]
    title = FreeRun.title


def left(kind: Any = Gas, channel: str = "p1", ratio: float = 3.0) -> LackOfFit:
    return LackOfFit(kind, channel, ratio, ratio, ())


@pytest.fixture(autouse=True)
def over(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Of which signal each channel's remainder is a function: what is told of it is tested by itself."""
    known: dict[str, str] = {}
    told = lambda diagnosis_data, fit, one: SimpleNamespace(variable=known.get(one.channel))  # noqa: E731
    monkeypatch.setattr(discrepancy, "describe_lack_of_fit", told)
    return known


def remaining(residual_models: Sequence[Gas], left: Sequence[LackOfFit]) -> list[Discrepancy]:
    return describe_discrepancies(SimpleNamespace(residual_models=residual_models), SimpleNamespace(model=None), left)  # type: ignore[arg-type]


def memory(*residual_models: Gas) -> float | None:
    """The time constant that is told of p1."""
    (found,) = remaining(residual_models, [left()])
    return found.time_constant_s


# --- how slow


@pytest.mark.parametrize("time_constant", [0.01, 0.05])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_time_constant_of_a_first_order_drift_is_found(time_constant: float, seed: int) -> None:
    """20 s of it, beside white noise, which is alike over no sample."""
    assert memory(Gas(p1=drifting(time_constant, seed=seed))) == pytest.approx(time_constant, rel=0.2)


def test_recordings_are_pooled() -> None:
    """The time constant is a hundredth of each of 16 recordings: one alone tells it to a fifth or worse."""
    residual_models = [Gas(p1=drifting(0.2, seed=seed)) for seed in range(16)]
    assert memory(*residual_models) == pytest.approx(0.2, rel=0.1)


def test_the_correlation_time_is_that_of_the_fastest_sampling() -> None:
    """At 20 ms a drift of 10 ms is alike over no sample."""
    slow = Gas(period=0.02, p1=drifting(0.01, period=0.02, seed=2))
    assert memory(slow, Gas(p1=drifting(0.01))) == pytest.approx(0.01, rel=0.2)
    assert memory(Gas(p1=drifting(0.01, period=1e-3, seed=3)), slow) == pytest.approx(0.01, rel=0.2)


def test_slower_recordings_have_no_say_in_it() -> None:
    wandering = Gas(period=0.02, p1=drifting(2.0, period=0.02, size=30.0))
    assert memory(Gas(p1=drifting(0.01)), wandering) == pytest.approx(0.01, rel=0.2)


def test_added_white_noise_does_not_shorten_the_correlation_time() -> None:
    """As much of it as of the drift: half of the power is alike after a sample, 1/e of that after the time constant."""
    assert memory(Gas(p1=drifting(0.02, size=1.0))) == pytest.approx(0.02, rel=0.2)


def test_an_alternating_residual_has_no_correlation_time() -> None:
    assert memory(Gas(p1=3.0 * np.where(np.arange(N) % 2, 1.0, -1.0))) is None


def test_the_end_of_a_recording_is_not_followed_by_its_beginning() -> None:
    """It errs in its first and in its last second: each is alike with itself, which falls to 1/e at 0.63 s."""
    time = 1e-3 * np.arange(N)
    assert memory(Gas(p1=np.where((time < 1.0) | (time >= 19.0), 5.0, 0.0))) == pytest.approx(0.632, rel=0.01)


def test_a_time_is_counted_in_the_recordings_own_samples() -> None:
    assert memory(Gas(period=4e-3, p1=drifting(0.1, period=4e-3))) == pytest.approx(0.1, rel=0.2)


def test_white_noise_is_correlated_over_at_most_one_sample() -> None:
    found = [memory(Gas(p1=3.0 * np.random.default_rng(seed).standard_normal(N))) or 0.0 for seed in range(20)]
    assert np.mean(np.array(found) < 1.5e-3) >= 0.8
    assert max(found) < 5e-3


def test_a_correlation_that_never_decays_has_no_time() -> None:
    """An offset is alike for ever."""
    assert memory(Gas(p1=5.0 + np.random.default_rng(1).standard_normal(N))) is None


# --- how large, where, over what


def test_shares_are_of_all_squares_beyond_noise_and_sum_to_one() -> None:
    """9 - 1 and 25 - 1, and of p2 half as many again: 8, 24 and 12 of 44."""
    flat = np.ones(N)
    gas = Gas(p1=3.0 * flat, p2=np.where(np.arange(N) % 2, 5.0, 0.0))
    mechanics = Mechanics(force=5.0 * flat)
    found = remaining([gas, mechanics], [left(), left(channel="p2"), left(Mechanics, "force")])
    assert [(d.subsystem, d.channel) for d in found] == [
        (ForceBalance.title, "force"), (ChamberPressures.title, "p2"), (ChamberPressures.title, "p1"),
    ]  # fmt: skip
    assert [d.share for d in found] == pytest.approx([24 / 44, 12 / 44, 8 / 44])


def test_subsystems_with_a_common_channel_are_separate() -> None:
    found = remaining([Gas(p1=3.0 * np.ones(N)), Axis(p1=5.0 * np.ones(N))], [left(), left(Axis)])
    assert [(d.subsystem, d.share) for d in found] == [(FreeRun.title, 0.75), (ChamberPressures.title, 0.25)]


def test_a_channel_near_the_noise_is_not_reported() -> None:
    one = Gas(p1=3.0 * np.ones(N), p2=1.03 * np.ones(N))
    found = remaining([one], [left(ratio=1.07), left(channel="p2", ratio=1.05)])
    assert [(d.channel, d.share) for d in found] == [("p1", 1.0)]
    assert remaining([one], []) == []


def test_the_first_lack_of_fit_of_a_channel_gives_its_size() -> None:
    """Held-out remainders come first."""
    found = remaining([Gas(p1=3.0 * np.ones(N))], [left(ratio=2.5), left(ratio=3.5)])
    assert [d.size for d in found] == [2.5]


def test_a_discrepancy_names_its_signal(over: dict[str, str]) -> None:
    over["p1"] = "x"
    one = Gas(p1=3.0 * np.ones(N), p2=2.0 * np.ones(N))
    assert {d.channel: d.over for d in remaining([one], [left(), left(channel="p2")])} == {"p1": "x", "p2": None}
