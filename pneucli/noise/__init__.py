"""Sensor noise: its model, and its estimate from a recording."""

from pneucli.noise.estimate import NORMAL_MAD, NoiseModel, estimate_noise, pool_noise
from pneucli.noise.spectrum import detect_jumps, jump_free_segments

__all__ = ["NORMAL_MAD", "NoiseModel", "detect_jumps", "estimate_noise", "jump_free_segments", "pool_noise"]
