"""Levels of a parameter over dates, and where they change."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.fleet.dataset import find_change_points, parameter_trends, robust_scatter

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("cuts", [(), (8,), (5, 12)])
def test_a_step_of_six_errors_is_a_change_point(cuts: tuple[int, ...]) -> None:
    levels = np.searchsorted(cuts, np.arange(20), side="right") * 6.0
    assert find_change_points(levels + RNG.standard_normal(20), np.ones(20)) == cuts


def test_pure_noise_rarely_has_a_change_point() -> None:
    """200 series of 20 dates: Schwarz's penalty leaves few with a cut."""
    cut = [bool(find_change_points(RNG.standard_normal(20), np.ones(20))) for _ in range(200)]
    assert np.mean(cut) < 0.05


def test_understated_errors_give_no_change_points() -> None:
    cut = [bool(find_change_points(5.0 + RNG.standard_normal(30), np.full(30, 1e-3))) for _ in range(200)]
    assert np.mean(cut) < 0.15
    assert robust_scatter(np.array([1.0, 2.0])) < 1e-9


def test_trends_are_by_rig_and_parameter_with_dates_in_order() -> None:
    records = [("a", f"2026-01-0{day}", "friction.coulomb", "N", float(day), 0.1) for day in (3, 1, 2)]
    (trend,) = parameter_trends([*records, ("b", "2026-01-01", "friction.coulomb", "N", 1.0, 0.1)])
    assert (trend.rig, trend.dates, trend.values) == ("a", ("2026-01-01", "2026-01-02", "2026-01-03"), (1.0, 2.0, 3.0))
