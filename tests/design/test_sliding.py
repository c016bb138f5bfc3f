"""Regular form, matching condition and sliding surfaces, held to their definitions."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.controller.layout import C_SECTOR_1, C_SECTOR_2
from pneucli.controller.standstill import sector_switching_term
from pneucli.design.pdc import axis_matrices, axis_model, compare_weight_types, design_pdc
from pneucli.design.sliding import (
    axis_systems,
    limit_slope,
    regular_form,
    sector_from_vertices,
    surface_by_lq,
    surface_by_poles,
    unmatched_disturbances,
)
from pneucli.errors import InputError
from tests.design import axis

SYSTEMS = axis_systems(axis.controller().values, 0.1, 3e5, 3e5)
A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -400.0, -25.0]])
B = np.array([[0.0], [1.0], [5.0]])


@settings(deadline=None, max_examples=50)
@given(st.integers(2, 5), st.integers(1, 2), st.integers(0, 2**32 - 1))
def test_in_regular_form_the_inputs_act_on_the_last_states_alone_and_the_poles_stay(n: int, m: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((n + 1, n + 1)), rng.standard_normal((n + 1, m))
    form = regular_form(a, b)
    assert np.allclose((form.T @ b)[:-m], 0.0, atol=1e-12)
    whole = np.block([[form.A11, form.A12], [form.A21, form.A22]])
    assert np.allclose(np.poly(whole), np.poly(a), rtol=1e-8, atol=1e-8)


def test_the_whole_pneumatic_system_breaks_the_matching_condition_and_its_subsystems_keep_it() -> None:
    """Thesis 7.1: the valve acts on p1, friction and load on v."""
    assert unmatched_disturbances(SYSTEMS["whole"]) == {"friction and load": ["v"]}
    assert not unmatched_disturbances(SYSTEMS["mechanical"])
    assert not unmatched_disturbances(SYSTEMS["pneumatic"])


def test_a_surface_by_pole_placement_slides_with_those_poles() -> None:
    surface = surface_by_poles(A, B, [-10.0, -20.0])
    equivalent = A - B @ np.linalg.solve(surface.S @ B, surface.S @ A)  # ds/dt = 0 (5.9)
    assert np.sort(np.linalg.eigvals(equivalent).real) == pytest.approx([-20.0, -10.0, 0.0], abs=1e-6)


def test_the_lq_surface_is_the_cheapest_one_near_it() -> None:
    """The cost while sliding, by simulation-free means: Lyapunov's equation for each surface."""
    from scipy.linalg import solve_continuous_lyapunov

    Q = np.diag([4.0, 1.0, 0.1])
    form = regular_form(A, B)
    best = surface_by_lq(A, B, Q)

    def cost(S: np.ndarray) -> float:
        c = (S @ form.T.T) / (S @ form.T.T)[0, -1]
        lift = form.T.T @ np.vstack([np.eye(2), -c[:, :2]])  # x over the reduced state while s = 0
        loop = form.A11 - form.A12 @ c[:, :2]
        return float(np.trace(solve_continuous_lyapunov(loop.T, -lift.T @ Q @ lift)))

    rng = np.random.default_rng(0)
    others = [cost(best.S * (1.0 + 0.05 * rng.standard_normal((1, 3)))) for _ in range(50)]
    assert cost(best.S) <= min(others)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (
            lambda: regular_form(A, np.hstack([B, 2 * B])),
            ("the input matrix", "rank below 2", "inputs that act independently"),
        ),
        (lambda: surface_by_poles(A, B, [-10.0]), ("poles", "1", "2, the states less the inputs")),
        (lambda: surface_by_poles(A, B, [-10.0, -10.0]), ("poles", None, "poles that the inputs can reach")),
        (
            lambda: surface_by_lq(A, B, np.diag([1.0, 1.0, 0.0])),
            ("Q", "not positive definite", "a weight above 0 on every state"),
        ),
    ],
)
def test_what_has_no_surface_is_refused(asked: Callable[[], object], says: tuple[str, str | None, str]) -> None:
    with pytest.raises(InputError) as error:
        asked()
    where, found, wanted = says
    assert (error.value.where, error.value.wanted) == (where, wanted)
    assert found in (error.value.found, None)


# --- the sliding sector: its geometry (thesis 5.11-5.14, 6.9-6.20), and what it does to a piston with dry friction


