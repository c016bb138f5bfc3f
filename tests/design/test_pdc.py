"""PDC by LMIs: against known solutions, eigenvalues and simulation."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.design.lpv import axis_matrices, axis_model, compare_weight_types
from pneucli.design.pdc import design_pdc
from pneucli.errors import InputError
from tests.design import axis

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
