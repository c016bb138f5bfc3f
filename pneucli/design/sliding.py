"""Regular form, matching condition and sliding surfaces of linear systems (thesis 5.1, 5.2, 7.1).

``dx/dt = A x + B u + E d`` with m inputs. A disturbance in the span of B is matched (Drazenovic): it does not act in
sliding mode. Friction and load of the pneumatic axis act on the velocity, where the valve does not act; hence the
cascade of two subsystems that each satisfy the condition.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are

from pneucli.arrays import Array
from pneucli.errors import InputError

ROUNDING_TOLERANCE = 1e-9


@dataclass(frozen=True)
class LinearSystem:
    """A linear system: names of the states, A (n, n), B (n, m), E (n, k) with names of the disturbances, in SI."""

    states: tuple[str, ...]
    A: Array
    B: Array
    E: Array
    disturbances: tuple[str, ...]


@dataclass(frozen=True)
class RegularForm:
    """Regular form ``z = T x``: inputs act on the last m states only; A11 (n - m, n - m), A12, A21, A22, B2 (m, m)."""

    T: Array
    A11: Array
    A12: Array
    A21: Array
    A22: Array
    B2: Array


@dataclass(frozen=True)
class SlidingSurface:
    """A sliding surface ``s = S x`` with S (m, n), and the poles (1/s) of the sliding motion."""

    S: Array
    poles: NDArray[np.complex128]


def axis_systems(c: Mapping[str, float], x: float, p1: float, p2: float) -> dict[str, LinearSystem]:
    """Return the linear axis at rest at x, p1, p2 (2.47-2.52): ``whole``, ``mechanical`` and ``pneumatic``.

    Args:
        c: Parameters of a controller by name.
        x: Position in m.
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.

    Returns:
        Systems by name. Input of ``whole`` and ``pneumatic``: pressure gradient of the valve (Pa/s); of ``mechanical``:
        force (N). Disturbances: friction and load (N), other flows (Pa/s).

    """
    m, area_1, area_2, gamma = c["C_MASS"], c["C_AREA_1"], c["C_AREA_2"], c["C_GAMMA"]
    volume_1 = c["C_DEAD_VOLUME_1"] + area_1 * x
    volume_2 = c["C_DEAD_VOLUME_2"] + area_2 * (c["C_STROKE"] - x)
    a32, a42 = gamma * p1 * area_1 / volume_1, gamma * p2 * area_2 / volume_2
    a22 = c["C_VISCOUS"] / m
    whole = np.array(
        [[0, 1, 0, 0], [0, -a22, area_1 / m, -area_2 / m], [0, -a32, 0, 0], [0, a42, 0, 0]], dtype=np.float64
    )
    return {
        "whole": LinearSystem(
            ("x", "v", "p1", "p2"),
            whole,
            np.array([[0.0], [0.0], [1.0], [0.0]]),
            np.array([[0.0, 0.0], [1.0 / m, 0.0], [0.0, 1.0], [0.0, 0.0]]),
            ("friction and load", "other flows"),
        ),
        "mechanical": LinearSystem(
            ("x", "v"),
            whole[:2, :2],
            np.array([[0.0], [1.0 / m]]),
            np.array([[0.0], [1.0 / m]]),
            ("friction and load",),
        ),
        "pneumatic": LinearSystem(
            ("p1",), np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), ("other flows and the motion",)
        ),
    }


def unmatched_disturbances(system: LinearSystem) -> dict[str, list[str]]:
    """Return the disturbances that violate the matching condition, with the states on which they act and no input does.

    Args:
        system: The linear system. A disturbance is matched if its column of E lies in the span of B.

    Returns:
        States by the name of the disturbance; empty where the condition holds.

    References:
        Thesis (5.15), 7.1: the whole axis violates the condition, its mechanical and its pneumatic part satisfy it.

    >>> axis = {"C_MASS": 2.0, "C_AREA_1": 8e-4, "C_AREA_2": 8e-4, "C_GAMMA": 1.4, "C_VISCOUS": 40.0, "C_STROKE": 0.2}
    >>> axis |= {"C_DEAD_VOLUME_1": 4e-5, "C_DEAD_VOLUME_2": 4e-5}
    >>> systems = axis_systems(axis, x=0.1, p1=3e5, p2=3e5)
    >>> unmatched_disturbances(systems["whole"]), unmatched_disturbances(systems["mechanical"])
    ({'friction and load': ['v']}, {})
    """
    projector = np.eye(len(system.states)) - system.B @ np.linalg.pinv(system.B)
    found = {}
    for name, column in zip(system.disturbances, system.E.T, strict=True):
        rest = np.abs(projector @ column)
        where = [
            state
            for state, r in zip(system.states, rest, strict=True)
            if r > ROUNDING_TOLERANCE * np.linalg.norm(column)
        ]
        if where:
            found[name] = where
    return found


def regular_form(A: Array, B: Array) -> RegularForm:
    """Return the regular form ``z = T x``, in which the inputs act on the last m states only; T is orthogonal.

    Args:
        A: System matrix, shape (n, n).
        B: Input matrix, shape (n, m), m < n.

    Raises:
        InputError: B does not have full column rank.

    References:
        Thesis 5.1; V. I. Utkin, Sliding Modes in Control and Optimization, 1992.

    >>> form = regular_form(np.array([[0.0, 1.0], [0.0, -2.0]]), np.array([[0.0], [4.0]]))
    >>> abs(form.B2.item()), form.A11.item()
    (4.0, 0.0)
    """
    n, m = B.shape
    if np.linalg.matrix_rank(B) < m:
        raise InputError("the input matrix", f"rank below {m}", "inputs that act independently", code="E090")
    q, _ = np.linalg.qr(B, mode="complete")
    T = np.vstack([q[:, m:].T, q[:, :m].T])
    form = T @ A @ T.T
    B_new = T @ B
    assert np.allclose(B_new[: n - m], 0.0, atol=ROUNDING_TOLERANCE * np.abs(B).max())
    k = n - m
    return RegularForm(T, form[:k, :k], form[:k, k:], form[k:, :k], form[k:, k:], B_new[k:])


def surface_by_poles(A: Array, B: Array, poles: Sequence[complex]) -> SlidingSurface:
    """Return the surface whose sliding motion has the given poles.

    Args:
        A: System matrix, shape (n, n).
        B: Input matrix, shape (n, m).
        poles: n - m poles in 1/s, complex ones in pairs.

    Raises:
        InputError: The number of poles is wrong, or the pair (A11, A12) cannot be placed.

    References:
        Thesis (5.2): with one input and two states ``s = x2 + lambda x1`` has the pole -lambda.

    >>> surface_by_poles(np.array([[0.0, 1.0], [0.0, -2.0]]), np.array([[0.0], [1.0]]), [-30.0]).poles
    array([-30.+0.j])
    """
    from scipy.signal import place_poles  # noqa: PLC0415 - slow to import, and a diagnosis imports this module

    form = regular_form(A, B)
    if len(poles) != len(form.A11):
        raise InputError("poles", f"{len(poles)}", f"{len(form.A11)}, the states less the inputs", code="E090")
    try:
        gain = place_poles(form.A11, form.A12, np.asarray(poles)).gain_matrix
    except ValueError as error:
        raise InputError("poles", str(error), "poles that the inputs can reach", code="E090") from error
    return _surface(form, gain)


def surface_by_lq(A: Array, B: Array, Q: Array) -> SlidingSurface:
    """Return the surface that minimises the integral of ``x' Q x`` in sliding mode.

    Args:
        A: System matrix, shape (n, n).
        B: Input matrix, shape (n, m).
        Q: Weight, positive definite, shape (n, n).

    Raises:
        InputError: Q is not positive definite, or B does not have full column rank.

    References:
        V. I. Utkin, K. D. Young, Methods for constructing discontinuity planes, Autom. Remote Control 39 (1978).

    For position and velocity with weights q and 1 the pole is -sqrt(q), whatever the damping:

    >>> A, B = np.array([[0.0, 1.0], [0.0, -2.0]]), np.array([[0.0], [1.0]])
    >>> surface_by_lq(A, B, np.diag([900.0, 1.0])).poles.real.round(6).tolist()
    [-30.0]
    """
    form = regular_form(A, B)
    k = len(form.A11)
    if np.linalg.eigvalsh(Q).min() <= 0.0:
        raise InputError("Q", "not positive definite", "a weight above 0 on every state", code="E090")
    W = form.T @ Q @ form.T.T
    inverse = np.linalg.inv(W[k:, k:])
    A_hat = form.A11 - form.A12 @ inverse @ W[k:, :k]
    Q_hat = W[:k, :k] - W[:k, k:] @ inverse @ W[k:, :k]
    P = solve_continuous_are(A_hat, form.A12, Q_hat, W[k:, k:])
    return _surface(form, inverse @ (form.A12.T @ P + W[k:, :k]))


def _surface(form: RegularForm, gain: Array) -> SlidingSurface:
    S = np.hstack([gain, np.eye(len(form.B2))]) @ form.T
    return SlidingSurface(S, np.linalg.eigvals(form.A11 - form.A12 @ gain).astype(np.complex128))
