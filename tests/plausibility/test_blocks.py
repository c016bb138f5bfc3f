"""Slopes and curvatures of blocks, lines through them, and whether a signal rests."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from pneucli.noise import NoiseModel
from pneucli.plausibility.blocks import Blocks, fit_linear, resolved_blocks
from pneucli.plausibility.rig_check import RigCheck, is_inactive
from pneucli.recording import Recording, Rig

RNG = np.random.default_rng(0)
T = np.cumsum(RNG.uniform(0.8e-3, 1.2e-3, 3000))


def recorded(noise: float = 1e-6, **signals: np.ndarray) -> Recording:
    return Recording("one", "friction", "train", T, signals, dict.fromkeys(signals, NoiseModel(noise)))


def test_a_parabola_has_its_slopes_and_curvature_whatever_the_clock() -> None:
    cut = Blocks.cut(recorded(x=0.1 + 0.2 * T + 0.3 * T**2), "x", 12)
    assert cut.curvature("x") == pytest.approx(np.full(250, 0.6))
    line = Blocks.cut(recorded(x=0.1 + 0.2 * T), "x", 12)
    assert line.slope("x") == pytest.approx(np.full(250, 0.2))


def test_acceleration_is_weighed_as_the_curvature_of_the_position_weighs_it() -> None:
    """Over a third of a period, where the plain mean is 5 % off the curvature."""
    cut = Blocks.cut(recorded(x=np.sin(9 * T), a=-81 * np.sin(9 * T)), "x", 240)
    derived = cut.curvature("x")
    assert np.abs(cut.mean("a", 2) - derived).max() < 0.02 * np.abs(derived).max()
    assert np.abs(cut.mean("a") - derived).max() > 0.05 * np.abs(derived).max()


def test_blocks_are_as_short_as_the_noise_allows() -> None:
    x = 0.1 * np.sin(6 * T)
    widths = [
        resolved_blocks(recorded(noise, x=x + noise * RNG.standard_normal(T.size)), "x", 2) for noise in (1e-7, 1e-4)
    ]
    assert [cut and cut.width for cut in widths] == [6, 48]


def test_blocks_are_cut_once_for_all_checks() -> None:
    one = recorded(x=0.1 * np.sin(6 * T))
    check = RigCheck([one], Rig(), {})
    assert check.blocks(one, "x", 2) is check.blocks(one, "x", 2)
    assert check.blocks(one, "x", 2) is not check.blocks(one, "x", 1)


def test_what_does_not_stand_clear_of_its_noise_has_no_blocks() -> None:
    assert resolved_blocks(recorded(x=1e-6 * RNG.standard_normal(T.size)), "x", 2) is None
    assert resolved_blocks(recorded(x=np.full(T.size, 0.1)), "x", 1) is None


def test_a_block_with_a_gap_is_left_out() -> None:
    late = Recording("one", "friction", "train", np.where(T < 1.0, T, T + 9.0), {"x": T})
    assert Blocks.cut(late, "x", 12).half_duration.max() < 0.01


def test_errors_of_a_line_hold_where_what_is_left_over_is_coloured() -> None:
    x = np.sin(0.01 * np.arange(4000))
    off = []
    for _ in range(100):
        coloured = lfilter([0.2], [1.0, -0.98], RNG.standard_normal(4000))
        line = fit_linear([x, np.ones_like(x)], 3.0 * x + coloured)
        assert line is not None
        off.append((line.factors[0] - 3.0) / line.errors[0])
    assert 0.5 < np.std(off) < 1.7


def test_too_few_values_give_no_line() -> None:
    assert fit_linear([np.ones(15)], np.ones(15)) is None


@pytest.mark.parametrize(
    ("values", "still"),
    [
        (np.full(1000, 0.1), True),
        (RNG.standard_normal(1000), True),
        (RNG.standard_normal(1000) + 1e-3 * np.arange(1000), False),
        (np.sin(0.01 * np.arange(1000)), False),
        (np.where(RNG.random(1000) < 0.5, np.nan, np.sin(np.arange(1000) / 50)), False),
        (np.full(5, 0.1), False),  # too few to tell
    ],
)
def test_constants_and_white_noise_rest(values: np.ndarray, still: bool) -> None:
    assert is_inactive(values) is still
