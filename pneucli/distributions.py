"""Tails and quantiles of the distributions that the tests use, from ``scipy.special``.

``scipy.stats`` has the same functions, and takes half a second to import.
"""

import numpy as np
from scipy.special import chdtrc, chdtri, fdtrc, ndtr, ndtri, stdtr, stdtrit

from pneucli.arrays import Array


def student_t_tail(t: float | Array, freedom: float | Array) -> Array:
    """Return the probability that Student's t with ``freedom`` degrees of freedom exceeds ``t``.

    >>> round(float(student_t_tail(2.776, 4)), 4)
    0.025
    """
    return np.asarray(stdtr(freedom, -t), dtype=np.float64)


def student_t_quantile(probability: float, freedom: float | Array) -> Array:
    """Return the value that Student's t stays below with this probability.

    >>> round(float(student_t_quantile(0.975, 4)), 3)
    2.776
    """
    return np.asarray(stdtrit(freedom, probability), dtype=np.float64)


def f_tail(value: float, numerator: float, denominator: float) -> float:
    """Return the probability that F with these degrees of freedom exceeds ``value``.

    >>> round(f_tail(4.96, 1, 10), 3)
    0.05
    """
    return float(fdtrc(numerator, denominator, value))


def chi_square_tail(value: float, freedom: float) -> float:
    """Return the probability that chi-square with ``freedom`` degrees of freedom exceeds ``value``.

    >>> round(chi_square_tail(3.841, 1), 3)
    0.05
    """
    return float(chdtrc(freedom, value))


def chi_square_upper_quantile(tail: float, freedom: float) -> float:
    """Return the value that chi-square exceeds with the probability ``tail``.

    >>> round(chi_square_upper_quantile(0.05, 1), 3)
    3.841
    """
    return float(chdtri(freedom, tail))


def normal_quantile(probability: float | Array) -> Array:
    """Return the value that a standard normal variable stays below with this probability.

    >>> round(float(normal_quantile(0.95)), 3)
    1.645
    """
    return np.asarray(ndtri(probability), dtype=np.float64)


def normal_tail(value: float | Array) -> Array:
    """Return the probability that a standard normal variable exceeds ``value``.

    >>> round(float(normal_tail(1.645)), 3)
    0.05
    """
    return np.asarray(ndtr(-np.asarray(value)), dtype=np.float64)
