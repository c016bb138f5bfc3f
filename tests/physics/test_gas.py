"""The flow function's approximation against the exact isentropic one, and the orifice."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneucli.physics.effects import catalogue
from pneucli.physics.gas import (
    CRITICAL_RATIO,
    PSI_MAX,
    choked_maximum,
    critical_ratio_of,
    flow_constant,
    flow_function,
    isentropic_flow_function,
    orifice_flow,
)
from pneucli.physics.vectorised import stribeck_friction

PRESSURES = st.floats(5e4, 1.5e6)


def test_the_constants_are_those_of_air() -> None:
    """2.37 and 2.38 at kappa = 1.4."""
    assert pytest.approx(CRITICAL_RATIO, abs=5e-4) == (2 / 2.4) ** (1.4 / 0.4)
    assert isentropic_flow_function(0.0, 1.4) == pytest.approx(PSI_MAX, abs=5e-4)


def test_the_ellipse_errs_by_at_most_a_fifth_of_a_percent_of_the_maximum() -> None:
    ratios = np.linspace(0.0, 1.0, 20_001)
    error = [flow_function(r, CRITICAL_RATIO) - isentropic_flow_function(r, 1.4) for r in ratios]
    assert np.max(np.abs(error)) < 0.002 * PSI_MAX


@given(r=st.floats(0.0, 2.0), b=st.floats(0.02, 0.8))
def test_the_flow_function_falls_from_its_maximum_to_zero(r: float, b: float) -> None:
    assert 0.0 <= flow_function(r, b) <= PSI_MAX
    assert flow_function(r, b) >= flow_function(r + 0.01, b)
    assert (flow_function(r, b) == PSI_MAX) == (r <= b) or abs(r - b) < 1e-7


@given(p=PRESSURES, q=PRESSURES, b=st.floats(0.1, 0.7))
def test_the_orifice_flows_from_the_higher_pressure_alike_both_ways(p: float, q: float, b: float) -> None:
    flow = orifice_flow(p, q, b, 0.0049, 0.0049)
    assert np.sign(flow) == np.sign(p - q)
    assert orifice_flow(q, p, b, 0.0049, 0.0049) == -flow


def test_the_upstream_gas_counts() -> None:
    assert orifice_flow(6e5, 1e5, 0.528, 2.0, 1.0) == 2 * orifice_flow(6e5, 1e5, 0.528, 1.0, 1.0)
    assert orifice_flow(1e5, 6e5, 0.528, 2.0, 1.0) == orifice_flow(1e5, 6e5, 0.528, 1.0, 1.0)


@pytest.mark.parametrize("kappa", [1.2, 1.4, 5 / 3])
def test_another_gas_has_its_own_maximum_and_critical_ratio(kappa: float) -> None:
    """Against the exact function, whose maximum over r these are."""
    ratios = np.linspace(0.3, 0.8, 50_001)
    outflow = np.sqrt(kappa / (kappa - 1) * (ratios ** (2 / kappa) - ratios ** ((kappa + 1) / kappa)))
    assert choked_maximum(kappa) == pytest.approx(outflow.max(), rel=1e-8)
    assert critical_ratio_of(kappa) == pytest.approx(ratios[outflow.argmax()], abs=5e-4)


def test_air_has_the_constants_of_the_thesis() -> None:
    assert critical_ratio_of(1.4) == CRITICAL_RATIO
    assert flow_constant(287.0, 293.15, 1.4) == np.sqrt(2.0 / (287.0 * 293.15))


# --- properties of Stribeck friction; the effect and the vectorised function agree


V = np.linspace(-0.5, 0.5, 1001)
FORCE, SPEED = st.floats(1.0, 100.0), st.floats(1e-3, 0.1)


@given(coulomb=FORCE, viscous=FORCE, velocity=SPEED)
def test_without_a_rise_friction_is_odd_and_affine_beyond_rest(coulomb: float, viscous: float, velocity: float) -> None:
    for law in (
        stribeck_friction(V, coulomb, viscous, coulomb),
        stribeck_friction(V, coulomb, viscous, coulomb, velocity),
    ):
        assert np.allclose(law, -law[::-1], rtol=0, atol=1e-12)
        assert np.allclose(law[V > 0], coulomb + viscous * V[V > 0])
        assert law[V == 0] == 0.0


@given(coulomb=FORCE, rise=FORCE, viscous=FORCE, velocity=SPEED)
def test_stribeck_friction_falls_from_static_to_coulomb(
    coulomb: float, rise: float, viscous: float, velocity: float
) -> None:
    static = coulomb + rise
    dry = stribeck_friction(V, coulomb, viscous, static, velocity) - viscous * V
    slow, at_it, fast = stribeck_friction(velocity * np.array([1e-6, 1.0, 1e3]), coulomb, 0.0, static, velocity)
    assert np.allclose([slow, at_it, fast], [static, coulomb + 0.5 * rise, coulomb], rtol=1e-3, atol=1e-5 * rise)
    assert np.all(np.diff(dry[V > 0]) <= 1e-9)


def test_the_effect_stribeck_equals_equation_3_6() -> None:
    rise = catalogue()["stribeck"].ports["dry_rise"]
    law = stribeck_friction(V[V > 0], 14.0, 0.0, 22.0, 0.015)
    assert np.allclose([14.0 + rise(14.0, v, 22.0, 0.015) for v in V[V > 0]], law)
    assert np.allclose(14.0 + 8.0 / (1.0 + (V[V > 0] / 0.015) ** 2), law)


@given(v=st.floats(-2, 2), coulomb=FORCE, viscous=FORCE, rise=st.floats(0, 100), velocity=SPEED)
def test_friction_adds_no_energy(v: float, coulomb: float, viscous: float, rise: float, velocity: float) -> None:
    assert (stribeck_friction(np.array([v]), coulomb, viscous, coulomb + rise, velocity) * v)[0] >= 0.0
