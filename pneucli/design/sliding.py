"""Sliding mode of linear systems: regular form, matching condition, surfaces (thesis 5.1, 5.2, 7.1), and the sector.

``dx/dt = A x + B u + E d`` with m inputs. A disturbance in the span of B is matched (Drazenovic): it does not act in
sliding mode. Friction and load of the pneumatic axis act on the velocity, where the valve does not act; hence the
cascade of two subsystems that each satisfy the condition.

The sliding sector (thesis 5.4, 6.2) takes friction into account: the piston is ``dv/dt = F / m - a22(v) v``, and a22
lies between two vertices a1 < a2 of the TP friction model. The sector lies between the lines ``s_r = x2 + lambda_r x1``
of the position error x1 and its rate x2. The same equivalent force on both lines needs
``lambda2 - lambda1 = a2 - a1``, and with the width ``alpha = lambda2 / lambda1`` follows
``lambda1 = (a2 - a1) / (alpha - 1)`` (6.18-6.20).

The slopes depend on a22(0) = (Fs eta / 2 + Fv) / m (6.22) and hence on eta, a choice and not physics. The eta of the
identified friction model follows from the resolution of its sensors and gives lines that no sampled controller can
follow (lambda T > 1). The controller has its own: ``[design] eta``, by default such that the steeper line is the corner
of the position loop.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_continuous_are

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.messages.formatting import format_plain, format_quantity

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


MAX_SLOPE_PER_SAMPLE = 0.2  # lambda T: a sampled controller overshoots a line by less than this share of its error


@dataclass(frozen=True)
class SlidingSector:
    """Lines of slope ``lambda_1 < lambda_2`` (1/s) from vertices ``a_1 < a_2`` (1/s), for a mass (kg) and a period (s).

    ``speed_floor``: the speed (m/s) below which a22 counts as constant, so that a22(0) = a_2.
    """

    a_1: float
    a_2: float
    lambda_1: float
    lambda_2: float
    mass: float
    period: float
    speed_floor: float

    @property
    def middle(self) -> float:
        """Slope of the middle line in 1/s (5.14)."""
        return 0.5 * (self.lambda_1 + self.lambda_2)

    @property
    def steepness(self) -> float:
        """The steeper line's slope times the period."""
        return self.lambda_2 * self.period

    @property
    def eta(self) -> float:
        """Steepness in s/m of the smoothed sign (6.22) that resolves friction down to the same speed."""
        return 2.0 / self.speed_floor

    @property
    def warning(self) -> str:
        """The reason why a sampled controller cannot follow the lines; empty if it can."""
        if self.steepness <= MAX_SLOPE_PER_SAMPLE:
            return ""
        return (
            f"too steep for the sample time (lambda2 T = {format_plain(self.steepness, 3)}, "
            f"at most {MAX_SLOPE_PER_SAMPLE}; a22(0) = {format_plain(self.a_2, 3)} 1/s "
            f"with friction resolved down to {format_quantity(self.speed_floor, 'm/s', 2)}): "
            "the law takes the sector of [design] eta"
        )

    def equivalent_force(self, v: ArrayLike, x2: ArrayLike, acceleration: ArrayLike = 0.0) -> Array:
        """Return the equivalent force in N (6.16), mean of both lines, and a moving reference's acceleration.

        For a constant one, x2 = v and both lines give the same force.
        """
        v, x2 = np.asarray(v, dtype=np.float64), np.asarray(x2, dtype=np.float64)
        mean = 0.5 * (self.a_1 + self.a_2)
        return np.asarray(self.mass * (mean * v - self.middle * x2 + np.asarray(acceleration)))

    def switching_term(self, x1: ArrayLike, x2: ArrayLike, boundary_layer: float = 0.0) -> Array:
        """Return the switching term, -1 to 1: minus the sign outside the sector, continuous across it (5.13).

        Within ``boundary_layer`` (m) of the origin, where the sector has no width, the term is linear.
        """
        s1 = np.asarray(x2) + self.lambda_1 * np.asarray(x1)
        s2 = np.asarray(x2) + self.lambda_2 * np.asarray(x1)
        least = max((self.lambda_1 + self.lambda_2) * boundary_layer, np.finfo(float).tiny)
        return np.asarray(-(s1 + s2) / np.maximum(np.abs(s1) + np.abs(s2), least))

    def boundary_layer(self, max_force: float) -> float:
        """Return the error in m below which a force of ``max_force`` N crosses the whole sector within one sample."""
        return max_force * self.period / (self.mass * self.lambda_1)

    def force(
        self, x1: ArrayLike, x2: ArrayLike, v: ArrayLike, max_force: float, acceleration: ArrayLike = 0.0
    ) -> Array:
        """Return equivalent and switching force in N; ``max_force`` is M of (5.13)."""
        return self.equivalent_force(v, x2, acceleration) + max_force * self.switching_term(
            x1, x2, self.boundary_layer(max_force)
        )


