"""Figures of a channel where something is missing, and the noise of a correct model over several recordings."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.compare import channel_errors, expected_error
from pneucli.compare.channel_errors import Comparison
from pneucli.noise import NoiseModel
from pneucli.simulate import layout as at
from pneucli.simulate import noise_propagation
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid

Y = np.array([1.0, 2.0, 3.0, 6.0, np.nan])


def figures(measured: np.ndarray, modelled: np.ndarray, noise: float = 0.5) -> channel_errors.ChannelResult:
    e = make_experiment("axis", time_grid(0.1), {"u": 0.0})
    return channel_errors.evaluate_channel(e, "p1", measured, modelled, noise)


def test_figures_by_hand() -> None:
    """Errors 1, 0, 0, 2 of readings whose mean is 3: sums of squares 5, 50 and 14."""
    r = figures(Y, np.array([0.0, 2.0, 3.0, 4.0, 9.0]))
    assert r.rmsd == pytest.approx(np.sqrt(5 / 4))
    assert r.percent == pytest.approx(100 * np.sqrt(5 / 4) / 5.0)
    assert r.relative_error_percent == pytest.approx(100 * np.sqrt(5 / 50))
    assert r.fit_percent == pytest.approx(100 * (1 - np.sqrt(5 / 14)))
    assert r.ratio_to_noise == pytest.approx(np.sqrt(5 / 4) / 0.5)
    assert (r.recording, r.use, r.channel, r.unit, r.noise) == ("bench", "train", "p1", "Pa", 0.5)


def test_samples_without_a_prediction_do_not_count() -> None:
    r = figures(Y, np.array([0.0, np.nan, 3.0, 4.0, 9.0]))
    assert r.rmsd == pytest.approx(np.sqrt(5 / 3))


def test_undefined_figures_are_nan() -> None:
    constant, zero = figures(np.full(5, 2.0), np.full(5, 1.0)), figures(np.zeros(5), np.ones(5), noise=0.0)
    assert np.isnan(constant.percent)
    assert np.isnan(constant.fit_percent)
    assert constant.relative_error_percent == pytest.approx(50.0)
    assert np.isnan(zero.relative_error_percent)
    assert np.isnan(zero.ratio_to_noise)


def test_every_sample_has_the_number_of_its_restart() -> None:
    e = make_experiment("axis", time_grid(0.006), {"u": 0.0}, restarts=(0, 3, 5))
    assert e.segments.tolist() == [0, 0, 0, 1, 1, 2, 2]


def test_the_residual_is_measured_minus_modelled() -> None:
    e = make_experiment("axis", time_grid(0.001), {"u": 0.0})
    found = Comparison(e, (), {"x": np.array([3.0, np.nan])}, {"x": np.array([1.0, 1.0])})
    np.testing.assert_array_equal(found.residual("x"), [2.0, np.nan])


def test_the_noise_of_a_correct_model_is_drawn_where_it_is_not_given(monkeypatch: pytest.MonkeyPatch) -> None:
    e = make_experiment("valve", time_grid(0.01), {"u": 0.0, "p1": 3e5})
    monkeypatch.setattr(
        channel_errors, "expected_rms", lambda model, experiment: dict.fromkeys(experiment.channels, 0.25)
    )
    assert {r.noise for r in channel_errors.compare(model(), e).results} == {0.25}
    assert {r.noise for r in channel_errors.compare(model(), e, dict.fromkeys(e.channels, 0.125)).results} == {0.125}


def test_motion_is_not_compared_in_contact_with_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first ten samples, as far as the ends know; pressures are compared all along."""
    e = make_experiment("axis", time_grid(0.1), {"u": 0.0, "p1": 3e5, "p2": 3e5, "x": 0.1, "v": 0.0, "a": 0.0})
    held = np.arange(e.time.size) < 10
    monkeypatch.setattr(
        channel_errors, "in_end_contact", lambda experiment, x, channel: held & (channel != "v") & (x < 0.2)
    )
    found = channel_errors.compare(model(), e, dict.fromkeys(e.channels, 1.0)).measured
    lost = {c: int(np.isnan(values).sum()) for c, values in found.items()}
    assert lost == {c: 10 if c in ("x", "a") else 0 for c in e.channels}
    assert {"p1", "x", "v", "a"} <= lost.keys()


# --- what a correct model shows


def of_all(monkeypatch: pytest.MonkeyPatch, found: list[tuple[str, str | None, dict[str, float]]]) -> list[dict]:
    """The noise of several recordings, each of a kind and with its own rms by channel."""
    experiments: list[Any] = [
        SimpleNamespace(recording=SimpleNamespace(experiment=kind, imposed=imposed), own=rms, time=np.zeros(3))
        for kind, imposed, rms in found
    ]
    monkeypatch.setattr(expected_error, "expected_error", lambda model, e: expected_error.ExpectedError(e.own, {}))
    heard: list[int] = []
    out = expected_error.expected_errors(model(), experiments, heard.append)
    assert sorted(heard) == list(range(len(found)))
    return [one.rms for one in out]


