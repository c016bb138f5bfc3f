"""Parallel distributed compensation of the axis' TP model by linear matrix inequalities (Tanaka and Wang).

The TP model, over speed and position, is ``dx/dt = sum w_r (A_r x + B_r u)``. Its states are the position error x (m),
the speed v (m/s) and the pressure force F (N) about equilibrium, its input is the gas flow q (kg/s):
``dv/dt = F / m - a22(v) v``, ``dF/dt = - k(x) v + g(x) q`` with the stiffness k of both chambers (thesis, 2.47-2.52).

The law is ``u = - sum w_r F_r x``. With X > 0 and M_r = F_r X, for all r and all r < q:
``G_rr + 2 a X < 0``, ``(G_rq + G_qr) / 2 + 2 a X <= 0`` where ``G_rq = A_r X + X A_r' - B_r M_q - M_q' B_r'``: the
state decays at the rate a. The input stays below u_max from x0 on where ``[1 x0'; x0 X] >= 0`` and
``[X M_r'; M_r u_max^2] >= 0``.
Needs the extra ``lmi`` (cvxpy, Clarabel). States and input are normalised first; only the status ``optimal`` counts,
and every solution is checked by eigenvalues afterwards.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.design.bandwidths import WORKING_PRESSURES, chamber_2_pressure
from pneucli.errors import InputError
from pneucli.imports import library_of_extra
from pneucli.physics.gas import PSI_MAX
from pneucli.physics.vectorised import stribeck_friction
from pneucli.tp import TPModel, sample, transform
from pneucli.tp.weights import WeightType

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
        self._cp = cp = library_of_extra("cvxpy", "lmi", "the LMI design")  # slow to import
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


GRID_SHAPE = (201, 41)  # speeds, positions
SIMULATION_STEP = 2e-4  # s, of the simulation that checks a design
WEIGHT_TYPES: tuple[WeightType, ...] = get_args(WeightType)


@dataclass(frozen=True)
class WeightStudy:
    """Result of one weight type.

    Attributes:
        weight_type: Type of the weighting functions.
        vertices: Number of vertices.
        pdc: The PDC; None without one.
        failure: The reason for None.
        peak_input_ratio: Largest |q| over its bound, in a simulation.
        lyapunov_ratio: Largest ``V(t) exp(2 rate t) / V(0)`` of the Lyapunov function, in a simulation.
        model: TP model of the gains.

    """

    weight_type: WeightType
    vertices: int
    pdc: Pdc | None
    failure: str = ""
    peak_input_ratio: float = np.nan
    lyapunov_ratio: float = np.nan
    model: TPModel | None = None


def axis_matrices(c: Mapping[str, float], v: Array, x: Array, speed_floor: float) -> Array:
    """Return the axis as a linear parameter-varying system in speed and position.

    States: position error (m), velocity (m/s) and net force of the pressures (N); input: mass flow (kg/s).

    Args:
        c: Parameters of a controller by name (SI).
        v: Speed in m/s.
        x: Position in m, of the shape of ``v``.
        speed_floor: Speed in m/s below which a22 is constant.

    Returns:
        ``[A | B]``, shape (..., 3, 4).

    References:
        Thesis (2.47) to (2.52), with the force in place of both pressures.
    """
    out = np.zeros((*np.shape(v), 3, 4))
    speed = np.hypot(v, speed_floor)
    dry = stribeck_friction(speed, c["C_COULOMB"], 0.0, c["C_STATIC"], c["C_STRIBECK"])
    p2 = chamber_2_pressure(c, x)
    p1 = (c["C_AREA_2"] * p2 + (c["C_AREA_1"] - c["C_AREA_2"]) * c["C_AMBIENT"]) / c["C_AREA_1"]
    volume_1 = c["C_DEAD_VOLUME_1"] + c["C_AREA_1"] * x
    volume_2 = c["C_DEAD_VOLUME_2"] + c["C_AREA_2"] * (c["C_STROKE"] - x)
    out[..., 0, 1] = 1.0
    out[..., 1, 1] = -(dry / speed + c["C_VISCOUS"]) / c["C_MASS"]
    out[..., 1, 2] = 1.0 / c["C_MASS"]
    out[..., 2, 1] = -c["C_GAMMA"] * (p1 * c["C_AREA_1"] ** 2 / volume_1 + p2 * c["C_AREA_2"] ** 2 / volume_2)
    out[..., 2, 3] = c["C_AREA_1"] * c["C_GAMMA_R_T"] / volume_1
    return out


def axis_model(c: Mapping[str, float], speed_floor: float, weight_type: WeightType) -> TPModel:
    """Return the TP model of the axis over speeds up to the limit of the reference and the middle 60 % of the stroke.

    Args:
        c: Parameters of a controller by name (SI).
        speed_floor: Speed in m/s below which a22 is constant.
        weight_type: Type of the weighting functions.

    References:
        Thesis chapter 4.
    """
    speeds = np.linspace(-c["C_V_MAX"], c["C_V_MAX"], GRID_SHAPE[0])
    positions = np.linspace(0.2, 0.8, GRID_SHAPE[1]) * c["C_STROKE"]
    samples = sample(lambda v, x: axis_matrices(c, v, x, speed_floor), (speeds, positions))
    return transform(samples, (speeds, positions), weight_type, tolerance=1e-6)


def compare_weight_types(
    c: Mapping[str, float], speed_floor: float, types: tuple[WeightType, ...] = WEIGHT_TYPES
) -> list[WeightStudy]:
    """Return the largest decay rate of each weight type, for equal initial state and input bound.

    The initial state is at rest, 15 % of the stroke off. The bound is half the flow of the slower direction at mean
    pressure.

    Args:
        c: Parameters of a controller by name (SI).
        speed_floor: Speed in m/s below which a22 is constant.
        types: Types of weighting functions.

    Returns:
        One study for each type; a type without verified gains states the reason.
    """
    x0 = np.array([0.15 * c["C_STROKE"], 0.0, 0.0])
    force = 0.5 * c["C_AREA_1"] * (WORKING_PRESSURES[1] * c["C_SUPPLY"] - WORKING_PRESSURES[0] * c["C_AMBIENT"])
    scale = np.array([x0[0], c["C_V_MAX"], force])
    most = min(c["C_AREA_FILL"] * c["C_SUPPLY"], c["C_AREA_VENT"] * c["C_P_MEAN"]) * c["C_K_GAS"] * PSI_MAX
    return [_weight_study(c, speed_floor, kind, x0, scale, 0.5 * most) for kind in types]


def _weight_study(
    c: Mapping[str, float], floor: float, kind: WeightType, x0: Array, scale: Array, most: float
) -> WeightStudy:
    try:
        model = axis_model(c, floor, kind)
        systems = model.systems
        pdc = design_pdc(systems[:, :, :3], systems[:, :, 3:], x0, scale, most)
    except InputError as error:
        return WeightStudy(kind, 0, None, str(error))
    peak, decayed = simulate_pdc(c, floor, model, pdc, x0)
    return WeightStudy(kind, len(systems), pdc, "", peak / most, decayed, model)


def simulate_pdc(c: Mapping[str, float], floor: float, model: TPModel, pdc: Pdc, x0: Array) -> tuple[float, float]:
    """Simulate the nonlinear axis under the PDC about mid-stroke.

    Args:
        c: Parameters of a controller by name (SI).
        floor: Speed in m/s below which a22 is constant.
        model: TP model of the gains.
        pdc: Gains and Lyapunov matrix.
        x0: Initial state: position error (m), velocity (m/s), force (N), shape (3,).

    Returns:
        Peak of |q| in kg/s, and the largest ``V(t) exp(2 rate t) / V(0)`` of the Lyapunov function: at most 1 if the
        decay rate of the LMIs holds.
    """
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - slow to import, and a diagnosis imports this module

    middle = 0.5 * c["C_STROKE"]

    def rates(states: Array) -> tuple[Array, Array]:
        """Return the derivatives (..., 3) and q (...) of states (..., 3)."""
        v = np.clip(states[..., 1], -c["C_V_MAX"], c["C_V_MAX"])
        x = np.clip(middle + states[..., 0], *model.grids[1][[0, -1]])
        w_v, w_x = model.weights_at(v, x)
        gains = pdc.gains[:, 0].reshape(w_v.shape[-1], w_x.shape[-1], 3)
        q = -np.einsum("...i,...j,ijk,...k->...", w_v, w_x, gains, states)
        matrix = axis_matrices(c, v, x, floor)
        return np.einsum("...ij,...j->...i", matrix[..., :3], states) + matrix[..., 3] * q[..., None], q

    time = np.arange(0.0, min(3.0 / pdc.rate, 2.0), SIMULATION_STEP)
    size = np.sqrt(float(x0 @ pdc.P @ x0) / np.diag(pdc.P))  # of each state while the Lyapunov function falls
    found = solve_ivp(lambda _, s: rates(s)[0], (0.0, time[-1]), x0, "LSODA", t_eval=time, rtol=1e-9, atol=1e-9 * size)
    states = found.y.T
    lyapunov = np.einsum("ti,ij,tj->t", states, pdc.P, states)
    return float(np.abs(rates(states)[1]).max()), float((lyapunov / lyapunov[0] * np.exp(2 * pdc.rate * time)).max())
