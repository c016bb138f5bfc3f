"""The sliding sector: its geometry (thesis 5.11-5.14, 6.9-6.20), and what it does to a piston with dry friction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneucli.controller.layout import C_SECTOR_1, C_SECTOR_2
from pneucli.controller.standstill import sector_switching_term
from pneucli.design.sliding_sector import limit_slope, sector_from_vertices
from pneucli.errors import InputError
from tests.design import axis

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
