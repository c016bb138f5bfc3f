"""The rig's equations: laws that a textbook states, each term of them as stored, and how a step ends."""

import math
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.exam.rig.gas import GAS_CONSTANT, KAPPA
from pneucli.exam.rig.kernel import MAX_STEP, P1, P2, PS, T1, T2, VL, XL, V, X, Z
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import Excitation
from tests.stored import hold_rows_against

STORED = Path(__file__).parent / "stored" / "terms.json"
PAR = Parameters(coulomb=15.0, viscous=50.0, overlap=0.5, exponent=2.0)
C_V = GAS_CONSTANT / (KAPPA - 1.0)


def state(**given: float) -> np.ndarray:
    """At rest in the middle, both chambers and the supply at different pressures and temperatures."""
    s = np.zeros(10)
    known = {"X": 0.1, "V": 0.0, "P1": 3e5, "T1": 290.0, "P2": 2.5e5, "T2": 300.0, "PS": 7e5, "Z": 0.0}
    places = {"X": X, "V": V, "P1": P1, "T1": T1, "P2": P2, "T2": T2, "PS": PS, "Z": Z, "XL": XL, "VL": VL}
    for name, value in (known | given).items():
        s[places[name]] = value
    return s


def choked(area: float, p: float, t: float) -> float:
    return 0.484 * area * p * math.sqrt(2.0 / (287.0 * t))


@pytest.mark.parametrize(
    ("ratio", "share"), [(0.0, 1.0), (0.3, 1.0), (0.4, 1.0), (0.7, math.sqrt(0.75)), (0.94, math.sqrt(0.19)), (1.0, 0)]
)
def test_flow_is_choked_below_the_critical_ratio_and_falls_on_an_ellipse_above_it(
    plain: SimpleNamespace, ratio: float, share: float
) -> None:
    """Critical at 0.4: 0.7 is half the way to 1, 0.94 nine tenths of it."""
    found = plain.orifice_flow(2e-6, 5e5, 300.0, ratio * 5e5, 0.4)
    assert found == pytest.approx(share * choked(2e-6, 5e5, 300.0), rel=1e-9)


@pytest.mark.parametrize(("q", "inflow", "growth", "conductance"), [(1e-3, 320.0, 0.0, 0.5), (-1e-3, 310.0, 2e-4, 0.0)])
def test_a_chamber_keeps_mass_and_energy(
    plain: SimpleNamespace, q: float, inflow: float, growth: float, conductance: float
) -> None:
    """d(m)/dt = q and d(m c_v T)/dt = c_p T_in q - p dV/dt + heat from the wall, with m = p V / (R T)."""
    p, t, volume = 3e5, 310.0, 1e-4
    dp, dt = plain.chamber_rates(PAR, p, t, volume, growth, q, q * inflow, conductance)
    mass_rate = (dp * volume + p * growth) / (287.0 * t) - p * volume * dt / (287.0 * t * t)
    energy_rate = (dp * volume + p * growth) / 0.4  # m c_v T = p V / (kappa - 1)
    assert mass_rate == pytest.approx(q, rel=1e-9)
    wall = conductance * (PAR.temperature - t)
    assert energy_rate == pytest.approx(KAPPA * C_V * inflow * q - p * growth + wall, rel=1e-9)


def test_without_heat_transfer_a_chamber_keeps_its_temperature(plain: SimpleNamespace) -> None:
    """Thesis 2.47: dp/dt = kappa (R T q - p dV/dt) / V, at the temperature of the rig."""
    dp, dt = plain.chamber_rates(PAR, 3e5, 310.0, 1e-4, 2e-4, 1e-3, 1e9, -1.0)
    assert dt == 0.0
    assert dp == pytest.approx(1.4 * (287.0 * PAR.temperature * 1e-3 - 3e5 * 2e-4) / 1e-4)


def test_walls_grow_with_the_chamber_and_a_vessel_is_as_long_as_it_is_wide(plain: SimpleNamespace) -> None:
    """A bore of 32 mm over 100 mm: 2 pi r^2 + 2 pi r l; a can of diameter d = l: 1.5 pi d^2 around pi d^3 / 4."""
    r = 0.016
    area = math.pi * r**2
    assert plain.wall_area(area, 0.1 * area) == pytest.approx(2 * area + 2 * math.pi * r * 0.1)
    assert plain.wall_area(0.0, math.pi / 4 * 0.06**3) == pytest.approx(1.5 * math.pi * 0.06**2)


# --- each term, as stored


