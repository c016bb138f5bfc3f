"""The flow function's approximation against the exact isentropic one, and the orifice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
