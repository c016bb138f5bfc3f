"""Parallel distributed compensation of a TP model by linear matrix inequalities (Tanaka and Wang).

``dx/dt = sum w_r (A_r x + B_r u)``, ``u = - sum w_r F_r x``. With X > 0 and M_r = F_r X, for all r and all r < q:
``G_rr + 2 a X < 0``, ``(G_rq + G_qr) / 2 + 2 a X <= 0`` where ``G_rq = A_r X + X A_r' - B_r M_q - M_q' B_r'``: the
state decays at the rate a. The input stays below u_max from x0 on where ``[1 x0'; x0 X] >= 0`` and
``[X M_r'; M_r u_max^2] >= 0``.
Needs the extra ``lmi`` (cvxpy, Clarabel). States and input are normalised first; only the status ``optimal`` counts,
and every solution is checked by eigenvalues afterwards.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.imports import library_of_extra

LMI_MARGIN = 1e-6  # of the normalised LMIs, below which an inequality counts as an equality
RATE_TOLERANCE = 5e-3  # of the decay rate


@dataclass(frozen=True)
class Pdc:
    """A PDC: gains, Lyapunov matrix, decay rate, and its verification by eigenvalues.

    Attributes:
        gains: F (R, m, n), one a vertex.
        P: Lyapunov matrix (n, n), in the units of the plant.
        rate: Decay rate in 1/s.
        status: Status of the solver.
        worst_pole: Largest real part in 1/s over all vertices and pairs of them.
        worst_lmi: Largest normalised eigenvalue of the decay inequality, negative if it holds.
        vertex_poles: Poles (R, n) in 1/s of every vertex loop.

    """

    gains: Array
    P: Array
    rate: float
    status: str
    worst_pole: float
    worst_lmi: float

    vertex_poles: NDArray[np.complex128]

    @property
    def verified(self) -> bool:
        """Whether the eigenvalues confirm the solver."""
        least = float(np.linalg.eigvalsh(self.P).min())
        return self.status == "optimal" and self.worst_lmi <= 0.0 and self.worst_pole <= -self.rate < 0.0 < least


def design_pdc(A: Array, B: Array, x0: Array, scale: Array, u_max: float) -> Pdc:
    """Return the gains of the largest decay rate with |u| <= u_max from x0 on.

    Args:
        A: State matrices (R, n, n).
        B: Input matrices (R, n, m).
        x0: Initial state (n,).
        u_max: Bound of the input.
        scale: Typical size (n,) of each state, above 0.

    Raises:
        InputError: The extra ``lmi`` is missing, or no rate above 0 is feasible.

    References:
        Tanaka and Wang, Fuzzy Control Systems Design and Analysis (2001).

    """
    A_n, B_n = A * scale[None, None, :] / scale[None, :, None], B * u_max / scale[None, :, None]
    time = float(max(np.abs(A_n).max(), np.abs(B_n).max()))  # 1/s: the fastest entry, which becomes 1
    problem = _Problem(A_n / time, B_n / time, x0 / scale)
    low, high, best = 0.0, 1.0, problem.solve(0.0)
    if best is None:
        raise InputError(
            "the LMIs", "no gains keep the input within its bound", "", "a wider bound or a smaller x0", code="E070"
        )
    while (more := problem.solve(high)) is not None:
        low, high, best = high, 2.0 * high, more
    while high - low > RATE_TOLERANCE * high and high > LMI_MARGIN:
        middle = 0.5 * (low + high)
        found = problem.solve(middle)
        low, high, best = (middle, high, found) if found is not None else (low, middle, best)
    X, M = best
    inverse = np.linalg.inv(X)
    F = M @ inverse
    lmi = _largest_eigenvalue(A_n / time, B_n / time, X, M, low)
    poles = _worst_pole(A_n, B_n, F)
    loops = np.linalg.eigvals(A_n - B_n @ F).astype(np.complex128)
    return Pdc(F * u_max / scale, inverse / np.outer(scale, scale), low * time, "optimal", poles, lmi, loops)


class _Problem:
    """The normalised LMIs with the rate as a parameter, compiled once."""

    def __init__(self, A: Array, B: Array, x0: Array) -> None:
        self._cp = cp = _cvxpy()
        count, n, m = B.shape
        self._X = X = cp.Variable((n, n), symmetric=True)
        self._M = M = [cp.Variable((m, n)) for _ in range(count)]
        self._rate = cp.Parameter(nonneg=True)
        one = np.eye(n)
        rules: list[Any] = [X >> LMI_MARGIN * one, cp.bmat([[np.ones((1, 1)), x0[None, :]], [x0[:, None], X]]) >> 0]
        for r in range(count):
            rules.append(_decay(A, B, X, M, r, r) + 2 * self._rate * X << -LMI_MARGIN * one)
            rules.append(cp.bmat([[X, M[r].T], [M[r], np.eye(m)]]) >> 0)
            for q in range(r + 1, count):
                both = 0.5 * (_decay(A, B, X, M, r, q) + _decay(A, B, X, M, q, r))
                rules.append(both + 2 * self._rate * X << -LMI_MARGIN * one)
        self._problem = cp.Problem(cp.Minimize(cp.trace(X)), rules)

    def solve(self, rate: float) -> tuple[Array, Array] | None:
        """Return X and M (R, m, n) for a normalised rate; None unless the solver finds an optimum."""
        self._rate.value = rate
        try:
            with warnings.catch_warnings():  # "may be inaccurate": then the status is not "optimal"
                warnings.simplefilter("ignore", UserWarning)
                self._problem.solve(solver=self._cp.CLARABEL)
        except self._cp.error.SolverError:
            return None
        if self._problem.status != "optimal":
            return None
        return np.asarray(self._X.value), np.stack([np.asarray(m.value) for m in self._M])


def _decay(A: Array, B: Array, X: Any, M: Any, r: int, q: int) -> Any:
    return A[r] @ X + X @ A[r].T - B[r] @ M[q] - M[q].T @ B[r].T


def _largest_eigenvalue(A: Array, B: Array, X: Array, M: Array, rate: float) -> float:
    """Return the largest eigenvalue of all decay inequalities, computed without the solver."""
    pairs = [(r, q) for r in range(len(A)) for q in range(r, len(A))]
    both = [0.5 * (_decay(A, B, X, M, r, q) + _decay(A, B, X, M, q, r)) + 2 * rate * X for r, q in pairs]
    return max(float(np.linalg.eigvalsh(b).max()) for b in both)


def _worst_pole(A: Array, B: Array, F: Array) -> float:
    """Return the largest real part of the closed-loop poles over vertices and means of pairs."""
    pairs = [(r, q) for r in range(len(A)) for q in range(r, len(A))]
    loops = [0.5 * (A[r] - B[r] @ F[q] + A[q] - B[q] @ F[r]) for r, q in pairs]
    return max(float(np.linalg.eigvals(loop).real.max()) for loop in loops)


def _cvxpy() -> Any:
    return library_of_extra("cvxpy", "lmi", "the LMI design")  # slow to import
