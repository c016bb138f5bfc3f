"""The fit: what it minimises, its intervals, its blocks, and how a part of it is joined to the rest."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pneucli.identify.estimation import model_fit
from pneucli.identify.estimation.blocks import block_labels, group_scores
from pneucli.identify.estimation.fit import Fit, fit, merge_partial_fit
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import FreeParameter, base_parameters, with_prior_knowledge
from pneucli.identify.residuals import ChamberPressures, ForceBalance, FreeRun, ImposedMotion
from pneucli.messages.formatting import format_figure
from pneucli.recording import ParameterPrior
from pneucli.simulate.model import parameter_value
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages.answer_parts import figures_of
from tests.simulate.synthetic_experiments import RIG, make_experiment, model, time_grid

RNG = np.random.default_rng
N = 2000
TIME = 1e-3 * np.arange(N)
WAVES = {"x": np.sin(TIME * 3.0), "a": np.cos(TIME * 7.0)}


class Line:
    """A view whose channels are a wave times Coulomb friction, and one times viscous friction, plus noise of 2."""

    name = "a line"
    is_simulated = True
    weights: dict[str, float] = {}  # noqa: RUF012 - never changed in place

    def __init__(
        self, channels: tuple[str, ...] = ("x", "a"), seed: int = 1, noise: float = 2.0, coulomb: float = 15.0
    ) -> None:
        self.channels = channels
        self.experiment = SimpleNamespace(time=TIME)
        self.noise = dict.fromkeys(channels, noise)
        rng = RNG(seed)
        truth = {"x": coulomb, "a": 40.0}
        self.measured = {c: truth[c] * WAVES[c] + noise * rng.standard_normal(N) for c in channels}

    def is_sensitive_to(self, effect: Any) -> bool:
        return False

    def differs(self, one: Any, other: Any) -> bool:
        names = {"x": "friction.coulomb", "a": "friction.viscous"}
        return any(one.values[names[c]] != other.values[names[c]] for c in self.channels)

    def differentiable(self, directions: Any) -> np.ndarray:
        return np.zeros(len(directions.steps), dtype=bool)

    def initial_state_sensitivity(self, model: Any) -> dict[str, np.ndarray]:
        return {}

    def residual(self, model: Any, errors: Any = None) -> dict[str, np.ndarray]:
        values = {"x": model.values["friction.coulomb"], "a": model.values["friction.viscous"]}
        return {c: self.measured[c] - values[c] * WAVES[c] for c in self.channels}


COULOMB = FreeParameter("friction.coulomb", "N", 10.0, 0.0, 1e3, 10.0)
VISCOUS = FreeParameter("friction.viscous", "N s/m", 50.0, 0.0, 1e3, 25.0)


def fitted(*free: FreeParameter, views: Any = None, **values: float) -> Fit:
    return fit(model(values={"friction.coulomb": 10.0, "friction.viscous": 50.0, **values}), views or [Line()], free)


def test_a_linear_problem_is_solved_by_least_squares_with_its_standard_errors() -> None:
    """Noise of 2 over waves of power N / 2: 2 / sqrt(N / 2)."""
    found = fitted(COULOMB, VISCOUS)
    (line,) = [Line()]
    for name, channel in (("friction.coulomb", "x"), ("friction.viscous", "a")):
        wave = WAVES[channel]
        best = float(wave @ line.measured[channel] / (wave @ wave))
        error = 2.0 / np.linalg.norm(wave)
        estimate = found[name]
        assert estimate.value == pytest.approx(best, rel=1e-6)
        assert estimate.error == pytest.approx(error, rel=0.6)  # from eight blocks
        low, high = estimate.ci95
        assert high - low == pytest.approx(2 * 1.959964 * estimate.error, rel=1e-6)
        assert low < best < high
        assert not estimate.at_bound
        assert found.model.values[name] == estimate.value
    assert (found["friction.coulomb"].unit, found["friction.viscous"].unit) == ("N", "N s/m")
    assert found.cost == pytest.approx(float(found.residual @ found.residual))
    assert np.std(found.residual) == pytest.approx(1.0, rel=0.05)


def test_standard_errors_are_those_of_many_data_sets() -> None:
    found = [fitted(COULOMB, views=[Line(("x",), seed)])["friction.coulomb"] for seed in range(60)]
    spread = np.std([f.value for f in found])
    assert np.mean([f.error for f in found]) == pytest.approx(spread, rel=0.3)


def test_residuals_and_derivatives_are_in_units_of_noise_and_of_the_scale() -> None:
    found = fitted(COULOMB, VISCOUS)
    assert found.residual.shape == (2 * N,)
    assert found.jacobian == pytest.approx(
        np.vstack([np.column_stack([-5.0 * WAVES["x"], 0 * TIME]), np.column_stack([0 * TIME, -12.5 * WAVES["a"]])]),
        abs=1e-6,
    )
    assert found.covariance.shape == (2, 2)
    assert found.initial_state_sensitivities == [{}]


def test_a_logarithmic_parameter_has_an_interval_that_is_a_factor() -> None:
    found = fitted(replace(COULOMB, logarithmic=True, lower=1e-3), VISCOUS)["friction.coulomb"]
    linear = fitted(COULOMB, VISCOUS)["friction.coulomb"]
    assert found.value == pytest.approx(linear.value, rel=1e-4)
    assert found.error == pytest.approx(linear.error, rel=1e-2)
    assert found.ci95[1] / found.value == pytest.approx(found.value / found.ci95[0])


@pytest.mark.parametrize(("bounds", "value"), [((0.0, 12.0), 12.0), ((20.0, 1e3), 20.0)])
def test_a_parameter_at_a_bound_is_marked(bounds: tuple[float, float], value: float) -> None:
    found = fitted(replace(COULOMB, start=15.0, lower=bounds[0], upper=bounds[1]))["friction.coulomb"]
    assert found.value == pytest.approx(value)
    assert found.at_bound


@pytest.mark.parametrize(
    ("bounds", "limits", "shown"),
    [
        ((0.0, 12.0), (False, False), "at least 9.6 N"),
        ((20.0, 1e3), (False, False), "at most 24 N"),
        ((0.0, 12.0), (False, True), "12.0 (9.6 to 12.0) N"),  # the user says that there is no more
        ((20.0, 1e3), (True, False), "20.0 (20.0 to 24.1) N"),
    ],
)
def test_an_estimate_at_the_end_of_the_search_is_at_least_or_at_most_that(
    bounds: tuple[float, float], limits: tuple[bool, bool], shown: str
) -> None:
    """15 N are fitted between other bounds."""
    free = replace(COULOMB, start=15.0, lower=bounds[0], upper=bounds[1])
    found = fitted(replace(free, lower_is_limit=limits[0], upper_is_limit=limits[1]))["friction.coulomb"]
    assert format_figure(found.figure) == shown


@settings(max_examples=40, deadline=None)
@given(truth=st.floats(1.0, 25.0), lower=st.floats(0.5, 20.0), width=st.floats(2.0, 20.0))
def test_an_answer_at_a_bound_of_the_search_says_so(truth: float, lower: float, width: float) -> None:
    upper = lower + width
    assume(min(abs(truth - lower), abs(truth - upper)) > 0.5)  # 8 standard errors
    free = replace(COULOMB, start=lower + 0.5 * width, lower=lower, upper=upper)
    found = fitted(free, views=[Line(coulomb=truth)])["friction.coulomb"]
    (figure,) = figures_of([found]).values()
    text = format_figure(figure)
    said = "at most" if truth < lower else "at least" if truth > upper else ""
    assert text.startswith(said)
    assert ("at " in text) == found.at_bound == bool(said)
    assert [not math.isfinite(end) for end in (figure.low, figure.high)] == [said == "at most", said == "at least"]


def test_sizes_of_zero_and_estimates_between_the_bounds_have_closed_intervals() -> None:
    zero = fitted(replace(COULOMB, start=1.0, upper=1e3), views=[Line(coulomb=-5.0)])
    for one in (zero["friction.coulomb"], fitted(COULOMB)["friction.coulomb"]):
        assert (one.figure.low, one.figure.high) == one.ci95


def test_what_is_known_of_a_parameter_limits_it() -> None:
    """A bound of [model.parameters], of the exponent of a gas, and of an overlap; not that of a mass."""
    stated = replace(RIG, priors={"rig.moving_mass": ParameterPrior("kg", upper=3.0)}, moving_mass=None)
    (free,) = with_prior_knowledge([FreeParameter("rig.moving_mass", "kg", 1.0, 1e-3, 1e3, 1.0)], stated)
    assert (free.lower_is_limit, free.upper, free.upper_is_limit) == (False, 3.0, True)
    axis = make_experiment("axis", time_grid(1.0), {"u": 5.0})
    gas = replace(model(), rig=replace(RIG, exponent_free=True, moving_mass=None))
    known = {f.name: (f.lower_is_limit, f.upper_is_limit) for f in base_parameters(gas, [axis])}
    assert known["rig.polytropic_exponent"] == (True, True)
    assert known["rig.moving_mass"] == known["friction.coulomb"] == (False, False)


def test_a_prior_draws_toward_the_start() -> None:
    """As tight as the data: half the way."""
    wave = WAVES["x"]
    tight = 2.0 / np.linalg.norm(wave) / 10.0
    free, known = fitted(COULOMB)["friction.coulomb"], fitted(replace(COULOMB, prior_sigma=tight))["friction.coulomb"]
    assert known.value == pytest.approx(0.5 * (10.0 + free.value), rel=1e-3)


def test_without_free_parameters_the_model_is_what_it_was() -> None:
    found = fitted()
    assert found.estimates == ()
    assert found.jacobian.shape == (2 * N, 0)
    assert found.covariance.shape == (0, 0)
    assert found.residual[:N] == pytest.approx((Line().measured["x"] - 10.0 * WAVES["x"]) / 2.0)
    assert found.cost == pytest.approx(float(found.residual @ found.residual))
    with pytest.raises(StopIteration):
        found["friction.coulomb"]


def test_what_the_parameters_can_do_is_taken_out_of_a_change() -> None:
    found = fitted(COULOMB, VISCOUS)
    rng = RNG(3)
    change = rng.standard_normal(2 * N)
    rest = found.project_out_nuisance(change)
    assert found.jacobian.T @ rest == pytest.approx(np.zeros(2), abs=1e-8)
    assert rest == pytest.approx(change - found.jacobian @ np.linalg.lstsq(found.jacobian, change, rcond=None)[0])
    assert found.projected_residual == pytest.approx(found.project_out_nuisance(found.residual))
    assert found.inverse_hessian @ (found.jacobian.T @ found.jacobian) == pytest.approx(np.eye(2), abs=1e-8)


def test_a_held_parameter_explains_nothing_of_a_change() -> None:
    columns, held = RNG(4).normal(size=(60, 3)), np.array([False, True, False])
    found = replace(fitted(COULOMB, VISCOUS), jacobian=columns)
    inverse = found.inverse_hessian_holding(held)
    assert not inverse[held].any()
    assert not inverse[:, held].any()
    left = found.project_out_nuisance(columns[:, 1], inverse)
    assert np.max(np.abs(columns[:, ~held].T @ left)) < 1e-12 < np.max(np.abs(left))
    assert np.max(np.abs(found.project_out_nuisance(columns[:, 1]))) < 1e-12
    moved = found.with_derivatives(np.asfortranarray(columns))
    np.testing.assert_array_equal(moved.curvature, found.curvature)


# --- blocks


def view_of(seconds: float, channels: int = 1, rate: float = 1e3) -> Any:
    time = 5.0 + np.arange(round(seconds * rate)) / rate
    return SimpleNamespace(experiment=SimpleNamespace(time=time), channels=("p1", "p2", "x")[:channels])


def test_a_block_is_a_quarter_of_a_second_of_all_channels() -> None:
    numbers = block_labels([view_of(1.0, 2)])
    assert numbers.tolist() == [*np.repeat([0, 1, 2, 3], 250)] * 2


def test_a_long_recording_has_forty_blocks_and_a_few() -> None:
    numbers = block_labels([view_of(100.0)])
    assert numbers.max() == 40
    assert np.bincount(numbers)[:40].tolist() == [2500] * 40 or abs(np.bincount(numbers)[0] - 2500) <= 1


def test_residual_models_do_not_share_blocks() -> None:
    numbers = block_labels([view_of(0.5), view_of(0.5, 2)])
    assert numbers.tolist() == [*np.repeat([0, 1], 250), *np.repeat([2, 3], 250), *np.repeat([2, 3], 250)]


def test_scores_of_a_block_add_up_before_they_are_squared() -> None:
    """Residuals 1, 1 and 1, -1 with derivatives 1 and 2: scores (2, 4) and (0, 0)."""
    scored = group_scores(np.tile([[1.0, 2.0]], (4, 1)), np.array([1.0, 1.0, 1.0, -1.0]), np.array([0, 0, 1, 1]))
    assert (scored.T @ scored).tolist() == [[4.0, 8.0], [8.0, 16.0]]


def test_a_block_may_come_back_and_another_be_empty() -> None:
    """Channels follow one another, each through the blocks anew."""
    scored = group_scores(np.ones((5, 1)), np.array([1.0, 2.0, 4.0, 8.0, 16.0]), np.array([0, 2, 2, 0, 2]))
    assert scored.tolist() == [[9.0], [0.0], [22.0]]


# --- which views are run


E = make_experiment("axis", time_grid(0.1), {"u": 4.0, "p1": 3e5, "p2": 3e5, "x": 0.1})


@pytest.mark.parametrize(
    ("kind", "changed", "differs"),
    [
        (ChamberPressures, "friction.coulomb", False),
        (ForceBalance, "friction.coulomb", True),
        (FreeRun, "friction.viscous", True),
        (ChamberPressures, "rig.dead_volume_1", True),
        (ForceBalance, "rig.moving_mass", True),
        (ChamberPressures, "valve.critical_ratio", True),
        (ForceBalance, "valve.critical_ratio", False),
        (ImposedMotion, "friction.viscous", True),
        (ImposedMotion, "valve.critical_ratio", False),
    ],
)
def test_only_sensitive_residual_models_are_evaluated(kind: Any, changed: str, differs: bool) -> None:
    known = model(values={changed: 1.0})
    assert kind(E).differs(known, known.with_values({changed: 1.1})) == differs
    assert not kind(E).differs(known, known)


@pytest.mark.parametrize(
    ("kind", "most", "differs"),
    [(ChamberPressures, 6.0, True), (FreeRun, 6.0, True), (ForceBalance, 6.0, False), (ChamberPressures, 4.0, False)],
)
def test_a_change_of_the_valve_matters_only_where_its_openings_pass(kind: Any, most: float, differs: bool) -> None:
    """A knot at 10 V bends the area from 5 V on, the second knot below; one recording opens that far."""
    valve = ValveArea((-10.0, -5.0, 2.0, 5.0, 7.0, 10.0), (2e-6, 1e-6, 2e-7, 1e-6, 1.4e-6, 2e-6))
    known = replace(model(), valve=valve)
    grown = replace(known, valve=replace(valve, areas=(*valve.areas[:-1], 2.2e-6)))
    seen = make_experiment("axis", time_grid(0.1), {"u": np.linspace(-most, most, 101), "p1": 3e5, "p2": 3e5, "x": 0.1})
    assert kind(seen).differs(known, grown) == differs


def test_an_effects_parameter_changes_the_residuals_that_the_effect_changes() -> None:
    known = model(["stribeck"], {"stribeck.static": 20.0, "stribeck.velocity": 0.01})
    other = known.with_values({"stribeck.static": 21.0})
    assert ForceBalance(E).differs(known, other)
    assert not ChamberPressures(E).differs(known, other)


# --- differences


def problem(*free: FreeParameter) -> LeastSquaresProblem:
    return LeastSquaresProblem(model(values={"friction.coulomb": 10.0, "friction.viscous": 50.0}), [Line()], free)  # type: ignore[list-item]


@pytest.mark.parametrize("free", [replace(COULOMB, upper=10.0005), replace(COULOMB, step=0.05), COULOMB])
def test_any_difference_gives_the_derivative_of_a_line(free: FreeParameter) -> None:
    p = problem(free)
    assert p.jacobian(p.start)[: 2 * N, 0] == pytest.approx(np.concatenate([-5.0 * WAVES["x"], 0 * TIME]), abs=1e-6)


@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_corrected_derivatives_reproduce_the_step_in_any_units_and_stay_zero_where_they_were(scale: float) -> None:
    p, move = problem(COULOMB, VISCOUS), np.array([0.1, 0.3])
    truth = p.jacobian(p.start)
    near = 0.8 * truth / [1.0, scale]
    p.correct_jacobian(near, np.zeros(2), move * [1.0, scale], truth @ move)
    assert (near * [1.0, scale])[: 2 * N] == pytest.approx(truth[: 2 * N], abs=1e-9)  # one parameter a channel
    assert not near[:N, 1].any()


# --- joining


def test_a_partial_fit_merges_into_the_fit_of_all() -> None:
    """Two views of which each tells one parameter: joined, the fit is that of both together."""
    views: list[Any] = [Line(("x",), 1), Line(("a",), 2)]
    start = model(values={"friction.coulomb": 10.0, "friction.viscous": 50.0})
    both = fit(start, views, [COULOMB, VISCOUS])
    first = fit(start, views, [COULOMB])
    part = fit(first.model, views[1:], [VISCOUS])
    found = merge_partial_fit(first, part, views, np.array([False, True]))
    assert [f.name for f in found.free] == ["friction.coulomb", "friction.viscous"]
    assert found.residual == pytest.approx(both.residual, abs=1e-6)
    assert found.jacobian == pytest.approx(both.jacobian, abs=1e-6)
    assert found.covariance == pytest.approx(both.covariance, rel=1e-4)
    assert found.cost == pytest.approx(both.cost)
    assert found.initial_state_sensitivities == [{}, {}]
    for name in ("friction.coulomb", "friction.viscous"):
        assert found[name].value == pytest.approx(both[name].value, rel=1e-6)
        assert found[name].error == pytest.approx(both[name].error, rel=1e-4)
    again = merge_partial_fit(found, fit(found.model, views[:1], [COULOMB]), views, np.array([True, False]))
    assert [f.name for f in again.free] == ["friction.coulomb", "friction.viscous"]
    assert again.jacobian == pytest.approx(both.jacobian, abs=1e-6)


# --- how a fit goes on


@pytest.mark.parametrize("times", [0.1, 27.0])
def test_a_fit_that_goes_on_from_its_end_keeps_its_errors_whatever_its_coordinates(
    monkeypatch: pytest.MonkeyPatch, times: float
):
    """The derivatives that the first one left are those of its own coordinates; noise of 2 tells the errors."""
    first = fitted(COULOMB, VISCOUS, views=[Line()])
    anew = [replace(f, start=parameter_value(first.model, f.name), scale=times * f.scale) for f in (COULOMB, VISCOUS)]
    monkeypatch.setattr(model_fit, "free_parameters", lambda *_: anew)
    then = model_fit.refit(first, [Line()])
    for before, after in zip(first.estimates, then.estimates, strict=True):
        assert (after.value, after.error) == pytest.approx((before.value, before.error), rel=1e-3)
