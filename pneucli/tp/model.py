"""The tensor-product (TP) model: weights of one parameter each, and vertices (thesis 4.4-4.6)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.tp.hosvd import DEFAULT_TOLERANCE, Hosvd, Spectrum, contract, hosvd
from pneucli.tp.sampling import as_grids, locate, require_finite
from pneucli.tp.weights import Violation, WeightType, affine_frame, convex_weights, violations

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Scaling = Literal["peak", "none"]

_MAX_CHUNK = 2**22  # numbers of one reconstructed piece while errors are taken


@dataclass(frozen=True)
class TPModel:
    """A model ``S(p) = sum over i, j, ... of w_1i(p_1) w_2j(p_2) ... vertices[i, j, ...]`` of N parameters.

    Attributes:
        grids: Nodes of each parameter, N arrays (n_k,).
        weights: Weights at the nodes, N arrays (n_k, v_k).
        vertices: Vertices, shape (v_1, ..., v_N, ...), then the shape of the matrix.
        weight_type: Type of the weights (:mod:`pneucli.tp.weights`).
        scale: Divisor of each entry of the matrix before the decomposition.
        errors: Largest absolute error of each entry over the nodes, in the entry's unit.
        spectra: Singular values of the scaled entries, rank and gap of each parameter.

    References:
        Thesis 4.4-4.6.
    """

    grids: tuple[Array, ...]
    weights: tuple[Array, ...]
    vertices: Array
    weight_type: WeightType
    scale: Array
    errors: Array
    spectra: tuple[Spectrum, ...]

    @property
    def systems(self) -> Array:
        """All vertices in one row, shape (R, ...); the last parameter's index runs fastest."""
        return self.vertices.reshape(-1, *self.errors.shape)

    def weights_at(self, *parameters: ArrayLike, interpolation: Literal["linear", "cubic"] = "linear") -> list[Array]:
        """Interpolate the weights.

        Args:
            parameters: One array for each parameter, within the grids.
            interpolation: ``linear`` keeps the weights convex: their sum is 1, none is negative. ``cubic`` (spline) is
                closer to the sampled function between nodes and keeps the sum, but may leave [0, 1] slightly there.

        Returns:
            For each parameter the weights, the shape of its array and then (v_k,).

        Raises:
            InputError: A value lies outside the domain, or the number of arrays differs from that of the parameters.
        """
        if len(parameters) != len(self.grids):
            raise InputError(
                "parameters", f"{len(parameters)} arrays", f"{len(self.grids)}, one a parameter", code="E090"
            )
        at = [
            _inside(g, np.asarray(p, dtype=np.float64), k)
            for k, (g, p) in enumerate(zip(self.grids, parameters, strict=True))
        ]
        if interpolation == "cubic":
            return [np.asarray(spline(p)) for spline, p in zip(self._splines, at, strict=True)]
        return [_linear(g, w, p) for g, w, p in zip(self.grids, self.weights, at, strict=True)]

    def evaluate(self, *parameters: ArrayLike, interpolation: Literal["linear", "cubic"] = "linear") -> Array:
        """Evaluate S on the domain.

        Args:
            parameters: One array for each parameter, broadcast together.
            interpolation: As of :meth:`weights_at`.

        Returns:
            The matrices: the shape of the parameters, then that of the matrix.

        Raises:
            InputError: As of :meth:`weights_at`.
        """
        weights = self.weights_at(*np.broadcast_arrays(*parameters), interpolation=interpolation)
        shape = weights[0].shape[:-1]
        rows = [w.reshape(-1, w.shape[-1]) for w in weights]
        answer = np.tensordot(rows[0], self.vertices, axes=1)
        for row in rows[1:]:
            answer = np.einsum("nv,nv...->n...", row, answer)
        return np.asarray(answer.reshape((*shape, *self.errors.shape)))

    @cached_property
    def _splines(self) -> list[CubicSpline]:
        from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to import, and a diagnosis imports this module

        return [CubicSpline(g, w) for g, w in zip(self.grids, self.weights, strict=True)]


