"""An effect in its place: what it leaves there, and what is not told from it."""

from __future__ import annotations

import pytest

from pneucli.diagnose.place import ALIKE, LEAST, Place
from pneucli.diagnose.trial import Trial
from tests.diagnose.trials import SAMPLES, bench, state, trial

BENCH = bench(held_out=False)
BEFORE = state(cost=SAMPLES + 10000.0)  # 10000 beyond noise


def leaving(effect: str, beyond: float) -> Trial:
    """A trial that leaves so much beyond noise."""
    return trial(effect, SAMPLES + beyond, before=BEFORE)


def place(beyond: float, **rivals: float) -> Place:
    """Stribeck friction that leaves so much, and what passed in its place with what that leaves."""
    return Place(leaving("stribeck", beyond), tuple(leaving(n.replace("_", "-"), much) for n, much in rivals.items()))


def test_what_is_left_is_a_part_of_what_there_was_beyond_noise() -> None:
    assert place(2500.0).left(BENCH) == pytest.approx(0.25)
    assert place(0.0).left(BENCH) == LEAST
    assert place(-500.0).left(BENCH) == LEAST


@pytest.mark.parametrize(("ratio", "told"), [(1.01 * ALIKE, False), (0.99 * ALIKE, True)])
def test_beside_something_unknown_what_leaves_about_as_much_is_not_told_from_it(ratio: float, told: bool) -> None:
    found = place(1000.0, extra_mass=ratio * 1000.0, presliding=9000.0)
    assert [t.effect.name for t in found.alike(BENCH, complete=False)] == ["extra-mass"] * told


def test_where_noise_alone_is_left_a_difference_of_as_much_tells() -> None:
    assert place(1000.0, extra_mass=1400.0).alike(BENCH, complete=True) == []