MASS, STATIC, PERIOD = axis.TRUTH["mass"], axis.TRUTH["static"], 1e-3
STEEP = sector_from_vertices([7738.0, 32.0], MASS, PERIOD, STATIC)  # the vertices of model B of fixtures/demo
SECTOR = limit_slope(STEEP, STATIC, 60.0)
NUMBERS = st.floats(-1.0, 1.0).filter(lambda x: abs(x) > 1e-6)


@given(NUMBERS)
def test_for_a_constant_reference_both_lines_have_the_same_equivalent_force(v: float) -> None:
    """F_eq,i = m (a_i - lambda_i) x2 (6.16), which the choice of the lines makes equal (6.17, 6.18)."""
    forces = [MASS * (a - line) * v for a, line in ((STEEP.a_1, STEEP.lambda_1), (STEEP.a_2, STEEP.lambda_2))]
    assert forces[0] == pytest.approx(forces[1], rel=1e-9)
    assert STEEP.equivalent_force(v, v) == pytest.approx(forces[0], rel=1e-9)


@given(NUMBERS, NUMBERS)
def test_outside_the_sector_it_is_a_relay_inside_it_lies_between(x1: float, x2: float) -> None:
    s1, s2 = x2 + SECTOR.lambda_1 * x1, x2 + SECTOR.lambda_2 * x1
    u = float(SECTOR.switching_term(x1, x2))
    if s1 * s2 > 0:
        assert u == pytest.approx(-np.sign(s1))
    assert -1.0 <= u <= 1.0


@given(st.floats(0.01, 1.0))
def test_it_is_continuous_over_both_lines(x1: float) -> None:
    for line in (SECTOR.lambda_1, SECTOR.lambda_2):
        sides = SECTOR.switching_term(x1, -line * x1 * np.array([1 - 1e-9, 1 + 1e-9]))
        assert sides[0] == pytest.approx(sides[1], abs=1e-6)


def test_it_is_zero_at_the_origin_and_near_the_middle_line() -> None:
    assert SECTOR.switching_term(0.0, 0.0) == 0.0
    assert abs(float(SECTOR.switching_term(1.0, -SECTOR.middle))) < 1e-12


@given(NUMBERS, NUMBERS)
def test_the_controller_switches_by_the_same_term(x1: float, x2: float) -> None:
    """The step counts errors as reference minus position, hence the sign."""
    c = axis.controller().vector()
    c[C_SECTOR_1], c[C_SECTOR_2] = SECTOR.lambda_1, SECTOR.lambda_2
    assert sector_switching_term(-x1, -x2, c) == pytest.approx(float(SECTOR.switching_term(x1, x2)), abs=1e-12)


def test_vertices_that_the_sample_time_cannot_follow_lead_to_a_remark_that_states_the_choice() -> None:
    assert "lambda2 T = 15.4" in STEEP.warning
    assert "1.3 mm/s" in STEEP.warning
    assert SECTOR.warning == ""
    assert SECTOR.lambda_2 - SECTOR.lambda_1 == pytest.approx(SECTOR.a_2 - SECTOR.a_1)  # 6.18 still holds


def test_a_model_without_dry_friction_has_no_sector() -> None:
    with pytest.raises(InputError, match="equal"):
        sector_from_vertices([20.0, 20.0], MASS, PERIOD, STATIC)


def piston(force: object, seconds: float = 2.0, x0: float = 0.03) -> tuple[np.ndarray, np.ndarray]:
    """A piston with set-valued Stribeck friction under force(x1, x2), sampled at PERIOD; returns x and F."""
    x, v, positions, forces = x0, 0.0, [], []
    for _ in range(int(seconds / PERIOD)):
        f = float(force(x, v))  # type: ignore[operator]
        positions.append(x)
        forces.append(f)
        for _ in range(10):
            h = PERIOD / 10
            level = axis.TRUTH["coulomb"] + (STATIC - axis.TRUTH["coulomb"]) / (
                1 + (v / axis.TRUTH["stribeck_velocity"]) ** 2
            )
            free = v + h / MASS * (f - axis.TRUTH["viscous"] * v)
            new = free - np.clip(free, -h * level / MASS, h * level / MASS)
            x, v = x + 0.5 * h * (v + new), new
    return np.array(positions), np.array(forces)


