"""Derivatives of the pressures by the valves' areas from one simulation, against differences of many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from pneucli.physics.effects import catalogue_with_sides
from pneucli.simulate import area_derivatives as module
from pneucli.simulate import layout as at
from pneucli.simulate.area_derivatives import AreaChanges, area_derivatives, can_simulate_derivatives
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, with_parameters
from pneucli.simulate.run import run

from .synthetic_experiments import VALVE, held_commands, make_experiment, model, time_grid, typical_values

TIME = time_grid(0.4)
U = held_commands(TIME, (0.0, 6.0, -3.0, 7.0), 0.1)
X = 0.1 + 0.03 * np.sin(15.0 * TIME)
MOTION = {"x": X, "v": 0.45 * np.cos(15.0 * TIME)}
STEP = 1e-5  # of a parameter's value
PARAMETERS = tuple(VALVE.parameters())

EFFECTS = {
    "base": {},
    "heat": {"heat-transfer": {}},
    "delay": {"line-delay": {}},
    "hose": {"line-delay": {"line-delay.delay": 2e-3, "line-delay.bore": 4e-3}},
    "lag": {"pressure-lag": {}},
    "late sensors": {"time-skew": {}},
    "leaks": {"piston-leak": {}, "valve-leak": {}},
    "scale": {"pressure-scale": {}},
    "slow spool": {"valve-lag": {}},
    "hot hose, slow sensors": {"heat-transfer": {}, "line-delay": {"line-delay.bore": 4e-3}, "pressure-lag": {}},
}


def with_effects(effects: Mapping[str, Mapping[str, float]]) -> Model:
    """The model with effects at their first typical values, but for those that are given."""
    named = [catalogue_with_sides()[name] for name in effects]
    given = {name: value for values in effects.values() for name, value in values.items()}
    values = {**typical_values(named), **given, "rig.vessel_volume": 1e-3}
    return replace(model((), values), effects=tuple(named))


def axis(restarts: Sequence[int] = (0, 130, 270)) -> Experiment:
    """Both chambers, each with a valve, and the measured motion."""
    made = make_experiment("axis", TIME, {"u": U, "u2": -0.8 * U, "p1": 3e5, "p2": 4e5, **MOTION}, "valve", restarts)
    return made.without_mechanics()


def steps_of(which: Model) -> list[list[tuple[float, Model]]]:
    """Each parameter of the valve moved by a small step."""
    moved = []
    for name in PARAMETERS:
        value = which.valve_parameters()[name][0]
        step = STEP * (value or 1.0)
        moved.append([(step, with_parameters(which, {name: value + step}))])
    return moved


def by_differences(which: Model, experiment: Experiment) -> np.ndarray:
    """The derivatives of both readings, shape (2, parameters, n)."""
    nominal = run(which, experiment)
    changes = [(run(other, experiment) - nominal) / step for ((step, other),) in steps_of(which)]
    return np.array(changes)[:, :, [at.R1, at.R2]].transpose(2, 0, 1)


def simulated(which: Model, experiment: Experiment) -> np.ndarray:
    parts = list(area_derivatives(AreaChanges(which, steps_of(which)), experiment))
    return np.concatenate([derivatives for _, derivatives in parts], axis=1)


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    scale = np.linalg.norm(expected, axis=2, keepdims=True)
    assert (scale > 0.0).any()
    return float(np.linalg.norm((found - expected) / np.where(scale > 0.0, scale, 1.0), axis=2).max())


@pytest.mark.parametrize("effects", EFFECTS.values(), ids=EFFECTS)
def test_one_simulation_gives_the_derivatives_that_differences_give(effects: Mapping[str, Mapping[str, float]]) -> None:
    which, experiment = with_effects(effects), axis()
    assert can_simulate_derivatives(which, experiment)
    assert relative_error(simulated(which, experiment), by_differences(which, experiment)) < 2e-3


@pytest.mark.parametrize("chamber_2", ["closed", "open"])
def test_a_chamber_without_a_valve_has_the_derivatives_that_reach_it(chamber_2: str) -> None:
    """Through the leak of the piston; an open chamber has none."""
    which = with_effects({"piston-leak": {}})
    experiment = make_experiment("axis", TIME, {"u": U, **MOTION}, chamber_2).without_mechanics()
    found = simulated(which, experiment)
    assert relative_error(found, by_differences(which, experiment)) < 2e-3
    assert found[1].any() == (chamber_2 == "closed")


def test_in_a_vessel_of_chamber_2_its_own_valve_counts() -> None:
    other = replace(VALVE, areas=tuple(2.0 * area for area in VALVE.areas), label="valve_2")
    which = replace(with_effects({}), valve_2=other)
    vessel = make_experiment("valve", TIME, {"u": U, "p1": 3e5})
    second = replace(vessel, recording=replace(vessel.recording, chamber=2))
    assert not simulated(which, second).any()  # the parameters are those of the first
    assert simulated(which, vessel)[0].any()


def test_few_parameters_at_a_time_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    which, experiment = with_effects({}), axis()
    whole = simulated(which, experiment)
    monkeypatch.setattr(module, "MEMORY", 0)
    assert len(list(area_derivatives(AreaChanges(which, steps_of(which)), experiment))) > 1
    assert np.array_equal(simulated(which, experiment), whole)


def test_an_edge_takes_the_mean_of_both_its_sides() -> None:
    which, (step, above) = with_effects({}), steps_of(with_effects({}))[0][0]
    area = which.valve_parameters()[PARAMETERS[0]][0]
    below = with_parameters(which, {PARAMETERS[0]: area - 3.0 * step})
    both, upper, lower = (
        AreaChanges(which, [steps]).shapes(1, 10.0)
        for steps in ([(step, above), (-3.0 * step, below)], [(step, above)], [(-3.0 * step, below)])
    )
    assert both == pytest.approx(0.5 * (upper + lower))


@pytest.mark.parametrize(
    ("effects", "experiment"),
    [
        ({"supply-droop": {}}, axis()),
        ({}, make_experiment("axis", TIME, {"u": U}, "valve")),
        ({}, make_experiment("friction", TIME, {"p1": 3e5, "p2": 3e5})),
    ],
    ids=["the supply droops", "the piston is free", "the pressures are imposed"],
)
def test_other_models_are_left_to_differences(
    effects: Mapping[str, Mapping[str, float]], experiment: Experiment
) -> None:
    assert not can_simulate_derivatives(with_effects(effects), experiment)


def test_an_unmeasured_p2_is_left_to_differences() -> None:
    made = axis()
    recording = replace(made.recording, signals={n: s for n, s in made.recording.signals.items() if n != "p2"})
    hidden = replace(made, recording=recording, raw={n: s for n, s in made.raw.items() if n != "p2"})
    assert hidden.infers_p2
    assert not can_simulate_derivatives(with_effects({}), hidden)
