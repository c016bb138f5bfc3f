"""The tensor-product (TP) model (thesis 4.4-4.6), by the higher-order singular value decomposition of samples.

The modes are decomposed one after the other, shortest first, each on the tensor that the modes before it have
compressed. Only singular values below rounding are cut on the way, so the basis and singular values of every mode are
those of its full unfolding. The ranks are cut at the end, on the core.

References:
    Thesis figure 4.3.
    De Lathauwer, De Moor, Vandewalle, SIAM J. Matrix Anal. Appl. 21 (2000) 1253-1278.
    Vannieuwenhoven, Vandebril, Meerbergen, SIAM J. Sci. Comput. 34 (2012) A1027-A1052.
    Demmel, Grigori, Hoemmen, Langou, SIAM J. Sci. Comput. 34 (2012) A206-A239 (QR by blocks).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.tp.sampling import as_grids, locate, require_finite
from pneucli.tp.weights import Violation, WeightType, affine_frame, convex_weights, violations

DEFAULT_TOLERANCE = 1e-10  # singular values below this share of the first are zero, unless the caller says otherwise
_ROUNDING_TOLERANCE = (
    1e-14  # cut on the way: about 50 roundings, below what double precision resolves in a long unfolding
)
_EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Spectrum:
    """Singular values of one unfolding and the number that is kept.

    Attributes:
        singular_values: Descending, shape (k,), in the unit of the samples.
        rank: Number of singular values kept.
    """

    singular_values: Array
    rank: int

    @property
    def gap(self) -> float:
        """Last kept over first discarded singular value; near 1 the rank is arbitrary, at most 1 / eps."""
        tail = self.singular_values[self.rank :]
        floor = max(tail[0] if tail.size else 0.0, _EPS * self.singular_values[0])
        return float(self.singular_values[self.rank - 1] / floor) if floor else math.inf

    @property
    def discarded(self) -> float:
        """Root of the sum of squares of the discarded singular values."""
        return float(np.linalg.norm(self.singular_values[self.rank :]))


@dataclass(frozen=True)
class Hosvd:
    """A decomposition ``samples = core x_1 bases[0] x_2 bases[1] ...``, up to what was discarded.

    Attributes:
        bases: Matrices with orthonormal columns, shapes (n_k, r_k); signs are arbitrary.
        core: Core tensor, shape (r_1, ..., r_N, ...).
        spectra: Singular values of each mode.
    """

    bases: tuple[Array, ...]
    core: Array
    spectra: tuple[Spectrum, ...]


def hosvd(
    samples: Array, parameters: int, rank: Sequence[int] | None = None, tolerance: float = DEFAULT_TOLERANCE
) -> Hosvd:
    """Decompose samples on a grid by the higher-order singular value decomposition.

    Args:
        samples: Samples, shape (n_1, ..., n_N, ...); further axes are those of a matrix at each node.
        parameters: Number N of leading axes to decompose.
        rank: Largest number of singular values kept per mode (reduced HOSVD); None: no bound.
        tolerance: Singular values above this share of the first of their mode are kept (compact HOSVD); 0 keeps all.

    Returns:
        The decomposition. Its error in the Frobenius norm is at most ``sqrt(sum(s.discarded**2 for s in spectra))``.

    Raises:
        InputError: ``rank`` has another length than ``parameters`` or an entry below 1.

    References:
        Thesis figure 4.3; De Lathauwer, De Moor, Vandewalle (2000), equation 24.

    >>> x, y = np.linspace(0, 1, 5)[:, None], np.linspace(0, 1, 4)
    >>> parts = hosvd(x * y + 1, 2)
    >>> parts.core.shape
    (2, 2)
    >>> bool(np.allclose(parts.bases[0] @ parts.core @ parts.bases[1].T, x * y + 1))
    True
    """
    if rank is not None and (len(rank) != parameters or min(rank) < 1):
        raise InputError("rank", f"{tuple(rank)}", f"{parameters} whole numbers from 1", code="E090")
    floor = min(_ROUNDING_TOLERANCE, tolerance)
    core, bases, values = samples, {}, {}
    for mode in sorted(range(parameters), key=samples.shape.__getitem__):
        basis, values[mode] = _left_svd(core, mode)
        bases[mode] = basis[:, : _count_above(values[mode], floor)]
        core = contract(core, bases[mode].T, mode)
    ranks = [_count_above(values[k], tolerance) for k in range(parameters)]
    if rank is not None:
        ranks = [min(pair) for pair in zip(ranks, rank, strict=True)]
    return Hosvd(
        tuple(bases[k][:, :r] for k, r in enumerate(ranks)),
        core[tuple(slice(r) for r in ranks)],
        tuple(Spectrum(values[k], r) for k, r in enumerate(ranks)),
    )


def contract(tensor: Array, matrix: Array, mode: int) -> Array:
    """Multiply a tensor by a matrix along one axis.

    Args:
        tensor: Tensor, shape (n_1, ..., n_mode, ...).
        matrix: Matrix, shape (m, n_mode).
        mode: The axis, from 0.

    Returns:
        The product; the length of the axis becomes m.

    >>> contract(np.ones((2, 3)), np.array([[1.0, 1.0, 1.0]]), 1)
    array([[3.],
           [3.]])
    """
    before, after = tensor.shape[:mode], tensor.shape[mode + 1 :]
    rows = matrix.shape[0]
    if math.prod(after) == 1:
        return (tensor.reshape(-1, tensor.shape[mode]) @ matrix.T).reshape(*before, rows, *after)
    return (matrix @ _fibres(tensor, mode)).reshape(*before, rows, *after)


def _left_svd(tensor: Array, mode: int) -> tuple[Array, Array]:
    """Return left singular vectors and singular values of the unfolding of one mode.

    >>> _left_svd(np.diag([3.0, 2.0]), 0)[1]
    array([3., 2.])
    """
    n = tensor.shape[mode]
    if tensor.size == n and (norm := np.linalg.norm(tensor)):  # one column: half the time for one scalar parameter
        return tensor.reshape(n, 1) / norm, np.array([norm])
    wide = tensor.size >= n * n
    narrow = _triangle(tensor, mode).T if wide else _fibres(tensor, mode).transpose(1, 0, 2).reshape(n, -1)
    vectors, values, _ = np.linalg.svd(narrow, full_matrices=False)
    return vectors, values


def _triangle(tensor: Array, mode: int) -> Array:
    """Return R of the transposed unfolding, by QR of one block after the other (TSQR)."""
    n = tensor.shape[mode]
    factor = np.empty((0, n))
    for block in _blocks(tensor, mode, max(2048, 8 * n)):
        factor = np.asarray(np.linalg.qr(np.concatenate((factor, block)), mode="r"))
    return factor


def _blocks(tensor: Array, mode: int, rows: int) -> Iterator[Array]:
    """Yield the transposed unfolding in blocks of about ``rows`` rows."""
    fibres = _fibres(tensor, mode)
    outer, n, inner = fibres.shape
    for i in range(0, outer, max(1, rows // inner)):
        for j in range(0, inner, rows):
            yield fibres[i : i + max(1, rows // inner), :, j : j + rows].transpose(0, 2, 1).reshape(-1, n)


def _fibres(tensor: Array, mode: int) -> Array:
    """Return the tensor with three axes: all before the mode, the mode, all after it."""
    return tensor.reshape(math.prod(tensor.shape[:mode]), tensor.shape[mode], -1)


def _count_above(values: Array, share: float) -> int:
    return max(1, int(np.count_nonzero(values > share * values[0])))


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

    def weights_at(self, *parameters: ArrayLike) -> list[Array]:
        """Interpolate the weights linearly, which keeps them convex: their sum is 1, none is negative.

        Args:
            parameters: One array for each parameter, within the grids.

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
        return [_linear(g, w, p) for g, w, p in zip(self.grids, self.weights, at, strict=True)]

    def evaluate(self, *parameters: ArrayLike) -> Array:
        """Evaluate S on the domain.

        Args:
            parameters: One array for each parameter, broadcast together.

        Returns:
            The matrices: the shape of the parameters, then that of the matrix.

        Raises:
            InputError: As of :meth:`weights_at`.
        """
        weights = self.weights_at(*np.broadcast_arrays(*parameters))
        shape = weights[0].shape[:-1]
        rows = [w.reshape(-1, w.shape[-1]) for w in weights]
        answer = np.tensordot(rows[0], self.vertices, axes=1)
        for row in rows[1:]:
            answer = np.einsum("nv,nv...->n...", row, answer)
        return np.asarray(answer.reshape((*shape, *self.errors.shape)))


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
