"""Laws of one signal: found over their own, on what was left out, beside what the model can do itself."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import spline_regression
from pneucli.diagnose.spline_regression import KNOTS, SmoothTerm, SplineRegression, linear_bspline_basis
from pneucli.identify.residuals import ForceBalance
from pneucli.identify.residuals.base import DiscrepancyTerm
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid

TIME = time_grid(6.0)
Force = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def runs(number: int = 3) -> list[ForceBalance]:
    """Balances of forces of motions that differ in pace, and wander over the whole stroke; noise of 1 N."""
    return [run(phase) for phase in range(number)]


def run(phase: float, time: np.ndarray = TIME) -> ForceBalance:
    """One of them."""
    pace = 2.1 + 0.3 * phase
    x = 0.1 + 0.06 * np.sin(pace * time + phase) + 0.03 * np.sin(3.7 * time - phase)
    v = 0.06 * pace * np.cos(pace * time + phase) + 0.111 * np.cos(3.7 * time - phase)
    p1 = 3e5 + 5e4 * np.sin(1.3 * time + 2.0 * phase) + 2e4 * np.sin(5.3 * time)
    residual_model = ForceBalance(make_experiment("friction", time, {"x": x, "v": v, "p1": p1}))
    residual_model.__dict__.update(noise={"force": 1.0}, channels=("force",))
    return residual_model


def left_by(
    residual_models: Sequence[ForceBalance], force: Force, seed: int = 1, noise: float = 1.0
) -> list[np.ndarray]:
    """What a force of (x, v, time) leaves over in each view, beside noise."""
    rng, left = np.random.default_rng(seed), []
    for residual_model in residual_models:
        e = residual_model.experiment
        left.append(force(e.raw["x"], e.raw["v"], e.time) + noise * rng.standard_normal(e.time.size))
    return left


def fitted(left: Sequence[np.ndarray], own: Sequence[np.ndarray] = ()) -> Any:
    """A fit with its ``own`` derivatives that leaves so much over."""
    residual = np.concatenate(left)
    jacobian = np.concatenate(own, axis=0) if own else np.zeros((residual.size, 0))
    return SimpleNamespace(
        model=model(), residual=residual, jacobian=jacobian, initial_state_sensitivities=[{}] * len(left)
    )


def rival(
    residual_models: Sequence[ForceBalance], left: Sequence[np.ndarray], own: Sequence[np.ndarray] = ()
) -> tuple[Any, SplineRegression]:
    """The same fit, its residuals in blocks of 0.25 s, and its channel."""
    fit = fitted(left, own)
    fit.blocks = np.arange(fit.residual.size) // 250
    return fit, SplineRegression(fit, residual_models, ForceBalance, "force")


def ranked(
    residual_models: Sequence[ForceBalance], left: Sequence[np.ndarray], own: Sequence[np.ndarray] = ()
) -> list[SmoothTerm]:
    """The laws of what is left, the best first."""
    fit = fitted(left, own)
    return SplineRegression(fit, residual_models, ForceBalance, "force").ranked_terms(fit)


def best(residual_models: Sequence[ForceBalance], left: Sequence[np.ndarray]) -> SmoothTerm:
    """The law that explains most."""
    return ranked(residual_models, left)[0]


def simple(
    residual_models: Sequence[ForceBalance], left: Sequence[np.ndarray], own: Sequence[np.ndarray], signal: str
) -> str | None:
    """The simple course of a force of a signal."""
    fit = fitted(left, own)
    channel = SplineRegression(fit, residual_models, ForceBalance, "force")
    return channel.simplest_shape(
        fit, next(w for w in channel.ranked_terms(fit) if (w.signal, w.acts_as) == (signal, "force"))
    )


def cogging(x: np.ndarray, v: np.ndarray, time: np.ndarray) -> np.ndarray:
    """A force with a pitch of 30 mm, of 5 N."""
    return 5.0 * np.sin(2.0 * np.pi * x / 0.03)


def rubbing(x: np.ndarray, v: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Dry friction that grows by 10 N over the stroke."""
    return np.sign(v) * 10.0 * (x / 0.2)


