"""Beside something unknown an effect is named only for what is its own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import stand_ins
from pneucli.diagnose.remainder import Remainder
from pneucli.identify.views import Chambers, Forces, View
from pneucli.physics.effects import catalogue

SAMPLES = 1000


def state(cost: float) -> Any:
    return SimpleNamespace(cost=cost * SAMPLES, samples=SAMPLES)


def bench(*, held_out: bool = True, falls: bool = True) -> Any:
    return SimpleNamespace(
        held_out=[1] if held_out else [],
        effects=catalogue(),
        falls=lambda before, after: falls,
        train=[
            SimpleNamespace(
                experiment=SimpleNamespace(recording=SimpleNamespace(name=name), time=np.zeros(SAMPLES)),
                channels=("p",),
            )
            for name in "ab"
        ],
    )


def left(ratio: float, kind: type[View] = Forces) -> list[Remainder]:
    return [Remainder(kind, "force", ratio, ratio, ())]


def named(effect: str, before: float, after: float, remaining: list[Remainder], **how: bool) -> bool:
    return stand_ins.stands(bench(**how), state(after), remaining, effect, state(before), state(after))


@pytest.fixture(autouse=True)
def agreement(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_ins, "agreed", lambda bench, state, name: name != "spring-force")


@pytest.mark.parametrize(
    ("before", "after", "ratio", "seen"),
    [
        (101.0, 31.0, 5.0, True),  # 70 % taken, and much left: two things act
        (101.0, 31.0, 2.0, False),  # 70 % taken, little left: what resembles one unknown does the same
        (101.0, 3.0, 2.0, True),  # 98 % taken
        (101.0, 91.0, 9.0, False),  # 10 % taken
    ],
)
def test_the_share_that_an_effect_must_take_depends_on_what_is_left(before, after, ratio, seen):
    assert named("extra-mass", before, after, left(ratio)) == seen


def test_without_held_out_recordings_nine_tenths_are_asked_for():
    assert not named("extra-mass", 101.0, 21.0, left(9.0), held_out=False)
    assert named("extra-mass", 101.0, 6.0, left(9.0), held_out=False)


def test_what_recordings_contradict_or_raises_the_error_is_not_named():
    assert not named("spring-force", 101.0, 3.0, left(2.0))
    assert not named("extra-mass", 101.0, 3.0, left(2.0), falls=False)


def test_bounds_are_no_name_for_a_force_that_remains():
    assert not named("friction-hysteresis", 101.0, 3.0, left(2.0))
    assert named("friction-hysteresis", 101.0, 3.0, left(2.0, kind=Chambers))
