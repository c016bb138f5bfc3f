"""A 5/3 valve in the loop: one command moves both chambers, and the piston arrives and stays."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, simulate
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.physics.effects import catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import ValveArea
from tests.simulate.synthetic_experiments import FRICTION, RIG, STRIBECK

COMMANDS = (-10.0, -5.0, -1.0, 1.0, 5.0, 10.0)
FIRST = ValveArea(COMMANDS, (1.8e-6, 0.9e-6, 1.2e-7, 1.2e-7, 0.9e-6, 1.8e-6))
SECOND = replace(FIRST.scaled(0.8), label="valve_2")


def axis(null: float = 0.0) -> Model:
    rig = replace(RIG, valve_arrangement="5/3", valve_null=null)
    return Model(rig, (catalogue()["stribeck"],), FRICTION | STRIBECK, FIRST, SECOND)


@pytest.fixture(scope="module", params=[0.0, 5.0])
def moved(request: pytest.FixtureRequest) -> tuple[Model, Run]:
    model = axis(request.param)
    wanted = Requirements(chamber_2="valve", quantum_x=1e-6)
    controller = design_cascade(model, wanted)
    (steps,) = (s for s in read_scenarios([], controller, "") if s.name == "steps")
    return model, simulate(model, controller, steps, ClosedLoopSetup(0.0, 0.0, 1e-6, 0.0, 0))


def test_the_piston_arrives_and_rests(moved: tuple[Model, Run]):
    """20 um is twice what the design tolerates by default. The null command of 5 V is part of what goes out."""
    model, done = moved
    controller = design_cascade(model, Requirements(chamber_2="valve", quantum_x=1e-6))
    assert evaluate_run(done, model, controller).steady_um < 20.0


def test_one_command_moves_both_pressures_apart(moved: tuple[Model, Run]):
    _, done = moved
    rates = np.diff(done.model[:, [at.P1, at.P2]], axis=0)
    driven = np.abs(done.model[:, at.V]) < 1e-4  # a piston that moves presses on both itself
    strong = driven[1:] & (np.abs(rates).min(axis=1) > 20.0)
    assert np.mean(np.sign(rates[strong, 0]) == -np.sign(rates[strong, 1])) > 0.95
