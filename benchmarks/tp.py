"""Speed of the TP transformation as ratios to numpy's SVD of every unfolding: ``python -m benchmarks.tp``.

Small: the reference cases of tests/tp, wanted <= 1.5. Big: 200 x 160 x 120 nodes of 3 x 3 matrices (280 MB), wanted
<= 0.1 at the accuracy of full SVDs (1.6e-13 of the largest sample, measured on 90 x 80 x 70 nodes).
Smallest simplex of the two-parameter case: wanted <= 0.1 s. Exit code 1 where one fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy loads; threads slow the small cases tenfold

import sys
import time
from collections.abc import Callable

import numpy as np

from pneucli.tp import hosvd, simplex_search
from pneucli.tp import simplex as sx
from pneucli.tp.hosvd import Array, contract
from tests.tp.cases import CASES, pressure_damping

BIG = (200, 160, 120)
SMALL_GRID = (20, 16, 12)


def main(arguments: list[str]) -> int:
    """Print every figure and its limit; return the exit code, which ``--small`` leaves at 0."""
    is_small = "--small" in arguments
    shape = SMALL_GRID if is_small else BIG
    figures = [(f"hosvd, case {name}: ratio to numpy", small(name), 1.5) for name in CASES]
    figures.append(("smallest simplex, case c: s", smallest(), 0.1))
    samples = big(shape)
    ours, theirs = once(lambda: hosvd(samples, 3)), once(lambda: numpy_svd(samples, 3))
    print(f"big grid {shape}: ours {ours:.2f} s, numpy {theirs:.2f} s")
    figures.append(("hosvd, big grid: ratio to numpy", ours / theirs, 0.1))
    figures.append(("hosvd, big grid: largest error / largest sample", error(samples), 1.6e-13))
    for name, value, limit in figures:
        print(f"{name:50s} {value:9.3g}  (limit {limit:g}) {'ok' if value <= limit else 'FAILED'}")
    return int(not is_small and any(value > limit for _, value, limit in figures))


def numpy_svd(samples: Array, parameters: int) -> list[Array]:
    """Left singular vectors of every unfolding, as numpy gives them."""
    unfoldings = (np.moveaxis(samples, k, 0).reshape(samples.shape[k], -1) for k in range(parameters))
    return [np.linalg.svd(u, full_matrices=False)[0] for u in unfoldings]


def small(name: str) -> float:
    """Ratio of the fastest of many runs."""
    case = CASES[name]
    ours = fastest(lambda: hosvd(case.samples, len(case.grids)))
    return ours / fastest(lambda: numpy_svd(case.samples, len(case.grids)))


def smallest() -> float:
    """Seconds for the smallest enclosing simplex of the velocity's weights."""
    case = CASES["c"]
    parts = hosvd(case.samples, 2)
    frame = sx.affine_frame(parts.bases[0], parts.spectra[0].singular_values[:2], 1e-10)
    h = sx.homogeneous(frame.points)
    return fastest(lambda: simplex_search.smallest_simplices(h), runs=10)


def big(shape: tuple[int, int, int]) -> Array:
    """A system matrix whose entries depend on all three parameters; of low, not equal, ranks."""
    v, p, x = np.linspace(-0.05, 0.05, shape[0]), np.linspace(0, 6e5, shape[1]), np.linspace(0, 0.2, shape[2])
    samples = np.zeros((*shape, 3, 3))
    samples[..., 0, 1] = 1.0
    samples[..., 1, 1] = pressure_damping(*np.meshgrid(v, p, indexing="ij"))[..., None] / 2e3
    samples[..., 1, 2] = np.sin(30 * v)[:, None, None] * x
    samples[..., 2, 1] = p[:, None] / 6e5 / (0.04 + x)
    samples[..., 2, 2] = np.exp(-v[:, None, None]) * np.sqrt(1 + p / 1e5)[:, None] * x**2
    return samples


def error(samples: Array) -> float:
    """Largest deviation of the decomposition from the samples."""
    parts = hosvd(samples, 3)
    inner = contract(contract(parts.core, parts.bases[1], 1), parts.bases[2], 2)
    rows = (np.abs(contract(inner, b[None, :], 0)[0] - s).max() for b, s in zip(parts.bases[0], samples, strict=True))
    return float(max(rows) / np.abs(samples).max())


def once(run: Callable[[], object]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def fastest(run: Callable[[], object], runs: int = 50) -> float:
    return min(once(run) for _ in range(runs))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
