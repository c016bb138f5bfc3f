"""Linear axes, drawn axes, sectors, PDC and the controller's numbers, each against its definition."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import place_poles

from pneucli.closed_loop import robustness
from pneucli.closed_loop.robustness import AxisDistribution, draw_effect_size, sigma_from_intervals, success_rates
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller import layout
from pneucli.controller.codegen import controller_source
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design import pdc
from pneucli.design.pdc import Pdc
from pneucli.design.sliding import SlidingSector, axis_systems, limit_slope, sector_from_vertices, speed_floor
from pneucli.errors import InputError
from pneucli.physics.declaration import Parameter
from pneucli.physics.effects import catalogue
from pneucli.simulate.build import source
from tests.design import axis

C = axis.controller().values
MODEL = axis.model()
VOLUME_1, VOLUME_2 = (
    C["C_DEAD_VOLUME_1"] + C["C_AREA_1"] * 0.08,
    C["C_DEAD_VOLUME_2"] + C["C_AREA_2"] * (C["C_STROKE"] - 0.08),
)


def test_the_whole_axis_is_the_derivative_of_motion_and_gas() -> None:
    """dv/dt by pressures and viscous friction, dp/dt = -kappa p A v / V (2.47), opposite in chamber 2."""
    found = axis_systems(C, 0.08, 3e5, 2e5)
    m, k = C["C_MASS"], C["C_GAMMA"]
    whole = found["whole"]
    assert whole.states == ("x", "v", "p1", "p2")
    np.testing.assert_allclose(
        whole.A,
        np.array([
            [0, 1, 0, 0],
            [0, -C["C_VISCOUS"] / m, C["C_AREA_1"] / m, -C["C_AREA_2"] / m],
            [0, -k * 3e5 * C["C_AREA_1"] / VOLUME_1, 0, 0],
            [0, k * 2e5 * C["C_AREA_2"] / VOLUME_2, 0, 0],
        ]),
    )  # fmt: skip
    assert whole.B.ravel().tolist() == [0, 0, 1, 0]
    np.testing.assert_allclose(whole.E, np.array([[0, 0], [1 / m, 0], [0, 1], [0, 0]]))
    assert whole.disturbances == ("friction and load", "other flows")
    mechanical, pneumatic = found["mechanical"], found["pneumatic"]
    np.testing.assert_allclose(mechanical.A, whole.A[:2, :2])
    np.testing.assert_allclose(mechanical.B, np.array([[0], [1 / m]]))
    np.testing.assert_allclose(mechanical.E, mechanical.B)
    assert (mechanical.states, mechanical.disturbances) == (("x", "v"), ("friction and load",))
    assert [x.tolist() for x in (pneumatic.A, pneumatic.B, pneumatic.E)] == [[[0.0]], [[1.0]], [[1.0]]]
    assert (pneumatic.states, pneumatic.disturbances) == (("p1",), ("other flows and the motion",))


def test_the_parameter_varying_axis_is_friction_over_speed_and_the_stiffness_of_both_chambers() -> None:
    v, x, floor = 0.03, 0.08, 0.04
    found = pdc.axis_matrices(C, np.array(v), np.array(x), floor)
    speed = 0.05
    friction = C["C_COULOMB"] + (C["C_STATIC"] - C["C_COULOMB"]) / (1 + (speed / C["C_STRIBECK"]) ** 2)
    half = C["C_DEAD_VOLUME_2"] + 0.5 * C["C_AREA_2"] * C["C_STROKE"]
    p2 = C["C_P_MEAN"] * (half / VOLUME_2) ** C["C_GAMMA"]
    p1 = C["C_AMBIENT"] + C["C_AREA_2"] / C["C_AREA_1"] * (p2 - C["C_AMBIENT"])
    stiffness = C["C_GAMMA"] * (p1 * C["C_AREA_1"] ** 2 / VOLUME_1 + p2 * C["C_AREA_2"] ** 2 / VOLUME_2)
    wanted = np.zeros((3, 4))
    wanted[0, 1] = 1.0
    wanted[1, 1:3] = -(friction / speed + C["C_VISCOUS"]) / C["C_MASS"], 1.0 / C["C_MASS"]
    wanted[2, 1], wanted[2, 3] = -stiffness, C["C_AREA_1"] * C["C_GAMMA_R_T"] / VOLUME_1
    assert found == pytest.approx(wanted)


def test_a_simulated_axis_decays_and_shows_the_largest_flow() -> None:
    """One vertex everywhere and a start so small that the axis is linear: against the matrix exponential."""
    both = pdc.axis_matrices(C, np.array(0.0), np.array(C["C_STROKE"] / 2), 0.05)
    gains = place_poles(both[:, :3], both[:, 3:], [-20.0 + 100j, -20.0 - 100j, -60.0]).gain_matrix
    weights = SimpleNamespace(
        grids=(np.array([-1.0, 1.0]), np.array([0.0, C["C_STROKE"]])), weights_at=lambda v, x: (np.ones(1), np.ones(1))
    )
    x0, scale = np.array([1e-9, 0.0, 0.0]), np.array([1.0, 1e-2, 1e-4])
    found = Pdc(gains[None], np.diag(scale**2), 15.0, "optimal", -1.0, -1.0, np.zeros((1, 2), complex))
    peak, decayed = pdc.simulate_pdc(C, 0.05, weights, found, x0)  # type: ignore[arg-type]
    step, states = expm((both[:, :3] - both[:, 3:] @ gains) * 2e-4), [x0]
    for _ in range(int(0.2 / 2e-4) - 1):
        states.append(step @ states[-1])
    flows, grown = np.abs(np.array(states) @ gains[0]), np.sum((np.array(states) * scale) ** 2, axis=1) / 1e-18
    grown *= np.exp(30.0 * 2e-4 * np.arange(grown.size))
    assert np.argmax(grown) > 10
    assert (peak, decayed) == (pytest.approx(flows.max(), rel=1e-6), pytest.approx(grown.max(), rel=1e-6))


# --- linear matrix inequalities, checked without a solver


def test_the_decay_inequality_is_lyapunovs() -> None:
    """dx/dt = -2 x + u with u = -f x and X = 1 / P: 2 (-2 - f) X + 2 a X < 0 for a < 2 + f."""
    A, B, X = np.array([[[-2.0]]]), np.array([[[1.0]]]), np.array([[0.5]])
    M = np.array([[[3.0 * 0.5]]])
    assert pdc._largest_eigenvalue(A, B, X, M, 4.0) == pytest.approx(2 * (-5.0 + 4.0) * 0.5)
    assert pdc._worst_pole(A, B, np.array([[[3.0]]])) == pytest.approx(-5.0)


def test_pairs_of_vertices_count_too() -> None:
    """Each vertex under its own gain decays at 5/s; crosswise at (-2 - 1) and (-4 - 3), in the mean 5 again."""
    A, B = np.array([[[-2.0]], [[-4.0]]]), np.ones((2, 1, 1))
    F = np.array([[[3.0]], [[1.0]]])
    assert pdc._worst_pole(A, B, F) == pytest.approx(-5.0)
    assert pdc._worst_pole(A, 2.0 * B, F) == pytest.approx(-6.0)
    assert pdc._largest_eigenvalue(A, B, np.eye(1), F, 1.0) == pytest.approx(2 * (-5.0 + 1.0))
    crossed = np.array([[[3.0]], [[-9.0]]])
    assert pdc._worst_pole(A, B, crossed) == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("changed", "verified"),
    [
        ({}, True),
        ({"status": "optimal_inaccurate"}, False),
        ({"worst_lmi": 1e-9}, False),
        ({"worst_pole": -1.9}, False),
        ({"rate": 0.0}, False),
        ({"P": np.diag([1.0, -1e-9])}, False),
    ],
)
def test_a_design_is_verified_by_eigenvalues(changed: dict[str, Any], verified: bool) -> None:
    found = Pdc(np.ones((1, 1, 2)), np.eye(2), 2.0, "optimal", -2.0, 0.0, np.zeros((1, 2), complex))
    assert replace(found, **changed).verified == verified


# --- sectors


def test_a_sector_has_the_slopes_of_its_vertices_and_width() -> None:
    """(6.18-6.20): lambda1 = (a2 - a1) / (width - 1)."""
    found = sector_from_vertices([[50.0, 10.0], [30.0, 20.0]], 2.0, 1e-3, 20.0, 3.0)
    assert (found.a_1, found.a_2, found.lambda_1, found.lambda_2) == (10.0, 50.0, 20.0, 60.0)
    assert (found.middle, found.steepness, found.mass, found.period) == (40.0, pytest.approx(0.06), 2.0, 1e-3)
    assert found.speed_floor == pytest.approx(20.0 / (2.0 * 40.0))
    assert sector_from_vertices([10.0, 50.0], 2.0, 1e-3, 20.0).lambda_1 == 40.0


@pytest.mark.parametrize("width", [1.0, 0.5])
def test_a_width_not_above_one_is_no_sector(width: float) -> None:
    with pytest.raises(InputError, match=rf"(?s)\[design\] sector_ratio: {width:g}.*above 1"):
        sector_from_vertices([10.0, 50.0], 2.0, 1e-3, 20.0, width)


def test_a_sector_too_steep_is_resolved_less_and_a_flat_one_left_alone() -> None:
    found = sector_from_vertices([10.0, 50.0], 2.0, 1e-3, 20.0, 3.0)
    assert limit_slope(found, 20.0, 60.0) is found
    less = limit_slope(found, 20.0, 30.0)
    assert (less.lambda_1, less.lambda_2, less.a_1, less.a_2) == (pytest.approx(10.0), 30.0, 10.0, pytest.approx(30.0))
    assert less.speed_floor == pytest.approx(20.0 / (2.0 * 20.0))
    assert speed_floor(10.0, 2.0, 20.0, 10.0) == math.inf


def test_the_equivalent_force_leads_along_the_middle_and_knows_the_reference() -> None:
    """(6.16): m (mean a v - middle x2 + acceleration)."""
    s = SlidingSector(10.0, 50.0, 20.0, 60.0, 2.0, 1e-3, 0.1)
    assert s.equivalent_force(0.1, 0.2, 3.0) == pytest.approx(2.0 * (30.0 * 0.1 - 40.0 * 0.2 + 3.0))
    assert s.boundary_layer(8.0) == pytest.approx(8.0 * 1e-3 / (2.0 * 20.0))
    near = 0.5 * s.boundary_layer(8.0)
    assert float(s.switching_term(near, 0.0, s.boundary_layer(8.0))) == pytest.approx(-0.5)
    assert float(s.switching_term(-1.0, 0.0)) == 1.0
    assert s.force(near, 0.0, 0.1, 8.0) == pytest.approx(float(s.equivalent_force(0.1, 0.0)) - 4.0)


@pytest.mark.parametrize(("slope", "warned"), [(200.0, False), (201.0, True)])
def test_a_sector_is_too_steep_beyond_a_fifth_a_sample(slope: float, warned: bool) -> None:
    assert bool(SlidingSector(10.0, 50.0, 20.0, slope, 2.0, 1e-3, 0.1).warning) == warned


# --- drawn axes


def test_all_areas_of_a_valve_vary_together_and_volumes_by_their_tolerance() -> None:
    axes = AxisDistribution(MODEL, {"no.such": 1.0}, {"valve.areas": 0.02, "rig.dead_volume_1": 0.1}, ())
    drawn = [axes.draw(1, k)[0] for k in range(400)]
    factors = np.array([np.array(m.valve.areas) / np.array(MODEL.valve.areas) for m in drawn])
    assert np.ptp(factors, axis=1).max() < 1e-12
    assert np.std(factors[:, 0]) == pytest.approx(0.02, rel=0.1)
    volumes = [m.base_values()["rig.dead_volume_1"] / axis.RIG.dead_volume_1 for m in drawn]
    assert np.mean(volumes) == pytest.approx(1.0, abs=0.02)
    assert np.std(volumes) == pytest.approx(0.1, rel=0.1)
    assert "no.such" not in drawn[0].values


@pytest.mark.parametrize(
    ("typical", "unit", "low", "high"),
    [
        ((1.0, 100.0), "N", 1.0, 100.0),
        ((-2.0, 3.0), "N", -2.0, 3.0),
        (("0.1 strokes", "0.4 strokes"), "m", 0.1 * 0.2, 0.4 * 0.2),
        (("0.5 Coulomb forces", "2 Coulomb forces"), "N", 7.5, 30.0),
    ],
)
def test_a_plausible_size_lies_between_the_typical_ones(
    typical: tuple[float | str, ...], unit: str, low: float, high: float
) -> None:
    """Evenly over the logarithm where both have one sign."""
    parameter = Parameter("size", unit, None, -1e9, 1e9, typical)
    effect: Any = SimpleNamespace(name="e", main_parameters=(parameter,))
    model = replace(MODEL.with_values({"friction.coulomb": 15.0}), rig=replace(axis.RIG, stroke=0.2))
    sizes = np.array([draw_effect_size(effect, model, np.random.default_rng(k))["e.size"] for k in range(500)])
    assert low <= sizes.min() < low + 0.03 * (high - low)
    assert high - 0.03 * (high - low) < sizes.max() <= high
    middle = math.sqrt(low * high) if low * high > 0 else 0.5 * (low + high)
    assert np.median(sizes) == pytest.approx(middle, abs=0.12 * (high - low))
    tight: Any = SimpleNamespace(name="e", main_parameters=(replace(parameter, lower=middle, upper=middle),))
    assert draw_effect_size(tight, model, np.random.default_rng(1))["e.size"] == middle


def test_sigma_is_an_interval_over_twice_1_96() -> None:
    found = sigma_from_intervals(
        {"friction.coulomb": (10.0, 20.0), "no.such": (0.0, 1.0), "friction.viscous": (0.0, np.inf)}, MODEL
    )
    assert found == {"friction.coulomb": pytest.approx(10.0 / 3.919928)}


def test_settings_have_usual_values_and_bounds() -> None:
    usual = robustness.read_settings({}, "here")
    assert (usual.runs, usual.seed) == (112, 0)
    assert usual.checks == {"steady_um": 10.0, "cycle_um": 10.0, "recovery_s": 0.5, "load_error": 0.1}
    assert usual.tolerances == {
        "rig.moving_mass": 0.02, "rig.dead_volume_1": 0.03, "rig.dead_volume_2": 0.03, "rig.supply_pressure": 0.01,
        "valve.areas": 0.02,
    }  # fmt: skip
    least, most = (
        robustness.read_settings({"runs": r, "seed": s}, "here") for r, s in ((1, 0), (1_000_000, 1_000_000))
    )
    assert (least.runs, most.seed) == (1, 1_000_000)
    stated = robustness.read_settings({"name": "mc", "kind": "x", "checks": {"rise_s": 0}}, "here")
    assert stated.checks["rise_s"] == 0.0


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"runs": 1_000_001}, r"here\.runs: 1000001.*a whole number from 1 to 1000000"),
        ({"seed": -1}, r"here\.seed: -1.*a whole number from 0 to 1000000"),
        ({"seed": 1.5}, r"here\.seed: 1\.5"),
        ({"runs": "many"}, "whole number"),
        ({"runs": 0}, "whole number"),
        ({"seeds": 3}, 'did you mean "seed"'),
        ({"checks": {"steady_um": -1}}, r"here\.checks\.steady_um: -1.*not below 0"),
        ({"checks": {"steady_mm": 1.0}}, "steady_um"),
        ({"checks": [1.0]}, "a table of numbers"),
        ({"checks": {"steady_um": "1"}}, "a number, not below 0"),
        ({"tolerances": {"rig.mass": 1}}, r"here\.tolerances\.rig\.mass: unknown key"),
        ({"tolerances": 3}, r"here\.tolerances: 3.*a table of numbers"),
    ],
)
def test_settings_that_cannot_be_read_are_named(table: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=f"(?s){says}"):
        robustness.read_settings(table, "here")


AXES = AxisDistribution(MODEL, {"friction.coulomb": 0.1}, {"valve.areas": 0.1}, (catalogue()["valve-lag"],))


def study(**changed: Any) -> robustness.MonteCarloStudy:
    scene = axis.scenario(axis.controller(), np.full(50, 0.1))
    known = {
        "distribution": AXES,
        "controller": axis.controller(),
        "scenarios": (scene,),
        "setup": ClosedLoopSetup(),
        "runs": 40,
        "seed": 1,
    }
    return robustness.MonteCarloStudy(**{**known, "checks": {"steady_um": 10.0}, **changed})


@pytest.mark.parametrize(
    "changed",
    [
        {"seed": 2},
        {"setup": ClosedLoopSetup(noise_x=1e-6)},
        {"controller": axis.controller().with_values(C_KP=1.0)},
        {"scenarios": (axis.scenario(axis.controller(), np.full(50, 0.11)),)},
        {"scenarios": (axis.scenario(axis.controller(), np.full(50, 0.1), 1.0),)},
        {"distribution": replace(AXES, sigma={"friction.coulomb": 0.2})},
        {"distribution": replace(AXES, tolerances={"valve.areas": 0.2})},
        {"distribution": replace(AXES, effects=())},
        {"distribution": replace(AXES, model=MODEL.with_values({"friction.viscous": 1.0}))},
    ],
)  # fmt: skip
def test_what_decides_the_rows_decides_the_key(changed: dict[str, Any]) -> None:
    assert study(**changed).key() != study().key()


def test_the_number_of_runs_and_the_limits_do_not() -> None:
    assert study(runs=5, checks={}).key() == study().key()


def test_a_check_that_no_run_shows_has_no_rate() -> None:
    rows = [{"run": 0, "effect": "", "rise_s": 1.0, "steady_um": 5.0, "held": {"steady_um": True}}]
    assert [(r.check, r.effect, r.limit) for r in success_rates(rows, {"rise_s": 1.0, "steady_um": 10.0})] == [
        ("steady_um", "all", 10.0), ("steady_um", "", 10.0),
    ]  # fmt: skip


# --- the controller's numbers


def test_every_number_of_the_controller_has_its_place() -> None:
    vector = axis.controller().vector()
    assert vector.size == len(layout.PARAMETERS) - 1 + 4 * 201 + len(layout.STROKE_TABLES) * layout.STROKE_NODES
    for name in layout.PARAMETERS[:-1]:
        assert vector[getattr(layout, name)] == C[name]
    assert tuple(vector[layout.C_TABLE : layout.C_TABLE + 201]) == axis.controller().fill
    assert tuple(vector[layout.C_TABLE + 201 : layout.C_TABLE + 402]) == axis.controller().vent
    named = [name for name in layout.STATE if hasattr(layout, name)]  # rows are named where they begin
    assert [layout.STATE.index(name) for name in named] == [getattr(layout, name) for name in named]


def test_replaced_numbers_are_replaced_alone_and_text_keeps_all() -> None:
    one = axis.controller()
    other = one.with_values(C_KP=7.0)
    assert other.values == {**one.values, "C_KP": 7.0}
    assert (other.fill, other.vent, other.period) == (one.fill, one.vent, 1e-3)
    assert Controller.from_json(other.to_json()) == other


def test_no_function_of_the_kernel_has_the_name_of_one_of_the_controller() -> None:
    """They stand in one text, in which the later one would replace the other."""
    functions = [set(re.findall(r"^def (\w+)", text, re.MULTILINE)) for text in (controller_source(), source(()))]
    assert set.intersection(*functions) == {"control"}


def test_the_kernel_gets_the_controllers_constants_and_functions_as_text() -> None:
    text = controller_source()
    names: dict[str, Any] = {"math": math}
    exec(text.replace("flow_function", "abs"), names)
    for name in (*(n for n in layout.STATE if hasattr(layout, n)), *layout.PARAMETERS, "L_U1", "L_ROW"):
        assert names[name] == getattr(layout, name)
    assert all(callable(names[name]) for name in ("clamp", "cascade_step", "control", "quantize", "step_law"))
    assert all(callable(names[law.step.__name__]) for law in LAWS.values())
    assert "import" not in text
