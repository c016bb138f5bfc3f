"""Single stick-slips cut out and averaged, against the true motion of the exam's rig."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.identify.friction.kinematics import estimate_motion
from pneucli.identify.friction.samples import MIN_REST_RATIO, average_stick_slips, find_stick_slips
from pneucli.simulate.model import Model
from tests.identify_friction.synthetic_recordings import BENCH, RIG, pressed, pulses, recorded

STICKY = BENCH._replace(static=18.0, stribeck_velocity=0.015)


@cache
def moved() -> dict[str, np.ndarray]:
    return pressed(STICKY, pulses(3, 30.0))


def true_slides() -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff((moved()["v"] != 0).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@pytest.mark.parametrize("sensors", [("x", "a"), ("x",), ("a",)], ids=["x and a", "x", "a"])
def test_every_slide_between_two_rests_is_cut_out(sensors: tuple[str, ...]) -> None:
    cuts = find_stick_slips(estimate_motion(recorded(STICKY, moved(), 1, ("p1", "p2", *sensors)), Model(RIG)), 2.0)
    slides = true_slides()
    assert len(cuts) == len(slides) == 6
    assert [c.direction for c in cuts] == [1, -1] * 3
    for one, (begin, stop) in zip(cuts, slides, strict=True):
        assert abs(one.breakaway - begin) <= 5
        assert abs(one.stop - stop) <= 10
        assert min(one.breakaway - one.start, one.end - one.stop) >= MIN_REST_RATIO * (one.stop - one.breakaway)
        assert one.peak_speed == pytest.approx(np.abs(moved()["v"]).max(), rel=0.01)


def test_a_slide_from_or_to_a_stop_is_no_stick_slip() -> None:
    """Until its first slide the piston rests on one."""
    found = estimate_motion(recorded(STICKY, moved(), 1, ("p1", "p2", "x", "a")), Model(RIG))
    first = find_stick_slips(found, 2.0)[0]
    stopped = replace(found, contact=np.arange(found.v.size) < first.breakaway)
    assert len(find_stick_slips(stopped, 2.0)) == 5


def test_break_away_takes_the_static_friction() -> None:
    cuts = find_stick_slips(estimate_motion(recorded(STICKY, moved(), 2), Model(RIG)), 2.0)
    # the force rises by at most 30 N pi / 280 ms = 0.34 N a sample; it is read within two samples of break-away
    assert np.mean([c.breakaway_force for c in cuts]) == pytest.approx(18.0, abs=0.7)


def test_motion_that_reverses_without_rest_is_not_a_stick_slip() -> None:
    sine = 15.0 * np.sin(2 * np.pi * np.arange(2000) / 200)
    truth = pressed(BENCH._replace(coulomb=2.0), sine)
    assert find_stick_slips(estimate_motion(recorded(BENCH, truth, 3), Model(RIG)), 2.0) == []


def test_averaging_n_repeats_brings_the_error_down_by_the_root_of_n() -> None:
    """Sensor noise is all that differs between repeats; the truth is the closed law."""
    cuts = [
        c
        for seed in range(16)
        for c in find_stick_slips(estimate_motion(recorded(STICKY, moved(), seed), Model(RIG)), 2.0)
    ]
    forward = [c for c in cuts if c.direction == 1]

    def error(n: int) -> float:
        groups = [forward[i : i + n] for i in range(0, len(forward) - n + 1, n)]
        slow = [a for group in groups for a in average_stick_slips(group) if a.branch == "slowing"]
        deviation = [a.friction - (12.0 + 6.0 / (1 + (a.speed / 0.015) ** 2) + 40.0 * a.speed) for a in slow]
        return float(np.sqrt(np.mean(np.concatenate([d[10:] for d in deviation]) ** 2)))

    assert error(1) / error(4) == pytest.approx(2.0, rel=0.2)
    assert error(1) / error(16) == pytest.approx(4.0, rel=0.35)


def test_the_stated_error_of_the_mean_is_its_scatter() -> None:
    cuts = [
        c
        for seed in range(8)
        for c in find_stick_slips(estimate_motion(recorded(STICKY, moved(), seed), Model(RIG)), 2.0)
    ]
    for one in average_stick_slips(cuts):
        truth = 12.0 + 6.0 / (1 + (one.speed / 0.015) ** 2) + 40.0 * one.speed
        pull = ((one.friction - truth) / one.error)[10:-2]  # beyond the turn only some of the cuts reach
        assert 0.6 < np.sqrt(np.mean(pull**2)) < 1.5
