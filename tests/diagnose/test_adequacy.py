"""What is left over: noise has no shape, a shape is found over its own variable."""

import numpy as np

from pneucli.diagnose.adequacy import binned_shape

RNG = np.random.default_rng(3)
N = 8000
BLOCKS = np.arange(N) // 100


def coloured(n=N, pole=0.9):
    noise = RNG.normal(size=n)
    for k in range(1, n):
        noise[k] += pole * noise[k - 1]
    return noise * np.sqrt(1 - pole**2)


def test_white_noise_has_no_shape():
    shares = [binned_shape("x", RNG.uniform(size=N), RNG.normal(size=N), BLOCKS).share for _ in range(20)]
    assert max(shares) < 0.01


def test_coloured_noise_has_no_shape():
    """AR(1) with pole 0.9 over a slow variable: its blocks scatter more, and the means' errors with them.

    They are some ten to a bin, so that errors are known to a quarter or so. Of 3000 other draws 0.2 % are below a
    chance of 0.001, of 200 five or more once in ten thousand times; taken for normal 7 % would be.
    """
    x = np.sin(np.arange(N) / 300.0)
    found = [binned_shape("x", x, coloured(), BLOCKS) for _ in range(200)]
    assert np.mean([f.share for f in found]) < 0.03
    assert sum(f.p_value < 0.001 for f in found) < 5


def test_a_quadratic_residual_has_a_shape_over_its_variable():
    v = np.sin(np.arange(N) / 250.0)
    found = binned_shape("v", v, RNG.normal(size=N) + 2.0 * v * np.abs(v), BLOCKS)
    assert found.share > 0.4
    assert found.p_value < 1e-6


def test_a_constant_variable_has_no_shape():
    assert binned_shape("u", np.ones(N), RNG.normal(size=N), BLOCKS) is None


def test_zero_residuals_do_not_count():
    """Half of the samples are zero for it: the step of 1 stands in the other half, and is all that there is."""
    x = np.linspace(0.0, 1.0, N)
    residual = np.where(x < 0.5, 0.0, 1.0)
    assert binned_shape("x", x, residual, BLOCKS).share == 1.0
