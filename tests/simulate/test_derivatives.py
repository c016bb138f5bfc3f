"""Derivatives of the readings from simulations with dual numbers, against central differences of plain ones."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numba import njit

from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.effects import catalogue_with_sides
from pneucli.physics.ports import PORTS
from pneucli.simulate.build import DIFFERENTIABLE
from pneucli.simulate.derivatives import COLUMNS, Directions, as_rows, derivatives, differentiable
from pneucli.simulate.dual import LANES, as_duals
from pneucli.simulate.experiment import OUTPUT_COLUMNS, Experiment
from pneucli.simulate.model import Model, parameter_value, with_parameters
from pneucli.simulate.run import kernel_for, run, simulate

from .synthetic_experiments import VALVE, held_commands, make_experiment, model, time_grid, typical_values

TIME = time_grid(0.4)
U = held_commands(TIME, (0.0, 6.0, -3.0, 7.0), 0.1)
X = 0.1 + 0.03 * np.sin(15.0 * TIME)
MOTION = {"x": X, "v": 0.45 * np.cos(15.0 * TIME)}
STEP = 1e-5  # of a parameter's value
AREAS = tuple(VALVE.parameters())[1:4]  # around the commands
TOLERANCE = 1e-5

MIXED = {
    "base": {},
    "hose": {"line-delay": {"line-delay.delay": 2.1e-3, "line-delay.bore": 4e-3}},
    "leaks": {"piston-leak": {}, "valve-leak": {}},
    "hot hose, slow sensors": {"heat-transfer": {}, "line-delay": {"line-delay.bore": 4e-3}, "pressure-lag": {}},
}
OF_GAS = [
    name
    for name, effect in catalogue_with_sides().items()
    if any(PORTS[port].balance in ("gas", "pressure sensor") for port in effect.ports)
]
EFFECTS = {**MIXED, **{name: {name: {}} for name in OF_GAS}}


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


def names_of(which: Model) -> list[str]:
    """Some areas, base parameters, and the parameters of effects that are not 0."""
    return [*AREAS, *DIFFERENTIABLE, *(name for name, value in which.effect_values().items() if value)]


def directions_of(which: Model, names: Sequence[str]) -> Directions:
    """Each parameter moved by a small step to both sides."""
    steps = []
    for name in names:
        value = parameter_value(which, name)
        step = STEP * (value or 1.0)
        steps.append([(s, with_parameters(which, {name: value + s})) for s in (step, -step)])
    return Directions(which, steps)


def by_differences(which: Model, experiment: Experiment, names: Sequence[str], relative: float = STEP) -> np.ndarray:
    """The derivatives of all readings, shape (readings, parameters, n)."""
    changes = []
    for name in names:
        value = parameter_value(which, name)
        step = relative * (value or 1.0)
        upper, lower = (run(with_parameters(which, {name: value + s}), experiment) for s in (step, -step))
        changes.append((upper - lower) / (2.0 * step))
    return np.array(changes)[:, :, [OUTPUT_COLUMNS[name] for name in COLUMNS]].transpose(2, 0, 1)


def simulated(which: Model, experiment: Experiment, names: Sequence[str]) -> np.ndarray:
    parts = derivatives(directions_of(which, names), experiment, range(len(names)))
    found = [out[:, list(COLUMNS.values()), 1 : 1 + len(part)].transpose(1, 2, 0).copy() for part, out in parts]
    return np.concatenate(found, axis=1)


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(relative_errors(found, expected).max())


def relative_errors(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Errors by reading and parameter, relative to the reading that depends most on the parameter."""
    scale = np.linalg.norm(expected, axis=2, keepdims=True).max(axis=0)
    assert (scale > 0.0).any()
    return np.linalg.norm((found - expected) / np.where(scale > 0.0, scale, 1.0), axis=2)


@pytest.mark.parametrize("effects", EFFECTS.values(), ids=EFFECTS)
def test_dual_numbers_give_the_derivatives_that_differences_give(effects: Mapping[str, Mapping[str, float]]) -> None:
    which, experiment = with_effects(effects), axis()
    names = names_of(which)
    assert differentiable(directions_of(which, names), experiment).all()
    found = simulated(which, experiment, names)[:2]
    errors = [
        relative_errors(found, by_differences(which, experiment, names, step)[:2]) for step in (STEP, 0.1 * STEP)
    ]  # of a longer step one is truncated, of a shorter one rounded
    assert np.minimum(*errors).max() < TOLERANCE


