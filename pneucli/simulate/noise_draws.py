"""Draws of sensor noise, and a cache for what follows from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeVar

import numpy as np

from pneucli.arrays import Array
from pneucli.noise import NoiseModel

Draw = TypeVar("Draw")

MAX_CACHE_BYTES = 16 << 20  # bytes, of one recording


def draw_sensor_noise(noise: Mapping[str, NoiseModel], time: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Draw the noise of every sensor once.

    Args:
        noise: Noise of each sensor.
        time: Time stamps in s, shape (n,).
        rng: Generator of random numbers.

    Returns:
        Noise of each sensor in the unit of its signal, each (n,).
    """
    return {name: model.draw(time, rng) for name, model in noise.items()}


def cache_draws(
    cache: dict[tuple[int, int], list[Draw]], key: tuple[int, int], drawn: Iterable[Draw], size: int
) -> Iterable[Draw]:
    """Return cached draws, or cache new ones where they fit.

    Args:
        cache: Draws by key.
        key: Number of draws and seed.
        drawn: New draws.
        size: Number of floats of all draws.

    Returns:
        The draws of the key.
    """
    if key in cache:
        return cache[key]
    return cache.setdefault(key, list(drawn)) if 8 * size <= MAX_CACHE_BYTES else drawn
