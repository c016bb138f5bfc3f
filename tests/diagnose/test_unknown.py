"""Describing what remains: a channel is sought only in the views that have it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from pneucli.diagnose.remainder import Remainder
from pneucli.diagnose.unknown import describe
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
        self.__dict__["experiment"] = SimpleNamespace(time=TIME, inputs=inputs, raw={"x": TIME})

    def residual(self, _model: object) -> dict[str, Any]:
        return dict.fromkeys(self.channels, self.left)


def test_a_ripple_of_p2_is_found_though_a_vessel_has_no_p2():
    ripple = 100.0 * np.sin(2 * np.pi * 7.0 * TIME) + np.random.default_rng(1).normal(size=TIME.size)
    views = [Seen(("p1",), np.ones(TIME.size)), Seen(("p1", "p2"), ripple)]
    found = describe(None, views, Remainder(Seen, "p2", 3.0, 3.0, ()))
    assert (found.channel, found.law) == ("p2", "a sine")
    assert "periodic" in found.character
    assert "period 0.14" in found.character  # 1 / 7 Hz
