"""Describing what remains: a channel is sought only in the views that have it."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from pneucli.diagnose.remainder import Remainder
from pneucli.diagnose.unknown import describe
from pneucli.simulate import layout as at

TIME = np.arange(0.0, 4.0, 1e-3)


@dataclass
class Seen:
    """What a view shows, without a rig behind it."""

    channels: tuple[str, ...]
    left: Any
    kind: str = "chambers"
    experiment: Any = field(default=None)

    def __post_init__(self) -> None:
        inputs = np.zeros((TIME.size, len(at.INPUTS)))
        inputs[:, at.IN_X] = TIME
        self.experiment = SimpleNamespace(time=TIME, inputs=inputs, raw={"x": TIME})

    def residual(self, _model: object) -> dict[str, Any]:
        return dict.fromkeys(self.channels, self.left)


def test_a_ripple_of_p2_is_found_though_a_vessel_has_no_p2():
    ripple = 100.0 * np.sin(2 * np.pi * 7.0 * TIME) + np.random.default_rng(1).normal(size=TIME.size)
    views = [Seen(("p1",), np.ones(TIME.size)), Seen(("p1", "p2"), ripple)]
    found = describe(None, views, Remainder("chambers", "p2", 3.0, 3.0, ()))
    assert (found.channel, found.law) == ("p2", "a sine")
    assert "periodic" in found.character
    assert "period 0.14" in found.character  # 1 / 7 Hz
