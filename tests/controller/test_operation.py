"""What a machine does with a controller beside stepping it: enable, hold, a start without a bump, a measured supply."""

from dataclasses import replace

import numpy as np
import pint
import pytest

from pneucli.closed_loop.simulation import Run, simulate
from pneucli.controller import cascade, operation, plant, valve_dynamics
from pneucli.controller import layout as at
from pneucli.controller.laws import LAWS
from pneucli.controller.layout import UNITS
from pneucli.simulate import layout as sim
from tests.controller.test_cascade import C, state
from tests.design import axis

TIME = 1e-3 * np.arange(4000)
NULL = -0.5  # V, in the middle between both closing edges


def states(**given: float) -> np.ndarray:
    return np.concatenate([state(**given), np.zeros(at.MAX_LAW_STATES)])


def driven(law: str, arrangement: str, duties: dict[str, slice], load: float = 0.0) -> Run:
    model, made = axis.bench_of_laws(arrangement)
    duty = np.zeros(TIME.size)
    for name, when in duties.items():
        duty[when] = at.OPERATING_MODES.index(name)
    reference = np.where(TIME < 0.2, 0.1, 0.13)
    return simulate(model, made[law], axis.scenario(made[law], reference, load, operating_mode=duty), axis.BENCH)


# --- the measured supply


def test_the_inverse_takes_the_supply_that_is_measured() -> None:
    """Choked, half of the pressure takes twice the area."""
    s, full = states(), 2e-6 * plant.pressure_rate_per_area(True, 1.5e5, 1e-4, states(), C)
    operation.set_supply(3.5e5, s, C)
    assert plant.valve_command(full / 8, 1.5e5, 1e-4, s, C) == pytest.approx(4.0)
    assert plant.valve_command(full / 4, 1.5e5, 1e-4, states(), C) == pytest.approx(4.0)
    assert plant.max_pressure_reference(s, C) == pytest.approx(0.5 * 6.5e5)


@pytest.mark.parametrize("supply", [4e5, 4.5e5])  # 4 bar: the sine takes all but a tenth of the supply
def test_a_supply_that_sags_costs_less_where_it_is_measured(supply: float) -> None:
    model, made = axis.bench_of_laws()
    c = made["best"]
    sine = 0.1 + 0.02 * np.sin(np.pi * TIME)
    scenario = replace(axis.scenario(c, sine), supply=np.full(TIME.size, supply))
    errors = [
        [float(np.sqrt(np.mean((simulate(model, c, scenario, bench, seed).model[1000:, sim.X] - sine[1000:]) ** 2)))
         for seed in range(6)]  # of the noise, which decides how it sticks as it turns
        for bench in (replace(axis.BENCH, supply=told) for told in (True, False))
    ]  # fmt: skip
    assert np.mean(errors[0]) < 0.9 * np.mean(errors[1])


def test_a_position_that_is_read_every_fourth_sample_is_enough() -> None:
    """The pressures go on at every sample; between its readings the position is missing."""
    c = axis.bench_of_laws()[1]["best"]
    gaps = tuple(("x", 1e-3 * k + 5e-4, 1e-3 * k + 3.5e-3) for k in range(0, TIME.size, 4))
    found = simulate(axis.model(), c, axis.scenario(c, np.where(TIME < 0.5, 0.1, 0.13), dropouts=gaps), axis.BENCH)
    assert np.isfinite(found.log[:, at.L_READ_X]).sum() == TIME.size // 4
    assert np.abs(found.model[-400:, sim.X] - 0.13).max() < 10e-6


# --- enable and hold


def test_a_moving_axis_that_is_held_comes_to_rest() -> None:
    found = driven("best", "one-chamber", {"hold": slice(260, 2000)})
    x = found.model[:, sim.X]
    assert 0.101 < x[1900] < 0.129
    assert np.ptp(x[1500:2000]) < 10e-6
    assert x[-1] == pytest.approx(0.13, abs=10e-6)


# --- a start without a bump


@pytest.mark.parametrize("u", [-9.0, -4.0, -2.0, 1.0, 3.3, 10.0])
def test_what_a_command_makes_is_what_its_inverse_takes(u: float) -> None:
    made = valve_dynamics.valve_gradient_1(u, 3e5, 1e-4, states(), C)
    assert plant.valve_command(made, 3e5, 1e-4, states(), C) == pytest.approx(u if made else NULL)
    assert (made == 0.0) == (u in (-2.0, 1.0))


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
@pytest.mark.parametrize("law", LAWS)
def test_no_law_steps_its_command_where_it_takes_over(law: str, arrangement: str) -> None:
    found = driven(law, arrangement, {"reset": slice(1500, 1501)}, load=-30.0)
    u = found.log[:, [at.L_U1, at.L_U2]]
    assert u[1500] == pytest.approx(u[1499], abs=1e-9)


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
def test_a_loaded_axis_does_not_move_as_it_is_enabled(arrangement: str) -> None:
    """Under 40 N; by what the readings at that moment tell, not by what was known before."""
    found = driven("best", arrangement, {"off": slice(1500, 2500)}, load=-40.0)
    x = found.model[:, sim.X]
    assert np.all(found.log[1500:2500, at.L_U1] == 0.0)
    assert np.ptp(x[2400:3500]) < 2e-6
    assert x[-1] == pytest.approx(0.13, abs=10e-6)


# --- the units of the controller's parameters: in other units of mass, length, time and voltage it does the same


REGISTRY = pint.UnitRegistry()
SMALLER = {"[mass]": 1 / 4, "[length]": 8.0, "[time]": 1.0, "[current]": 1 / 16}  # powers of two: nothing is rounded
FASTER = SMALLER | {"[time]": 2.0}
CONTROLLER = axis.controller()
READ = ("m", "m", "Pa", "Pa")  # x_ref, x, p1, p2


