"""What a state costs and leaves over: each reading counts once, held out where it is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import trial
from pneucli.diagnose.likelihood import deviance
from pneucli.diagnose.trial import Bench, Squares
from pneucli.identify.fit import Fit
from tests.simulate.benches import model

N = 1000


class Stated:
    """A view of one channel, with blocks of 0.25 s, whose residual with whatever model is stated."""

    channels = ("p1",)
    noise = {"p1": 1.0}  # noqa: RUF012

    def __init__(self, seed: int, name: str = "one") -> None:
        self.left = 3.0 * np.random.default_rng(seed).normal(size=N)
        recording = SimpleNamespace(name=name, period=1e-3)
        self.experiment = SimpleNamespace(time=1e-3 * np.arange(N), recording=recording)

    def residual(self, model: Any, errors: Any = None) -> dict[str, np.ndarray]:
        return {"p1": self.left}

    def carried(self, model: Any) -> dict[str, np.ndarray]:
        return {}

    def volume(self, errors: Any) -> np.ndarray:
        return np.zeros(N)


ONE, OTHER = Stated(1), Stated(2, "other")
NONE: Any = {}


def fitted(*views: Stated) -> Fit:
    """A fit without parameters."""
    left = np.concatenate([view.left for view in views])
    blocks = np.repeat(np.arange(4 * len(views)), 250)
    return Fit(model(), (), (), left, np.zeros((left.size, 0)), blocks, np.zeros((0, 0)), 0.0, [{}] * len(views))


def bench(train: list[Any], held_out: list[Any] | None = None, **more: Any) -> Bench:
    return Bench(train, held_out or [], {}, **more)


def test_costs_of_fitted_and_of_held_out_recordings_are_by_block() -> None:
    """The octaves of both have one variance each, so that they are told together."""
    found = bench([ONE], [OTHER]).state(fitted(ONE))
    both: Any = [ONE, OTHER]
    wanted = deviance(both, np.concatenate([ONE.left, OTHER.left]), [NONE, NONE])
    assert found.costs == pytest.approx(wanted)
    assert (found.train, found.test) == (pytest.approx(wanted[:4]), pytest.approx(wanted[4:]))
    assert found.cost == pytest.approx(wanted.sum())
    assert found.fitted == Squares.of(ONE.left)
    assert found.every.total == pytest.approx(ONE.left @ ONE.left + OTHER.left @ OTHER.left)


def test_by_turns_each_reading_counts_as_held_out(monkeypatch: pytest.MonkeyPatch) -> None:
    both: Any = [ONE, OTHER]
    turned = 1.5 * np.concatenate([ONE.left, OTHER.left])
    monkeypatch.setattr(trial, "held_out_by_turns", lambda found, views, turns: turned)
    found = bench(both, turns=(0, 1)).state(fitted(ONE, OTHER))
    assert found.train == pytest.approx(deviance(both, turned / 1.5, [NONE, NONE]))
    assert found.test == pytest.approx(deviance(both, turned, [NONE, NONE]))
    assert found.costs is found.test
    assert found.every.total == pytest.approx(1.5**2 * found.fitted.total)


def test_of_one_recording_alone_nothing_is_held_out() -> None:
    found = bench([ONE]).state(fitted(ONE))
    assert found.costs is found.train
    assert found.test.size == 0
    assert found.every == found.fitted == Squares.of(ONE.left)


def test_squares_beyond_noise_are_those_of_what_was_read() -> None:
    """Zeros are no readings; less than noise is not beyond it."""
    assert Squares.of(np.array([3.0, 0.0, -1.0])) == (10.0, 2)
    assert Squares(10.0, 2).beyond_noise == 8.0
    assert Squares(1.0, 2).beyond_noise == 0.0


OFFSET: Any = SimpleNamespace(name="offset", part="sensor", parameters=(1,), sides=frozenset({"pressure sensor"}))
LEAK: Any = SimpleNamespace(
    name="leak", part="cylinder", parameters=(1, 2), sides=frozenset({"gas", "pressure sensor"})
)


@pytest.mark.parametrize(
    ("recorded", "shows"), [({"x"}, False), ({"x", "p1"}, True), ({"p2"}, True), ({"p_supply"}, False)]
)
def test_a_pressure_sensors_fault_cannot_show_where_no_pressure_is_recorded(recorded: set[str], shows: bool) -> None:
    """What acts in the gas as well may show all the same."""
    seen: Any = SimpleNamespace(
        feels=lambda effect: True, experiment=SimpleNamespace(raw=dict.fromkeys(recorded, np.zeros(3)))
    )
    found = Bench([seen], [], {e.name: e for e in (OFFSET, LEAK)})
    assert (found.can_show(OFFSET), found.can_show(LEAK)) == (shows, True)
    assert found.hypotheses == 2 + shows
