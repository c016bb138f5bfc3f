"""What a sensor adds to a signal, and how it is found from a recording."""

from __future__ import annotations

from pneucli.noise.estimate import estimate, pool
from pneucli.noise.model import NoiseModel
from pneucli.noise.spectrum import free_of, jumps_of

__all__ = ["NoiseModel", "estimate", "free_of", "jumps_of", "pool"]
