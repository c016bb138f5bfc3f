"""Describing what remains: a channel is sought only in the views that have it."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose.remainder import Remainder
from pneucli.diagnose.unknown import Unknown, describe
from pneucli.identify.views import Chambers
from pneucli.simulate import layout as at

TIME = np.arange(0.0, 4.0, 1e-3)


class Seen(Chambers):
    """What a view shows, without a rig behind it."""

    channels = ()

    def __init__(self, channels: tuple[str, ...], left: Any) -> None:
        self.__dict__.update(channels=channels, left=left)
        inputs = np.zeros((TIME.size, len(at.INPUTS)))
        inputs[:, at.IN_X] = TIME
        each = np.arange(0, TIME.size, 500)
        self.__dict__["experiment"] = SimpleNamespace(time=TIME, inputs=inputs, raw={"x": TIME}, restarts=each)

    def residual(self, _model: object) -> dict[str, Any]:
        return dict.fromkeys(self.channels, self.left)


def period(found: Unknown) -> float:
    """The period that is told."""
    told = re.search(r"periodic over .*, period ([\d.e-]+) ", found.character)
    assert told is not None
    return float(told[1])


def test_a_ripple_of_p2_is_found_though_a_vessel_has_no_p2():
    ripple = 100.0 * np.sin(2 * np.pi * 7.0 * TIME) + np.random.default_rng(1).normal(size=TIME.size)
    views = [Seen(("p1",), np.ones(TIME.size)), Seen(("p1", "p2"), ripple)]
    found = describe(None, views, Remainder(Seen, "p2", 3.0, 3.0, ()))
    assert (found.channel, found.law) == ("p2", "a sine")
    assert period(found) == pytest.approx(1 / 7, rel=0.01)


def test_what_grows_from_restart_to_restart_is_the_comparisons_and_no_period_of_the_rig():
    """An error that grows after each of the restarts, 0.5 s apart, and is set back at the next."""
    saw = 50.0 * (TIME % 0.5) + np.random.default_rng(1).normal(size=TIME.size)
    vessel = Seen(("p1",), saw)
    del vessel.experiment.raw["x"]
    found = describe(None, [vessel], Remainder(Seen, "p1", 3.0, 3.0, ()))
    assert "periodic" not in found.character


@pytest.mark.parametrize("frequency", [1.3, 3.0, 7.0])
def test_a_period_of_the_rig_is_found_whatever_the_restarts(frequency: float):
    wave = 5.0 * np.sin(2 * np.pi * frequency * TIME) + np.random.default_rng(1).normal(size=TIME.size)
    found = describe(None, [Seen(("p1",), wave)], Remainder(Seen, "p1", 3.0, 3.0, ()))
    assert period(found) == pytest.approx(1 / frequency, rel=0.01)


def test_what_is_not_replayed_has_no_period_of_restarts():
    """A balance of forces starts nowhere anew: a force that swings at 2 Hz is the rig's, though restarts do so too."""

    class Balance(Seen):
        replayed = False

    wave = np.sin(2 * np.pi * 2.0 * TIME)
    balance = Balance(("p1",), wave)
    del balance.experiment.raw["x"]
    found = describe(None, [balance], Remainder(Balance, "p1", 3.0, 3.0, ()))
    assert period(found) == pytest.approx(0.5, rel=0.01)


def test_a_recording_that_says_nothing_has_no_period():
    """Such as one in which the piston rests all the time, so that no reading of the force is compared."""
    found = describe(None, [Seen(("p1",), np.zeros(TIME.size))], Remainder(Seen, "p1", 3.0, 3.0, ()))
    assert found.character == "without a shape over any signal"
