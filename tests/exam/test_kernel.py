"""Every term of the rig's equations by itself, against what a textbook says of it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from pneucli.exam.rig.gas import GAS_CONSTANT, KAPPA
from pneucli.exam.rig.hose import SPEED_OF_SOUND
from pneucli.exam.rig.kernel import (
    MAX_STEP,
    P1,
    P2,
    PS,
    T1,
    T2,
    VL,
    XL,
    V,
    X,
    Z,
)
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters
from pneucli.exam.rig.simulation import Excitation

PAR = Parameters(coulomb=15.0, viscous=50.0, overlap=0.5, exponent=2.0)
C_V = GAS_CONSTANT / (KAPPA - 1.0)
HALF_A_STEP = MAX_STEP / math.log(2.0)  # s, of a lag that takes half the way in one step


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


def test_nothing_flows_against_the_pressure(plain: SimpleNamespace) -> None:
    assert plain.orifice_flow(2e-6, 5e5, 300.0, 6e5, 0.4) == 0.0


@pytest.mark.parametrize(
    ("volts", "area"), [(0.3, 0.0), (0.5, 0.0), (-0.5, 0.0), (5.25, 5e-7), (-5.25, -5e-7), (10, 2e-6)]
)
def test_beyond_the_overlap_the_area_is_a_power_of_the_opening(
    plain: SimpleNamespace, volts: float, area: float
) -> None:
    """Half of the way from 0.5 V to 10 V, squared, is a quarter."""
    assert plain.valve_area(PAR, volts, 3.0) == pytest.approx(area)


def test_a_gain_that_drifts_changes_the_area_over_time(plain: SimpleNamespace) -> None:
    assert plain.valve_area(PAR._replace(gain_drift=0.1), 10.0, 3.0) == pytest.approx(1.3 * 2e-6)


def test_an_open_valve_feeds_from_the_supply_or_into_the_ambient(plain: SimpleNamespace) -> None:
    s = state()
    into = plain.valve_flow(PAR, 1e-6, 0.0, s)
    out = plain.valve_flow(PAR, -1e-6, 0.0, s)
    assert into == (pytest.approx(choked(1e-6, 7e5, PAR.temperature)), 0.0)
    assert out == (0.0, pytest.approx(choked(1e-6, 3e5, 290.0)))


def test_a_leaky_valve_feeds_both_ways_at_once(plain: SimpleNamespace) -> None:
    leaky = PAR._replace(valve_leak_area=1e-7)
    shut, open_ = (plain.valve_flow(leaky, area, 0.0, state()) for area in (0.0, 1e-6))
    assert shut == pytest.approx((choked(1e-7, 7e5, PAR.temperature), choked(1e-7, 3e5, 290.0)))
    assert open_ == pytest.approx((choked(1.1e-6, 7e5, PAR.temperature), shut[1]))


def test_a_ripple_of_the_supply_shows_in_what_flows_in(plain: SimpleNamespace) -> None:
    rippling = PAR._replace(ripple=1e5, ripple_frequency=5.0)
    at_crest, at_zero = (plain.valve_flow(rippling, 1e-6, t, state())[0] for t in (0.05, 0.1))
    assert at_crest == pytest.approx(choked(1e-6, 8e5, PAR.temperature))
    assert at_zero == pytest.approx(choked(1e-6, 7e5, PAR.temperature))


def test_a_clogged_silencer_throttles_large_flows_more(plain: SimpleNamespace) -> None:
    free = choked(1e-6, 3e5, 290.0)
    clogged = plain.valve_flow(PAR._replace(silencer=300.0), -1e-6, 0.0, state())[1]
    assert clogged == pytest.approx(free / (1.0 + 300.0 * free))


def test_the_valves_critical_ratio_is_its_own(plain: SimpleNamespace) -> None:
    """At 0.6 of the upstream pressure an orifice of ratio 0.2 has left its choked branch by half of the rest."""
    found = plain.valve_flow(PAR._replace(critical_ratio=0.2), 1e-6, 0.0, state(P1=4.2e5))[0]
    assert found == pytest.approx(math.sqrt(0.75) * choked(1e-6, 7e5, PAR.temperature))


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


def gas(plain: SimpleNamespace, par: Parameters, s: np.ndarray, q_in: float = 0.0, q_out: float = 0.0, held: int = 0):
    ds = np.zeros(10)
    plain.gas_rates(par, s, (q_in, q_out, 0.0, 0.0), held, ds)
    return ds


WARM = PAR._replace(heat_conductance=0.0, piston_area_1=8e-4, piston_area_2=7e-4, dead_volume_2=20e-6)
VOLUMES = (30e-6 + 8e-4 * 0.1, 20e-6 + 7e-4 * 0.1)


def masses(s: np.ndarray, ds: np.ndarray) -> tuple[float, float]:
    """Rates of both masses in kg/s while the piston rests, from the rates of p and T."""
    return tuple(  # type: ignore[return-value]
        volume / (287.0 * s[t]) * (ds[p] - s[p] * ds[t] / s[t])
        for volume, p, t in zip(VOLUMES, (P1, P2), (T1, T2), strict=True)
    )


def energies(ds: np.ndarray) -> tuple[float, float]:
    return VOLUMES[0] * ds[P1] / 0.4, VOLUMES[1] * ds[P2] / 0.4


def test_the_valve_feeds_only_chamber_1(plain: SimpleNamespace) -> None:
    s = state()
    ds = gas(plain, WARM, s, 2e-3, 5e-4)
    assert masses(s, ds) == pytest.approx((1.5e-3, 0.0))
    assert energies(ds) == pytest.approx((KAPPA * C_V * (2e-3 * WARM.temperature - 5e-4 * 290.0), 0.0))


def test_a_second_valve_feeds_only_chamber_2(plain: SimpleNamespace) -> None:
    s, ds = state(T2=280.0), np.zeros(10)
    plain.gas_rates(WARM, s, (0.0, 0.0, 2e-3, 5e-4), 0, ds)
    assert masses(s, ds) == pytest.approx((0.0, 1.5e-3))
    assert energies(ds) == pytest.approx((0.0, KAPPA * C_V * (2e-3 * WARM.temperature - 5e-4 * 280.0)))


@pytest.mark.parametrize(("p1", "p2", "direction"), [(6e5, 2e5, 1.0), (2e5, 6e5, -1.0)])
def test_a_leaky_piston_seal_moves_mass_and_energy_from_the_higher_to_the_lower_pressure(
    plain: SimpleNamespace, p1: float, p2: float, direction: float
) -> None:
    s = state(P1=p1, P2=p2)
    ds = gas(plain, WARM._replace(piston_leak_area=1e-7), s)
    donor = s[T1] if direction > 0 else s[T2]
    over = direction * choked(1e-7, 6e5, donor)
    assert masses(s, ds) == pytest.approx((-over, over))
    assert energies(ds) == pytest.approx((-KAPPA * C_V * donor * over, KAPPA * C_V * donor * over))


def test_a_leak_of_chamber_1_loses_to_the_ambient_or_draws_from_it(plain: SimpleNamespace) -> None:
    leaky = WARM._replace(leak_area=1e-7)
    full, thin = state(), state(P1=0.3e5)
    lost, drawn = choked(1e-7, 3e5, 290.0), choked(1e-7, leaky.ambient, leaky.temperature)
    assert masses(full, gas(plain, leaky, full))[0] == pytest.approx(-lost)
    assert masses(thin, gas(plain, leaky, thin))[0] == pytest.approx(drawn)
    assert energies(gas(plain, leaky, full))[0] == pytest.approx(-KAPPA * C_V * 290.0 * lost)
    assert energies(gas(plain, leaky, thin))[0] == pytest.approx(KAPPA * C_V * leaky.temperature * drawn)


def test_a_leak_of_chamber_2_leaves_chamber_1_alone(plain: SimpleNamespace) -> None:
    leaky, s, thin = WARM._replace(leak_area_2=1e-7), state(T2=280.0), state(P2=0.3e5)
    assert masses(s, gas(plain, leaky, s)) == pytest.approx((0.0, -choked(1e-7, 2.5e5, 280.0)))
    assert masses(thin, gas(plain, leaky, thin))[1] == pytest.approx(choked(1e-7, leaky.ambient, leaky.temperature))


def test_leaks_of_chamber_2_are_laminar_or_open_under_pressure_like_those_of_chamber_1(plain: SimpleNamespace) -> None:
    same = {"P1": 2.5e5, "T1": 290.0, "P2": 2.5e5, "T2": 290.0}
    for field, value in (("laminar_conductance", 1e-11), ("relief_growth", 1e-12)):
        one, other = (
            masses(
                state(**same),
                gas(plain, WARM._replace(**{field + side: value, "relief_pressure" + side: 1e5}), state(**same)),
            )
            for side in ("", "_2")
        )
        assert one[0] < 0.0 == one[1]
        assert other == pytest.approx((0.0, one[0]))


def test_a_dead_volume_of_chamber_2_slows_its_pressure(plain: SimpleNamespace) -> None:
    more, usual = (gas(plain, par, state(V=0.5)) for par in (WARM._replace(dead_volume_added_2=VOLUMES[1]), WARM))
    assert (more[P1], more[P2]) == pytest.approx((usual[P1], 0.5 * usual[P2]))


def test_walls_grow_with_the_chamber_and_a_vessel_is_as_long_as_it_is_wide(plain: SimpleNamespace) -> None:
    """A bore of 32 mm over 100 mm: 2 pi r^2 + 2 pi r l; a can of diameter d = l: 1.5 pi d^2 around pi d^3 / 4."""
    r = 0.016
    area = math.pi * r**2
    assert plain.wall_area(area, 0.1 * area) == pytest.approx(2 * area + 2 * math.pi * r * 0.1)
    assert plain.wall_area(0.0, math.pi / 4 * 0.06**3) == pytest.approx(1.5 * math.pi * 0.06**2)


def test_convection_warms_each_chamber_by_its_own_walls(plain: SimpleNamespace) -> None:
    s, par = state(), WARM._replace(wall_coefficient=50.0)
    warmed = np.array(energies(gas(plain, par, s))) - energies(gas(plain, WARM, s))
    areas = zip((par.piston_area_1, par.piston_area_2), VOLUMES, strict=True)
    walls = [50.0 * plain.wall_area(area, volume) for area, volume in areas]
    assert warmed == pytest.approx([walls[0] * (par.temperature - 290.0), walls[1] * (par.temperature - 300.0)])


PUMP = PAR._replace(pump_flow=2e-3, pump_clearance=1.0 / 4e5)


@pytest.mark.parametrize(
    ("volts", "gauge", "flow"), [(10, 0, 2e-3), (5, 0, 1e-3), (5, 1e5, 0.75e-3), (10, 4e5, 0), (10, 5e5, 0), (-5, 0, 0)]
)
def test_a_pump_delivers_by_its_speed_and_less_against_pressure(
    plain: SimpleNamespace, volts: float, gauge: float, flow: float
) -> None:
    assert plain.pump_flow(PUMP, volts, PUMP.ambient + gauge) == pytest.approx(flow)


def test_what_slips_in_a_pump_does_not_go_with_its_speed(plain: SimpleNamespace) -> None:
    slipping = PUMP._replace(pump_slip=2e-9)
    for volts in (5.0, 10.0):
        lost = plain.pump_flow(PUMP, volts, PUMP.ambient + 1e5) - plain.pump_flow(slipping, volts, PUMP.ambient + 1e5)
        assert lost == pytest.approx(2e-4)
    assert plain.pump_flow(slipping, 1.0, PUMP.ambient + 1e5) == 0.0


LOOP = PAR._replace(command_range=5.0, regulated_span=5e5, regulated_band=0.5e5)


@pytest.mark.parametrize(
    ("asked", "gauge", "opening"), [(0, 2.5e5, 0), (5, 4.9e5, 1.0), (-5, 0.1e5, -1.0), (0, 0, 5.0), (0, 5e5, -5.0)]
)
def test_a_valve_with_a_pressure_loop_opens_by_the_error_of_its_pressure(
    plain: SimpleNamespace, asked: float, gauge: float, opening: float
) -> None:
    assert plain.regulated_opening(LOOP, asked, LOOP.ambient + gauge) == pytest.approx(opening)
    assert plain.regulated_opening(PAR, asked, LOOP.ambient + gauge) == asked


def test_motion_compresses_one_chamber_and_expands_the_other(plain: SimpleNamespace) -> None:
    ds = gas(plain, WARM, state(V=0.5))
    assert ds[P1] == pytest.approx(-1.4 * 3e5 * 8e-4 * 0.5 / VOLUMES[0])
    assert ds[P2] == pytest.approx(1.4 * 2.5e5 * 7e-4 * 0.5 / VOLUMES[1])


def test_an_added_dead_volume_belongs_to_chamber_1(plain: SimpleNamespace) -> None:
    more = gas(plain, WARM._replace(dead_volume_added=VOLUMES[0]), state(), 1e-3)
    assert more[P1] == pytest.approx(0.5 * gas(plain, WARM, state(), 1e-3)[P1])


@pytest.mark.parametrize(("held", "moved"), [(0, [True, True]), (1, [True, False]), (2, [False, False])])
def test_pressures_that_are_held_do_not_change(plain: SimpleNamespace, held: int, moved: list[bool]) -> None:
    ds = gas(plain, WARM, state(V=0.5), 1e-3, 0.0, held)
    assert [bool(ds[P1]), bool(ds[P2])] == moved


def test_a_supply_of_finite_volume_falls_and_is_fed_up_to_its_setting(plain: SimpleNamespace) -> None:
    par = WARM._replace(supply=7.5e5, supply_volume=2e-3, regulator_conductance=1e-8)
    rate = gas(plain, par, state(), 2e-3)[PS]
    assert rate == pytest.approx(1.4 * 287.0 * par.temperature * (1e-8 * 0.5e5 - 2e-3) / 2e-3)
    assert gas(plain, par, state(PS=8e5))[PS] == 0.0
    assert gas(plain, WARM, state(), 2e-3)[PS] == 0.0


@pytest.mark.parametrize(
    ("changed", "s", "direction", "t", "levels"),
    [
        ({}, {}, 1.0, 0.0, (15.0, 15.0)),
        ({"static": 25.0}, {}, 1.0, 0.0, (25.0, 25.0)),
        ({"static": 25.0}, {"V": -0.01}, 1.0, 0.0, (20.0, 20.0)),  # half the rise at the Stribeck velocity
        ({"static": 10.0}, {}, 1.0, 0.0, (15.0, 15.0)),
        ({"static": 25.0, "drop": 0.4}, {}, 1.0, 0.0, (25.0, 9.0)),
        ({"static": 25.0, "drop": 0.0}, {}, 1.0, 0.0, (25.0, 15.0)),  # one Coulomb level, no rise while slowing (6.21)
        ({"drop": 0.4, "viscous_drop": 0.5, "viscous": 50.0}, {"V": -0.2}, -1.0, 0.0, (15.0, 9.0 - 5.0)),
        ({"drop": 0.0, "viscous_drop": -0.5, "viscous": 50.0}, {"V": 0.2}, 1.0, 0.0, (15.0, 15.0)),  # never more
        ({"viscous_drop": 0.5, "viscous": 50.0}, {"V": 0.2}, 1.0, 0.0, (15.0, 15.0)),  # both branches are one
        ({"asymmetry": 0.2}, {}, 1.0, 0.0, (18.0, 18.0)),
        ({"asymmetry": 0.2}, {}, -1.0, 0.0, (12.0, 12.0)),
        ({"pressure_gain": 1e-6}, {"P1": 3e5, "P2": 2.026e5}, 1.0, 0.0, (19.5, 19.5)),  # 3 bar over ambient in sum
        ({"position_from": 0.1, "position_to": 0.2, "position_gain": 1.0}, {}, 1.0, 0.0, (30.0, 30.0)),
        ({"position_from": 0.0, "position_to": 0.1, "position_gain": 1.0}, {}, 1.0, 0.0, (30.0, 30.0)),
        ({"position_from": 0.11, "position_to": 0.2, "position_gain": 1.0}, {}, 1.0, 0.0, (15.0, 15.0)),
        ({"running_in": 0.5}, {}, 1.0, 1.5 * math.log(2.0), (11.25, 11.25)),  # half of the half is lost
        ({"running_in": 0.5}, {}, 1.0, 0.0, (15.0, 15.0)),
    ],
)
def test_dry_friction_while_speeding_up_and_slowing(
    plain: SimpleNamespace, changed: dict, s: dict, direction: float, t: float, levels: tuple[float, float]
) -> None:
    found = plain.dry_friction(PAR._replace(stribeck_velocity=0.01, **changed), t, state(**s), direction)
    assert found == pytest.approx(levels, rel=1e-9)


@pytest.mark.parametrize(
    ("stretch", "rate", "force"), [(0.012, 0.3, 20.0 + 1.5), (-0.012, 0.3, -20.0 + 1.5), (0.0019, 0.3, 0.0)]
)
def test_a_load_pulls_beyond_half_its_gap(plain: SimpleNamespace, stretch: float, rate: float, force: float) -> None:
    loaded = PAR._replace(load_mass=1.0, load_stiffness=2000.0, load_damping=5.0, load_gap=4e-3)
    found = plain.coupling_force(loaded, state(XL=0.1 + stretch, VL=rate + 0.1, V=0.1))
    assert found == pytest.approx(force)


def test_a_load_is_moved_by_what_moves_the_piston(plain: SimpleNamespace) -> None:
    loaded = PAR._replace(load_mass=0.5, load_stiffness=2000.0)
    s, ds = state(XL=0.11, VL=0.2), np.zeros(10)
    plain.state_rates(loaded, 0.0, s, 0.0, (0.0, 0.0, 0.0, 0.0), 2, ds)
    assert ds[XL] == 0.2
    assert ds[VL] == pytest.approx(-20.0 / 0.5)
    assert plain.net_force(loaded, 0.0, s) - plain.net_force(PAR, 0.0, s) == pytest.approx(20.0)


def test_pressures_push_by_their_areas_above_ambient(plain: SimpleNamespace) -> None:
    par = PAR._replace(piston_area_1=8e-4, piston_area_2=7e-4)
    assert plain.net_force(par, 0.0, state()) == pytest.approx(8e-4 * (3e5 - 101300) - 7e-4 * (2.5e5 - 101300))


@pytest.mark.parametrize(
    ("changed", "s", "t", "more"),
    [
        ({"constant_force": 16.0}, {}, 0.0, -16.0),
        ({"spring_stiffness": 200.0, "spring_rest": 0.03}, {}, 0.0, -14.0),
        ({"pitch_force": 9.0, "pitch": 0.02}, {"X": 0.105}, 0.0, -9.0),
        ({"pitch_force": 9.0, "pitch": 0.02}, {"X": 0.1}, 0.0, 0.0),
        ({"swinging_force": 9.0, "swinging_frequency": 1.25}, {}, 0.2, -9.0),
        ({"viscous_asymmetry": 0.2}, {"V": 0.5}, 0.0, -5.0),
        ({"viscous_asymmetry": 0.2}, {"V": -0.5}, 0.0, -5.0),
        ({"warming": 0.4}, {"V": 0.5}, 1.5 * math.log(2.0), 5.0),
        ({"quadratic_drag": 200.0}, {"V": 0.5}, 0.0, -50.0),
        ({"quadratic_drag": 200.0}, {"V": -0.5}, 0.0, 50.0),
        ({"cushion_length": 0.06, "cushion_damping": 100.0}, {"V": 0.5, "X": 0.17}, 0.0, -25.0),  # half of the way in
        ({"cushion_length": 0.06, "cushion_damping": 100.0}, {"V": -0.5, "X": 0.03}, 0.0, 25.0),
        ({"cushion_length": 0.06, "cushion_damping": 100.0}, {"V": -0.5, "X": 0.17}, 0.0, 0.0),
        ({"cushion_length": 0.06, "cushion_damping": 100.0}, {"V": 0.5, "X": 0.1}, 0.0, 0.0),
    ],
)
def test_other_forces_on_the_piston(plain: SimpleNamespace, changed: dict, s: dict, t: float, more: float) -> None:
    found = plain.net_force(PAR._replace(**changed), t, state(**s)) - plain.net_force(PAR, t, state(**s))
    assert found == pytest.approx(more, abs=1e-9)


def test_viscous_friction_opposes_motion(plain: SimpleNamespace) -> None:
    assert plain.net_force(PAR, 0.0, state(V=0.5)) - plain.net_force(PAR, 0.0, state()) == pytest.approx(-25.0)


def pushed(force: float, par: Parameters = PAR, **given: float) -> np.ndarray:
    """A state whose pressures push with this force in N, viscous friction taken into account."""
    s = state(P2=par.ambient, **given)
    s[P1] = par.ambient + (force + par.viscous * s[V]) / par.piston_area_1
    return s


@pytest.mark.parametrize(
    ("force", "mode", "wanted"),
    [
        (45.0, 1.0, 10.0),  # (45 - 15) N over 3 kg
        (-45.0, -1.0, -10.0),
        (9.0, 1.0, 0.0),  # between the branches of a hysteresis the velocity is kept
        (3.0, 1.0, -1.0),  # slowing, at the lower branch: (3 - 6) N
        (-3.0, -1.0, 1.0),
        (45.0, 0.0, 0.0),  # it sticks
    ],
)
def test_force_beyond_dry_friction_accelerates_the_mass(
    plain: SimpleNamespace, force: float, mode: float, wanted: float
) -> None:
    par = PAR._replace(drop=0.6, mass=2.0, extra_mass=1.0)
    s = pushed(force, par, V=0.1 * mode)
    assert plain.acceleration(par, 0.0, s, mode, np.zeros(10)) == pytest.approx(wanted, abs=1e-9)


def test_bristles_bend_and_carry_the_piston(plain: SimpleNamespace) -> None:
    """dz/dt = v - stiffness |v| z / level; force = stiffness z + damping dz/dt (Dahl)."""
    par, ds = PAR._replace(bristle_stiffness=1e4, bristle_damping=20.0), np.zeros(10)
    s = pushed(30.0, par, V=-0.1, Z=-6e-4)
    found = plain.acceleration(par, 0.0, s, -1.0, ds)
    bending = -0.1 + 1e4 * 0.1 * 6e-4 / 15.0
    assert ds[Z] == pytest.approx(bending)
    assert found == pytest.approx((30.0 + 6.0 - 20.0 * bending) / par.mass)


@pytest.mark.parametrize(
    ("force", "given", "rest", "mode"),
    [
        (15.1, {}, 0.0, 1.0),
        (14.9, {}, 0.0, 0.0),
        (-15.1, {}, 0.0, -1.0),
        (5.0, {"V": -0.01}, 0.0, -1.0),  # what moves goes on
        (50.0, {"X": 0.0}, 0.0, 1.0),
        (-50.0, {"X": 0.2}, 0.0, -1.0),
        (21.0, {}, 0.4 * math.log(2.0), 1.0),  # a dwell of that long has grown friction by a quarter: 18.75 N
        (18.0, {}, 0.4 * math.log(2.0), 0.0),
    ],
)
def test_a_piston_breaks_away_beyond_dry_friction(
    plain: SimpleNamespace, force: float, given: dict, rest: float, mode: float
) -> None:
    par = PAR._replace(dwell_gain=0.5, dwell_time=0.4)
    assert plain.motion_sign(par, 0.0, pushed(force, par, **given), rest) == mode


def test_a_vessel_has_no_motion(plain: SimpleNamespace) -> None:
    ds = np.zeros(10)
    plain.state_rates(
        PAR._replace(piston_area_1=0.0, piston_area_2=0.0), 0.0, state(V=1.0), 1.0, (1e-3, 0.0, 0.0, 0.0), 0, ds
    )
    assert (ds[X], ds[V]) == (0.0, 0.0)
    assert ds[P1] > 0.0


# --- the loop


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


@pytest.mark.parametrize(
    ("changed", "before", "after"),
    [
        ({}, (0.0, 0.0, 0.0), (4.0, 4.0, 4.0)),
        ({"spool_stiction": 1.0}, (2.5, 2.5, 2.5), (4.0, 4.0, 4.0)),
        ({"spool_stiction": 1.0}, (3.5, 3.5, 3.5), (3.5, 3.5, 3.5)),
        ({"spool_stiction": 1.0}, (3.0, 3.0, 3.0), (3.0, 3.0, 3.0)),
        ({"valve_lag": HALF_A_STEP}, (0.0, 0.0, 0.0), (4.0, 2.0, 2.0)),
        ({"valve_lag": HALF_A_STEP, "spool_stiction": 1.0}, (0.0, 0.0, 0.0), (4.0, 2.0, 2.0)),
        ({"valve_lag": HALF_A_STEP, "spool_stiction": 1.0}, (3.5, 1.5, 1.5), (3.5, 2.5, 2.5)),
        ({"sluggish_opening": HALF_A_STEP, "spool_stiction": 1.0}, (3.5, 1.5, 1.5), (3.5, 2.5, 2.5)),
        ({"sluggish_opening": HALF_A_STEP}, (4.0, 5.0, 5.0), (4.0, 4.0, 4.0)),
        ({"valve_half_width": 0.5}, (0.0, 0.0, 0.0), (4.0, 4.0, 3.5)),
        ({"valve_half_width": 0.5}, (0.0, 0.0, 9.0), (4.0, 4.0, 4.5)),
        ({"valve_half_width": 0.5}, (0.0, 0.0, 4.2), (4.0, 4.0, 4.2)),
    ],
)
def test_spool_and_opening_follow_a_command_of_4_v(
    plain: SimpleNamespace, changed: dict, before: tuple[float, float, float], after: tuple[float, float, float]
) -> None:
    """Each in the order: where the spool goes, where it is, the opening; of a spool that sticks the lag stays."""
    assert plain._spool(PAR._replace(**changed), MAX_STEP, 4.0, *before) == pytest.approx(after)


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


def test_the_gas_of_a_hose_is_not_in_its_chamber_as_well(plain: SimpleNamespace) -> None:
    """Without flow and heat a moving piston makes dp/dt = -kappa p A v / V of what the hose leaves of the chamber."""
    bore, delay, ds = 2e-3, 1e-3, np.zeros(10)
    par = PAR._replace(hose_bore=bore, line_delay=delay, heat_conductance=0.0, arrangement=ONE_CHAMBER)
    plain.state_rates(par, 0.0, state(V=0.1), 1.0, (0.0, 0.0, 0.0, 0.0), 0, ds)
    chamber_1 = PAR.dead_volume_1 - 0.25 * math.pi * bore**2 * SPEED_OF_SOUND * delay + PAR.piston_area_1 * 0.1
    chamber_2 = PAR.dead_volume_2 + PAR.piston_area_2 * (PAR.stroke - 0.1)  # which no valve feeds
    assert ds[P1] == pytest.approx(-KAPPA * 3e5 * PAR.piston_area_1 * 0.1 / chamber_1)
    assert ds[P2] == pytest.approx(KAPPA * 2.5e5 * PAR.piston_area_2 * 0.1 / chamber_2)


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
