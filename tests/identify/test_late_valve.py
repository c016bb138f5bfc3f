"""A valve that is late: how late the flow tells, before any fit, and that a fit finds it from there."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.model_fit import fit_model, fit_with_effect
from pneucli.identify.estimation.score_test import late_valve, score_tests
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import run
from tests.identify.test_arrangements import FIRST, NOISE, SECOND
from tests.identify.test_command_timing import SPOOL
from tests.simulate.synthetic_experiments import FRICTION

TIME = 1e-3 * np.arange(8000)
SWING = 3.5 * np.sin(2 * np.pi * 4.0 * TIME) * np.sin(2 * np.pi * 0.8 * TIME + 1.0) + np.sin(2 * np.pi * 0.9 * TIME)


SQUARES = 3.5 * np.sign(np.sin(2 * np.pi * 4.0 * TIME)) * np.sin(2 * np.pi * 0.8 * TIME + 1.0)
STEPS = np.round((SQUARES + np.sin(2 * np.pi * 0.9 * TIME))[::20]).repeat(20)  # the piston stays off its ends


def recorded(effect: str = "", command: np.ndarray = SWING, **values: float) -> Experiment:
    """A 5/3 axis under changing commands, recorded at 1 kHz with noise."""
    still = {"p1": 3e5, "p2": 3e5, "x": 0.1, "v": 0.0, "p_supply": 7e5}
    given = {"u": command} | {name: np.full(TIME.size, value) for name, value in still.items()}
    ideal = Recording("axis", "axis", "train", TIME, given, {}, chamber_2="valve")
    effects = (catalogue()[effect],) if effect else ()
    model = Model(SPOOL, effects, FRICTION | {f"{effect}.{name}": v for name, v in values.items()}, FIRST, SECOND)
    true, rng = run(model, prepare(ideal, SPOOL, None)), np.random.default_rng(1)
    seen = {name: true[:, column] for name, column in (("p1", at.P1), ("p2", at.P2), ("x", at.X))}
    read = {name: values + NOISE[name].draw(TIME, rng) for name, values in seen.items()}
    signals = {"u": command, "p_supply": np.full(TIME.size, 7e5)} | read
    return prepare(replace(ideal, signals=signals, noise=NOISE), SPOOL, 0.5)


@pytest.mark.parametrize(
    ("effect", "parameter", "how", "time"),
    [("valve-lag", "time_constant", "lag", 0.04), ("line-delay", "delay", "delay", 0.02)],
)
def test_the_flow_tells_how_late_the_valve_is_and_its_areas(effect: str, parameter: str, how: str, time: float) -> None:
    found = late_valve([recorded(effect, **{parameter: time})], SPOOL, 1e-3, how, 0.5)
    assert found is not None
    assert found.time == pytest.approx(time, rel=0.3)  # the times that are tried are a factor of 1.3 apart
    commands = np.array([-2.0, -1.0, 1.0, 2.0])
    for guessed, true in zip(found.valves, (FIRST, SECOND), strict=True):
        assert guessed(commands) == pytest.approx(true(commands), rel=0.3)


def test_a_valve_in_time_is_hardly_late() -> None:
    found = late_valve([recorded()], SPOOL, 1e-3, "lag", 0.5)
    assert found is None or found.time <= 0.002


@pytest.mark.parametrize("experiments", [[], ["slower than the longest time"]])
def test_without_a_time_to_try_there_is_none(experiments: list[str]) -> None:
    ready = [recorded() for _ in experiments]
    assert late_valve(ready, SPOOL, 1e-3, "lag", 0.5 if not ready else 1e-3) is None


def test_the_start_that_the_flow_tells_explains_most_at_once() -> None:
    """With its areas, before any fit; a step along the derivative of a lag promises less."""
    models = residual_models([recorded("valve-lag", time_constant=0.04)], whiten_initial_state=True)
    base = fit_model(guess_base_model([models[0].experiment], SPOOL), models, [])
    tests = score_tests(catalogue()["valve-lag"], base, models)
    assert [test.direct for test in tests] == [True, False, False]
    assert tests[0].gain > 0.8 * base.cost
    assert tests[0].values["valve-lag.time_constant"] == pytest.approx(0.04, rel=0.3)


def test_a_spool_of_second_order_is_told_from_a_dead_time() -> None:
    models = residual_models(
        [recorded("valve-lag", STEPS, time_constant=8e-3, roundness=1.5)], whiten_initial_state=True
    )
    base = fit_model(guess_base_model([models[0].experiment], SPOOL), models, [])
    spool, hose = (fit_with_effect(base, models, catalogue()[name]) for name in ("valve-lag", "line-delay"))
    assert spool["valve-lag.time_constant"].value == pytest.approx(8e-3, rel=0.05)
    assert spool["valve-lag.roundness"].value == pytest.approx(1.5, rel=0.1)
    assert hose.cost > 1.5 * spool.cost
