"""Arrays of the kernel's numbers; :mod:`pneucli.simulate.build` makes them arrays of dual numbers where it must."""

import numpy as np


def new_array(shape):
    """Return zeros of a shape, a tuple."""
    return np.zeros(shape)


def new_copy(values):
    """Return a copy of numbers (n, m)."""
    out = new_array(values.shape)
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            out[i, j] = values[i, j]
    return out


def fixed(number):
    """Return a number that counts as constant where others are differentiated: the length of a step or of a buffer."""
    return number