@pytest.mark.parametrize("effects", EFFECTS.values(), ids=EFFECTS)
def test_their_values_are_those_of_the_plain_simulation(effects: Mapping[str, Mapping[str, float]]) -> None:
    which, experiment = with_effects(effects), axis()
    ((_, out),) = derivatives(directions_of(which, AREAS), experiment, [0])
    for name, column in COLUMNS.items():
        assert out[:, column, 0] == pytest.approx(run(which, experiment)[:, OUTPUT_COLUMNS[name]], rel=1e-13, abs=1e-9)


@pytest.mark.parametrize("chamber_2", ["closed", "open"])
def test_a_chamber_without_a_valve_has_the_derivatives_that_reach_it(chamber_2: str) -> None:
    """Through the leak of the piston; an open chamber has none."""
    which = with_effects({"piston-leak": {}})
    experiment = make_experiment("axis", TIME, {"u": U, **MOTION}, chamber_2).without_mechanics()
    found = simulated(which, experiment, AREAS)
    assert relative_error(found, by_differences(which, experiment, AREAS)) < TOLERANCE
    assert found[1].any() == (chamber_2 == "closed")


def test_temperature_and_flow_have_derivatives() -> None:
    which, experiment = with_effects({"heat-transfer": {}}), axis()
    found, expected = (f(which, experiment, names_of(which)) for f in (simulated, by_differences))
    assert found[2].any()
    assert found[3].any()
    assert max(relative_error(found[i : i + 1], expected[i : i + 1]) for i in (2, 3)) < TOLERANCE


def test_a_slow_sensor_of_temperature_follows_with_its_derivatives() -> None:
    """By its own time constant, which no simulation depends on, and by all that the gas depends on."""
    which = with_effects({"heat-transfer": {"heat-transfer.sensor_time_constant": 0.05}})
    names, made = names_of(which), axis()
    signals = {**made.recording.signals, "temperature": np.full(TIME.size, 293.0)}
    experiment = replace(made, recording=replace(made.recording, signals=signals), raw={**made.raw, **signals})
    found = simulated(which, experiment, names)[2]
    for name, row in zip(names, found, strict=True):
        value = parameter_value(which, name)
        step = STEP * value
        upper, lower = (
            simulate(with_parameters(which, {name: value + s}), experiment)["temperature"] for s in (step, -step)
        )
        assert row == pytest.approx((upper - lower) / (2.0 * step), rel=1e-3, abs=1e-4 * np.abs(row).max() + 1e-9)
    assert found[names.index("heat-transfer.sensor_time_constant")].any()


def test_in_a_vessel_of_chamber_2_its_own_valve_counts() -> None:
    other = replace(VALVE, areas=tuple(2.0 * area for area in VALVE.areas), label="valve_2")
    which = replace(with_effects({}), valve_2=other)
    vessel = make_experiment("valve", TIME, {"u": U, "p1": 3e5})
    second = replace(vessel, recording=replace(vessel.recording, chamber=2))
    assert not simulated(which, second, AREAS).any()  # the parameters are those of the first
    assert simulated(which, vessel, AREAS)[0].any()


def test_the_volume_of_a_vessel_takes_the_place_of_a_dead_volume() -> None:
    which, vessel = with_effects({}), make_experiment("valve", TIME, {"u": U, "p1": 3e5})
    names = ["rig.vessel_volume", "rig.dead_volume_1"]
    found = simulated(which, vessel, names)
    assert relative_error(found, by_differences(which, vessel, names)) < TOLERANCE
    assert found[0, 0].any()
    assert not found[:, 1].any()


def test_more_parameters_than_a_dual_number_holds_come_one_after_another() -> None:
    which, experiment = with_effects({"valve-lag": {}}), axis()
    names = [name for _ in range(LANES) for name in ("valve-lag.time_constant", "rig.dead_volume_1")]
    found = simulated(which, experiment, names)
    assert np.array_equal(found[:, :2], found[:, -2:])
    assert not np.array_equal(found[:, 0], found[:, 1])


