"""A model that replays badly is found out, though stretches with stick-slip scatter."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import free_run_test
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.identify.residuals import ChamberPressures, ForceBalance, FreeRun, ResidualModel
from pneucli.simulate import layout as at
from tests.simulate.synthetic_experiments import model

STRETCHES, LENGTH = 40, 100
N = STRETCHES * LENGTH


def seen(errors: np.ndarray, monkeypatch: pytest.MonkeyPatch, kind: type[ResidualModel] = ForceBalance) -> list[Any]:
    """A view whose model errs by ``errors`` (stretches,) times white noise of 1 in each stretch."""
    rng = np.random.default_rng(4)
    error = np.repeat(errors, LENGTH) * rng.normal(size=N)
    experiment = SimpleNamespace(
        restarts=np.arange(0, N, LENGTH),
        recording=SimpleNamespace(experiment="axis"),
        measured=lambda channel: error,
        inputs=np.zeros((N, len(at.INPUTS))),
        noise={"x": SimpleNamespace(rms=1.0)},
        detected_ends=(-np.inf, np.inf),
        end_compliance=0.0,
    )
    monkeypatch.setattr(free_run_test, "simulate_outputs", lambda model, e: {"x": np.zeros(N)})
    monkeypatch.setattr(free_run_test, "sample_deviations", lambda model, e, draws: {"x": rng.normal(size=(draws, N))})
    return [kind(experiment)]


def test_a_true_model_errs_as_its_draws_do(monkeypatch: pytest.MonkeyPatch):
    assert free_run_test.free_run_lack_of_fit(None, seen(np.ones(STRETCHES), monkeypatch)) == []


def test_wild_errors_in_a_third_of_the_stretches_are_stick_slip(monkeypatch: pytest.MonkeyPatch):
    errors = np.where(np.arange(STRETCHES) % 3 == 0, 20.0, 1.0)
    assert free_run_test.free_run_lack_of_fit(None, seen(errors, monkeypatch)) == []


def test_errors_of_twice_the_noise_everywhere_are_not(monkeypatch: pytest.MonkeyPatch):
    (found,) = free_run_test.free_run_lack_of_fit(None, seen(np.full(STRETCHES, 2.0), monkeypatch))
    assert (found.kind, found.channel) == (FreeRun, "x")
    assert found.ratio == pytest.approx(2.0, rel=0.1)


def test_too_few_stretches_say_nothing(monkeypatch: pytest.MonkeyPatch):
    residual_models = seen(np.full(STRETCHES, 5.0), monkeypatch)
    residual_models[0].experiment.restarts = np.arange(0, N, N // 10)
    assert free_run_test.free_run_lack_of_fit(None, residual_models) == []


@pytest.mark.parametrize(
    ("stretches", "beyond", "typical", "told"),
    [
        (20, 0.5, 1.4, True),
        (19, 0.5, 1.4, False),
        (20, 0.45, 1.4, False),
        (20, 0.5, 1.39, False),
        (1000, 1.0, 5.0, True),
    ],
)
def test_most_of_twenty_stretches_err_beyond_every_draw_and_by_much_in_the_median(
    stretches: int, beyond: float, typical: float, told: bool
) -> None:
    """An error as large as the largest draw is none beyond it."""
    largest = np.where(np.arange(stretches) < beyond * stretches, 1.01, 1.0)
    found = free_run_test._channel_lack_of_fit("x", np.column_stack([largest, np.full(stretches, typical)]))
    assert found == (LackOfFit(FreeRun, "x", typical, typical, ()) if told else None)


def test_where_an_end_decides_on_the_motion_pressures_count_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    (residual_model,) = seen(np.full(STRETCHES, 3.0), monkeypatch)
    draws = np.random.default_rng(1).normal(size=(6, N))
    monkeypatch.setattr(free_run_test, "simulate_outputs", lambda model, e: {"x": np.zeros(N), "p1": np.zeros(N)})
    monkeypatch.setattr(free_run_test, "sample_deviations", lambda model, e, number: {"x": draws, "p1": draws})
    monkeypatch.setattr(free_run_test, "in_end_contact", lambda e, x, channel: np.ones(N, dtype=bool))
    found = free_run_test._error_ratios(model(), residual_model.experiment)
    assert not found["x"].any()
    assert found["p1"][:, 1] == pytest.approx(np.full(STRETCHES, 3.0), rel=0.4)
    assert found["p1"].mean() > 2.0


def test_only_free_runs_are_replayed(monkeypatch: pytest.MonkeyPatch):
    assert (
        free_run_test.free_run_lack_of_fit(None, seen(np.full(STRETCHES, 5.0), monkeypatch, kind=ChamberPressures))
        == []
    )
