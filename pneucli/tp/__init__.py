"""Tensor-product model transformation of sampled, parameter-dependent matrices; knows nothing of pneumatics.

>>> import numpy as np
>>> from pneucli.tp import check, sample, transform
>>> grids = (np.linspace(-1, 1, 21), np.linspace(1, 2, 11))
>>> samples = sample(lambda v, p: np.stack([v**2, p * v], axis=-1), grids)
>>> model = transform(samples, grids, weight_type="cno")
>>> model.vertices.shape, check(model)
((3, 2, 2), [])
>>> model.evaluate(0.5, 1.5)
array([0.25, 0.75])
"""

from pneucli.tp.model import Hosvd, Spectrum, TPModel, check, hosvd, transform
from pneucli.tp.sampling import sample
from pneucli.tp.weights import Violation, WeightType

__all__ = [
    "Hosvd",
    "Spectrum",
    "TPModel",
    "Violation",
    "WeightType",
    "check",
    "hosvd",
    "sample",
    "transform",
]