def transform(
    samples: ArrayLike,
    grids: Sequence[ArrayLike],
    weight_type: WeightType = "cno",
    rank: Sequence[int] | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    scaling: Scaling | ArrayLike = "peak",
) -> TPModel:
    """Transform samples on a grid into a TP model.

    Args:
        samples: Samples, shape (n_1, ..., n_N, ...).
        grids: Nodes of each parameter, N arrays (n_k,), rising.
        weight_type: Type of the weights (:mod:`pneucli.tp.weights`).
        rank: Largest rank of each parameter; None: no bound.
        tolerance: Share of a mode's first singular value below which singular values are cut.
        scaling: Divisor of each entry before the decomposition: ``peak``, its largest absolute value; ``none``, 1; or
            an array that broadcasts to the shape of the matrix. In SI units friction's singular value is 3e-5 of the
            first, and would be cut without scaling.

    Returns:
        The model. A mode of rank r has r vertices where a constant lies in the span of its weights, else r + 1.

    Raises:
        InputError: Samples do not fit the grids or are not finite, or weights of this type do not exist.

    References:
        Thesis figure 4.1, 4.4-4.6; P. Baranyi, Y. Yam, P. Varlaki, Tensor Product Model Transformation in Polytopic
        Model-Based Control (2013).

    >>> speed = np.linspace(-1, 1, 21)
    >>> model = transform(speed**2, [speed])
    >>> model.vertices.shape, model.evaluate(0.5).round(6).tolist()
    ((2,), 0.25)
    """
    values, axes = np.asarray(samples, dtype=np.float64), as_grids(grids)
    sizes = tuple(g.size for g in axes)
    if values.shape[: len(sizes)] != sizes:
        raise InputError("samples", f"shape {values.shape}", f"shape {sizes} and then the matrix", code="E090")
    require_finite(values, axes)
    scale = _scale(values, len(sizes), scaling)
    scaled = values / scale
    parts = hosvd(scaled, len(sizes), rank, tolerance)
    weights, core = _convex(parts, weight_type, tolerance)
    errors = _max_errors(scaled, weights, core) * scale
    return TPModel(axes, weights, core * scale, weight_type, scale, errors, parts.spectra)


def check(model: TPModel) -> list[Violation]:
    """Return the invariants that a model violates.

    The weights must have the properties of their type, and the error at the nodes may not exceed what the discarded
    singular values explain, beyond rounding. For ``mvs`` local optimality is tested, not that no other simplex is
    smaller.

    Args:
        model: The model.

    Returns:
        The violations; an empty list where every invariant holds.

    >>> grid = np.linspace(0, 1, 5)
    >>> check(transform(grid**2, [grid]))
    []
    """
    found = [v for k, w in enumerate(model.weights) for v in violations(w, model.weight_type, k)]
    first = max(float(s.singular_values[0]) for s in model.spectra)
    limit = math.hypot(*(s.discarded for s in model.spectra)) + DEFAULT_TOLERANCE * first
    error = float(np.max(model.errors / model.scale, initial=0.0))
    if not error <= limit:
        found.append(Violation(None, "reconstruction within the discarded singular values", error, limit))
    return found


def _convex(parts: Hosvd, weight_type: WeightType, tolerance: float) -> tuple[tuple[Array, ...], Array]:
    """Replace the orthonormal bases by convex weights, and the core by the vertices."""
    core, weights = parts.core, []
    for mode, (basis, spectrum) in enumerate(zip(parts.bases, parts.spectra, strict=True)):
        frame = affine_frame(basis, spectrum.singular_values[: spectrum.rank], tolerance)
        columns, vertices = convex_weights(frame, weight_type)
        weights.append(columns)
        core = contract(core, vertices, mode)
    return tuple(weights), core


def _scale(values: Array, parameters: int, scaling: Scaling | ArrayLike) -> Array:
    shape = values.shape[parameters:]
    if isinstance(scaling, str):
        if scaling not in ("peak", "none"):
            raise InputError("scaling", repr(scaling), '"peak", "none" or an array', code="E090")
        peak = np.abs(values).max(axis=tuple(range(parameters)))
        return np.where((peak > 0) & (scaling == "peak"), peak, 1.0)
    given = np.asarray(scaling, dtype=np.float64)
    if not np.all(given > 0):
        raise InputError("scaling", f"{given}", "above 0", code="E090")
    return np.array(np.broadcast_to(given, shape))


def _max_errors(samples: Array, weights: Sequence[Array], vertices: Array) -> Array:
    """Return the largest absolute error of each entry over the nodes, in pieces along the first parameter."""
    parameters = len(weights)
    partial = vertices
    for mode in range(1, parameters):
        partial = contract(partial, weights[mode], mode)
    step = max(1, _MAX_CHUNK // max(1, samples[0].size))
    worst = np.zeros(samples.shape[parameters:])
    for i in range(0, len(samples), step):
        piece = contract(partial, weights[0][i : i + step], 0) - samples[i : i + step]
        np.maximum(worst, np.abs(piece).max(axis=tuple(range(parameters))), out=worst)
    return worst


def _inside(grid: Array, at: Array, parameter: int) -> Array:
    slack = 1e-9 * (grid[-1] - grid[0])  # a value computed to lie on the boundary may miss it by rounding
    if not np.all((at >= grid[0] - slack) & (at <= grid[-1] + slack)):
        found = f"{np.min(at):g} to {np.max(at):g}"
        raise InputError(
            f"parameter {parameter}",
            found,
            f"within [{grid[0]:g}, {grid[-1]:g}]",
            "clip it, or sample wider",
            code="E090",
        )
    return np.clip(at, grid[0], grid[-1])


def _linear(grid: Array, weights: Array, at: Array) -> Array:
    left, right = locate(grid, at)
    share = right[..., None]
    return np.asarray((1 - share) * weights[left] + share * weights[left + 1])
