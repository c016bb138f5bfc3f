"""Limits of a rig: defaults, stated ones, and what exceeds them."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.plan.bench import described_benches
from pneucli.plan.limits import Limits, limits_of, violations
from pneucli.plan.manoeuvre import Outcome
from pneucli.recording import Rig

RIG = Rig(supply_pressure=7e5, ambient_pressure=1e5, piston_area_1=8e-4, stroke=0.2, moving_mass=2.0)
REST = Outcome(
    np.arange(3.0),
    {},
    p1=np.full(3, 3e5),
    p2=np.full(3, 3e5),
    x=np.full(3, 0.1),
    v=np.zeros(3),
)


def test_limits_follow_from_the_rig_where_the_file_states_none():
    limits = limits_of(RIG, described_benches(RIG))
    assert limits.position == pytest.approx((0.01, 0.19))
    assert limits.max_pressure == pytest.approx(1.15 * 7e5)
    assert limits.max_force == pytest.approx(1.1 * 6e5 * 8e-4)


def test_stated_limits_replace_the_defaults():
    limits = limits_of(RIG, described_benches(RIG), {"end_margin": 0.05, "max_speed": 0.2, "max_air": 1e-3})
    assert limits.position == pytest.approx((0.05, 0.15))
    assert limits.max_speed == 0.2
    assert limits.max_air == pytest.approx(1.185e-3)


@pytest.mark.parametrize(
    ("change", "quantity"),
    [
        ({"x": np.array([0.1, 0.195, 0.1])}, "x"),
        ({"x": np.array([0.1, 0.004, 0.1])}, "x"),
        ({"v": np.array([0.0, -1.7, 0.0])}, "v"),
        ({"p1": np.array([3e5, 9e5, 3e5])}, "p1"),
        ({"p2": np.array([3e5, 9e5, 3e5])}, "p2"),
        ({"p1": np.array([3e5, 7.9e5, 3e5]), "p2": np.full(3, 1e5)}, "force"),
        ({"p1": np.array([3e5, np.nan, 3e5])}, "p1"),
        ({"air": 1.0}, "air"),
    ],
)
def test_each_limit_is_checked(change: dict, quantity: str):
    limits = replace(limits_of(RIG, described_benches(RIG)), max_air=0.5)
    assert violations(REST, limits, RIG) == []
    assert quantity in {v.quantity for v in violations(replace(REST, **change), limits, RIG)}


def test_a_pressure_that_no_bench_can_make_is_refused():
    impossible = replace(REST, p1=np.array([3e5, 0.5e5, 3e5]), lowest_pressure=0.97e5)
    assert [v.quantity for v in violations(impossible, Limits(), RIG)] == ["p1"]
