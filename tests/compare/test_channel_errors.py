"""Figures of merit by their definitions (interface, section 3), and the regions of errors."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.compare import Comparison, channel_errors, expected_error, find_error_regions, overall_error
from pneucli.compare.channel_errors import DEFAULT_SHARE, ChannelResult, assess_purpose, compare
from pneucli.compare.expected_error import ErrorDistribution, ExpectedError, combined_distribution
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate import outputs
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid

TIME = 1e-3 * np.arange(2000)
X = 0.1 + 0.05 * np.sin(2 * np.pi * (TIME + 0.0005))
TURNS = [249, 250, 749, 750, 1249, 1250, 1749, 1750]  # its velocity changes sign between two samples
RIG = Rig(piston_area_1=1e-3, piston_area_2=1e-3, moving_mass=2.0, stroke=0.2)


def comparison(error: np.ndarray, noise: float = 1.0) -> Comparison:
    """A given motion whose measured force is ``error`` beyond what the model needs: no friction, a mass of 2 kg."""
    motion = prepare(recording(np.zeros(TIME.size)), RIG, None)
    model = Model(RIG, (), {"friction.coulomb": 0.0, "friction.viscous": 0.0})
    needed = compare(model, motion, {"force": 1.0}).modelled["force"]
    return compare(model, prepare(recording(needed + error), RIG, None), {"force": noise})


def with_limit(found: Comparison, limit: float) -> Comparison:
    """The same comparison, whose channels would be within a limit for a correct model."""
    return replace(found, results=tuple(replace(r, ratio_limit=limit) for r in found.results))


def recording(force: np.ndarray) -> Recording:
    noise = {"x": NoiseModel(1e-7), "force": NoiseModel(1.0)}
    return Recording("given", "friction", "test", TIME, {"x": X, "force": force}, noise, "open", "motion")


def test_figures_follow_their_definitions() -> None:
    """Over all samples but those beside the four turns of the motion."""
    error = np.random.default_rng(0).standard_normal(TIME.size)
    found = comparison(error, noise=2.0)
    (r,) = found.results
    seen = ~np.isnan(found.measured["force"])
    y, model = found.measured["force"][seen], found.modelled["force"][seen]
    assert np.flatnonzero(~seen).tolist() == TURNS
    assert y - model == pytest.approx(error[seen], abs=1e-9)
    assert r.rmsd == pytest.approx(np.sqrt(np.mean(error[seen] ** 2)))
    assert r.percent == pytest.approx(100 * r.rmsd / np.ptp(y))
    assert r.relative_error_percent == pytest.approx(100 * np.linalg.norm(y - model) / np.linalg.norm(y))
    assert r.fit_percent == pytest.approx(100 * (1 - np.linalg.norm(y - model) / np.linalg.norm(y - y.mean())))
    assert r.ratio_to_noise == pytest.approx(r.rmsd / 2.0)
    assert r.unit == "N"
    of_segments = replace(found, experiment=found.experiment.with_restarts(0.5)).segment_squares["force"]
    assert of_segments.size == 4
    assert np.sum(of_segments) == pytest.approx(r.rmsd**2)
    assert of_segments[2] == pytest.approx(np.sum((y - model)[1000 - 4 : 1500 - 6] ** 2) / seen.sum())


def test_the_overall_error_is_the_root_mean_square_of_a_use() -> None:
    def result(use: str, ratio: float) -> ChannelResult:
        return ChannelResult("r", use, "x", "m", 1.0, 1.0, 1.0, 1.0, 1.0, ratio, 1.0)

    found = [result("train", 3.0), result("train", 4.0), result("train", float("nan"))]
    assert overall_error(found, "train") == pytest.approx(np.sqrt(12.5))
    assert overall_error(found, "test") is None


def test_the_region_of_an_error_is_found_in_its_own_signal() -> None:
    """Five noises between 0.12 and 0.13 m, in both directions: x names it, though v sees it too."""
    error = np.random.default_rng(2).standard_normal(TIME.size)
    bumpy = (X > 0.12) & (X < 0.13)
    error[bumpy] += 5.0
    regions = find_error_regions([comparison(error)])
    worst = regions[0]
    assert (worst.signal, worst.channel, worst.recording, worst.unit) == ("x", "force", "given", "m")
    assert worst.from_ == pytest.approx(0.12, abs=0.006)
    assert worst.to == pytest.approx(0.13, abs=0.006)
    assert worst.share_of_samples == pytest.approx(bumpy.mean(), abs=0.06)
    share = bumpy.mean()
    assert worst.share_of_error == pytest.approx(26 * share / (25 * share + 1), abs=0.05)  # 1 of noise, 25 on top


def test_noise_has_no_region() -> None:
    error = np.random.default_rng(4).standard_normal(TIME.size)
    assert find_error_regions([comparison(error)]) == []
    assert find_error_regions([comparison(2.0 * error)]) == []  # too much, but nowhere in particular


def test_one_error_over_several_signals_is_one_event() -> None:
    error = np.random.default_rng(3).standard_normal(TIME.size)
    first, second = (TIME > 0.3) & (TIME < 0.4), (TIME > 1.5) & (TIME < 1.52)
    one = find_error_regions([comparison(error + 9.0 * first)])
    assert len(one) > 2
    assert {r.event for r in one} == {0}
    other = comparison(error + 30.0 * second)
    renamed = replace(other.results[0], recording="another")
    both = find_error_regions([comparison(error + 9.0 * first), replace(other, results=(renamed,))])
    assert {r.event for r in both if r.recording == "given"}.isdisjoint(
        r.event for r in both if r.recording == "another"
    )
    assert both[0].event == 0


# --- good enough for whom: errors against tolerances, stated or a share of the measured range


def result(channel: str, rmsd: float, span: float, use: str = "test", recording: str = "run") -> ChannelResult:
    return ChannelResult(recording, use, channel, "m", rmsd, 1.0, 1.0, 99.0, 1e-6, rmsd / 1e-6, span)


def test_a_stated_tolerance_decides() -> None:
    results = [result("x", 2e-4, 0.1), result("v", 0.01, 1.0)]
    tight, loose = (assess_purpose(results, {"x": x, "v": 0.02}) for x in (1e-4, 3e-4))
    assert tight is not None
    assert loose is not None
    assert (tight.adequate, tight.worst.channel, tight.worst.value, tight.worst.tolerance) == (False, "x", 2e-4, 1e-4)
    assert (loose.adequate, loose.worst.channel) == (True, "x")


def test_without_a_tolerance_a_share_of_the_largest_range_is_taken() -> None:
    results = [result("x", 2e-3, 0.01, recording="short"), result("x", 2e-3, 0.1, recording="long")]
    found = assess_purpose(results, {})
    assert found is not None
    assert found.adequate
    assert found.worst.tolerance == pytest.approx(DEFAULT_SHARE * 0.1)


def test_test_recordings_decide_where_there_are_any() -> None:
    fitted, held_out = result("x", 1e-6, 0.1, use="train"), result("x", 0.09, 0.1)
    alone, both = assess_purpose([fitted], {}), assess_purpose([fitted, held_out], {})
    assert alone is not None
    assert both is not None
    assert alone.adequate
    assert not both.adequate


def test_a_channel_that_never_moves_and_has_no_tolerance_does_not_decide() -> None:
    assert assess_purpose([result("x", 1e-6, 0.0)], {}) is None
    assert assess_purpose([result("x", np.nan, 0.1)], {}) is None
    assert assess_purpose([], {}) is None


# --- the distribution of the error of a correct model


SEGMENTS, DRAWS = 30, 6


def expected(rng: np.random.Generator, recordings: int, channels: int = 1) -> list[ExpectedError]:
    """Recordings whose segments have the square of one normal number, common to all channels of a recording."""
    names = [f"p{i}" for i in range(channels)]
    squares = [rng.standard_normal((DRAWS, SEGMENTS)) ** 2 for _ in range(recordings)]
    population = np.concatenate([one.ravel() for one in squares])
    return [
        ExpectedError(dict.fromkeys(names, 1.0), dict.fromkeys(names, one), dict.fromkeys(names, population))
        for one in squares
    ]


def distribution(rows: list[ExpectedError]) -> ErrorDistribution:
    found = combined_distribution([(one.distribution(list(one.rms)), len(one.rms)) for one in rows])
    assert found is not None
    return found


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("tail", [0.05, 0.01])
def test_so_many_correct_models_stay_below_their_limit(channels: int, tail: float) -> None:
    rng = np.random.default_rng(5)
    below = []
    for _ in range(1000):
        one = distribution(expected(rng, 2, channels))
        error = float(np.sqrt(np.mean(rng.standard_normal(2 * SEGMENTS) ** 2)))
        assert (error < one.limit(tail)) == (one.p_value(error) > tail)
        below.append(error < one.limit(tail))
    assert np.mean(below) == pytest.approx(1.0 - tail, abs=0.02)


def test_few_segments_leave_a_wider_limit_than_many() -> None:
    rng = np.random.default_rng(6)
    few, many = (distribution(expected(rng, n)) for n in (1, 20))
    assert few.limit() > 1.25 > many.limit() > 1.0


def test_the_scatter_of_a_recording_without_a_break_away_is_that_of_all_of_its_kind() -> None:
    """A calm recording draws nothing of what happens to it in one segment of a hundred."""
    calm, other = np.full((DRAWS, SEGMENTS), 0.5), np.full((DRAWS, SEGMENTS), 0.5)
    other[0, 0] = 100.0
    population = np.concatenate([calm.ravel(), other.ravel()])
    one = ExpectedError({"x": 1.0}, {"x": calm}, {"x": population})
    assert one.distribution(["x"]).limit() > 1.2
    assert one._replace(population={"x": calm.ravel()}).distribution(["x"]).limit() == pytest.approx(0.5**0.5)


def test_uncertain_parameters_add_one_squared_normal_number() -> None:
    rng = np.random.default_rng(7)
    one = ErrorDistribution(1.0, 0.02).with_uncertain_parameters(3.0)
    noise = 0.01 * rng.chisquare(100.0, 20_000)
    errors = np.sqrt(noise + 3.0 * rng.standard_normal(20_000) ** 2)
    assert np.mean(errors > one.limit(0.05)) == pytest.approx(0.05, abs=0.015)


def test_an_error_within_the_limit_of_a_correct_model_has_no_region() -> None:
    error = np.random.default_rng(7).standard_normal(2000)
    error[900:1000] *= 8.0
    found = comparison(error)
    assert find_error_regions([found])
    assert not find_error_regions([with_limit(found, 1.01 * found.results[0].ratio_to_noise)])


# --- figures of a channel where something is missing, and the noise of a correct model over several recordings


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
    drawn = outputs.sample_deviations(model(), e, draws=5)
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
