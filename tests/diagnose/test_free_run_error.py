"""The error that a user sees: which one speaks, and which part of it goes."""

from __future__ import annotations

import pytest

from pneucli.diagnose.free_run_error import held_out_error, remaining_error_share, removed_error_share


def errors(train: float | None, test: float | None) -> dict[str, float | None]:
    return {"train": train, "test": test}


def test_the_held_out_error_counts_where_it_exists() -> None:
    assert held_out_error(errors(3.0, 5.0)) == 5.0
    assert held_out_error(errors(3.0, None)) == 3.0


def test_the_parts_are_of_the_squared_error_beyond_noise() -> None:
    """From 5 to the square root of 13: from 24 to 12 beyond noise."""
    before, after = errors(1.0, 5.0), errors(9.0, 13.0**0.5)
    assert remaining_error_share(before, after) == pytest.approx(0.5)
    assert removed_error_share(before, after) == pytest.approx(0.5)


@pytest.mark.parametrize(("after", "left"), [(0.9, 0.0), (7.0, 1.0)])
def test_less_than_noise_is_all_and_more_than_before_is_nothing(after: float, left: float) -> None:
    assert remaining_error_share(errors(None, 5.0), errors(None, after)) == left
    assert removed_error_share(errors(None, 5.0), errors(None, after)) == 1.0 - left


def test_at_the_noise_floor_no_error_is_removed() -> None:
    assert remaining_error_share(errors(0.9, None), errors(0.8, None)) == 0.0
    assert removed_error_share(errors(0.9, None), errors(0.8, None)) is None
    assert (
        remaining_error_share(errors(None, None), errors(1.0, 1.0))
        is removed_error_share(errors(5.0, None), errors(None, None))
        is None
    )