def factor(unit: str, scales: dict[str, float]) -> float:
    """How many of the new units are one of the old."""
    return float(np.prod([scales[base] ** power for base, power in REGISTRY.parse_units(unit).dimensionality.items()]))


def commands(readings: np.ndarray, scales: dict[str, float], *, rested: float = 0.0, **values: float) -> np.ndarray:
    """Commands in V and the force in N that is asked for, (n, 3), at readings (n, 4), calculated in other units."""
    here = CONTROLLER.with_values(**values)
    scaled = {name: value * factor(UNITS.get(name, "1"), scales) for name, value in here.values.items()}
    tables = np.concatenate(
        [factor(at.STROKE_TABLES.get(n, "V"), scales) * np.array(t) for n, t in here.tables().items()]
    )
    c, s, out = np.concatenate([here.with_values(**scaled).vector()[: at.C_TABLE], tables]), np.zeros(len(at.STATE)), []
    units = [factor(unit, scales) for unit in READ]
    for row in readings * units:
        cascade.cascade_step(*map(float, row), s, c)
        out.append(
            [s[at.S_U1] / factor("V", scales), s[at.S_U2] / factor("V", scales), s[at.S_FORCE] / factor("N", scales)]
        )
        s[at.S_REF_REST_TIME] = max(
            s[at.S_REF_REST_TIME], rested
        )  # in s: the step itself knows one time, from which on it is at rest
    return np.array(out)


def moving(samples: int) -> np.ndarray:
    """A reference that moves all the time, followed with errors now and then, and pressures with noise and a jump."""
    time, rng = 1e-3 * np.arange(samples), np.random.default_rng(1)
    pushed = np.where(np.arange(samples) % 50 < 25, 0.02, -0.02) * (np.arange(samples) > 50)
    p = 3e5 + 2e4 * np.sin(20.0 * time)[:, None] + 400.0 * rng.standard_normal((samples, 2))
    p[30:] += 1e5
    return np.column_stack([0.1 + 0.03 * np.sin(20.0 * time), 0.1 + 0.028 * np.sin(20.0 * time) + pushed, p])


def sticking(samples: int) -> np.ndarray:
    """A piston that creeps from 50 um to 4 um off its reference while it is pushed harder, read with noise."""
    k, rng, known = np.arange(samples), np.random.default_rng(2), CONTROLLER.values
    x = 0.1 - np.maximum(50e-6 - 60e-6 * k / samples, 4e-6) + 0.3e-6 * rng.standard_normal(samples)
    force = 1.2 * known["C_STATIC"] * np.minimum(4 * k / samples, 1.0)
    p = 3e5 + 10.0 * rng.standard_normal((samples, 2))
    p[:, 0] = known["C_AMBIENT"] + (known["C_AREA_2"] * (p[:, 1] - known["C_AMBIENT"]) + force) / known["C_AREA_1"]
    return np.column_stack([np.full(samples, 0.1), x, p])


VARIANTS = [{}, {"C_TWO_VALVES": 1.0}, {"C_MIRRORED": 1.0}, *({name: 0.0} for name in at.COMPONENT_SWITCHES)]


@pytest.mark.parametrize("values", VARIANTS)
@pytest.mark.parametrize("scales", [SMALLER, FASTER])
def test_a_moving_axis_is_controlled_alike_in_all_units(scales: dict[str, float], values: dict[str, float]) -> None:
    known = commands(moving(150), dict.fromkeys(scales, 1.0), **values)
    assert np.ptp(known[:, 0]) > 1.0
    assert commands(moving(150), scales, **values) == pytest.approx(known, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("scales", [SMALLER, FASTER])
def test_a_sticking_axis_is_controlled_alike_in_all_units(scales: dict[str, float]) -> None:
    known = commands(sticking(300), dict.fromkeys(scales, 1.0), rested=10.0)
    assert np.ptp(known[:, 0]) > 1.0
    assert commands(sticking(300), scales, rested=10.0) == pytest.approx(known, rel=1e-9, abs=1e-12)


RATIOS_AND_COUNTS = (
    "C_SPOOL_SHARE C_SPOOL_MEAN_SHARE C_SPOOL_LEAD C_FLOW_DELAY C_SENSOR_SHARE C_SENSOR_DELAY C_OBS_SENSOR "
    "C_OBS_X C_OBS_P C_TABLE_NODES C_STROKE_NODES C_DECELERATION_RATIO C_DEADBAND_GAIN_MAX C_PRESSURE_MODE C_FAMILY "
    "C_FAMILY_MEMBERS C_FAMILY_WIDTH C_SCALE_1 C_SCALE_2 C_TWO_VALVES C_MIRRORED C_GAMMA C_CRITICAL_RATIO C_TABLE"
)


def test_every_parameter_but_ratios_switches_and_counts_has_a_unit() -> None:
    assert set(at.PARAMETERS) - set(UNITS) == {*RATIOS_AND_COUNTS.split(), *at.COMPONENT_SWITCHES}


def test_every_column_of_a_rows_log_has_one_name() -> None:
    """Beside these there are the number of states, which go before, and that of the columns."""
    columns = {getattr(at, name) for name in dir(at) if name.startswith("L_") and name not in ("L_STATES", "L_ROW")}
    assert columns == set(range(at.L_ROW))
    assert len(at.STATE) + at.MAX_LAW_STATES == at.L_STATES
    assert UNITS["C_U_MAX"] == "V"  # the step clips by the tables