def test_the_sector_chatters_ten_times_less_than_the_plain_relay_and_ends_within_its_reach() -> None:
    """Plain relay (5.6) on the middle line with the same M; chattering: mean change of force from sample to sample."""
    most = 1.5 * STATIC
    relay = piston(lambda x, v: -most * np.sign(v + SECTOR.middle * x))
    sector = piston(lambda x, v: SECTOR.force(x, v, v, most))
    chattering = [np.abs(np.diff(f)).mean() for _, f in (relay, sector)]
    assert 10.0 * chattering[1] <= chattering[0]
    assert np.abs(sector[0][-100:]).max() <= SECTOR.boundary_layer(most)


def test_the_sector_follows_a_moving_reference() -> None:
    """0.5 Hz, 30 mm: the error stays below that of the same force without the reference's rate and acceleration."""
    w, k = np.pi, [0]

    def moving(known: float) -> object:
        def force(x: float, v: float) -> float:
            t = PERIOD * k[0]
            k[0] += 1
            r, rv, ra = 0.03 * np.sin(w * t), 0.03 * w * np.cos(w * t), -0.03 * w * w * np.sin(w * t)
            errors.append(x - r)
            return float(SECTOR.force(x - r, v - known * rv, v, 1.5 * STATIC, known * ra))

        return force

    worst = []
    for known in (1.0, 0.0):
        errors: list[float] = []
        k[0] = 0
        piston(moving(known), 4.0, 0.0)
        worst.append(np.abs(errors[1000:]).max())
    assert worst[0] < 0.5 * worst[1]


# --- PDC by LMIs: against known solutions, eigenvalues and simulation


pytest.importorskip("cvxpy")
C = axis.controller().values
FLOOR = 0.33  # m/s: what test_sector's resolved sector resolves


def test_a_single_integrator_reaches_exactly_the_rate_that_its_bound_allows() -> None:
    """dx/dt = u from x0 = 2 with |u| <= 3: u = -f x is bounded by 3 for f = 1.5, and that is the decay rate."""
    found = design_pdc(np.zeros((1, 1, 1)), np.ones((1, 1, 1)), np.array([2.0]), np.array([2.0]), 3.0)
    assert found.verified
    assert found.rate == pytest.approx(1.5, rel=0.01)
    assert found.gains[0, 0, 0] == pytest.approx(1.5, rel=0.01)


def test_a_wider_bound_lets_it_decay_faster() -> None:
    A = np.array([[[0.0, 1.0], [0.0, -20.0]], [[0.0, 1.0], [0.0, -120.0]]])
    B = np.array([[[0.0], [1.0]], [[0.0], [1.0]]])
    x0, scale = np.array([0.03, 0.0]), np.array([0.03, 0.1])
    rates = [design_pdc(A, B, x0, scale, most) for most in (10.0, 40.0)]
    assert rates[0].rate < rates[1].rate
    assert all(r.verified for r in rates)


def test_an_unstable_plant_that_the_bound_cannot_hold_is_refused() -> None:
    """dx/dt = x + u from 1 with |u| <= 0.5 grows, whatever u."""
    with pytest.raises(InputError, match="bound"):
        design_pdc(np.ones((1, 1, 1)), np.ones((1, 1, 1)), np.ones(1), np.ones(1), 0.5)


def test_the_tp_model_of_the_axis_is_the_axis_at_its_nodes() -> None:
    model = axis_model(C, FLOOR, "cno")
    v, x = model.grids[0][::40], model.grids[1][::10]
    vv, xx = np.meshgrid(v, x, indexing="ij")
    exact = axis_matrices(C, vv, xx, FLOOR)
    assert np.allclose(model.evaluate(vv, xx), exact, rtol=1e-4, atol=1e-4 * np.abs(exact).max(axis=(0, 1)))


def test_tighter_weights_let_the_axis_decay_faster_and_simulation_keeps_what_the_lmis_promise() -> None:
    loose, tight = compare_weight_types(C, FLOOR, ("ino", "cno"))
    assert loose.pdc is not None
    assert tight.pdc is not None
    assert tight.pdc.rate > loose.pdc.rate
    for study in (loose, tight):
        assert study.pdc is not None
        assert study.pdc.verified
        assert study.peak_input_ratio <= 1.0
        assert study.lyapunov_ratio <= 1.0 + 1e-6


def test_a_type_that_does_not_exist_for_these_samples_says_so() -> None:
    (study,) = compare_weight_types(C, FLOOR, ("no",))
    assert study.pdc is None
    assert "cno" in study.failure
