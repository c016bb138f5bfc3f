"""What a sensor adds to a signal: white and coloured noise, mains hum, quantisation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseModel:
    """White + first-order coloured noise + sinusoidal lines, and the step of quantisation, all in the signal's unit.

    ``white`` and ``coloured`` are standard deviations; ``pole`` is the AR(1) coefficient of the coloured part per
    ``period`` (s); ``lines`` holds pairs (frequency in Hz, amplitude); ``step`` is the quantisation step (0: none).
    """

    white: float
    coloured: float = 0.0
    pole: float = 0.0
    period: float = 1e-3
    lines: tuple[tuple[float, float], ...] = ()
    step: float = 0.0

    @property
    def rms(self) -> float:
        """Root mean square of the whole, never below step / sqrt(12) (interface, section 3)."""
        power = self.white**2 + self.coloured**2 + sum(a * a / 2 for _, a in self.lines)
        return float(max(np.sqrt(power), self.step / np.sqrt(12)))

    def draw(self, time: Array, rng: np.random.Generator) -> Array:
        """Return one realisation, shape ``(n,)``, at the time stamps ``time`` (s), taken as about equidistant."""
        n = time.size
        white = max(self.white, 0.0 if self.coloured or self.lines else self.rms)
        noise = white * rng.standard_normal(n)
        if self.coloured:
            innovations = np.sqrt(1 - self.pole**2) * rng.standard_normal(n)
            state = self.pole * rng.standard_normal()
            noise += self.coloured * lfilter([1.0], [1.0, -self.pole], innovations, zi=[state])[0]
        for frequency, amplitude in self.lines:
            noise += amplitude * np.sin(2 * np.pi * (frequency * time + rng.random()))
        return np.asarray(noise, dtype=np.float64)