def terms(plain: SimpleNamespace, par: Parameters, s: np.ndarray, t: float) -> Iterator[tuple[str, object]]:
    """All that the equations make of a state at time t in s: areas, flows, rates, forces and where the spool goes."""
    for volts in (0.3, 5.25, -10.0):
        area = plain.valve_area(par, volts, t)
        yield f"area at {volts} V", area
        yield f"flows at {volts} V", plain.valve_flow(par, area, t, s)
        yield f"flows at {volts} V of chamber 2", plain.valve_flow(par, plain.valve_area_2(par, volts, t), t, s, 1)
        yield f"pump at {volts} V", plain.pump_flow(par, volts, s[P1])
        yield f"regulated at {volts} V", plain.regulated_opening(par, volts, s[P1])
        yield f"spool at {volts} V", plain._spool(par, MAX_STEP, volts, volts - 0.5, 1.5, 1.2)
    for held in (0, 1, 2):
        ds = np.zeros(10)
        plain.state_rates(par, t, s, 1.0, (1e-3, 2e-4, 3e-4, 4e-4), held, ds)
        yield f"rates, {held} held", ds.tolist()
    yield "coupling", plain.coupling_force(par, s)
    yield "net force", plain.net_force(par, t, s)
    for direction in (1.0, -1.0):
        yield f"dry friction {direction:+.0f}", plain.dry_friction(par, t, s, direction)
        yield f"acceleration {direction:+.0f}", plain.acceleration(par, t, s, direction, np.zeros(10))
    for push in (0.7, 1.2, 1.45, -3.0):
        pushed = s.copy()
        pushed[V], pushed[P2] = 0.0, par.ambient
        pushed[P1] = par.ambient + push * par.coulomb / max(par.piston_area_1, 1e-4)
        yield f"breaks away at {push}", plain.motion_sign(par, t, pushed, 0.3)


def test_what_each_parameter_changes_is_as_stored(plain: SimpleNamespace) -> None:
    """Of each row: the parameters, state and time (s) that are others than usual, and the terms that differ."""

    def told(row: dict[str, Any]) -> dict[str, str]:
        par, s, t = PAR._replace(**row.get("parameters", {})), state(**row.get("state", {})), row.get("time", 0.0)
        numbers = ((name, np.atleast_1d(np.array(one, float)) + 0.0) for name, one in terms(plain, par, s, t))
        return {name: " ".join(f"{one:.6g}" for one in values) for name, values in numbers}

    def gives(row: dict[str, Any]) -> dict[str, str]:
        like = told({**row, "parameters": {}}) if "parameters" in row else told({}) if "state" in row else {}
        return {
            name: one for name, one in told({k: row[k] for k in row if k != "gives"}).items() if one != like.get(name)
        }

    hold_rows_against(STORED, gives, rel=1e-5)


# --- the loop


def pushed(force: float, par: Parameters = PAR, **given: float) -> np.ndarray:
    """A state whose pressures push with this force in N, viscous friction taken into account."""
    s = state(P2=par.ambient, **given)
    s[P1] = par.ambient + (force + par.viscous * s[V]) / par.piston_area_1
    return s


def coasting(plain: SimpleNamespace, v: float, par: Parameters, steps: int = 1, rest: float = 0.0):
    s, work = pushed(0.0, par._replace(viscous=0.0), V=v), np.zeros((3, 10))
    for k in range(steps):
        rest = plain._advance(par, k * MAX_STEP, MAX_STEP, s, rest, (0.0, 0.0, 0.0, 0.0), 2, work)
    return s, rest


def test_a_midpoint_step_is_exact_for_a_constant_deceleration(plain: SimpleNamespace) -> None:
    par = PAR._replace(viscous=0.0, mass=2.0)
    s, rest = coasting(plain, 0.3, par, 40)
    t = 40 * MAX_STEP
    assert rest == 0.0
    assert s[V] == pytest.approx(0.3 - 7.5 * t, rel=1e-12)
    assert s[X] == pytest.approx(0.1 + 0.3 * t - 3.75 * t * t, rel=1e-12)


def test_a_piston_that_stops_within_a_step_stops_where_its_energy_ends(plain: SimpleNamespace) -> None:
    """v^2 m / (2 F) on from where it was, at rest at once, which is counted from the next step on."""
    par = PAR._replace(viscous=0.0, mass=2.0)
    v = 7.5 * 0.4 * MAX_STEP
    s, rest = coasting(plain, v, par)
    assert s[V] == 0.0
    assert s[X] - 0.1 == pytest.approx(v * v * 2.0 / 30.0, rel=1e-6)
    assert rest == MAX_STEP
    assert coasting(plain, v, par, 5)[1] == pytest.approx(5 * MAX_STEP)


def test_motion_that_turns_under_load_goes_on_in_the_new_direction_within_the_step(plain: SimpleNamespace) -> None:
    """It is thrown back by 30 N: slowed by 45 N over 2 kg, and then driven by 15 N."""
    par = PAR._replace(viscous=0.0, mass=2.0)
    s = pushed(-30.0, par, V=22.5 * 0.5 * MAX_STEP)
    rest = plain._advance(par, 0.0, MAX_STEP, s, 0.1, (0.0, 0.0, 0.0, 0.0), 2, np.zeros((3, 10)))
    assert rest == 0.0
    assert s[V] == pytest.approx(-7.5 * 0.5 * MAX_STEP, rel=1e-6)


