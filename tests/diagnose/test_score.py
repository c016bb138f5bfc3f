"""What recordings cost, those that were fitted and those that were not."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import score as counted
from pneucli.diagnose.score import (
    correct_for_model_noise,
    fitted_costs,
    flow_gain_deviation,
    held_out_costs,
    likelihood_costs,
    with_flow_gain_errors,
)
from pneucli.identify.residuals import ChamberPressures
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import simulate
from tests.simulate.synthetic_experiments import held_commands, make_experiment, model, time_grid

NOISE = 500.0  # Pa


def view_of(n: int = 500) -> Any:
    e = SimpleNamespace(time=1e-3 * np.arange(n))
    return SimpleNamespace(experiment=e, channels=("p1", "p2"), log_determinant=lambda _: np.full(2 * n, 0.1))


def test_a_cost_is_the_square_and_the_log_determinant_of_a_residual() -> None:
    """Noise as drawn: no allowance."""
    residual = np.where(np.arange(1000) < 500, 2.0, 1.0)
    found = likelihood_costs([view_of()], [{"p1": 1.0, "p2": 1.0}], residual, [{}])
    assert found == pytest.approx(residual**2 + 0.1)


def test_costs_and_counts_are_summed_by_block_and_by_channel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two blocks of 250 samples of two channels, the second twice as large; three residuals of the first are zero."""
    monkeypatch.setattr(
        counted, "drawn_rms", lambda model, residual_model, errors: dict.fromkeys(residual_model.channels, 1.0)
    )
    residual_model, residual = view_of(), np.repeat([1.0, 2.0], 500)
    residual_model.initial_state_sensitivity, residual_model.states_force = lambda _: {}, False
    residual[:3] = 0.0
    found: Any = SimpleNamespace(model=model(), residual=residual, initial_state_sensitivities=[{}])
    costs, counts, channels = fitted_costs(found, [residual_model])
    assert costs == pytest.approx([247.0 + 1000.0 + 50.0, 250.0 + 1000.0 + 50.0])
    assert counts.tolist() == [497.0, 500.0]
    assert channels == (pytest.approx((497.0 + 50.0, 497.0)), pytest.approx((2000.0 + 50.0, 500.0)))


# --- the flow in recordings that were not fitted


def chamber(fill: float = 1.0, vent: float = 1.0) -> ChamberPressures:
    """A chamber that is filled and vented by commands so many times those recorded, restarted every 0.5 s."""
    time, rng = time_grid(2.0), np.random.default_rng(2)
    stated = held_commands(time, [2.0, -2.0, 1.0, -1.0], 0.5)
    acting = np.where(stated > 0.0, fill, vent) * stated
    given = {"x": np.full(time.size, 0.1)}
    exact = make_experiment("axis", time, {**given, "u": acting, "v": np.zeros(time.size), "p1": 2e5}, chamber_2="open")
    exact.flags[at.MECHANICS] = 0.0
    readings = simulate(model(), exact)["p1"] + rng.normal(scale=NOISE, size=time.size)
    recording = replace(exact.recording, signals={**given, "u": stated, "p1": readings})
    ready = prepare(recording, exact.rig, 0.5)
    ready.flags[at.MECHANICS] = 0.0
    return ChamberPressures(ready, whiten_initial_state=True)


def size_of_flow(residual_model: ChamberPressures, of: Model) -> float:
    """The standard deviation of the flow's relative error over that by which a command of its own size errs."""
    starts = [residual_model.initial_state_sensitivity(of)]
    (errors,) = with_flow_gain_errors([of], [residual_model], [residual_model.residual(of, {})], starts)
    flow = residual_model.flow_gain_sensitivity(of)["p1"]
    return float(np.linalg.norm(errors["p1"][1:]) / np.linalg.norm(flow)) if len(errors["p1"]) > 1 else 0.0


def test_a_flow_that_is_as_in_the_model_has_no_error_worth_the_name() -> None:
    assert size_of_flow(chamber(), model()) < 2e-3


@pytest.mark.parametrize(("fill", "vent"), [(1.05, 1.0), (1.0, 1.05), (0.95, 0.95)])
def test_a_changed_flow_gain_is_estimated(fill: float, vent: float) -> None:
    assert 0.01 < size_of_flow(chamber(fill, vent), model()) < 0.1