def test_motion_is_pooled_over_recordings_of_its_kind_and_pressures_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    found = of_all(
        monkeypatch,
        [
            ("axis", None, {"x": 3.0, "v": 1.0, "p1": 5.0}),
            ("axis", None, {"x": 4.0, "p1": 7.0}),
            ("friction", None, {"x": 9.0}),
            ("friction", "motion", {"a": 2.0, "force": 1.0}),
            ("friction", "motion", {"a": 4.0, "force": 3.0}),
        ],
    )
    both, a = np.sqrt(12.5), np.sqrt(10.0)
    assert found == [
        {"x": pytest.approx(both), "v": 1.0, "p1": 5.0},
        {"x": pytest.approx(both), "p1": 7.0},
        {"x": 9.0},
        {"a": pytest.approx(a), "force": 1.0},
        {"a": pytest.approx(a), "force": 3.0},
    ]


def still(noise: dict[str, float], low_pass: float | None = None) -> Any:
    """A piston that sticks: what is read differs from the model by the sensors' noise alone."""
    e = make_experiment("friction", time_grid(0.2), {"p1": 2e5, "p2": 2e5, "x": 0.1})
    e.noise.update({name: NoiseModel(rms) for name, rms in noise.items()})
    object.__setattr__(e, "low_pass", low_pass)
    return e


def test_draws_have_the_requested_shape_and_the_sensors_level() -> None:
    e = still({"p1": 1.0, "p2": 1.0, "x": 2e-6})
    drawn = noise_propagation.sample_deviations(model(), e, draws=5)
    assert drawn["x"].shape == (5, e.time.size)
    # the state at the restart is read too, with the same sensor
    rms = expected_error.expected_rms(model(), e)["x"]
    assert 2e-6 <= rms < 6e-6


def test_the_expected_error_is_at_least_the_sensors_noise_unless_filtered(monkeypatch: pytest.MonkeyPatch) -> None:
    e = still({"p1": 1.0, "p2": 1.0, "x": 2e-6})
    quiet = {c: np.full(e.time.size, 1e-9) for c in e.channels}
    monkeypatch.setattr(expected_error, "iterate_deviations", lambda *_: iter([quiet, quiet]))
    assert expected_error.expected_rms(model(), e)["x"] == 2e-6
    object.__setattr__(e, "low_pass", 10.0)
    assert expected_error.expected_rms(model(), e)["x"] == pytest.approx(1e-9)
    del e.noise["x"]
    object.__setattr__(e, "low_pass", None)
    assert expected_error.expected_rms(model(), e)["x"] == pytest.approx(1e-9)


def test_the_level_is_the_root_of_the_mean_square_over_all_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    e = still({"p1": 1e-9, "p2": 1e-9, "x": 1e-9})
    draws = [{c: np.full(e.time.size, level) for c in e.channels} for level in (3.0, 4.0)]
    monkeypatch.setattr(expected_error, "iterate_deviations", lambda *_: iter(draws))
    assert expected_error.expected_rms(model(), e)["x"] == pytest.approx(np.sqrt(12.5))


def test_the_squares_of_all_segments_make_the_mean_square(monkeypatch: pytest.MonkeyPatch) -> None:
    e = still({"x": 1e-9}).with_restarts(0.05)
    drawn = {c: np.linspace(0.0, 1.0, e.time.size) for c in e.channels}
    monkeypatch.setattr(expected_error, "iterate_deviations", lambda *_: iter([drawn, drawn]))
    found = expected_error.expected_error(model(), e)
    assert found.squares["x"].shape == (2, e.restarts.size)
    assert found.squares["x"].sum(axis=1) == pytest.approx(np.mean(drawn["x"] ** 2))
    assert found.relative_squares("x").size == 2 * e.restarts.size
    assert found.relative_squares("x").mean() == pytest.approx(1.0)
    assert np.all(np.diff(found.squares["x"][0, :-1]) > 0.0)  # the deviation grows over the recording


def test_the_velocity_errs_by_its_smoothed_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    e = still({})
    inputs = e.inputs.copy()
    inputs[:, at.IN_V] += 0.3
    assert noise_propagation._reading_noise(e, "v", {}, inputs) == pytest.approx(np.full(e.time.size, 0.3))
    assert noise_propagation._reading_noise(e, "x", {"x": np.ones(3)}, inputs).tolist() == [1.0, 1.0, 1.0]