def sector_from_vertices(
    vertices: ArrayLike, mass: float, period: float, static: float, width: float = 2.0
) -> SlidingSector:
    """Return the sector of a TP friction model.

    Args:
        vertices: Vertices of a22 in 1/s, of any shape; the smallest and the largest count.
        mass: Moving mass in kg.
        period: Sample time in s.
        static: Break-away force in N, for the speed floor.
        width: lambda_2 / lambda_1, above 1.

    Raises:
        InputError: The vertices do not differ, or the width is not above 1.

    References:
        Thesis (6.18) to (6.20): lambda_2 - lambda_1 = a_2 - a_1.

    >>> sector = sector_from_vertices([45.0, 20.0], mass=2.0, period=1e-3, static=20.0, width=2.0)
    >>> sector.lambda_1, sector.lambda_2, sector.speed_floor
    (25.0, 50.0, 0.4)
    """
    values = np.asarray(vertices, dtype=np.float64).ravel()
    low, high = float(values.min()), float(values.max())
    if width <= 1.0:
        raise InputError("[design] sector_ratio", f"{format_plain(width)}", "above 1", code="E023")
    if high - low <= 1e-9 * max(abs(high), 1.0):
        raise InputError(
            "the friction model", "its vertices are equal: a22 does not depend on speed", "dry friction", code="E070"
        )
    lambda_1 = (high - low) / (width - 1.0)
    return SlidingSector(low, high, lambda_1, width * lambda_1, mass, period, speed_floor(high, mass, static, low))


def sector_from_eta(
    eta: float, mass: float, period: float, static: float, viscous: float, width: float = 2.0
) -> SlidingSector:
    """Return the sector of a friction model whose sign is smoothed by ``2 / (1 + exp(-eta v)) - 1``.

    The vertices are those of a22 = F / (m v) over all speeds: ``a_1 = Fv / m`` and ``a_2 = (Fs eta / 2 + Fv) / m``.

    Args:
        eta: Steepness of the smoothed sign in s/m.
        mass: Moving mass in kg.
        period: Sample time in s.
        static: Break-away force Fs in N.
        viscous: Viscous friction Fv in N s/m.
        width: lambda_2 / lambda_1, above 1.

    Raises:
        InputError: There is no dry friction, or the width is not above 1.

    References:
        Thesis (6.18) to (6.20), (6.22).

    >>> sector = sector_from_eta(eta=5.0, mass=2.0, period=1e-3, static=20.0, viscous=40.0)
    >>> sector.a_1, sector.a_2, sector.lambda_1, sector.lambda_2
    (20.0, 45.0, 25.0, 50.0)

    """
    low = viscous / mass
    return sector_from_vertices([low, low + 0.5 * eta * static / mass], mass, period, static, width)


def eta_for_slope(slope: float, mass: float, static: float, width: float = 2.0) -> float:
    """Return eta in s/m such that the steeper line of :func:`sector_from_eta` has the ``slope`` lambda_2 (1/s).

    Infinite without dry friction, whose sector has no width.

    >>> eta_for_slope(50.0, mass=2.0, static=20.0)
    5.0
    """
    return 2.0 * mass * slope * (1.0 - 1.0 / width) / static if static > 0.0 else math.inf


def limit_slope(sector: SlidingSector, static: float, max_slope: float) -> SlidingSector:
    """Return the sector with a22(0) resolved only as far as a largest slope allows, or the same one.

    Args:
        sector: The sector.
        static: Break-away force in N.
        max_slope: Largest slope lambda_2 of the steeper line in 1/s.

    Returns:
        A sector of the same width whose steeper line has at most that slope.

    >>> sector = sector_from_vertices([45.0, 20.0], mass=2.0, period=1e-3, static=20.0, width=2.0)
    >>> limited = limit_slope(sector, static=20.0, max_slope=20.0)
    >>> limited.lambda_1, limited.lambda_2, limited.a_2
    (10.0, 20.0, 30.0)
    """
    if sector.lambda_2 <= max_slope:
        return sector
    width = sector.lambda_2 / sector.lambda_1
    high = sector.a_1 + max_slope * (1.0 - 1.0 / width)
    floor = speed_floor(high, sector.mass, static, sector.a_1)
    return SlidingSector(sector.a_1, high, max_slope / width, max_slope, sector.mass, sector.period, floor)


def speed_floor(a_0: float, mass: float, static: float, a_1: float) -> float:
    """Return the speed in m/s at which dry friction makes the damping a_0 in addition to that of the other vertex.

    Args:
        a_0: Vertex a22(0) in 1/s.
        mass: Moving mass in kg.
        static: Break-away force in N.
        a_1: The smaller vertex in 1/s.

    >>> speed_floor(45.0, mass=2.0, static=20.0, a_1=20.0)
    0.4
    """
    return static / (mass * (a_0 - a_1)) if a_0 > a_1 else math.inf
