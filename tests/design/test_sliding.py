"""Regular form, matching condition and sliding surfaces, held to their definitions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.design.sliding import (
    axis_systems,
    regular_form,
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
