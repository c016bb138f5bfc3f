"""Higher-order singular value decomposition of samples on a grid.

The modes are decomposed one after the other, shortest first, each on the tensor that the modes before it have
compressed. Only singular values below rounding are cut on the way, so the basis and singular values of every mode are
those of its full unfolding. The ranks are cut at the end, on the core.

References:
    Thesis figure 4.3.
    De Lathauwer, De Moor, Vandewalle, SIAM J. Matrix Anal. Appl. 21 (2000) 1253-1278.
    Vannieuwenhoven, Vandebril, Meerbergen, SIAM J. Sci. Comput. 34 (2012) A1027-A1052.
    Demmel, Grigori, Hoemmen, Langou, SIAM J. Sci. Comput. 34 (2012) A206-A239 (QR by blocks).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError

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