def test_imposed_pressures_are_linear_between_samples_and_held_at_the_end(plain: SimpleNamespace) -> None:
    rows = np.array([[1.0, 10.0], [3.0, 30.0]])
    assert plain._interpolated(rows, 0, 0.25) == pytest.approx([1.5, 15.0])
    assert plain._interpolated(rows, 1, 0.25) == pytest.approx([3.0, 30.0])


def test_the_rows_begin_with_the_initial_state(plain: SimpleNamespace) -> None:
    move = Excitation(np.zeros(2), chamber_2_open=True, position=0.15, velocity=0.2, pressure_1=2e5, pressure_2=3e5)
    seen = {name: values[0] for name, values in plain.simulate_rig(PAR, move).items()}
    assert [seen[n] for n in ("x", "v", "p1", "p2", "p_supply", "temperature")] == [
        0.15, 0.2, 2e5, 3e5, PAR.supply, PAR.temperature,
    ]  # fmt: skip
    pushes = PAR.piston_area_1 * (2e5 - PAR.ambient) - PAR.piston_area_2 * (3e5 - PAR.ambient)
    assert seen["a"] == pytest.approx((pushes - 15.0 - 50.0 * 0.2) / PAR.mass)


@pytest.mark.parametrize(("gain", "command"), [(100.0, 5.0), (1000.0, 10.0), (-0.0, 0.15), (33.33333, 1.6667)])
def test_a_controller_commands_in_proportion_within_10_v_in_steps_of_a_tenth_of_a_millivolt(
    plain: SimpleNamespace, gain: float, command: float
) -> None:
    move = Excitation(np.array([0.15]), gain=gain, position=0.1)
    assert plain.simulate_rig(PAR, move)["u"][0] == command
    assert plain.simulate_rig(PAR, Excitation(np.array([0.05]), gain=1000.0, position=0.1))["u"][0] == -10.0


def test_open_and_imposed_chambers_keep_their_pressure(plain: SimpleNamespace) -> None:
    moving = {"velocity": 0.5, "position": 0.1, "pressure_1": 3e5, "pressure_2": 2e5}
    free, open_ = (plain.simulate_rig(PAR, Excitation(np.zeros(3), chamber_2_open=o, **moving)) for o in (False, True))
    assert free["p2"][2] > 2e5
    assert open_["p2"][2] == 2e5
    given = np.array([[3e5, 2e5], [3.1e5, 2.1e5], [3.2e5, 2.2e5]])
    seen = plain.simulate_rig(PAR, Excitation(np.zeros(3), imposed=given, **moving))
    # half a step before the sample
    assert seen["p1"][1:] == pytest.approx(given[1:, 0] - 0.5 * 1e4 * 1e3 * MAX_STEP)
    assert seen["p2"][1:] == pytest.approx(given[1:, 1] - 0.5 * 1e4 * 1e3 * MAX_STEP)


def test_a_line_delays_the_flow_by_its_steps(plain: SimpleNamespace) -> None:
    """From 1 ms on the valve is open; a line of 0.5 ms feeds from 1.5 ms on, and so half as long until 2 ms."""
    vessel = PAR._replace(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=1e-4)
    move = Excitation(np.array([0.0, 10.0, 10.0]), pressure_1=PAR.ambient)
    rise = [np.diff(plain.simulate_rig(vessel._replace(line_delay=d), move)["p1"]) for d in (0.0, 5e-4)]
    assert rise[0][0] == rise[1][0] == 0.0
    assert rise[1][1] == pytest.approx(0.5 * rise[0][1], rel=1e-6)


def test_time_runs_on_from_sample_to_sample(plain: SimpleNamespace) -> None:
    """A force that swings is read from the acceleration of a heavy piston."""
    par = PAR._replace(swinging_force=200.0, swinging_frequency=100.0, coulomb=0.0, viscous=0.0, mass=1e3)
    a = plain.simulate_rig(par, Excitation(np.zeros(8), position=0.1, velocity=1e-9))["a"]
    assert a == pytest.approx(-0.2 * np.sin(2 * np.pi * 100.0 * 1e-3 * np.arange(8)), abs=1e-3)


@pytest.mark.parametrize(("rate", "rows"), [(1e3, 2), (2e3, 4), (1.0 / MAX_STEP, round(2e-3 / MAX_STEP))])
def test_commands_of_a_millisecond_make_as_many_rows_as_the_rate_asks_for(
    plain: SimpleNamespace, rate: float, rows: int
) -> None:
    seen = plain.simulate_rig(PAR, Excitation(np.array([1.0, 2.0]), position=0.1), rate)
    assert {name: values.size for name, values in seen.items()} == dict.fromkeys(seen, rows)
    assert seen["u"].tolist() == [1.0] * (rows // 2) + [2.0] * (rows // 2)
