"""The error that a user sees: which one speaks, and which part of it goes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.compare import ChannelResult
from pneucli.compare.expected_error import ExpectedError
from pneucli.diagnose import free_run_error
from pneucli.diagnose.free_run_error import held_out_error, relative_error, remaining_error_share, removed_error_share


def result(use: Any, rmsd: float, noise: float, channel: str = "x") -> ChannelResult:
    """The error of one channel; the model's number stands for its rms error."""
    return ChannelResult("one", use, channel, "m", rmsd, 0.0, 0.0, 0.0, noise, rmsd / noise, 1.0)


def errors(train: float | None, test: float | None) -> dict[str, float | None]:
    return {"train": train, "test": test}


@pytest.fixture(autouse=True)
def within_the_fitted_range(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stand-ins for comparisons have no samples."""
    monkeypatch.setattr(free_run_error, "excess_beyond_fitted", lambda found: [{} for _ in found])


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


def test_the_relative_error_is_that_of_held_out_recordings() -> None:
    assert relative_error(errors(1.0, 5.0), errors(9.0, 4.0)) == 0.8
    assert relative_error(errors(2.0, None), errors(1.0, None)) == 0.5
    assert relative_error(errors(None, 0.0), errors(None, 1.0)) is None
    assert relative_error(errors(None, None), errors(1.0, 1.0)) is None


def test_at_the_noise_floor_no_error_is_removed() -> None:
    assert remaining_error_share(errors(0.9, None), errors(0.8, None)) == 0.0
    assert removed_error_share(errors(0.9, None), errors(0.8, None)) is None
    assert (
        remaining_error_share(errors(None, None), errors(1.0, 1.0))
        is removed_error_share(errors(5.0, None), errors(None, None))
        is None
    )


def test_errors_are_over_each_models_own_noise_by_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three recordings, each with a channel's ratio of the model's number over the noise that it is given."""

    def compare(model: float, experiment: Any, noise: dict[str, float]) -> Any:
        compared.append(model)
        return SimpleNamespace(segment_squares={}, results=(result(experiment, model, noise["x"]),))

    compared: list[float] = []
    drawn: list[float] = []

    def expected(model: float, experiments: list[str]) -> list[ExpectedError]:
        drawn.append(model)
        return [ExpectedError({"x": 2.0 if use == "train" else 4.0}, {}) for use in experiments]

    monkeypatch.setattr(free_run_error, "compare", compare)
    monkeypatch.setattr(free_run_error, "expected_errors", expected)
    shown: Any = free_run_error.FreeRunErrors(["train", "test", "train"])  # type: ignore[list-item]
    first, other = 6.0, 8.0
    assert shown(first) == {"train": 3.0, "test": 1.5}
    assert shown(other) == {"train": 4.0, "test": 2.0}
    assert shown(first) == {"train": 3.0, "test": 1.5}
    assert shown(other, first) == {"train": 4.0, "test": 2.0}
    assert drawn == [6.0, 8.0]  # noise is drawn once for each model
    assert compared == 3 * [6.0] + 3 * [8.0]  # and each is simulated once
    alone: Any = free_run_error.FreeRunErrors(["train"])  # type: ignore[list-item]
    assert alone(first) == {"train": 3.0, "test": None}


def test_two_models_are_compared_in_units_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a correct model without a damper errors of 4 um are expected, with it of 1 um; 6 um are left of 8 um."""

    def compare(model: float, experiment: Any, noise: dict[str, float]) -> Any:
        return SimpleNamespace(segment_squares={}, results=(result("train", model, noise["x"]),))

    def expected(model: float, experiments: list[str]) -> list[ExpectedError]:
        return [ExpectedError({"x": 4.0 if model == 8.0 else 1.0}, {})]

    monkeypatch.setattr(free_run_error, "compare", compare)
    monkeypatch.setattr(free_run_error, "expected_errors", expected)
    shown: Any = free_run_error.FreeRunErrors(["train"])  # type: ignore[list-item]
    without, damped = 8.0, 6.0
    assert (shown(without)["train"], shown(damped)["train"]) == (2.0, 6.0)
    assert (shown(without, without)["train"], shown(damped, without)["train"]) == (2.0, 1.5)


def test_the_limit_of_a_correct_model_is_that_of_the_recordings_of_a_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two segments of mean 1 and variance 1: chi-square with four degrees of freedom, over four."""

    def expected(model: float, experiments: list[str]) -> list[ExpectedError]:
        return [ExpectedError({"x": 1.0}, {"x": np.ones((10_000, 2))}, {"x": np.tile([0.0, 2.0], 10_000)})]

    found = SimpleNamespace(segment_squares={}, results=(result("train", 8.0, 1.0),))
    monkeypatch.setattr(free_run_error, "compare", lambda model, experiment, noise: found)
    monkeypatch.setattr(free_run_error, "expected_errors", expected)
    limits: Any = free_run_error.FreeRunErrors(["train"]).limits(8.0)  # type: ignore[list-item, arg-type]
    assert limits == {"train": pytest.approx((13.277 / 4.0) ** 0.5, rel=1e-3), "test": None}


def test_the_overall_error_of_a_use_is_a_root_mean_square(monkeypatch: pytest.MonkeyPatch) -> None:
    results = tuple(result("train", rmsd, 1.0, channel) for channel, rmsd in (("x", 3.0), ("v", 4.0)))
    monkeypatch.setattr(
        free_run_error, "compare", lambda model, experiment, noise: SimpleNamespace(segment_squares={}, results=results)
    )
    monkeypatch.setattr(
        free_run_error, "expected_errors", lambda model, experiments: [ExpectedError({"x": 1.0, "v": 1.0}, {})]
    )
    shown: Any = free_run_error.FreeRunErrors([None])  # type: ignore[list-item]
    assert shown(None)["train"] == pytest.approx(12.5**0.5)