def running_in(x: np.ndarray, v: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Dry friction that starts 8 N higher, and loses that with a time constant of 2 s."""
    return np.sign(v) * 8.0 * np.exp(-time / 2.0)


def warming(x: np.ndarray, v: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Viscous friction that falls by 40 N s/m over 6 s."""
    return 40.0 * v * (1.0 - time / 6.0)


def drag(x: np.ndarray, v: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Drag with the square of the velocity: 10 N at 0.2 m/s."""
    return 250.0 * v * np.abs(v)


@pytest.mark.parametrize(
    ("force", "signal", "ways"),
    [
        (cogging, "x", {"force"}),
        (rubbing, "x", {"dry friction"}),
        (running_in, "time", {"dry friction"}),
        (warming, "time", {"viscous friction"}),
        (drag, "v", {"force", "dry friction", "viscous friction"}),  # of the velocity these are one
    ],
)
def test_a_smooth_term_is_found_over_its_signal_and_quantity(force: Force, signal: str, ways: set[str]) -> None:
    residual_models = runs()
    found = best(residual_models, left_by(residual_models, force))
    assert found.signal == signal
    assert found.acts_as in ways


def test_its_share_is_that_of_the_squares_that_are_no_noise() -> None:
    """5 N of amplitude beside 1 N rms: 12.5 of 13.5, which 60 coefficients for 18,000 samples hardly change."""
    residual_models = runs()
    assert best(residual_models, left_by(residual_models, cogging)).share == pytest.approx(12.5 / 13.5, abs=0.02)


def test_its_values_are_the_force() -> None:
    """To 0.5 N in the middle of the range: 250 samples a knot with 1 N of noise, and a sine of 8 knots a cycle."""
    residual_models = runs()
    found = best(residual_models, left_by(residual_models, cogging))
    x = np.linspace(found.low, found.high, KNOTS)[5:-5]
    assert found.values[5:-5] == pytest.approx(cogging(x, x, x), abs=0.5)


def test_noise_has_no_smooth_term() -> None:
    residual_models = runs()
    for seed in range(5):
        assert best(residual_models, left_by(residual_models, lambda x, v, t: 0.0 * x, seed)).share < 0.005


def test_a_function_that_differs_between_recordings_explains_nothing() -> None:
    """Of one sign in two of them, of the other in the third: it explains nothing of one that was left out."""
    residual_models = runs()
    left = left_by(residual_models, cogging)
    left[1] = -left[1]
    found = [law for law in ranked(residual_models, left) if law.signal == "x"]
    assert all(law.share < 0.2 for law in found)


def test_the_adjustment_of_the_model_is_excluded() -> None:
    """What its own dry and viscous friction have taken of a force of the pressure is seen through."""
    residual_models = runs()
    left = left_by(residual_models, lambda x, v, t: 0.0 * x)
    left = [r + 2e-9 * (v.experiment.raw["p1"] - 3e5) ** 2 for r, v in zip(left, residual_models, strict=True)]
    own = [np.column_stack([np.sign(v.experiment.raw["v"]), v.experiment.raw["v"]]) for v in residual_models]
    design, target = np.concatenate(own), np.concatenate(left)
    target = target - design @ np.linalg.lstsq(design, target, rcond=None)[0]
    law = ranked(residual_models, np.split(target, len(residual_models)), own)[0]
    assert (law.signal, law.acts_as) == ("p1", "force")
    assert simple(residual_models, np.split(target, len(residual_models)), own, "p1") == "parabola"


def test_a_single_recording_is_held_out_by_quarters() -> None:
    """A force that comes once, in the first quarter, is of no signal; one that comes back is."""
    residual_model = run(0.0)
    once = left_by([residual_model], lambda x, v, t: np.where(t < 1.5, cogging(x, v, t), 0.0))
    assert best([residual_model], once).share < 0.2
    assert best([residual_model], left_by([residual_model], cogging)).share > 0.8


def test_zero_residuals_carry_no_information() -> None:
    """Zeros of a residual stand for that: they are no readings in which nothing acted."""
    residual_models = runs()
    left = [
        np.where(v.experiment.time % 0.4 < 0.2, 0.0, r)
        for r, v in zip(left_by(residual_models, cogging), residual_models, strict=True)
    ]
    found = best(residual_models, left)
    x = np.linspace(found.low, found.high, KNOTS)[8:-8]
    assert (found.signal, found.share) == ("x", pytest.approx(12.5 / 13.5, abs=0.02))
    assert found.values[8:-8] == pytest.approx(cogging(x, x, x), abs=0.7)


def test_long_recordings_are_thinned(monkeypatch: pytest.MonkeyPatch) -> None:
    residual_models = runs()
    whole = best(residual_models, left_by(residual_models, cogging))
    monkeypatch.setattr(spline_regression, "MAX_SAMPLES", 3000)
    few = best(residual_models, left_by(residual_models, cogging))
    assert (few.signal, few.acts_as) == (whole.signal, whole.acts_as)
    assert few.share == pytest.approx(whole.share, abs=0.02)


@pytest.mark.parametrize(
    ("force", "words"),
    [
        (lambda x, v, t: 0.0 * x + 4.0, "constant"),
        (lambda x, v, t: 100.0 * (x - 0.1), "line"),
        (lambda x, v, t: 3000.0 * (x - 0.1) ** 2, "parabola"),
        (cogging, None),
    ],
)
def test_a_simple_shape_replaces_an_equal_spline(force: Force, words: str | None) -> None:
    residual_models = runs()
    assert simple(residual_models, left_by(residual_models, force), (), "x") == words


def test_a_signal_of_nan_has_no_smooth_term() -> None:
    """Such as the pressure ratio at a valve that was never opened."""
    residual_models = runs()
    for residual_model in residual_models:
        residual_model.experiment.raw["u"] = np.zeros(TIME.size)
        residual_model.experiment.raw["p1"] = np.full(TIME.size, 3e5)
    assert "p_ratio" not in {law.signal for law in ranked(residual_models, left_by(residual_models, cogging))}


def test_a_simple_shape_has_few_coefficients() -> None:
    residual_models = runs()
    fit, channel = rival(residual_models, left_by(residual_models, lambda x, v, t: 100.0 * (x - 0.1)))
    law = next(one for one in channel.ranked_terms(fit) if (one.signal, one.acts_as) == ("x", "force"))
    line = next(one for one in channel.simple_terms(fit, law) if one.simple_shape == "line")
    assert (line.signal, line.acts_as, line.basis.shape) == ("x", "force", (2, KNOTS))
    x = np.linspace(line.low, line.high, KNOTS)
    assert line.values == pytest.approx(100.0 * (x - 0.1), abs=0.3)  # 3000 readings of 1 N and more


# --- splines


def test_splines_sum_to_one_and_keep_straight_lines() -> None:
    place = np.linspace(-0.1, 1.1, 1001)
    made = linear_bspline_basis(place)
    assert made.shape == (KNOTS, place.size)
    assert made.sum(axis=0) == pytest.approx(1.0)
    assert np.linspace(0.0, 1.0, KNOTS) @ made == pytest.approx(np.clip(place, 0.0, 1.0))


def test_nan_samples_have_no_response() -> None:
    assert np.all(linear_bspline_basis(np.array([np.nan, 0.5]))[:, 0] == 0.0)


def test_a_modelled_signal_replaces_the_measured_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """It errs over what the model reads, here the position a quarter of a second late, not over what was measured."""
    residual_models = runs()
    late = {id(residual_model): np.roll(residual_model.experiment.raw["x"], 250) for residual_model in residual_models}

    def lacking(residual_model: ForceBalance, *_: object) -> list[DiscrepancyTerm]:
        return [
            DiscrepancyTerm("error of its sensor", "m", np.ones(TIME.size), lambda q: q, "x", late[id(residual_model)])
        ]

    monkeypatch.setattr(ForceBalance, "discrepancy_terms", lacking)
    left = [cogging(x, x, x) + np.random.default_rng(1).standard_normal(TIME.size) for x in late.values()]
    (law,) = ranked(residual_models, left)
    assert law.signal == "x"
    assert law.share == pytest.approx(12.5 / 13.5, abs=0.02)