def test_a_gain_that_is_another_one_costs_little_more_than_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise costs 1 a sample; 5 % of the gain cost more than 10 of them without the allowance."""
    residual_model = chamber(1.05)
    monkeypatch.setattr(counted, "drawn_rms", lambda model, residual_model, errors: {"p1": 1.0})
    found, counts, _ = held_out_costs([model()], [residual_model], [residual_model.initial_state_sensitivity(model())])
    samples = counts.sum()
    assert samples == 2001
    assert counts.size == found.size
    plain = residual_model.residual(model())["p1"] / residual_model.noise["p1"]
    assert plain @ plain > 10.0 * samples
    assert found.sum() < 1.2 * samples


def test_an_error_of_another_shape_stays_in_the_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drift of 20 times the noise while the valve is shut, which no error of a flow makes."""
    residual_model = chamber()
    monkeypatch.setattr(counted, "drawn_rms", lambda model, residual_model, errors: {"p1": 1.0})
    drifting = residual_model.measured["p1"] + 20.0 * NOISE * np.sin(60.0 * residual_model.experiment.time)
    residual_model.experiment.raw["p1"][:] = drifting
    found, counts, _ = held_out_costs([model()], [residual_model], [residual_model.initial_state_sensitivity(model())])
    assert found.sum() > 100.0 * counts.sum()


def test_the_most_likely_deviation_is_that_of_the_random_draws() -> None:
    """Powers of 1e4, sizes of 0.1: the residual along them varies by P + s^2 P^2."""
    rng, power = np.random.default_rng(4), np.full(4000, 1e4)
    along = rng.normal(size=4000) * np.sqrt(power + 0.01 * power**2)
    assert flow_gain_deviation(np.array([power, along])) == pytest.approx(0.1, rel=0.04)
    assert flow_gain_deviation(np.array([power, np.sqrt(0.5 * power)])) == 0.0
    assert flow_gain_deviation(np.zeros((2, 0))) == 0.0


TIME = np.arange(4000) * 1e-3
VIEW = SimpleNamespace(channels=("force",), experiment=SimpleNamespace(time=TIME))


@pytest.mark.parametrize(
    ("rms", "expected", "left"),
    [
        (1.0, 1.0, 1.0),
        (2.0, 2.0, 1.0),
        (3.0, 1.0, 3.0),
        (3.0, 2.0, np.sqrt(9.0 - 3.0)),
        (0.95, 1.05, 0.95 / 1.05),  # the noise is known a little less well than that: in proportion
        (0.95, 0.95, 1.0),  # a model that smooths over noise leaves less of it
        (3.0, 0.9, np.sqrt(9.0 + 0.19)),
        (3.0, 0.0, np.sqrt(9.0 + 0.2)),  # nothing drawn: noise is known to four fifths
        (0.8, 2.0, np.sqrt(0.8) * 0.8),
        (1.5, 4.0, np.sqrt(0.8)),
    ],
)
def test_noise_is_subtracted_from_the_deviation(rms: float, expected: float, left: float):
    """In squares: rms^2 - (drawn^2 - 1), in proportion where that is noise, but not below 0.8 of the sensors' 1."""
    residual = rms * np.where(np.arange(TIME.size) % 2, 1.0, -1.0)
    seen = correct_for_model_noise([VIEW], [{"force": expected}], residual)
    assert np.sqrt(np.mean(seen**2)) == pytest.approx(left)


def test_each_channel_of_each_view_has_its_own_allowance() -> None:
    """Four channels of two views, one after the other; only the last one's noise is allowed for."""
    one, two = (SimpleNamespace(channels=c, experiment=VIEW.experiment) for c in (("p1", "p2", "x"), ("force",)))
    residual = 3.0 * np.where(np.arange(4 * TIME.size) % 2, 1.0, -1.0)
    seen = correct_for_model_noise([one, two], [{"p1": 1.0, "p2": 1.0, "x": 1.0}, {"force": 2.0}], residual)  # type: ignore[list-item]
    parts = np.sqrt(np.mean(seen.reshape(4, -1) ** 2, axis=1))
    assert parts == pytest.approx([3.0, 3.0, 3.0, np.sqrt(6.0)])


def test_zero_samples_stay_zero():
    assert not correct_for_model_noise([VIEW], [{"force": 2.0}], np.zeros(TIME.size)).any()