def test_an_edge_takes_the_mean_of_both_its_sides() -> None:
    which = with_effects({})
    value = parameter_value(which, AREAS[0])
    (step, above), (back, below) = ((s, with_parameters(which, {AREAS[0]: value + s})) for s in (1e-9, -3e-9))
    both, upper, lower = (
        Directions(which, [steps]).area_slopes(1, 10.0)
        for steps in ([(step, above), (back, below)], [(step, above)], [(back, below)])
    )
    assert both == pytest.approx(0.5 * (upper + lower))


@pytest.mark.parametrize(
    "experiment",
    [
        make_experiment("axis", TIME, {"u": U}, "valve"),
        make_experiment("friction", TIME, {"p1": 3e5, "p2": 3e5}),
    ],
    ids=["the piston is free", "the pressures are imposed"],
)
def test_other_simulations_are_left_to_differences(experiment: Experiment) -> None:
    assert not differentiable(directions_of(with_effects({}), AREAS), experiment).any()


def test_a_parameter_that_is_no_number_of_the_gas_is_left_to_differences() -> None:
    which = with_effects({})
    names = ["rig.piston_area_1", *AREAS]
    assert differentiable(directions_of(which, names), axis()).tolist() == [False, True, True, True]


def test_a_plug_in_with_other_functions_is_left_to_differences() -> None:
    def volume_1(exponent: float) -> float:
        return 1e-6 * math.tanh(exponent)

    plain = catalogue_with_sides()["dead-volume"]
    assert kernel_for((plain,)).has_duals
    own: Effect = replace(
        plain,
        name="own-volume",
        parameters=(Parameter("exponent", "1", 0.0, 0.0, 9.0, (1.0,)),),
        ports={"volume_1": volume_1},
    )
    assert not kernel_for((own,)).has_duals


def test_an_unmeasured_p2_is_left_to_differences() -> None:
    made = axis()
    recording = replace(made.recording, signals={n: s for n, s in made.recording.signals.items() if n != "p2"})
    hidden = replace(made, recording=recording, raw={n: s for n, s in made.raw.items() if n != "p2"})
    assert hidden.inferred_pressures == ("p2",)
    assert not differentiable(directions_of(with_effects({}), AREAS), hidden).any()


@njit(error_model="numpy")  # no cache, which would not notice another rule
def every_rule(rows: np.ndarray, out: np.ndarray) -> None:
    """Write what each rule makes of two dual numbers."""
    given, found = as_duals(rows), as_duals(out)
    x, y = given[0], given[1]
    found[0] = x * y + x / y - 3 * y
    found[1] = math.sqrt(x) + math.exp(-y) - math.log(x)
    found[2] = math.sin(x) * math.cos(y) + abs(-x)
    found[3] = x**y + x**2 + 2.0**y + math.pow(y, 0.5)
    found[4] = max(x, y) - min(x, 1.0) + math.floor(x)


def every_rule_by_hand(x: float, y: float) -> tuple[float, ...]:
    return (
        x * y + x / y - 3 * y,
        math.sqrt(x) + math.exp(-y) - math.log(x),
        math.sin(x) * math.cos(y) + abs(-x),
        x**y + x**2 + 2.0**y + math.pow(y, 0.5),
        max(x, y) - min(x, 1.0) + math.floor(x),
    )


def test_each_rule_gives_value_and_derivatives() -> None:
    """Of x = 0.7 and y = 1.3, by each; a difference over 2e-6 errs by 1e-9."""
    rows, out = as_rows(np.array([0.7, 1.3])), np.zeros((5, 1 + LANES))
    rows[0, 1], rows[1, 2] = 1.0, 1.0
    every_rule(rows, out)
    assert out[:, 0] == pytest.approx(every_rule_by_hand(0.7, 1.3), rel=1e-15)
    for lane, (dx, dy) in ((1, (1e-6, 0.0)), (2, (0.0, 1e-6))):
        upper, lower = every_rule_by_hand(0.7 + dx, 1.3 + dy), every_rule_by_hand(0.7 - dx, 1.3 - dy)
        assert out[:, lane] == pytest.approx((np.array(upper) - np.array(lower)) / 2e-6, abs=1e-8)
    assert not out[:, 3:].any()
